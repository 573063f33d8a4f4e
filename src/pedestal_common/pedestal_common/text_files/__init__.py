"""Readers of text files of other programs, with limits on their size."""
