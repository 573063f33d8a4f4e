"""Mesh of a pinion with the bull gear: its torque on the load axis, with lash, uneven teeth and a lost tooth."""
import math

from pedestal_common.compiled import inlined


@inlined
def mesh_torque(delta, rate, k, c, half_lash):
    """Return the torque [Nm] of a pinion on the load; delta = theta_m / N - theta [rad], rate its derivative.

    theta_m, theta: angles of the motor and of the load; N: gear ratio; k, c: stiffness [Nm/rad] and damping [Nms/rad]
    of the mesh. The dead zone is +-half_lash; a flank pushes and never pulls.
    """
    if delta > half_lash:
        return max(k * (delta - half_lash) + c * rate, 0.0)
    if delta < -half_lash:
        return min(k * (delta + half_lash) + c * rate, 0.0)
    return 0.0


@inlined
def transmission_error(pinion, c):
    """Return the transmission error [rad on the load axis] of a pinion at an angle [rad].

    c: constants of the axis. c.runout, c.tooth_error: amplitudes [rad on the load axis] of an error once per turn and
    once per tooth; c.teeth: number of teeth. ISO 1328-1 limits the corresponding deviations, the total and the
    tooth-to-tooth tangential composite deviation. A deviation is peak to peak and along the pitch circle. An amplitude
    is half of it, divided by the radius of the bull gear.
    """
    return c.runout * math.sin(pinion) + c.tooth_error * math.sin(c.teeth * pinion)


@inlined
def gap(pinion, teeth, ratio):
    """Return the additional half lash [rad on the load axis] of a pinion at an angle [rad] without its tooth at 0.

    teeth: number of teeth, 0 for a whole pinion; ratio: bull gear to pinion. At the lost tooth, the flanks of its
    neighbours stop the pinion after half a pitch. They come closer as the pinion turns, so the gap is half a pitch
    times (cos phi - cos phi_0) / (1 - cos phi_0). Here phi is the angle of the pinion from the lost tooth. The gap is
    0 from phi_0 = pi / teeth on, half a pitch of the pinion.
    """
    if teeth == 0.0:
        return 0.0
    edge = math.cos(math.pi / teeth)
    return math.pi / (teeth * ratio) * max(math.cos(pinion) - edge, 0.0) / (1.0 - edge)
