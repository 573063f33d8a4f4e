"""Shell of a node: a unit, its topics, its clock and its diagnostics."""
