"""Verbs for a choice: scenarios, parameters, studies, trials, tuning, benchmarks."""
