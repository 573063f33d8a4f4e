"""Laws of the plant: motors, gears, structure, wind and mount."""
