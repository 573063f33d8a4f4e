"""Product of quaternions in the order (x, y, z, w). A module of its own, because each user needs this law alone."""
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Quaternion, Xyzw


@compiled
def product(a: Quaternion | Xyzw, b: Quaternion | Xyzw) -> Xyzw:
    """Return the Hamilton product of a and b, which stands for the rotation b followed by the rotation a."""
    ax, ay, az, aw = a[0], a[1], a[2], a[3]
    bx, by, bz, bw = b[0], b[1], b[2], b[3]
    return (aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz)
