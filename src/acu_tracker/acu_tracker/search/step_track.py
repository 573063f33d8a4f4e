"""The law of the mode steptrack: the beam follows the peak of the signal level, without angle errors of the receiver.

Once a cycle the beam goes one step d to either side of its place, first in cross-elevation, then in elevation. On each
side the level z is averaged. In decibels the main lobe is a parabola, which is 12 (theta/b)^2 below its peak at the
angle theta. Therefore the peak is at a distance theta0 from the place of the beam:

    theta0 = (z+ - z-) b^2 / (48 d)

The place moves towards the peak, by one step at most. If theta0 is within the deadband, the place does not move. For
comparison: the antenna controller GD 7200 has a step of 8 % of the beamwidth, a cycle of 2 min, and a deadband as
large as the step.
"""
import dataclasses
import math

from pedestal_common.compiled import compiled
from pedestal_common.parameters import Parameters, parameter
from pedestal_common.quantities import Bit, DecibelHertz, Pair, Radians, Seconds
from pedestal_common.record import Record


@dataclasses.dataclass(frozen=True)
class StepTrackParameters(Parameters):
    """Mode steptrack: the step of the GD 7200, a shorter cycle for faster targets, a smaller deadband."""

    cycle: float = parameter(20.0, 1.0, 3600.0, 's', 'period of the climbs; 120 s in the GD 7200')
    step: float = parameter(0.08, 0.01, 0.3, 'beamwidths', 'step of the beam to either side')
    deadband: float = parameter(0.02, 0.0, 0.3, 'beamwidths', 'distance of the peak up to which the beam stays')
    dwell: float = parameter(1.0, 0.01, 60.0, 's', 'averaging time of the level at each place')


class StepTrack(Record):
    """State of step track."""
    place: Pair     # offset of the beam between its steps: cross-elevation, elevation [rad]
    began: Seconds  # begin of the cycle
    phase: int      # index into STEP_PHASES
    since: Seconds  # begin of this phase
    sum: float      # of the levels in this phase [dB-Hz]
    samples: int    # number of these levels
    plus: DecibelHertz  # mean level on the plus side


STEP_PHASES = ('cross-elevation plus', 'cross-elevation minus', 'elevation plus', 'elevation minus', 'rest')
REST_PHASE = len(STEP_PHASES) - 1
"""Phases of a cycle, in their order. An even index is the plus side; two phases belong to each axis."""

STEP_SETTLING_LAGS = 5.0  # number of time constants of the level after which it is that of a new place


@compiled
def start(state: StepTrack, t: Seconds, x: Radians, e: Radians) -> None:
    """Start at t at an offset x, e (cross-elevation, elevation); a cycle begins at once."""
    state.place[0], state.place[1] = x, e
    state.began = t
    _enter(state, 0, t)


@compiled
def _enter(state: StepTrack, phase: int, t: Seconds) -> None:
    state.phase, state.since, state.sum, state.samples = phase, t, 0.0, 0


@compiled
def peak(z_plus: DecibelHertz, z_minus: DecibelHertz, step: Radians, beamwidth: Radians) -> Radians:
    """Return theta0; z_plus, z_minus: levels one step to either side."""
    return (z_plus - z_minus) * beamwidth * beamwidth / (48.0 * step)


@compiled
def step(state: StepTrack, params: StepTrackParameters, beamwidth: Radians, tau: Seconds, t: Seconds, z: DecibelHertz,
         present: Bit) -> tuple[Radians, Radians]:
    """Advance to t and return the offset (cross-elevation, elevation) of the beam; tau: time constant of the level; z:
    level since the last step, NaN without one; present: there is a signal."""
    d = params.step * beamwidth
    if not present or (state.phase == REST_PHASE and t - state.began < params.cycle):
        if not present:
            _enter(state, REST_PHASE, t)
        return state.place[0], state.place[1]
    if state.phase == REST_PHASE:
        state.began = t
        _enter(state, 0, t)
    settled = STEP_SETTLING_LAGS * tau
    if not math.isnan(z) and t - state.since > settled:
        state.sum += z
        state.samples += 1
    if t - state.since >= settled + params.dwell and state.samples > 0:
        mean, axis = state.sum / state.samples, state.phase // 2
        if state.phase % 2 == 0:
            state.plus = mean
        else:
            move = peak(state.plus, mean, d, beamwidth)
            if abs(move) > params.deadband * beamwidth:
                state.place[axis] += min(max(move, -d), d)
        _enter(state, state.phase + 1, t)
    x, e = state.place[0], state.place[1]
    if state.phase == REST_PHASE:
        return x, e
    aside = d if state.phase % 2 == 0 else -d
    return (x + aside, e) if state.phase < 2 else (x, e + aside)
