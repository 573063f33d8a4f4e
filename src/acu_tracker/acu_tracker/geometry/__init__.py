"""Directions and their rates in the frames of the earth, the deck and the filter.

Symbols
    u, du, ddu      unit vector towards the target and its derivatives                  [-, 1/s, 1/s2]
    q, M            attitude of the deck: quaternion, rotation matrix deck -> earth          [-]
    w, dw           rate and angular acceleration of the deck, FLU                      [rad/s, rad/s2]
    r               lever arm from INS to antenna                                       [m]
    rho, R          range of the target from the antenna, from the INS                  [m]
"""
