"""Calibration of an antenna: the pointing model from measured offsets, and plans of the directions to measure."""
