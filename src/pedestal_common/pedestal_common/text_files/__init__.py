"""Text files of other people, read within bounds."""
