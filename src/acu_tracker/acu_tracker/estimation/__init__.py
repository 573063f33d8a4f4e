"""Estimation of the direction of the target and of its motion, from the errors of the receiver."""
