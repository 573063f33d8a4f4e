"""Search patterns: the path of the beam about the expected place of the target, a pure function of time.

The path passes every place of the area within half a pitch; the square passes a few places near its centre within 0.57
of a pitch. The beam moves at a constant speed

    v <= b / (4 tau)

along its path, so that the target is within the beam for about four time constants of the level. After four time
constants a smoothed level has 98 % of its final value. b: beamwidth [rad];
tau: time constant with which the receiver smooths the level [s].
The beam starts from rest in SPEED_RISE_TIME_S, and rests for an instant in each corner: offset and rate have no jump
there. The spiral has no corner and ends at full speed, so its rate jumps to zero at its end.
"""
import math
from collections import namedtuple

from pedestal_common.compiled import compiled

SEARCH_PATTERNS = ('spiral', 'raster', 'square', 'sector')
PATTERN_SPIRAL, PATTERN_RASTER, PATTERN_SQUARE, PATTERN_SECTOR = range(len(SEARCH_PATTERNS))
"""Shapes of a pattern.

    spiral      Archimedean
    raster      lines along the track of the target, the middle line first: a late prediction is off along the track
    square      expanding, along the track and across
    sector      lines from one edge of the area to the other
"""

SPEED_RISE_TIME_S = 0.2
"""Time in which the beam reaches its speed, and in which it stops [s]."""

Area = namedtuple('Area', 'pattern radius across pitch speed')
"""Area and pattern of a search. pattern: its code; radius: half length along the track, across: half width
[rad] (raster and sector; the others use the radius both ways). `pitch`: distance between neighbouring
lines [rad]; speed [rad/s]."""

Point = namedtuple('Point', 'x y dx dy')
"""Offset [rad] along x and y, and its rate [rad/s]."""


@compiled
def highest_speed(beamwidth, time_constant, share):
    """Return the speed of the beam [rad/s]: share (at most 1) of b / (4 tau)."""
    return share * beamwidth / (4.0 * time_constant)


@compiled
def rotated(p, angle):
    """Return a Point turned by an angle [rad]: from along and across the track to cross-elevation and elevation."""
    s, c = math.sin(angle), math.cos(angle)
    return Point(c * p.x - s * p.y, s * p.x + c * p.y, c * p.dx - s * p.dy, s * p.dx + c * p.dy)


@compiled
def circle(radius, period, t):
    """Return the Point at t [s] of a circle about the centre, entered along a radius that grows for one period [s].

    The circle is no search pattern. `acquisition` uses it to check the slopes of the receiver errors.
    """
    w = 2.0 * math.pi / period
    r, dr = (radius * t / period, radius / period) if t < period else (radius, 0.0)
    s, c = math.sin(w * t), math.cos(w * t)
    return Point(r * c, r * s, dr * c - r * w * s, dr * s + r * w * c)


@compiled
def duration(area):
    """Return the duration of a pattern [s]."""
    if area.pattern == PATTERN_SPIRAL:
        return spiral_length(_turn_of(area), area.pitch) / area.speed + 0.5 * SPEED_RISE_TIME_S
    T, n = 0.0, vertices(area)
    for i in range(1, n):
        T += _leg_time(area, i)
    return T


@compiled
def point(area, t):
    """Return the Point of a pattern at t [s] after its begin; after its `duration` it stays at its end."""
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
def _turn_of(area):
    """Return the angle [rad] at which the spiral has reached the radius, and half a pitch more,
    so that all of its edge is seen."""
    return 2.0 * math.pi * (area.radius / area.pitch + 0.5)


@compiled
def spiral_length(theta, pitch):
    """Return the length [rad] of r = k theta, k = pitch / (2 pi), from the centre to the angle theta [rad]: k/2 (theta
    sqrt(1 + theta^2) + asinh theta)."""
    return 0.25 * pitch / math.pi * (theta * math.sqrt(1.0 + theta * theta) + math.asinh(theta))


@compiled
def _on_spiral(area, t):
    """Return the Point of the spiral: the length is v t after the rise,
    and Newton's method finds the angle of this length."""
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
def lines_aside(area):
    """Return the number of lines of a raster or a sector on one side of the middle line, at least 0.

    The outermost line is at most half a pitch inside the edge, so that the edge is seen.
    """
    return max(math.ceil(area.across / area.pitch - 0.5), 0)


@compiled
def vertices(area):
    """Return the number of corners of a pattern of straight legs, with its begin and its end.

    A raster or a sector has the centre and two ends of each of its 2 lines_aside + 1 lines. A square has the centre
    and two corners for each length of leg. Its outermost legs are at most half a pitch inside the edge.
    """
    if area.pattern == PATTERN_SQUARE:
        return 4 * max(math.ceil(area.radius / area.pitch - 0.5), 1) + 3
    return 4 * lines_aside(area) + 3


@compiled
def vertex(area, i):
    """Return (x, y) [rad] of corner i, 0 the centre."""
    if i == 0:
        return 0.0, 0.0
    if area.pattern == PATTERN_SQUARE:
        # Legs of 1, 1, 2, 2, 3, 3 ... pitches, each a quarter of a turn on.
        return _alternating((i + 1) // 2) * area.pitch, _alternating(i // 2) * area.pitch
    # Boustrophedon: the corners of a line are its two ends, and the next line begins at the side where it ended.
    line = (i - 1) // 2
    x = area.radius if (i + line) % 2 == 1 else -area.radius
    return x, (_alternating(line) if area.pattern == PATTERN_RASTER else line - lines_aside(area)) * area.pitch


@compiled
def _alternating(n):
    """Return 0, 1, -1, 2, -2 ... for n = 0, 1, 2, 3, 4 ..."""
    return (n + 1) // 2 if n % 2 == 1 else -(n // 2)


@compiled
def _leg_length(area, i):
    """Return the distance [rad] from corner i - 1 to corner i."""
    x0, y0 = vertex(area, i - 1)
    x1, y1 = vertex(area, i)
    return math.hypot(x1 - x0, y1 - y0)


@compiled
def _leg_time(area, i):
    """Return the time [s] from corner i - 1 to corner i, from rest to rest with the acceleration v /
    SPEED_RISE_TIME_S."""
    L, v = _leg_length(area, i), area.speed
    return L / v + SPEED_RISE_TIME_S if L > v * SPEED_RISE_TIME_S else 2.0 * math.sqrt(L * SPEED_RISE_TIME_S / v)


@compiled
def _on_leg(area, i, t):
    """Return the Point of the leg to corner i, t [s] after its begin."""
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
