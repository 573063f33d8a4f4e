"""Lin 2020: feed-forward of rate and acceleration from an IMM. The papers are in docs/understand/papers.md."""
