"""The seaway and the motion of a ship on it."""
