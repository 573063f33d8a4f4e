"""The antenna control unit: from the receiver's angle error to the rate command of the drive.

`control_unit.step` runs once per drive step:
    error + encoder -> y -> `tracker` (an `axis_filter` each) -> prediction to the instant of the command
    -> `deck_reference` (earth -> deck) -> `position_loop` (`shaper`; `pid`, `feedforward` or `adrc`; `notch`)
    -> rate and torque; of an electronically steered beam (`beam_loop`) -> its angles.
`modes` decides which target is followed. Frames and angles as in `pedestal_common`.

Symbols
    alpha           manoeuvre frequency of the 'current' statistical model              [1/s]
    a_max, abar     largest and mean acceleration of the target                         [rad/s2]
    sigma_a         standard deviation of the acceleration about abar                   [rad/s2]
    T, x = alpha T  time between two errors; that time over 1 / alpha                   [s], [-]
    X = (x1 x2 x3)  estimate: angle, rate, acceleration                                 [rad, rad/s, rad/s2]
    Phi, U, Q, P    transition, input, process noise, covariance of X
    F, H, K         Phi of any of the `motion_models`; what is measured of X; gain of the filter
    y, R, nu, S     measured angle, its variance, innovation, variance of the innovation
    alpha, beta, gamma      constant gains of angle, rate, acceleration (`alpha_beta`)          [-]
    mu, cbar        `imm`: probability of a model; its predicted probability             [-]
    A, E            azimuth (clockwise), elevation; dA, ddA ... their time derivatives  [rad, rad/s, rad/s2]
    w, dw           rate and angular acceleration of the deck, FLU                      [rad/s, rad/s2]
    t_k             stamp of the drive step                                             [s]
    t_m             middle of the interval in which the command is in force             [s]
    v, a, j         rate, acceleration, jerk of the shaped reference                    [rad/s, ...]
    h0, r           filter step and acceleration of Han's fhan                          [s], [rad/s2]
    e, u, y         error of the axis, rate command, encoder angle                      [rad], [rad/s], [rad]
    K_p, K_i, K_d   gains of the position loop; D, the filtered derivative of e         [1/s], [1/s2], [-]
    k_v, k_a        shares of v and of a fed forward into the rate command              [-], [s]
    J, Tc           inertia and Coulomb friction at the load                            [kg m2], [Nm]
    v1, v2, v3      adrc: shaped angle, rate, acceleration                              [rad, rad/s, rad/s2]
    z1, z2, z3      adrc: observed angle, rate, disturbance                             [rad, rad/s, rad/s2]
    w_c, w_o, w_s   adrc: poles of feedback, of observer, of the drive's rate loop      [rad/s]
    l1, l2, l3      adrc: gains of the observer over a step h; b0 = w_s, u0 the wanted y'' [-], [1/s], [1/s2]
    R, v            beam_loop: angle of the beam, its rate; alpha, beta gains on them   [rad], [rad/s], [-]
    delta, V        share compensated of V, the rate at which a fixed target moves with the deck [-], [rad/s]
    w, width, depth notch: centre, damping of its poles, what is left at the centre     [rad/s], [-], [-]
    theta3, k_m     beamwidth and monopulse slope of the receiver                       [rad], [-]
    W, E0           rate of a target along its great circle, its highest elevation      [rad/s], [rad]
    t1, t2          begin and end of a slew through the keyhole                         [s]
    r, rho, R       lever arm from INS to antenna; range of the antenna, of the INS     [m]

References: paper 000 (Ma Jijun et al. 2023, 'current' statistical model filter of an antenna; PID position loop);
paper 001 (TD, ESO and NLC of a gyrocompass); paper 003 (Lin Di et al. 2020, interacting models); paper 004 (Li Hongwei
et al. 2018, angle and rate measured); Han 2009 (fhan).
"""
