"""Paper 003: feed-forward of rate and acceleration from an IMM. The papers are in docs/papers.md."""
