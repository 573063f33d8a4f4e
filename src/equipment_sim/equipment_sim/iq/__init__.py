"""Simulated I/Q samples of all channels of a feed."""
