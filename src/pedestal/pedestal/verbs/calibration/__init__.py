"""Verb for the calibration of an antenna, and the steps of this verb."""
