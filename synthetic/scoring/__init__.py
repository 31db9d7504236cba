"""Results beside the truth, and what a picture can tell."""
