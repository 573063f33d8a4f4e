"""Antenna control unit (ACU): from the angle error of the receiver to the rate command of the drive.

`control_unit.step` runs once per drive step. The packages take part in this order:
    `pointing`      pointing model: from encoder angles to the direction of the beam, and back
    `geometry`      measured angles of the target from encoders, attitude of the deck and receiver error
    `estimation`    target filter, and its prediction to the instant of the command
    `mode`          mode of the step: which target the axes follow; `search`, `program`: other targets than the
                    estimate
    `guidance`      reference of the axes in encoder angles; `lookahead`: slews through the keyhole
    `servo`         rate and torque of each axis, or the angles of an electronic beam
    `alarms`        alarms that follow from all of this
`operating` serves the operator outside this step. Each package defines its own symbols. Common symbols:
    A, E            azimuth (clockwise), elevation; dA, ddA ... their time derivatives  [rad, rad/s, rad/s2]
    t_k             stamp of the drive step                                             [s]
    t_m             middle of the interval in which the command is in force             [s]

References: paper 000 (Ma Jijun et al. 2023, 'current' statistical model filter of an antenna; PID position loop);
paper 001 (TD, ESO and NLC of a gyrocompass); paper 003 (Lin Di et al. 2020, interacting models); paper 004 (Li Hongwei
et al. 2018, angle and rate measured); Han 2009 (fhan).
"""
