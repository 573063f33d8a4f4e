"""Inertial navigation systems: stated errors, or an alignment and a strapdown computer."""
