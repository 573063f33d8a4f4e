"""In the drive's place: the beam of a phased array."""
