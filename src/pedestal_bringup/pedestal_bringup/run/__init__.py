"""A run: its scenario, its nodes as processes, the same closed loop without them."""
