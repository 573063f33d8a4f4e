"""Search, acquisition and loss of a target by the level of its signal.

`level` tells signal from noise, `pattern` leads the beam over an area in which the target may be, `side_lobe` and
`slope_check` judge what was found before the loop is closed on it, `step_track` follows a level where there is no
angle error, `coast` says how long an estimate without signal is worth pointing at. `acquisition` composes them.

    b       half-power beamwidth                                            [rad]
    z       level of the sum channel, C/N0                                  [dB-Hz]
    x, e    offset of the beam from the expected place of the target, in cross-elevation and elevation [rad]
    tau     time constant with which the receiver smooths its level         [s]
    v       speed of the beam along a pattern                               [rad/s]
"""
