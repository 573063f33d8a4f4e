"""Trials: many runs of a scenario with varied parameters, their table and their statistics."""
