"""From a video of whiskers to contacts, forces and base moments."""
