"""Directions and their rates in the frames of the earth, the deck and the filter; history of encoders and attitude.

`tracking` keeps the measured histories, `estimation.target` and `guidance` convert directions between the frames.

Symbols
    u, du, ddu      unit vector towards the target and its derivatives                  [-, 1/s, 1/s2]
    q, M            attitude of the deck: quaternion, rotation matrix deck -> earth          [-]
    w, dw           angular rate and angular acceleration of the deck, FLU              [rad/s, rad/s2]
    r               lever arm: vector from the INS to the antenna, FLU                  [m]
    rho, R          range of the target from the antenna, from the INS                  [m]
"""
