"""The numbers that the documentation prints, and the source of each number."""
