"""Laws of the plant: motors, mechanics, wind and mount."""
