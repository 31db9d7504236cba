"""Centreline → numbers: follicle, angle, curvature, distance to the pole."""
