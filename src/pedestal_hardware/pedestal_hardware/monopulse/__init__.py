"""Monopulse receiver of I/Q samples."""
