"""Directions and their rates between earth, deck and the frame of the filter."""
