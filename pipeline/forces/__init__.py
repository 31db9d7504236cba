"""The elastic rod fitted to the whisker, and the force that bends it."""
