"""Numerical parts that know nothing of whiskers: splines, polylines, angles, runs."""
