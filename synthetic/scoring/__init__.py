"""Results beside the truth, and the limits set by a picture's noise."""
