"""Laws of a monopulse receiver, which the simulated receiver and the receiver of I/Q samples run.

    monopulse    patterns of sum and differences
    detector     voltages to angle errors, C/N0 and lock
    smoothing    smoothing of the errors

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
"""
