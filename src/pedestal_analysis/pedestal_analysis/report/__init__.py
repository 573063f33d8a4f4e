"""Figures, and the report of a recording as one HTML file."""
