"""The azimuth wrap: of the azimuths that point in the same direction, the one to which the axis goes.

The choice matters for an axis with more than one revolution of travel. At a limit of its travel the axis turns: it
goes round to another azimuth wrap of its target. During the turn the beam is off the target on purpose. Errors of the
receiver that belong to this time are not used, and the outage of the receiver counts as explained. An axis with less
than one revolution of travel waits at its limit, and turns as soon as the target is inside the travel again.
"""
import math
from typing import NamedTuple

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import wrap
from pedestal_common.quantities import Bit, Radians, Records, Seconds
from pedestal_common.record import Record


class Travel(NamedTuple):
    """Future travel of a target's azimuth from its present value."""
    below: Radians      # at most 0
    above: Radians      # at least 0


@compiled
def nearest(azimuth: Radians, near: Radians, low: Radians, high: Radians, travel: Travel) -> Radians:
    """Return the wrap of an azimuth that suits the limits low to high best. The first choice is the wrap nearest to
    `near` from which the Travel stays inside the limits. The second choice is the nearest wrap that is inside the
    limits itself. The last choice is the nearest wrap."""
    # Two penalties, far above every distance, rank the wraps: 2e6 for a wrap outside the limits, 1e6 for a wrap whose
    # travel leaves the limits.
    closest = near + wrap(azimuth - near)
    best, score = closest, math.inf
    for i in range(-2, 3):
        candidate = closest + 2.0 * math.pi * i
        away = abs(candidate - near)
        if candidate < low or candidate > high:
            away += 2e6
        elif candidate + travel.below < low or candidate + travel.above > high:
            away += 1e6
        if away < score:
            best, score = candidate, away
    return best


class Turn(Record):
    """State of the turn."""
    under_way: Bit      # 1 from the change of the azimuth wrap until the beam is on the target again
    begun: Seconds      # begin of this turn or of the last one; -inf: no turn yet
    over: Seconds       # last instant at which this turn was under way; -inf: no turn yet


MAX_OFFSET_BEAMWIDTHS = 0.5  # largest intended angle between beam and target at which an error is used


def initialise_turn(record: Records) -> None:
    """Begin without a turn."""
    record['begun'] = record['over'] = -math.inf


@compiled
def begin_turn(turn: Turn, t: Seconds) -> None:
    """Begin a turn at t, if none is under way."""
    if not turn.under_way:
        turn.under_way, turn.begun, turn.over = 1, t, t


@compiled
def stop_turn(turn: Turn) -> None:
    """End the turn because the antenna follows no target any more."""
    turn.under_way = 0


@compiled
def watch_turn(turn: Turn, axis: Radians, target: tuple[Radians, Radians], beamwidth: Radians, t: Seconds) -> None:
    """End the turn at t if the azimuth of the axis is within half a beamwidth of the target. axis: azimuth of its
    reference; target: encoder angles (azimuth, elevation). Both azimuths count revolutions."""
    if turn.under_way:
        azimuth, elevation = target
        turn.over, left = t, abs(azimuth - axis)
        turn.under_way = left > math.pi or left * math.cos(elevation) > MAX_OFFSET_BEAMWIDTHS * beamwidth


@compiled
def turn_covers(turn: Turn, t: Seconds) -> bool:
    """Return True if a turn was under way at t."""
    return turn.begun <= t and (turn.under_way != 0 or t <= turn.over)
