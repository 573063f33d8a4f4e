"""Targets and the monopulse receiver that tracks them: the node tracking_receiver.

unit.py holds the unit of the node. receiver.py holds the `step` of the receiver and uses these modules:

    target.py       position of the target: a satellite, a test motion, or a file
    track_files.py  files of a target: recorded flights (folder track), predicted orbits and tables of directions
                    (folder ephemeris)
    path            refraction, light time, multipath, scintillation, polarisation
    monopulse.py    voltages of the channels for an error
    error_rate.py   rate of the error
    detector.py     voltages to angle errors, C/N0 and lock
    smoothing.py    smoothing of the errors
    injected.py     effects of injected faults
    params.py       every parameter

elements.py reads the orbital elements of a satellite for the command line.

Frames: positions of targets are in ENU, with the origin at the station and axes fixed to the earth. The deck is FLU.
Offsets from the beam are cross-elevation and elevation, as in pedestal_common. The time of a target counts from the
start of the run (stamp 0).

Symbols
    theta3      half-power beamwidth of the sum pattern                             [rad]
    k_m         slope on the beam axis: difference voltage / sum voltage, per beamwidth     [-]
    v           offset from the beam in beamwidths                                  [-]
    S, D        sum and difference voltage patterns, S(0) = 1                       [-]
    s, d        complex channel voltages of one sub-sample, unit noise power        [-]
    C/N0        carrier power / noise density in the sum channel on the beam axis   [Hz] or [dB-Hz]
    tau         integration time of one sub-sample                                  [s]
    n           number of samples of the smoothing: recursion or moving average     [-]
    beta        cross-coupling angle: rotation of the error axes                    [rad]
    phi         post-comparator phase error                                         [rad]
    dX, dE      cross-elevation and elevation of the target off the beam            [rad]
    e, n, u     east, north, up                                                     [m]
"""
