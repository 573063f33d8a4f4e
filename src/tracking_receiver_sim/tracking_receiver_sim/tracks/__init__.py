"""Files of targets: recorded flights, predicted orbits, tables of directions (docs/tracks.md).

A reader (tables, gpx, nmea, oem, stk, directions) makes fixes, states or directions of a file. flight and course make
a trajectory in the ENU frame of the station of these, and the parameters of a run that the file gives.
"""
