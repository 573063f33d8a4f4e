"""Studies of what the five papers claim."""
