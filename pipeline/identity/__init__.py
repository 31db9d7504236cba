"""Which line is which whisker, over a whole video."""
