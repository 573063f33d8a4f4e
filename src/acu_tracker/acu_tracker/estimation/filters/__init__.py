"""The target filters: their laws, one axis of them, both axes, and the table of their kinds."""
