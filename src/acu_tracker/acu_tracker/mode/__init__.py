"""Modes of the control unit: facts that decide on a change of mode, effects of the change, laws of single modes.

The transition function itself is in acu_tracker/modes.py.
"""
