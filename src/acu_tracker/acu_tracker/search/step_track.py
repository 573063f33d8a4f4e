"""The law of the mode steptrack: the beam follows the peak of the signal level, without angle errors of the receiver.

Once a cycle the beam goes one step d to either side of its place, first in cross-elevation, then in elevation. On each
side the level is averaged. In decibels the main lobe is a parabola, which is 12 (theta/b)^2 below its peak. Therefore
the peak is at a distance theta0 from the place of the beam:

    theta0 = (z+ - z-) b^2 / (48 d)

    theta    angle from the axis of the beam [rad]
    z+, z-   mean levels on the two sides [dB-Hz]
    b, d     beamwidth and step [rad]

The place moves towards the peak, by one step at most. If theta0 is within the deadband, the place does not move. For
comparison: the antenna controller GD 7200 has a step of 8 % of the beamwidth, a cycle of 2 min, and a deadband as
large as the step.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Pair
from pedestal_common.record import Record


class StepTrack(Record):
    """State of step track."""
    place: Pair  # offset of the beam between its steps: cross-elevation, elevation [rad]
    began: float  # begin of the cycle [s]
    phase: int  # phase, since: index in STEP_PHASES, and begin of this phase [s]
    since: float
    sum: float  # sum, samples: sum [dB-Hz] and number of the levels in this phase
    samples: int
    plus: float  # mean level on the plus side [dB-Hz]


STEP_PHASES = ('cross-elevation plus', 'cross-elevation minus', 'elevation plus', 'elevation minus', 'rest')
REST_PHASE = len(STEP_PHASES) - 1
"""Phases of a cycle, in their order. An even index is the plus side; two phases belong to each axis."""

STEP_SETTLING_LAGS = 5.0  # number of time constants of the level after which it is that of a new place


@compiled
def start(s, t, x, e):
    """Start at t [s] at an offset x, e (cross-elevation, elevation) [rad]; a cycle begins at once."""
    s.place[0], s.place[1] = x, e
    s.began = t
    _enter(s, 0, t)


@compiled
def _enter(s, phase, t):
    """Begin a phase at t [s]."""
    s.phase, s.since, s.sum, s.samples = phase, t, 0.0, 0


@compiled
def peak(z_plus, z_minus, step, beamwidth):
    """Return theta0 [rad], the distance of the peak; z_plus, z_minus: levels one step [rad] to either side [dB-Hz]."""
    return (z_plus - z_minus) * beamwidth * beamwidth / (48.0 * step)


@compiled
def step(s, p, beamwidth, tau, t, z, present):
    """Advance to t [s] and return the offset (cross-elevation, elevation) of the beam [rad].

    p        record of StepTrackParameters
    tau      time constant of the level [s]
    z        level that was measured since the last step [dB-Hz]; NaN: none
    present  True if there is a signal
    """
    d = p.step * beamwidth
    if not present or (s.phase == REST_PHASE and t - s.began < p.cycle):
        if not present:
            _enter(s, REST_PHASE, t)
        return s.place[0], s.place[1]
    if s.phase == REST_PHASE:
        s.began = t
        _enter(s, 0, t)
    settled = STEP_SETTLING_LAGS * tau
    if not math.isnan(z) and t - s.since > settled:
        s.sum += z
        s.samples += 1
    if t - s.since >= settled + p.dwell and s.samples > 0:
        mean, axis = s.sum / s.samples, s.phase // 2
        if s.phase % 2 == 0:
            s.plus = mean
        else:
            move = peak(s.plus, mean, d, beamwidth)
            if abs(move) > p.deadband * beamwidth:
                s.place[axis] += min(max(move, -d), d)
        _enter(s, s.phase + 1, t)
    x, e = s.place[0], s.place[1]
    if s.phase == REST_PHASE:
        return x, e
    aside = d if s.phase % 2 == 0 else -d
    return (x + aside, e) if s.phase < 2 else (x, e + aside)
