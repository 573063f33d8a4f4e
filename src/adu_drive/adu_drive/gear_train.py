"""Pinion on bull gear: a mesh with lash, its torque on the load axis."""
from pedestal_common.compiled import compiled


@compiled
def mesh_torque(delta, rate, k, c, half_lash):
    """Torque [Nm] of a pinion on the load; delta = theta_m / N - theta [rad], rate its derivative.

    Dead zone of +-half_lash; a flank pushes, it never pulls.
    """
    if delta > half_lash:
        return max(k * (delta - half_lash) + c * rate, 0.0)
    if delta < -half_lash:
        return min(k * (delta + half_lash) + c * rate, 0.0)
    return 0.0
