"""Beam of a phased array, in place of a drive with motors."""
