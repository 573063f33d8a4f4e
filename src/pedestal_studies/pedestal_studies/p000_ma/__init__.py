"""Ma 2023: servo with two motors, backlash, choice of a filter. The papers are in docs/understand/papers.md."""
