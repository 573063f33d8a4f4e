"""Guidance: the reference of the axes in each mode, and the manual rates of an operator."""
