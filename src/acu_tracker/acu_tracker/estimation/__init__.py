"""Where the target is and how it moves: the filters of the angles, the Cartesian one, and which of them is used.

Symbols
    X = (x1 x2 x3)  estimate of one axis: angle, rate, acceleration                     [rad, rad/s, rad/s2]
    T               time between two measurements                                       [s]
    F, Q, P         transition, process noise, covariance of X
    y, R, nu, S     measured angle, its variance, innovation, variance of the innovation
    K               gain of the filter; k1, k2, k3 on the innovation of the angle       [-, 1/s, 1/s2]
    alpha           manoeuvre frequency of an acceleration, x = alpha T                 [1/s], [-]
    a_max, abar     largest and mean acceleration of the target                         [rad/s2]
    sigma_a         standard deviation of the acceleration about abar                   [rad/s2]
    mu, cbar        `imm`: probability of a model; its prediction                       [-]
    theta3, k_m     beamwidth and monopulse slope of the receiver                       [rad], [-]
In `constant_gain` alone alpha, beta, gamma are the constant gains of angle, rate and acceleration, as its textbooks
write them.
"""
