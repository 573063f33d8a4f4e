"""Recorded flights as targets: from a log of fixes to a trajectory in the ENU frame of the station.

A fix is a recorded position of an aircraft with its time.

    fixes.py                        fixes of one aircraft in a log
    tables.py, gpx.py, nmea.py      readers of logs: CSV, GPX, NMEA
    times.py, dates.py, instant.py  times of a log
    flight.py                       spline of the fixes
    place.py                        station for a flight

Symbols
    e, n, u     east, north, up from the station, the place of the antenna                      [m]
    sigma       1-sigma of a fix, per axis                                                      [m]
    q           root of the power density of the white acceleration, constant-velocity model    [m/s2/sqrt(Hz)]
    lambda      sigma^2 / q^2, weight of the acceleration in a smoothing spline                 [s3]
"""
