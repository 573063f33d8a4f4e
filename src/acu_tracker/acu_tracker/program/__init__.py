"""The program track: a table of times and angles, its interpolation, and its use as a bridge over an outage."""
