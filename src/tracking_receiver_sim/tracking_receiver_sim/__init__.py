"""Targets and the monopulse receiver that tracks them: the node tracking_receiver.

unit.py holds the unit of the node. receiver.py holds the `step` of the receiver and uses these modules:

    target.py       position of the target: a satellite, a test motion, or a file
    track_files.py  files of a target: recorded flights (folder track), predicted orbits and tables of directions
                    (folder ephemeris)
    wave_path.py    refraction, light time, multipath, scintillation, polarisation
    error_rate.py   rate of the error
    injected.py     effects of injected faults
    params.py       every parameter

The patterns of the channels, the detector and the smoothing are those of receiver_law.

elements.py reads the orbital elements of a satellite for the command line.

Frames: positions of targets are in ENU, with the origin at the station and axes fixed to the earth. The deck is FLU.
Offsets from the beam are cross-elevation and elevation, as in pedestal_common. The time of a target counts from the
start of the run (stamp 0).

Symbols, beside those of receiver_law
    phi         post-comparator phase error                                         [rad]
    dX, dE      cross-elevation and elevation of the target off the beam            [rad]
    e, n, u     east, north, up                                                     [m]
"""
