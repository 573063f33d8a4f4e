"""Studies of the claims of the five papers."""
