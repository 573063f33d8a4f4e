"""Rate of the error of a beam on a moving deck: the true value of the rate channels of the receiver."""
from typing import Protocol

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import offset_rates, to_deck
from pedestal_common.quantities import Matrix3, Radians, RadiansPerSecond, Vector3
from tracking_receiver_sim.target import TargetState


class Inputs(Protocol):
    """The part of receiver.Inputs that the rate needs."""
    azimuth: Radians
    elevation: Radians
    azimuth_rate: RadiansPerSecond
    elevation_rate: RadiansPerSecond
    mat_ed: Matrix3
    twist_angular: Vector3


@compiled
def error_rate(inputs: Inputs, position: Vector3, velocity: Vector3,
               target: TargetState) -> tuple[RadiansPerSecond, RadiansPerSecond]:
    """Return (d dX/dt, d dE/dt) of a target off the beam.

    position, velocity: position of the antenna, ENU [m], and its velocity, FLU [m/s]. The rate is exact. In the deck
    frame the target is at r = M^T (p - position), and its derivative is dr/dt = M^T v - velocity - w x r.

        p, v    position and velocity of the target, ENU [m, m/s]
        M       mat_ed, rotation deck -> earth
        w       rate of the deck, FLU [rad/s]
    """
    (e, n, u), (v_e, v_n, v_u) = target.position, target.velocity
    x, y, z = r = to_deck(inputs.mat_ed, e - position[0], n - position[1], u - position[2])
    vx, vy, vz = to_deck(inputs.mat_ed, v_e, v_n, v_u)
    wx, wy, wz = inputs.twist_angular[0], inputs.twist_angular[1], inputs.twist_angular[2]
    v = (vx - velocity[0] - (wy * z - wz * y), vy - velocity[1] - (wz * x - wx * z),
         vz - velocity[2] - (wx * y - wy * x))
    return offset_rates((inputs.azimuth, inputs.elevation), (inputs.azimuth_rate, inputs.elevation_rate), r, v)
