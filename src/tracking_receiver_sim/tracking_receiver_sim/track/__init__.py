"""Recorded flights: from a log of fixes to a trajectory in the station's ENU frame.

fixes.py reads a log (with tables.py for CSV, gpx.py, nmea.py), flight.py makes a spline of its fixes, and place.py
finds a station for it.

Symbols
    e, n, u     east, north, up of the station                                                  [m]
    sigma       1-sigma of a fix, per axis                                                      [m]
    q           white acceleration of the constant-velocity model, as its square root           [m/s2/sqrt(Hz)]
    lambda      sigma^2 / q^2, weight of the acceleration in a smoothing spline                 [s3]
"""
