"""Files of targets: recorded flights, predicted orbits, tables of directions (docs/reference/tracks.md).

The readers of the formats make fixes, states or directions of a file. The modules flight and course make a trajectory
in the ENU frame of the station of these, and the parameters of a run.
"""
