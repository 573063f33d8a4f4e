"""The program track: a table of times and angles, and where it leads."""
