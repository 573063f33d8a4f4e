"""Gains and filters of an antenna from its data sheet, from measured loops, or from a recording."""
