"""Servers of rotator protocols, by which satellite programs point the antenna, and their common controller."""
