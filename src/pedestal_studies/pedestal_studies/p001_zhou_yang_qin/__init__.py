"""Zhou 2011: alignment of an INS by ADRC. The papers are in docs/understand/papers.md."""
