"""Step track: the beam climbs to the peak of the level, for a receiver that measures no angle errors.

Once a cycle the beam stays one step d to either side of its place, first in cross-elevation, then in elevation, and
averages the level z there. The main lobe is a parabola in decibels, 12 (theta/b)^2, so that the peak is at

    theta0 = (z+ - z-) b^2 / (48 d)

from the place of the beam. theta: angle from the axis of the beam; z+, z-: levels on the two sides; b: beamwidth. The
beam moves there by one step at most, and stays if theta0 is within the deadband. For comparison: the antenna
controller GD 7200 has a step of 8 % of the beamwidth, a cycle of 2 min, and a deadband as large as the step.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled

STEP_TRACK_DTYPE = np.dtype([('place', 'f8', (2,)), ('began', 'f8'), ('phase', 'i8'), ('since', 'f8'),
                             ('sum', 'f8'), ('samples', 'i8'), ('plus', 'f8')], align=True)
"""place: offset of the beam between its steps [rad]; began: begin of the cycle [s]; phase: index in STEP_PHASES.
`since`: time at which the beam went to its place of the phase [s]; sum, samples: sum of the levels there [dB-Hz] and
their number; plus: the mean on the plus side."""

STEP_PHASES = ('cross-elevation plus', 'cross-elevation minus', 'elevation plus', 'elevation minus', 'rest')
REST_PHASE = len(STEP_PHASES) - 1
"""Phases of a cycle, in order: an even phase is the plus side, and two phases belong to each axis."""

STEP_SETTLING_LAGS = 5.0
"""Number of time constants after which a level is that of a new place."""


@compiled
def start(s, t, x, e):
    """Start at t [s] at an offset [rad], with an immediate cycle."""
    s.place[0], s.place[1] = x, e
    s.began = t
    _enter(s, 0, t)


@compiled
def _enter(s, phase, t):
    """Begin a phase at t [s]."""
    s.phase, s.since, s.sum, s.samples = phase, t, 0.0, 0


@compiled
def peak(z_plus, z_minus, step, beamwidth):
    """Return theta0 [rad], the place of the peak, from the levels one step [rad] to either side [dB]."""
    return (z_plus - z_minus) * beamwidth * beamwidth / (48.0 * step)


@compiled
def step(s, p, beamwidth, tau, t, z, present):
    """Return the offset (x, e) of the beam [rad] at t [s].

    z: level measured since the last step, NaN for none; present: whether there is a signal. p: record of
    StepTrackParameters; tau: time constant of the level [s].
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
