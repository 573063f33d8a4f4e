"""A direction that keeps its angular rate, and so moves along a great circle."""
import math

from acu_tracker.geometry.vector import Vector
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Radians


@compiled
def turned(u: Vector, du: Vector, W: float, angle: Radians) -> Vector:
    """Return the unit vector u after a turn by an angle towards its rate du [1/s]; W: length of du."""
    # du / W is the unit vector along the motion.
    cos, sin = math.cos(angle), math.sin(angle) / W if W > 0.0 else 0.0
    return Vector(cos * u.x + sin * du.x, cos * u.y + sin * du.y, cos * u.z + sin * du.z)
