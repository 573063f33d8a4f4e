"""Gains and filters for an antenna: from its data sheet, from its loops, from a recording."""
