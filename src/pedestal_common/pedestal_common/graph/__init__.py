"""Tables of the graph: its topics, their layouts, its nodes, and its steps."""
