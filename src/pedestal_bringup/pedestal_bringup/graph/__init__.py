"""Graph of a scenario: its nodes as processes, which are started, watched and ended."""
