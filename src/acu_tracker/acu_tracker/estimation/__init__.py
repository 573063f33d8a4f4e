"""Estimation of the direction of the target and of its motion, from the errors of the receiver.

`receiver_error` measures the direction of the target with an error, gates it and gives it to the filters of the
package `filters`. `target` predicts the target from their estimate. `monitors` detect wrong errors.

Symbols
    X = (x1 x2 x3)  estimate of one axis: angle, rate, acceleration                     [rad, rad/s, rad/s2]
    T               time between two measurements                                       [s]
    F, Q, P         transition, process noise, covariance of X
    y, R, nu, S     measured angle, its variance, innovation, variance of the innovation
    K               gain of the filter; k1, k2, k3 on the innovation of the angle       [-, 1/s, 1/s2]
    alpha           reciprocal of the duration of an acceleration; x = alpha T          [1/s], [-]
    a_max, abar     largest and mean acceleration of the target                         [rad/s2]
    sigma_a         standard deviation of the acceleration about abar                   [rad/s2]
    mu, cbar        `imm`: probability of a model after and before a measurement        [-]
    theta3, k_m     beamwidth and monopulse slope of the receiver                       [rad], [-]
    alpha, beta, gamma   `constant_gain` only: gains of angle, rate and acceleration    [-]
"""
