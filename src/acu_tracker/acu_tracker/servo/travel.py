"""The travel of an axis: its ends, the largest rate towards an end, and the floor of the elevation.

    v^2 / (2 a) + v t = d

v is the largest rate from which the axis stops within the distance d to the end, with the deceleration a and the
reaction time t (AcuParameters.reaction). The slope dv/dd is at most 1 / t. Therefore a command that is late by t / e
(e: Euler's number) causes no overshoot.

The floor is the lowest elevation that the antenna may have at each azimuth, in every mode. It keeps the dish clear of
structures around the antenna. A table of points, joined by straight lines, defines it. Where the floor rises, the
azimuth waits until the elevation is above the floor ahead. A, E: azimuth and elevation in encoder angles.
"""
import math
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np

from acu_tracker.servo.params import LimitsParameters
from acu_tracker.signals import Inputs
from pedestal_common.compiled import compiled
from pedestal_common.parameters import ParameterError
from pedestal_common.quantities import Bit, Floats, Radians, RadiansPerSecond, RadiansPerSecond2, Records, Seconds
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.control_unit import Constants


class Ends(NamedTuple):
    """Angles between which an axis may be at present: its limits, or the floor."""
    low: Radians
    high: Radians


@compiled
def braking_distance(v: RadiansPerSecond, a: RadiansPerSecond2, t: Seconds) -> Radians:
    """Return the distance in which an axis at a rate v >= 0 stops."""
    return v * v / (2.0 * a) + v * t


@compiled
def stopping_rate(d: Radians, a: RadiansPerSecond2, t: Seconds) -> RadiansPerSecond:
    """Return the largest rate from which an axis stops before an end d ahead; 0 beyond the end (d <= 0)."""
    if d <= 0.0:
        return 0.0
    return math.sqrt(a * t * (a * t) + 2.0 * a * d) - a * t


@compiled
def inside(u: RadiansPerSecond, y: Radians, ends: Ends, a: RadiansPerSecond2, t: Seconds) -> RadiansPerSecond:
    """Return a rate command u with which an axis at y stops between its Ends; beyond one it may only move back."""
    return min(max(u, -stopping_rate(y - ends.low, a, t)), stopping_rate(ends.high - y, a, t))


@compiled
def time_to(y: Radians, dy: RadiansPerSecond, ends: Ends) -> Seconds:
    """Return the time until an axis at y reaches an end at its rate dy: 0 beyond an end, inf at rest."""
    if y > ends.high or y < ends.low:
        return 0.0
    if dy > 0.0:
        return (ends.high - y) / dy
    return (ends.low - y) / dy if dy < 0.0 else math.inf


MAX_FLOOR_POINTS = 64  # largest number of points of a floor
FLOOR_DOC = ("floor of the elevation over the azimuth, at most 64 points: 'azimuth elevation; ...' [rad] on the deck, "
             'clockwise within a turn, straight lines between; empty: elevation.limits.low')

CELL_COUNT = 720  # number of cells of a turn in which the floor is looked up: half a degree each
CELL_WIDTH_RAD = 2.0 * math.pi / CELL_COUNT  # width of a cell [rad]


class Floor(Record):
    """Table of the floor. Cell 0 is from azimuth 0 to CELL_WIDTH_RAD."""
    given: Bit      # 1 if there is a floor
    highest: Annotated[Floats, (CELL_COUNT,)]   # highest value of the floor in each cell [rad]


MAX_AZIMUTH_RAD = 1e3
"""Azimuth beyond the travel of every axis [rad]. It replaces a larger one, because an infinite azimuth has no cell."""

FLOOR_CLEARANCE_RAD = 1e-3
"""Least elevation above the floor to which the elevation is sent [rad]. The azimuth waits until the elevation is above
the floor. Because of the clearance it does not wait for the last step of the encoder."""


def floor_points(text: str) -> tuple[tuple[Radians, ...], tuple[Radians, ...]]:
    """Return (azimuths, elevations) of the points in a text as in FLOOR_DOC. Raise ParameterError for a wrong text."""
    parts = [part.split() for part in text.split(';') if part.strip()]
    if len(parts) > MAX_FLOOR_POINTS:
        raise ParameterError(f'floor = {text!r}: {len(parts)} points; must be at most {MAX_FLOOR_POINTS}')
    try:
        rows = [(float(azimuth), float(elevation)) for azimuth, elevation in parts]
    except ValueError:
        raise ParameterError(f'floor = {text!r}: must be azimuth elevation [rad], separated by semicolons') from None
    # A: azimuths; f: elevations of the floor there.
    A, f = zip(*rows) if rows else ((), ())
    if rows and not (all(a < b for a, b in zip(A, A[1:])) and A[-1] - A[0] < 2.0 * math.pi
                     and all(abs(a) <= 2.0 * math.pi and abs(e) <= 0.5 * math.pi for a, e in rows)):
        raise ParameterError(f'floor = {text!r}: azimuths must increase, within one turn and -6.2832 to 6.2832 rad; '
                             'elevations must be -1.5708 to 1.5708 rad')
    return A, f


def floor_at(text: str, A: Radians) -> Radians:
    """Return the floor at an azimuth A, of a text as in FLOOR_DOC; -inf if there is no floor."""
    azimuths, elevations = floor_points(text)
    return np.interp(A, azimuths, elevations, period=2.0 * math.pi) if azimuths else -math.inf


def floor_table(text: str) -> Records:
    """Return the Floor (1,) of the parameter `floor`. The value of a cell is the highest floor in it."""
    A, f = floor_points(text)
    floor = Floor.zeros()
    if A:
        edges = np.interp(CELL_WIDTH_RAD * np.arange(CELL_COUNT + 1), A, f, period=2.0 * math.pi)
        highest = np.maximum(edges[:-1], edges[1:])
        np.maximum.at(highest, (np.mod(A, 2.0 * math.pi) / CELL_WIDTH_RAD).astype(int) % CELL_COUNT, f)
        floor['given'], floor['highest'] = 1, highest
    return floor


@compiled
def _cell(A: Radians) -> int:
    """Return the number of the cell of an azimuth, which still counts turns; modulo CELL_COUNT it is an index."""
    return math.floor(min(max(A, -MAX_AZIMUTH_RAD), MAX_AZIMUTH_RAD) / CELL_WIDTH_RAD)


@compiled
def highest(floor: Floor, A: Radians, B: Radians) -> Radians:
    """Return the highest value of the floor between the azimuths A and B."""
    first, last = _cell(min(A, B)), _cell(max(A, B))
    top = -math.inf
    for i in range(first, min(last, first + CELL_COUNT - 1) + 1):
        top = max(top, floor.highest[i % CELL_COUNT])
    return top


@compiled
def above(floor: Floor, A: Radians, E: Radians) -> bool:
    """Return True if the floor at the azimuth A is above the elevation E."""
    return floor.given != 0 and floor.highest[_cell(A) % CELL_COUNT] > E


@compiled
def of_azimuth(floor: Floor, limits: LimitsParameters, A: Radians, E: Radians) -> Ends:
    """Return the Ends of the azimuth, now at A: its limits, or the places where the floor rises above the elevation E.
    If the floor at A is above E already, the azimuth may leave: its Ends are then the limits."""
    if not floor.given or above(floor, A, E):
        return Ends(limits.low, limits.high)
    # first, last: outermost cells up to which the floor is not above E; CELL_COUNT cells are a whole turn.
    first = last = _cell(A)
    while (last - first < CELL_COUNT and floor.highest[(first - 1) % CELL_COUNT] <= E
           and first * CELL_WIDTH_RAD > limits.low):
        first -= 1
    while (last - first < CELL_COUNT and floor.highest[(last + 1) % CELL_COUNT] <= E
           and (last + 1) * CELL_WIDTH_RAD < limits.high):
        last += 1
    if last - first >= CELL_COUNT:
        return Ends(limits.low, limits.high)
    return Ends(max(limits.low, first * CELL_WIDTH_RAD), min(limits.high, (last + 1) * CELL_WIDTH_RAD))


@compiled
def of_elevation(floor: Floor, limits: LimitsParameters, A: Radians, ahead: Radians, target: Radians) -> Ends:
    """Return the Ends of the elevation: above the floor on the whole way of the azimuth. A: azimuth now; ahead:
    azimuth at which the axis can stop; target: azimuth to which the axis goes."""
    if not floor.given:
        return Ends(limits.low, limits.high)
    top = max(highest(floor, A, ahead), highest(floor, A, target)) + FLOOR_CLEARANCE_RAD
    return Ends(max(limits.low, min(top, limits.high)), limits.high)


@compiled
def ends(constants: 'Constants', inputs: Inputs, azimuth: Radians) -> tuple[Ends, Ends]:
    """Return (Ends of the azimuth, Ends of the elevation) at present; azimuth: angle to which this axis goes."""
    a, e, A, dA = constants.axis[0].p.limits, constants.axis[1].p.limits, inputs.position[0], inputs.velocity[0]
    ahead = A + math.copysign(braking_distance(abs(dA), constants.axis[0].braking, constants.axis[0].reaction), dA)
    return of_azimuth(constants.floor, a, A, inputs.position[1]), of_elevation(constants.floor, e, A, ahead, azimuth)


@compiled
def by_hand(constants: 'Constants', inputs: Inputs, azimuth: Radians) -> tuple[Ends, Ends]:
    """Return (Ends of the azimuth, Ends of the elevation) of a point that an operator moves by hand. In contrast to
    `ends`, its azimuth goes on wherever the elevation can rise above the floor."""
    _, of_elevation_now = ends(constants, inputs, azimuth)
    azimuth_limits, highest_elevation = constants.axis[0].p.limits, constants.axis[1].p.limits.high
    return of_azimuth(constants.floor, azimuth_limits, inputs.position[0], highest_elevation), of_elevation_now
