"""Rotators: drives that close their own position loop and take set-points."""
