"""How fast the error of a beam on a moving deck changes: the true value of the receiver's rate channels."""
from pedestal_common.compiled import compiled
from pedestal_common.line_of_sight import offset_rates, to_deck


@compiled
def error_rate(mat_ed, position, twist_linear, twist_angular, azimuth, elevation, azimuth_rate, elevation_rate,
               e, n, u, v_e, v_n, v_u):
    """(d dX/dt, d dE/dt) [rad/s] of a target at ENU [m], moving with v [m/s], off a beam at deck angles.

    mat_ed (3, 3) deck -> earth; position (3,) ENU of the antenna [m]; twist_linear, twist_angular (3,) its velocity
    [m/s] and the rate [rad/s] of the deck, FLU. Exact: the target's place in the deck frame is
    r = M' (p - position), and r' = M' v - v_deck - w x r.
    """
    x, y, z = to_deck(mat_ed, e - position[0], n - position[1], u - position[2])
    vx, vy, vz = to_deck(mat_ed, v_e, v_n, v_u)
    wx, wy, wz = twist_angular[0], twist_angular[1], twist_angular[2]
    return offset_rates(azimuth, elevation, azimuth_rate, elevation_rate, x, y, z,
                        vx - twist_linear[0] - (wy * z - wz * y), vy - twist_linear[1] - (wz * x - wx * z),
                        vz - twist_linear[2] - (wx * y - wy * x))
