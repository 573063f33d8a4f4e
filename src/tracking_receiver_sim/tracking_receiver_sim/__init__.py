"""Targets and the monopulse receiver that tracks them.

receiver.py holds the `step` of the receiver and uses these modules:

    target.py       position of the target: a satellite, a test motion, or a file (the rooms track and ephemeris)
    path            refraction, light time, multipath, scintillation, polarisation
    monopulse.py    voltages of the channels for an error
    smoothing.py    smoothing of the errors
    params.py       every parameter

Frames: the ENU frame of the station for targets (axes fixed to the earth at the station), deck FLU and the offsets of
the beam as in pedestal_common. The time of a target runs from the start of the run (stamp 0).

Symbols
    theta3      half-power beamwidth of the sum pattern                             [rad]
    k_m         slope of difference over sum per beamwidth, on the beam axis        [-]
    v           offset from the beam in beamwidths                                  [-]
    S, D        sum and difference voltage patterns, S(0) = 1                       [-]
    s, d        complex channel voltages of one sub-sample, unit noise power        [-]
    C/N0        carrier to noise density of the sum channel on the beam axis        [Hz] or [dB-Hz]
    tau         integration time of one sub-sample                                  [s]
    n           samples of the smoothing: recursion or moving average                [-]
    beta        cross-coupling angle: rotation of the error axes                    [rad]
    phi         post-comparator phase error                                         [rad]
    dX, dE      cross-elevation and elevation of the target off the beam            [rad]
    e, n, u     east, north, up                                                     [m]
"""
