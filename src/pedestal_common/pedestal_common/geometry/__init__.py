"""Directions, places on the earth, orbits and intervals of angles."""
