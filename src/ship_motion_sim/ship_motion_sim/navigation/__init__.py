"""Inertial navigation systems: a model with stated errors, or an alignment and a strapdown computer."""
