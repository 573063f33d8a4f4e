"""Tables of directions over time that a mode follows: the program track, and the predicted satellite and sun."""
