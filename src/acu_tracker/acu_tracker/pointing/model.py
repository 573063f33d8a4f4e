"""The pointing model in force: it converts directions to the angles of the encoders, and back.

A direction is a pair of deck angles on the sky. The encoders of a real pedestal show other angles, which
pedestal_common.geometry.pointing_model computes. The receiver's errors are added to the direction of the beam, and the
reference of the axes is computed from a direction. In autotrack both conversions cancel each other: where the beam
points then depends on the receiver alone. Hence no hand-over between modes causes a jump. A new model takes effect
gradually, because this avoids a jump of the antenna.
"""
import math
from typing import Annotated

import numpy as np

from acu_tracker.geometry.history import Pointing
from acu_tracker.geometry.vector import AxisMotion, Motion, line_of_sight, north_west_up
from pedestal_common.compiled import compiled
from pedestal_common.geometry import pointing_model
from pedestal_common.geometry.pointing_model import FACTORS, TERMS, PointingModel
from pedestal_common.graph import topics
from pedestal_common.quantities import Bit, Floats, Radians, Seconds
from pedestal_common.record import Record


class PointingRecord(Record):
    """State of the pointing model."""
    model: pointing_model.PointingModel     # the model in force
    before: Annotated[Floats, (len(TERMS),)]    # terms at the begin of the last change [rad, -]
    after: Annotated[Floats, (len(TERMS),)]     # terms at its end [rad, -]
    begins: Seconds     # begin of this change
    ends: Seconds       # its end
    changing: Bit       # 1 while the terms change
    # number of the report on acu/pointing: 0 of the model at the start, 2 n - 1 and 2 n of the begin and of the end of
    # the n-th change; topics.NO_TEXT_CODE without a model at the start
    report: int


MAX_CHANGE_RATE_RAD_S = math.radians(0.1)
"""Largest rate at which a new model moves the encoder angles [rad/s], near the zenith in cross-elevation."""

MIN_CHANGE_TIME_S = 1.0  # least time in which a new model takes effect [s]
SMOOTHSTEP_PEAK = 1.5  # largest slope of the curve of put_between [-]


def initialise(record: np.void, terms: Floats, named: bool) -> None:
    """Begin with the terms (20,) [rad, -]. A `named` model is reported although all terms may be 0."""
    pointing_model.put(record['model'], terms)
    record['changing'], record['report'] = 0, 0 if named or np.any(terms) else topics.NO_TEXT_CODE


def replace(record: np.void, terms: Floats, stamp: Seconds) -> Seconds:
    """Begin the change to other terms (20,) at a stamp; return the time until it is complete. The time follows from
    MAX_CHANGE_RATE_RAD_S and the sum of the changes of all terms, as if all terms pulled in the same direction."""
    now = record['model']['terms'].copy()
    reach = np.array([math.pi if name in FACTORS else 1.0 for name in TERMS])
    duration = max(SMOOTHSTEP_PEAK * float(np.abs(terms - now) @ reach) / MAX_CHANGE_RATE_RAD_S, MIN_CHANGE_TIME_S)
    record['report'] = max(record['report'], 0) + (2 if record['changing'] else 1)
    record['before'], record['after'], record['changing'] = now, terms, 1
    record['begins'], record['ends'] = stamp, stamp + duration
    return duration


@compiled
def step(pointing: PointingRecord, t: Seconds) -> None:
    """Advance the change of the model to t."""
    if not pointing.changing:
        return
    x = min(max((t - pointing.begins) / (pointing.ends - pointing.begins), 0.0), 1.0)
    pointing_model.put_between(pointing.model, pointing.before, pointing.after, x)
    if x == 1.0:
        pointing.changing = 0
        pointing.report += 1


@compiled
def to_sky(model: PointingModel, at: Pointing) -> Pointing:
    """Return the direction of the beam on the sky of that of the encoders."""
    if model.exact:
        return at
    angles, rates = pointing_model.direction_motion(model, at.A, at.E, at.dA, at.dE)
    return Pointing(angles[0], angles[1], rates[0], rates[1])


@compiled
def to_encoders(model: PointingModel, motion: Motion) -> tuple[Motion, bool]:
    """Return (the Motion of the encoders that keeps the beam on a direction in deck angles, True if the beam reaches
    it). The azimuth of the encoder is the one nearest to that of the direction."""
    if model.exact:
        return motion, True
    sight = line_of_sight(motion)
    u, v, w = north_west_up(sight.u), north_west_up(sight.du), north_west_up(sight.ddu)
    A, E, reachable = pointing_model.encoder_motion(model, (u.x, u.y, u.z), (v.x, v.y, v.z), (w.x, w.y, w.z),
                                                    math.cos(motion.elevation.angle) < 0.0, motion.azimuth.angle)
    return Motion(AxisMotion(A[0], A[1], A[2]), AxisMotion(E[0], E[1], E[2])), reachable


@compiled
def in_turn(model: PointingModel, motion: Motion, azimuth: Radians, wrapped: Radians) -> Radians:
    """Return the angle of the azimuth encoder in the turn of the azimuth wrap. azimuth: angle of the encoder, in any
    turn; wrapped: the same angle plus the whole turns of the azimuth wrap. Only the factor P12 makes a difference
    between the turns."""
    if model.p.p12 == 0.0 or wrapped == azimuth:
        return wrapped
    A, _, _ = pointing_model.encoder_of(model, motion.azimuth.angle + (wrapped - azimuth), motion.elevation.angle)
    return A
