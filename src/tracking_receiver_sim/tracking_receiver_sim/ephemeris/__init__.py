"""Predicted tracks of a target from files: orbits as states (position, velocity) in a frame, and tables of directions.

    oem.py, stk.py      readers of orbits, into states.py
    directions.py       reader of tables of azimuth and elevation
    lines.py            functions that the readers share
    interpolation.py    polynomials through the states, as the file prescribes
    frames.py           conversion to the earth-fixed frame
    horizon.py          times at which an orbit is above the horizon
    course.py           trajectory of the target

Symbols
    r, v        position [m] and velocity [m/s] in the frame of the file, or earth-fixed
    t           time [s] after midnight UTC before the first state of the file
    omega       rate of the earth against the stars [rad/s]
    u           time scaled to -1 ... 1 over the states of a polynomial
"""
