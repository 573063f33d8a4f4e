"""The position loop of an axis: controllers, shaper of the reference, limits, and detectors of drive faults.

`position_loop` selects the controller; `axes` runs both axes for `control_unit`. Where the name of a module stands
before the meaning of a symbol, the symbol has this meaning in that module only.

Symbols
    e, u, y         error of the axis, rate command, encoder angle                      [rad], [rad/s], [rad]
    v, a, j         rate, acceleration, jerk of the shaped reference                    [rad/s, rad/s2, rad/s3]
    K_p, K_i, K_d   gains of the position loop                                          [1/s], [1/s2], [-]
    D               filtered derivative of e                                            [rad/s]
    k_v, k_a        shares of v and of a fed forward into the rate command              [-], [s]
    J, Tc           inertia and Coulomb friction at the load                            [kg m2], [Nm]
    h0, r           filter step and acceleration of Han's fhan                          [s], [rad/s2]
    v1, v2, v3      `adrc`: shaped angle, rate, acceleration                            [rad, rad/s, rad/s2]
    z1, z2, z3      `adrc`: observed angle, rate, disturbance                           [rad, rad/s, rad/s2]
    w_c, w_o, w_s   `adrc`: poles of feedback, of observer, of the drive's rate loop    [rad/s]
    l1, l2, l3      `adrc`: gains of the observer over a step h                         [-], [1/s], [1/s2]
    b0              `adrc`: gain from u to the acceleration, equal to w_s               [1/s]
    u0              `adrc`: wanted acceleration                                         [rad/s2]
    R, v            `beam_loop`: angle of the beam and its rate                         [rad], [rad/s]
    alpha, beta     `beam_loop`: gains on the angle and on the rate                     [-]
    V               `beam_loop`: rate at which the ship's motion moves a fixed target   [rad/s]
    delta           `beam_loop`: share of V that is compensated                         [-]
    d, a, t         `ends`: distance to the end of travel, deceleration, reaction time  [rad], [rad/s2], [s]
    w, width, depth `notch`: centre, damping ratio of the poles, gain at the centre     [rad/s], [-], [-]
"""
