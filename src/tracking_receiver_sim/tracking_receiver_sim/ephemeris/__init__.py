"""What somebody predicted: orbits as states in a frame, and tables of directions.

oem.py and stk.py read orbits into states.py, directions.py reads tables of azimuth and elevation. interpolation.py
joins the states as the file says, frames.py turns them with the earth, horizon.py says when they are above it, and
course.py makes the target of them. lines.py is what the readers share.

Symbols
    r, v        position [m] and velocity [m/s] in the frame of the file, or earth-fixed
    t           time [s] after midnight UTC before the first state of the file
    omega       rate of the earth against the stars [rad/s]
    u           time scaled to -1 ... 1 over the states that a polynomial runs through
"""
