"""The arm r from the INS to the antenna, where the range is measured. `s` is the unit's STATE.

The antenna of a rolling ship swings, and a near target with it: by r / range. The INS's own line of sight does not.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.line_of_sight import earth_angles, earth_direction, to_earth, wrap

RANGE_SHARE = 0.05
"""Share of a measured range that the smoothed one takes."""


@compiled
def from_ins(s, r, measured, x, y, z):
    """The FLU direction (x, y, z), measured at the antenna, as the INS would see it: a vector of length about 1.

    r: the arm, record x, y, z [m]; measured: range of the antenna [m], NaN none. Sets s.range, s.arm.

    With a range the estimate is the line of sight of the INS, which the deck's turning does not move: R = |rho u + r|
    is smoothed, and the arm put between. Only a filter that starts with a range does so, so that what it estimates
    stays the same.
    """
    along, r2 = x * r.x + y * r.y + z * r.z, r.x * r.x + r.y * r.y + r.z * r.z
    known = measured > 0.0 and s.stabilised
    R = math.sqrt(measured * measured + 2.0 * measured * along + r2) if known else 0.0
    if not s.tracker.running:
        s.range = R
    elif s.range > 0.0 and known:
        s.range += RANGE_SHARE * (R - s.range)
    if not s.range > math.sqrt(r2):
        s.arm[:] = 0.0
        return x, y, z
    k = 1.0 / s.range
    s.arm[0], s.arm[1], s.arm[2] = k * r.x, k * r.y, k * r.z
    rho = k * (math.sqrt(along * along + s.range * s.range - r2) - along)
    return rho * x + s.arm[0], rho * y + s.arm[1], rho * z + s.arm[2]


@compiled
def to_antenna(s, x):
    """An estimate x (2, 3) of the INS's line of sight, earth angles, becomes that of the antenna; the rates stay. The
    attitude is the one last asked for."""
    e, n, u = earth_direction(x[0, 0], x[1, 0])
    re, rn, ru = to_earth(s.mat_ed, s.arm[0], s.arm[1], s.arm[2])
    azimuth, x[1, 0] = earth_angles(e - re, n - rn, u - ru)
    x[0, 0] += wrap(azimuth - x[0, 0])
