"""Verbs for the design of an antenna: scenarios, parameters, studies, trials, tuning, benchmarks."""
