"""The numbers that the documentation prints, and where each comes from."""
