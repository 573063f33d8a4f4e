"""Modes of the control unit: facts that decide on a change of mode (see modes.py), and laws of single modes."""
