"""The turn of the azimuth axis: at a limit of its travel the axis goes round to another azimuth wrap of its target.

During the turn the beam is off the target on purpose. Errors of the receiver that belong to this time are not used,
and the outage of the receiver counts as explained. The turn ends when the reference of the axis is near the azimuth of
the target at the same instant. An axis with less than one revolution of travel waits at its limit, and turns as soon
as the target is inside the travel again.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.record import Record


class Turn(Record):
    """State of the turn."""
    under_way: int  # 1 from the change of the azimuth wrap until the beam is on the target again
    begun: float  # begin of this turn or of the last one [s]; -inf: no turn yet
    over: float  # last instant at which this turn was under way [s]; -inf: no turn yet


MAX_OFFSET_BEAMWIDTHS = 0.5
"""Largest intended angle between beam and target [beamwidths] at which the receiver's error is still used."""


def initialise(s):
    """Begin without a turn; s: view of Turn."""
    s['begun'] = s['over'] = -math.inf


@compiled
def begin(s, t):
    """Begin a turn at t [s], if none is under way."""
    if not s.under_way:
        s.under_way, s.begun, s.over = 1, t, t


@compiled
def stop(s):
    """End the turn because the antenna follows no target any more."""
    s.under_way = 0


@compiled
def watch(s, axis, target, beamwidth, t):
    """End the turn at t [s] if the azimuth of the axis is within half a beamwidth of the target.

    axis    azimuth of the reference of the axis [rad]
    target  encoder angles (azimuth, elevation) of the target [rad]

    Both azimuths count revolutions: they are not reduced to one turn.
    """
    if s.under_way:
        azimuth, elevation = target
        s.over, left = t, abs(azimuth - axis)
        s.under_way = left > math.pi or left * math.cos(elevation) > MAX_OFFSET_BEAMWIDTHS * beamwidth


@compiled
def covers(s, t):
    """Return True if a turn was under way at t [s]."""
    return s.begun <= t and (s.under_way != 0 or t <= s.over)
