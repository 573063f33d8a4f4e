"""A recording used again: recomputed node by node, replayed into live nodes, the whole run made once more."""
