"""Search, acquisition and loss of a target by the level of its signal.

Modules: `level` separates signal from noise. `pattern` leads the beam over an area that may contain the target.
`side_lobe` and `slope_check` judge a signal before the loop is closed on it. `step_track` follows a level if there is
no angle error. `coast` limits the time of pointing without a signal. `acquisition` combines them.

    b       half-power beamwidth                                            [rad]
    z       level of the sum channel, C/N0                                  [dB-Hz]
    x, e    offset of the beam from the expected place of the target, in cross-elevation and elevation [rad]
    tau     time constant with which the receiver smooths its level         [s]
    v       speed of the beam along a pattern                               [rad/s]
"""
