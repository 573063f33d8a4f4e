"""Pinion on bull gear: a mesh with lash, its torque on the load axis."""
import math

from pedestal_common.compiled import inlined


@inlined
def mesh_torque(delta, rate, k, c, half_lash):
    """Torque [Nm] of a pinion on the load; delta = theta_m / N - theta [rad], rate its derivative.

    Dead zone of +-half_lash; a flank pushes, it never pulls.
    """
    if delta > half_lash:
        return max(k * (delta - half_lash) + c * rate, 0.0)
    if delta < -half_lash:
        return min(k * (delta + half_lash) + c * rate, 0.0)
    return 0.0


@inlined
def transmission_error(pinion, c):
    """How much too far [rad on the load axis] a pinion at this angle [rad] drives the gear: by its runout once a turn,
    by its teeth once each (total and tooth-to-tooth tangential composite deviation, ISO 1328-1)."""
    return c.runout * math.sin(pinion) + c.tooth_error * math.sin(c.teeth * pinion)


@inlined
def gap(pinion, teeth, ratio):
    """Additional half lash [rad] on the load axis of a pinion at an angle [rad] that has lost the tooth at 0 of its
    `teeth`; 0 teeth: it is whole. ratio: bull gear : pinion.

    Where the tooth was, the flanks of its neighbours stop the pinion after half a pitch; they come nearer again as it
    turns on, which makes the gap a cam: (cos phi - cos phi_0) / (1 - cos phi_0) within phi_0 = pi / teeth.
    """
    if teeth == 0.0:
        return 0.0
    edge = math.cos(math.pi / teeth)
    return math.pi / (teeth * ratio) * max(math.cos(pinion) - edge, 0.0) / (1.0 - edge)
