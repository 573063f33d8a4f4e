"""Paper 001: alignment of an INS by ADRC. The papers are in docs/papers.md."""
