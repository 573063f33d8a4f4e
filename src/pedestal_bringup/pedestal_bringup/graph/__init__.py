"""Scenario as a graph: its nodes as processes, started, watched and ended."""
