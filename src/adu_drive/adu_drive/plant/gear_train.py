"""Mesh of a pinion with the bull gear: its torque on the load axis, with lash, uneven teeth and a lost tooth."""
import math
from typing import Protocol

from pedestal_common.compiled import inlined
from pedestal_common.quantities import NewtonMeters, Radians, RadiansPerSecond


class UnevenTeeth(Protocol):
    """Constants of an axis with uneven teeth. The amplitudes are those on the load axis."""
    runout: Radians         # amplitude of the error once per turn of the pinion
    tooth_error: Radians    # amplitude of the error once per tooth
    teeth: float            # number of teeth of the pinion


@inlined
def mesh_torque(delta: Radians, rate: RadiansPerSecond, k: float, c: float, half_lash: Radians) -> NewtonMeters:
    """Return the torque of a pinion on the load; delta = theta_m / N - theta, rate its derivative.

    theta_m, theta: angles of the motor and of the load; N: gear ratio; k, c: stiffness [Nm/rad] and damping [Nms/rad]
    of the mesh. The dead zone is +-half_lash; a flank pushes and never pulls.
    """
    if delta > half_lash:
        return max(k * (delta - half_lash) + c * rate, 0.0)
    if delta < -half_lash:
        return min(k * (delta + half_lash) + c * rate, 0.0)
    return 0.0


@inlined
def transmission_error(pinion: Radians, constants: UnevenTeeth) -> Radians:
    """Return the transmission error, on the load axis, of a pinion at an angle.

    ISO 1328-1 limits the corresponding deviations, the total and the tooth-to-tooth tangential composite deviation. A
    deviation is peak to peak and along the pitch circle. An amplitude is half of it, divided by the radius of the bull
    gear.
    """
    return constants.runout * math.sin(pinion) + constants.tooth_error * math.sin(constants.teeth * pinion)


@inlined
def gap(pinion: Radians, teeth: float, ratio: float) -> Radians:
    """Return the additional half lash, on the load axis, of a pinion at an angle without its tooth at 0.

    teeth: number of teeth, 0 for a whole pinion; ratio: bull gear to pinion. At the lost tooth, the flanks of its
    neighbours stop the pinion after half a pitch. They come closer as the pinion turns, so the gap is half a pitch
    times (cos phi - cos phi_0) / (1 - cos phi_0). Here phi is the angle of the pinion from the lost tooth. The gap is
    0 from phi_0 = pi / teeth on, half a pitch of the pinion.
    """
    if teeth == 0.0:
        return 0.0
    edge = math.cos(math.pi / teeth)
    return math.pi / (teeth * ratio) * max(math.cos(pinion) - edge, 0.0) / (1.0 - edge)
