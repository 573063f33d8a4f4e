"""Verbs for an antenna that runs: start it, ask it, command it."""
