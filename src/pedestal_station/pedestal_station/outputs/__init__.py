"""Outputs of a night: table, rows, files and charts."""
