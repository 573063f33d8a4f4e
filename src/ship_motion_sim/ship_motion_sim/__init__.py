"""Motion of a ship on a seaway, measurements of its IMU and outputs of its INS: the nodes ship_motion and ins.

ship_unit, ins_unit units of both nodes, which call the functions below
recording           recorded motion as piecewise polynomials, instead of waves
motion.truth        time -> truth of the ship (stateless: the same seed and time give the same bits in any order)
imu.step            truth -> specific force and angular rate by REP 145, the convention of ROS for IMU messages
strapdown.step      increments of angle and velocity -> attitude and velocity in a computed frame
ins.step            stamp of an IMU message -> attitude and deck rate of an INS with parametrised errors and latency
aligning_ins.step   stamp and data of an IMU message -> attitude and deck rate of an INS that aligns and navigates

Frames
    earth   ENU tangent plane at the position of the ship at t = 0.
    deck    FLU: x to the bow, y to port, z up. roll about x (port side up), pitch about y (bow down), yaw
            about z (to port) as fixed axes of REP 103; yaw 0 is east. A compass heading is clockwise:
            yaw = 90 deg - heading, converted when the parameter is read.
    mu      direction to which a wave travels, clockwise from the bow: 0 following, 90 from port to starboard,
            180 head sea.

Units are SI and radians; a name that ends in _deg is in degrees.

Symbols
    Hs, Tp, wp      significant wave height [m], peak period [s], peak frequency [rad/s]
    S(w)            one-sided wave spectrum, variance Hs^2/16                       [m2 s/rad]
    gamma           peak enhancement of JONSWAP; 1 is Bretschneider (ITTC)          [-]
    k               wave number w^2/g of deep water                                 [rad/m]
    w_e             encounter frequency w - k U cos mu; negative when the ship overtakes the wave  [rad/s]
    X               complex amplitude of one degree of freedom: x = sum Re(X e^{j(w_e t + phase)})
    U               speed through the water along the mean heading                  [m/s]
    w, dw           angular velocity of the deck against the earth, FLU, and its derivative  [rad/s, rad/s2]
    f               specific force, FLU: at rest +g along z                         [m/s2]
    n'              frame that the INS computes as its estimate of ENU; an alignment rotates it by w_c
    w_ie, w_c       rotation of the earth; rate at which an alignment rotates n'    [rad/s]
    mat_ed          rotation deck -> earth; quaternions are x, y, z, w and rotate the same way
"""
