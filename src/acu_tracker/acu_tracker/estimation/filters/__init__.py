"""The target filters: their laws, the filter of one axis, of both axes, and the table of filter kinds."""
