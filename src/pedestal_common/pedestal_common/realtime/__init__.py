"""Checks of a node in a realtime graph: its time, and the right publisher of each message."""
