"""Search patterns: the path on which the beam covers an area around the expected place of the target.

The path is a pure function of time. It passes every place of the area within half a pitch. Only the square passes a
few places near its centre within 0.57 of a pitch. The beam moves along its path at a constant speed v <= b / (4 tau).
The target is then within the beam for about four time constants tau of the level. After this time a smoothed level has
98 % of its final value.

The beam reaches its speed in SPEED_RISE_TIME_S, and is at rest for an instant in each corner. Therefore offset and
rate have no jump. The exception is the end of the spiral, where the rate jumps from full speed to zero.
"""
import math
from typing import NamedTuple

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Radians, RadiansPerSecond, Seconds

SEARCH_PATTERNS = ('spiral', 'raster', 'square', 'sector')
PATTERN_SPIRAL, PATTERN_RASTER, PATTERN_SQUARE, PATTERN_SECTOR = range(len(SEARCH_PATTERNS))
"""Shapes of a pattern. The spiral is Archimedean. The lines of a raster lie along the track of the target, the middle
line first, because a target that is early or late is on its track. The square expands. The lines of a sector go from
one edge of the area to the other."""

SPEED_RISE_TIME_S = 0.2  # time in which the beam reaches its speed, and in which it stops [s]


class Area(NamedTuple):
    """Area and pattern of a search."""
    pattern: int                # index into SEARCH_PATTERNS
    radius: Radians             # half length of the area along the track of the target
    across: Radians             # half width of a raster or a sector; the others use the radius in both directions
    pitch: Radians              # distance between neighbouring lines
    speed: RadiansPerSecond     # of the beam along its path


class Point(NamedTuple):
    """Offset of the beam from the expected place in two directions, and its rates. The directions are along and across
    the track of the target, or cross-elevation and elevation."""
    x: Radians
    y: Radians
    dx: RadiansPerSecond
    dy: RadiansPerSecond


@compiled
def highest_speed(beamwidth: Radians, time_constant: Seconds, share: float) -> RadiansPerSecond:
    """Return the speed of the beam: a share (at most 1) of the highest speed b / (4 tau)."""
    return share * beamwidth / (4.0 * time_constant)


@compiled
def rotated(point: Point, angle: Radians) -> Point:
    """Return a point turned from along and across the track to cross-elevation and elevation; angle: place.track."""
    s, c = math.sin(angle), math.cos(angle)
    return Point(c * point.x - s * point.y, s * point.x + c * point.y,
                 c * point.dx - s * point.dy, s * point.dx + c * point.dy)


@compiled
def circle(radius: Radians, period: Seconds, t: Seconds) -> Point:
    """Return the Point at t of a circle; its radius grows from 0 to `radius` during the first period. The circle is no
    search pattern, but checks the slopes of the receiver errors."""
    w = 2.0 * math.pi / period
    r, dr = (radius * t / period, radius / period) if t < period else (radius, 0.0)
    s, c = math.sin(w * t), math.cos(w * t)
    return Point(r * c, r * s, dr * c - r * w * s, dr * s + r * w * c)


@compiled
def duration(area: Area) -> Seconds:
    """Return the duration of a pattern."""
    if area.pattern == PATTERN_SPIRAL:
        return spiral_length(_turn_of(area), area.pitch) / area.speed + 0.5 * SPEED_RISE_TIME_S
    T, n = 0.0, vertices(area)
    for i in range(1, n):
        T += _leg_time(area, i)
    return T


@compiled
def point(area: Area, t: Seconds) -> Point:
    """Return the Point of a pattern at t after its begin; after its `duration` it stays at its end."""
    if area.pattern == PATTERN_SPIRAL:
        return _on_spiral(area, t)
    n = vertices(area)
    for i in range(1, n):
        T = _leg_time(area, i)
        if t < T:
            return _on_leg(area, i, t)
        t -= T
    x, y = vertex(area, n - 1)
    return Point(x, y, 0.0, 0.0)


@compiled
def _turn_of(area: Area) -> Radians:
    """Return the angle at which the spiral ends: half a pitch beyond the radius, to cover all of the edge."""
    return 2.0 * math.pi * (area.radius / area.pitch + 0.5)


@compiled
def spiral_length(theta: Radians, pitch: Radians) -> Radians:
    """Return the length k/2 (theta sqrt(1 + theta^2) + asinh theta) of the spiral r = k theta, k = pitch / (2 pi)."""
    return 0.25 * pitch / math.pi * (theta * math.sqrt(1.0 + theta * theta) + math.asinh(theta))


@compiled
def _on_spiral(area: Area, t: Seconds) -> Point:
    """Return the Point of the spiral at t: Newton's method finds the angle theta of its length, which grows with v."""
    v, k, end = area.speed, 0.5 * area.pitch / math.pi, _turn_of(area)
    length, rate = v * (t - 0.5 * SPEED_RISE_TIME_S), v
    if t < SPEED_RISE_TIME_S:
        length, rate = 0.5 * v * t * t / SPEED_RISE_TIME_S, v * t / SPEED_RISE_TIME_S
    # First value of theta: the length is k theta near the centre, and k theta^2 / 2 far from it.
    theta = min(length / k, math.sqrt(2.0 * length / k))
    for _ in range(6):
        theta -= (spiral_length(theta, area.pitch) - length) / (k * math.sqrt(1.0 + theta * theta))
    if theta >= end:
        theta, rate = end, 0.0
    s, c = math.sin(theta), math.cos(theta)
    turn = rate / (k * math.sqrt(1.0 + theta * theta))
    return Point(k * theta * c, k * theta * s, k * turn * (c - theta * s), k * turn * (s + theta * c))


@compiled
def lines_aside(area: Area) -> int:
    """Return the number of lines of a raster or a sector on one side of the middle line. The outermost line is at most
    half a pitch inside the edge of the area, so that the beam passes over the edge."""
    return max(math.ceil(area.across / area.pitch - 0.5), 0)


@compiled
def vertices(area: Area) -> int:
    """Return the number of corners of a pattern of straight legs; begin and end of the pattern count as corners. A
    raster or a sector has the centre and the two ends of each of its lines. A square has the centre and two corners
    for each length of leg; its outermost legs are at most half a pitch inside the edge."""
    if area.pattern == PATTERN_SQUARE:
        return 4 * max(math.ceil(area.radius / area.pitch - 0.5), 1) + 3
    return 4 * lines_aside(area) + 3


@compiled
def vertex(area: Area, i: int) -> tuple[Radians, Radians]:
    """Return (x, y) of corner i; corner 0 is the centre."""
    if i == 0:
        return 0.0, 0.0
    if area.pattern == PATTERN_SQUARE:
        # The legs are 1, 1, 2, 2, 3, 3 ... pitches long, and each leg is turned by 90 deg from the one before.
        return _alternating((i + 1) // 2) * area.pitch, _alternating(i // 2) * area.pitch
    # The corners of a line are its two ends. Each line begins on the side where the previous line ended.
    line = (i - 1) // 2
    x = area.radius if (i + line) % 2 == 1 else -area.radius
    return x, (_alternating(line) if area.pattern == PATTERN_RASTER else line - lines_aside(area)) * area.pitch


@compiled
def _alternating(n: int) -> int:
    """Return 0, 1, -1, 2, -2 ... for n = 0, 1, 2, 3, 4 ..."""
    return (n + 1) // 2 if n % 2 == 1 else -(n // 2)


@compiled
def _leg_length(area: Area, i: int) -> Radians:
    x0, y0 = vertex(area, i - 1)
    x1, y1 = vertex(area, i)
    return math.hypot(x1 - x0, y1 - y0)


@compiled
def _leg_time(area: Area, i: int) -> Seconds:
    """Return the time of the leg to corner i, from rest to rest, with the acceleration v / SPEED_RISE_TIME_S."""
    L, v = _leg_length(area, i), area.speed
    return L / v + SPEED_RISE_TIME_S if L > v * SPEED_RISE_TIME_S else 2.0 * math.sqrt(L * SPEED_RISE_TIME_S / v)


@compiled
def _on_leg(area: Area, i: int, t: Seconds) -> Point:
    x0, y0 = vertex(area, i - 1)
    x1, y1 = vertex(area, i)
    L, T, a = _leg_length(area, i), _leg_time(area, i), area.speed / SPEED_RISE_TIME_S
    rise = min(SPEED_RISE_TIME_S, 0.5 * T)
    if t < rise:
        distance, rate = 0.5 * a * t * t, a * t
    elif T - t < rise:
        distance, rate = L - 0.5 * a * (T - t) * (T - t), a * (T - t)
    else:
        distance, rate = a * rise * (t - 0.5 * rise), a * rise
    part, speed = (distance / L, rate / L) if L > 0.0 else (1.0, 0.0)
    dx, dy = x1 - x0, y1 - y0
    return Point(x0 + part * dx, y0 + part * dy, speed * dx, speed * dy)
