"""Rate of the error of a beam on a moving deck: the true value of the rate channels of the receiver."""
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import offset_rates, to_deck


@compiled
def error_rate(i, position, velocity, target):
    """Return (d dX/dt, d dE/dt) [rad/s] of a TargetState off the beam; i: record of receiver.Inputs.

    position, velocity (3,): position of the antenna, ENU [m], and its velocity, FLU [m/s]. The rate is exact. In the
    deck frame the target is at r = M^T (p - position), and its derivative is dr/dt = M^T v - velocity - w x r.

        p, v    position and velocity of the target, ENU [m, m/s]
        M       mat_ed, rotation deck -> earth
        w       rate of the deck, FLU [rad/s]
    """
    (e, n, u), (v_e, v_n, v_u) = target.position, target.velocity
    x, y, z = r = to_deck(i.mat_ed, e - position[0], n - position[1], u - position[2])
    vx, vy, vz = to_deck(i.mat_ed, v_e, v_n, v_u)
    wx, wy, wz = i.twist_angular[0], i.twist_angular[1], i.twist_angular[2]
    v = (vx - velocity[0] - (wy * z - wz * y), vy - velocity[1] - (wz * x - wx * z),
         vz - velocity[2] - (wx * y - wy * x))
    return offset_rates((i.azimuth, i.elevation), (i.azimuth_rate, i.elevation_rate), r, v)
