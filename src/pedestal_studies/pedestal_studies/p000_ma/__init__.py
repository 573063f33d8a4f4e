"""Paper 000: servo with two motors, backlash, choice of a filter. The papers are in docs/papers.md."""
