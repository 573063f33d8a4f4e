"""Gyrocompass alignment: level and north of a strapdown INS from its gyros and accelerometers.

classical           fourth-order gyrocompass: the level error that a wrong azimuth causes closes the azimuth loop
adrc                paper 001, corrected: levelled by ADRC, azimuth from the least-squares slope of the level commands
adrc_scheduled      observer of adrc with a bandwidth that falls as 6 / t; azimuth from the estimate z3
riccati_eso         observer of adrc with the gains of a Kalman filter
oba                 optimisation-based: the rotation that maps one set of vectors onto another, no feedback loop

Each method is a module with one `step` and its State. The methods share extended_observer, levelling, slope,
steady_state and the conditions; navigator runs the selected method. Sources: paper 001 (Zhou, Yang, Qin 2011) with
corrected equations (levelling, adrc); Han 2009 (ADRC); Horn 1987 and Wu 2013 (optimisation-based alignment).

Symbols
    n, n'           ENU; frame that the INS computes for ENU, rotated by a_z about up and by small a_x, a_y about the
                    level axes
    C_b^n           rotation from the deck b to n
    az              azimuth misalignment a_z: C_b^n = R_z(az) C_b^n'                [rad]
    eps_E, eps_N    east and north component of the gyro bias                       [rad/s]
    w_c             commanded rate of n' against the earth, in n' (E, N, U)         [rad/s]
    w_N, g          north part of the earth's rate, gravity                         [rad/s, m/s2]
    v_E, v_N        level velocity in n' less that of an aid: the error            [m/s]
    x1, x2, x3      state of a channel: v_N or v_E, its rate, the rate of x2 without command [m/s, m/s2, m/s3]
                    north: x2 = g a_x, x3 = g (-sin az w_N - eps_E), b0 = g
                    east: x2 = -g a_y, x3 = -g ((1 - cos az) w_N - eps_N), b0 = -g
    z1, z2, z3      estimates of x1, x2, x3
    b0 u            effect of a command on the rate of x2: u = w_cE (north channel), w_cN (east)
    v1, v2          reference of x1, x2 from the tracking differentiator
    w_o, w_c (level)    bandwidth of the observer and of the level control          [rad/s]
    l1, l2, l3      observer gains; p: covariance of z as p11, p12, p13, p22, p23, p33
    h               step of the laws                                                [s]
    r, q            variance of the velocity disturbance per step [m2/s2]; growth of the variance of x2 [(m/s2)2/s]
"""
