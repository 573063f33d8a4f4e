"""The turn of the azimuth axis: at a limit of its travel the axis goes round to another azimuth wrap of its target.

During the turn the beam is off the target on purpose. Errors of the receiver that belong to this time are not used,
and the outage of the receiver counts as explained. The turn ends when the reference of the axis is near the azimuth of
the target at the same instant. An axis with less than one revolution of travel waits at its limit, and turns as soon
as the target is inside the travel again.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Radians, Records, Seconds
from pedestal_common.record import Record


class Turn(Record):
    """State of the turn."""
    under_way: Bit      # 1 from the change of the azimuth wrap until the beam is on the target again
    begun: Seconds      # begin of this turn or of the last one; -inf: no turn yet
    over: Seconds       # last instant at which this turn was under way; -inf: no turn yet


MAX_OFFSET_BEAMWIDTHS = 0.5
"""Largest intended angle between beam and target [beamwidths] at which the receiver's error is still used."""


def initialise(record: Records) -> None:
    """Begin without a turn."""
    record['begun'] = record['over'] = -math.inf


@compiled
def begin(turn: Turn, t: Seconds) -> None:
    """Begin a turn at t, if none is under way."""
    if not turn.under_way:
        turn.under_way, turn.begun, turn.over = 1, t, t


@compiled
def stop(turn: Turn) -> None:
    """End the turn because the antenna follows no target any more."""
    turn.under_way = 0


@compiled
def watch(turn: Turn, axis: Radians, target: tuple[Radians, Radians], beamwidth: Radians, t: Seconds) -> None:
    """End the turn at t if the azimuth of the axis is within half a beamwidth of the target.

    axis    azimuth of the reference of the axis
    target  encoder angles (azimuth, elevation) of the target

    Both azimuths count revolutions: they are not reduced to one turn.
    """
    if turn.under_way:
        azimuth, elevation = target
        turn.over, left = t, abs(azimuth - axis)
        turn.under_way = left > math.pi or left * math.cos(elevation) > MAX_OFFSET_BEAMWIDTHS * beamwidth


@compiled
def covers(turn: Turn, t: Seconds) -> bool:
    """Return True if a turn was under way at t."""
    return turn.begun <= t and (turn.under_way != 0 or t <= turn.over)
