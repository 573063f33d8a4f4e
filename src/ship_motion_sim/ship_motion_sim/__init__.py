"""Motion of a ship on a seaway, measurements of its IMU and outputs of its INS: the nodes ship_motion and ins.

Frames
    earth   ENU tangent plane at the position of the ship at t = 0.
    deck    FLU: x to the bow, y to port, z up. roll about x (port side up), pitch about y (bow down), yaw
            about z (to port) as fixed axes of REP 103; yaw 0 is east. A compass heading is clockwise:
            yaw = 90 deg - heading, converted when the parameter is read.
    mu      direction to which a wave travels, clockwise from the bow: 0 following, 90 from port to starboard,
            180 head sea.
    n'      frame that the INS computes as its estimate of ENU; an alignment rotates it by w_c [rad/s]

Symbols
    Hs, Tp, wp      significant wave height [m], peak period [s], peak frequency [rad/s]
    S(w)            one-sided wave spectrum, variance Hs^2/16                       [m2 s/rad]
    gamma           peak enhancement of JONSWAP; 1 is Bretschneider (ITTC)          [-]
    k, w_e          wave number w^2/g of deep water; encounter frequency w - k U cos mu, negative when the ship
                    overtakes the wave                                              [rad/m, rad/s]
    X               complex amplitude of one degree of freedom: x = sum Re(X e^{j(w_e t + phase)})
    w, f, w_ie      rate of the deck against the earth, specific force, both FLU; rotation of the earth
    mat_ed          rotation deck -> earth; quaternions are x, y, z, w and rotate the same way
"""
