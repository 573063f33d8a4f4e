"""Recorded flights: from a log of fixes to a trajectory in the station's ENU frame.

fixes.py reads a log (with tables.py for CSV, gpx.py, nmea.py), flight.py makes a spline of its fixes, and place.py
finds a station for it.

Symbols
    e, n, u     east, north, up from the station, the place of the antenna                      [m]
    sigma       1-sigma of a fix, per axis                                                      [m]
    q           root of the power density of the white acceleration, constant-velocity model    [m/s2/sqrt(Hz)]
    lambda      sigma^2 / q^2, weight of the acceleration in a smoothing spline                 [s3]
"""
