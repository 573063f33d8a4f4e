"""Guidance: it computes the reference of both axes in each mode, also from the manual rates of an operator."""
