"""Verbs for a running antenna: start, observe and command the graph."""
