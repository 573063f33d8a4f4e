"""Antenna control unit: from the receiver's angle error to the rate command of the drive.

`control_unit.step` runs once per drive step:
    encoders, attitude, error in    -> measured angles of the target (`geometry`)
    -> `estimation`: the target filter, its prediction to the instant of the command
    -> `modes`: which target the axes follow; `program`: the time-tagged one; `lookahead`: slews through the keyhole
    -> reference on the deck (`geometry`) -> `servo`: rate and torque of each axis, or the angles of a beam
    -> `alarms`: the alarms that follow from all of this
Each subpackage defines its own symbols. Common symbols:
    A, E            azimuth (clockwise), elevation; dA, ddA ... their time derivatives  [rad, rad/s, rad/s2]
    t_k             stamp of the drive step                                             [s]
    t_m             middle of the interval in which the command is in force             [s]

References: paper 000 (Ma Jijun et al. 2023, 'current' statistical model filter of an antenna; PID position loop);
paper 001 (TD, ESO and NLC of a gyrocompass); paper 003 (Lin Di et al. 2020, interacting models); paper 004 (Li Hongwei
et al. 2018, angle and rate measured); Han 2009 (fhan).
"""
