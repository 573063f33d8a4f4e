"""Tables of directions over time that a mode follows: the program track, and the predicted satellite and sun.

The modules receive, predict and interpolate the tables. `bridge` rotates the program track to the target, as a bridge
over an outage of the receiver.
"""
