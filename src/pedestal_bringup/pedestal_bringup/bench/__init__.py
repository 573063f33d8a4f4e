"""What this machine makes of the graph and of the compiled core."""
