"""Paper 002: angle loop of a phased array. The papers are in docs/papers.md."""
