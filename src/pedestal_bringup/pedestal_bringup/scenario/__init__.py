"""Scenario: its file, its parameters, and the program track that follows from it."""
