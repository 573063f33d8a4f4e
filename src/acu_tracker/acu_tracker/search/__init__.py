"""Search, acquisition and loss of a target by its signal level: laws of the modes search, acquire and steptrack.

level                    separates the signal from noise
pattern                  leads the beam over an area that may contain the target
place                    expected place of a target that was lost
side_lobe, slope_check   test a signal before autotrack closes the loop on it
step_track               follows the level if the receiver measures no angle error
acquisition              laws of search and acquire; it combines the modules above
level_modes              the three modes, as the control unit calls them

    b       half-power beamwidth                                            [rad]
    z       signal level: C/N0 of the sum channel of the receiver           [dB-Hz]
    x, e    offset of the beam from the expected place of the target, in cross-elevation and elevation [rad]
    tau     time constant with which the receiver smooths its level         [s]
    v       speed of the beam along a pattern                               [rad/s]
"""
