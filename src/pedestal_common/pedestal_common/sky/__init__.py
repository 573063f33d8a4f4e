"""Places of the sun and the moon, for predictions and for simulated targets."""
