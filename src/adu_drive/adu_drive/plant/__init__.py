"""Laws of the plant."""
