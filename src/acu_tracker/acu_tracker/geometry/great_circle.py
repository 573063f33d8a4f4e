"""A direction that moves on along the great circle of its rate."""
import math

from acu_tracker.geometry.vector import Vector
from pedestal_common.compiled import compiled


@compiled
def turned(u, du, W, angle):
    """Return the unit Vector u turned by an angle [rad] in the direction of its rate du [1/s] of length W."""
    # du / W is the unit vector along the motion.
    cos, sin = math.cos(angle), math.sin(angle) / W if W > 0.0 else 0.0
    return Vector(cos * u.x + sin * du.x, cos * u.y + sin * du.y, cos * u.z + sin * du.z)
