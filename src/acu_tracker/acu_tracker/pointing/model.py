"""The pointing model in force: it converts directions to the angles of the encoders, and back.

A direction is a pair of deck angles on the sky. The encoders of a real pedestal show other angles, which
pedestal_common.geometry.pointing_model computes. The receiver's errors are added to the direction of the beam, and
the reference of the axes is computed from a direction. In autotrack both conversions cancel each other: where the beam
points then depends on the receiver alone. Hence no hand-over between modes causes a jump.

A new model takes effect gradually: the terms go from the old to the new values along a smooth curve. This avoids a
jump of the antenna.

s      record of PointingRecord
m      its field `model`, a record of pointing_model.PointingModel.dtype
"""
import math
from typing import Annotated

import numpy as np

from acu_tracker.geometry.encoders import Pointing
from acu_tracker.geometry.motion import AxisMotion, Motion, line_of_sight, north_west_up
from pedestal_common.compiled import compiled
from pedestal_common.geometry import pointing_model
from pedestal_common.geometry.pointing_model import FACTORS, TERMS
from pedestal_common.graph import topics
from pedestal_common.quantities import Floats
from pedestal_common.record import Record


class PointingRecord(Record):
    """State of the pointing model."""
    model: pointing_model.PointingModel  # the model in force
    # before, after: terms at the begin and at the end of the last change [rad, -]
    before: Annotated[Floats, (len(TERMS),)]
    after: Annotated[Floats, (len(TERMS),)]
    begins: float  # begins, ends: begin and end of this change [s]
    ends: float
    changing: int  # 1 while the terms change
    # number of the report on acu/pointing: 0 of the model at the start, 2 n - 1 and 2 n of the begin and of the end of
    # the n-th change; topics.NO_TEXT_CODE without a model at the start
    report: int


MAX_CHANGE_RATE_RAD_S = math.radians(0.1)
"""Largest rate at which a new model moves the encoder angles [rad/s], near the zenith in cross-elevation."""

MIN_CHANGE_TIME_S = 1.0  # least time in which a new model takes effect [s]
SMOOTHSTEP_PEAK = 1.5  # largest slope of the curve of put_between [-]


def initialise(s, terms, named):
    """Begin with the terms (20,) [rad, -].

    named: True if the model has an antenna, a file or a date. Such a model is reported although all terms may be 0.
    """
    pointing_model.put(s['model'], terms)
    s['changing'], s['report'] = 0, 0 if named or np.any(terms) else topics.NO_TEXT_CODE


def replace(s, terms, stamp):
    """Begin the change to other terms (20,) at a stamp [s]; return the time until it is complete [s].

    s: view of PointingRecord. The time follows from MAX_CHANGE_RATE_RAD_S and the sum of the changes of all terms, as
    if all terms pulled in the same direction.
    """
    now = s['model']['terms'].copy()
    reach = np.array([math.pi if name in FACTORS else 1.0 for name in TERMS])
    duration = max(SMOOTHSTEP_PEAK * float(np.abs(terms - now) @ reach) / MAX_CHANGE_RATE_RAD_S, MIN_CHANGE_TIME_S)
    s['report'] = max(s['report'], 0) + (2 if s['changing'] else 1)
    s['before'], s['after'], s['begins'], s['ends'], s['changing'] = now, terms, stamp, stamp + duration, 1
    return duration


@compiled
def step(s, t):
    """Advance the change of the model to t [s]."""
    if not s.changing:
        return
    x = min(max((t - s.begins) / (s.ends - s.begins), 0.0), 1.0)
    pointing_model.put_between(s.model, s.before, s.after, x)
    if x == 1.0:
        s.changing = 0
        s.report += 1


@compiled
def to_sky(m, at):
    """Return the Pointing of the beam on the sky; at: the Pointing of the encoders."""
    if m.exact:
        return at
    angles, rates = pointing_model.direction_motion(m, at.A, at.E, at.dA, at.dE)
    return Pointing(angles[0], angles[1], rates[0], rates[1])


@compiled
def to_encoders(m, motion):
    """Return (the Motion of the encoders that keeps the beam on a direction, True if the beam reaches the direction).

    motion: Motion of the direction in deck angles. The azimuth of the encoder is the one nearest to its azimuth.
    """
    if m.exact:
        return motion, True
    sight = line_of_sight(motion)
    u, v, w = north_west_up(sight.u), north_west_up(sight.du), north_west_up(sight.ddu)
    A, E, reachable = pointing_model.encoder_motion(m, (u.x, u.y, u.z), (v.x, v.y, v.z), (w.x, w.y, w.z),
                                                    math.cos(motion.elevation.angle) < 0.0, motion.azimuth.angle)
    return Motion(AxisMotion(A[0], A[1], A[2]), AxisMotion(E[0], E[1], E[2])), reachable


@compiled
def in_turn(m, motion, azimuth, wrapped):
    """Return the angle of the azimuth encoder [rad] in the turn of the azimuth wrap.

    motion: Motion of the direction in deck angles; azimuth: angle of its encoder, in any turn [rad]; wrapped: the same
    angle plus the whole turns of the azimuth wrap [rad]. Only the factor P12 makes a difference between the turns.
    """
    if m.p.p12 == 0.0 or wrapped == azimuth:
        return wrapped
    A, _, _ = pointing_model.encoder_of(m, motion.azimuth.angle + (wrapped - azimuth), motion.elevation.angle)
    return A
