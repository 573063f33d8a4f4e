"""Devices that send lines of text on their own: a level, a sentence of an INS."""
