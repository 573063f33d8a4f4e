"""A night of passes: the plan of a station, and the station that tracks it by itself."""
