"""Jia 2025: angle loop of a phased array. The papers are in docs/understand/papers.md."""
