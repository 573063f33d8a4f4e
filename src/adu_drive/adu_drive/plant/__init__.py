"""The laws of the plant: motors, gears, structure, wind, and the mount that they move."""
