"""Wrong slope of the receiver, against the program of a target that keeps to it: sums of likelihood ratios.

The direction of a satellite less that of its program is a slow line, plus the lateness times the rate of the program.
Where the beam should be is then known so well that its small motion about this place shows the slope.

    d       direction of the target less that of the program = c + r t + tau p', p': rate of the program
    a, b    innovations of beam less program, and of the error, divided by their standard deviation. One Kalman filter
            for lines has the gains of all components. The innovations q of p' in the same filter give the estimate of
            tau, and tau q is subtracted (Friedland, Treatment of bias in recursive filtering, IEEE Transactions on
            Automatic Control 14 (1969) 359). Components are across the beam, as complex numbers a_x + i a_e
    W       turn of the errors that undoes the wrong slope; 1: right slope, -1: phase turned by 180 deg

A block adds to the logarithm of the likelihood ratio of a wrong and the right slope

    (|a + b|^2 - |a + W b|^2) / 2 = Re (1 - W) b a*,    for a reversed sign 2 a_x b_x or 2 a_e b_e

Page's sum S of these steps never falls below 0 (Page, Continuous inspection schemes, Biometrika 41 (1954) 100). Under
the right slope S exceeds its limit once in exp(limit) blocks or less often (Lorden, Annals of Mathematical Statistics
42 (1971) 1897), whatever the beam does. From S are subtracted:

    - CAUTION times the step of an error that repeats the motion of the beam, because errors of the attitude move a
      alone
    - MISFIT_WEIGHT X, where X sums |a + W b|^2 of smoothed innovations, less that of the noise. A receiver whose
      offset jumps has such a misfit before the beam follows

A target that leaves its program while the beam follows with the delay of its filter may look like a wrong slope
(docs/develop/decisions.md states how often). Therefore only a target with `keeps_program` is tested. Gusts swing the
dish of a flexible structure, which no encoder shows. Therefore only a rigid antenna makes this test.
"""
import math
from typing import Annotated

from acu_tracker.estimation import monitors
from acu_tracker.geometry.vector import LineOfSight, Vector, dot, line_of_sight
from acu_tracker.modes import Reason
from acu_tracker.program import program_track
from acu_tracker.program.program_track import ProgramTrack
from pedestal_common.compiled import compiled
from pedestal_common.geometry.interval import interval
from pedestal_common.quantities import Floats, Radians2, Seconds, Vector3
from pedestal_common.record import Record

_TURNS = tuple((math.cos(math.radians(beta)), math.sin(math.radians(beta)))
               for beta in (90.0, 135.0, 180.0, 225.0, 270.0))     # real and imaginary part of W
HYPOTHESIS_COUNT = 2 + len(_TURNS)  # reversed sign of cross-elevation, of elevation, then turns


class SlopeRatio(Record):
    """State of the test."""
    stamp: Seconds      # of the last block
    n: int              # number of blocks in the lines
    beam: Vector3       # beam less program of the last block, ENU
    line: Annotated[Floats, (9, 2)]     # value and rate of beam less program, error, rate of the program, ENU
    covariance: Vector3     # of a line: of its value, of value and rate, of its rate
    lateness: Vector3       # sums of q q, a q and b q: the lateness of the beam is a q / (q q + prior)
    smoothed: Annotated[Floats, (4,)]   # a_x, a_e, b_x, b_e
    right: float        # mean of |a + b|^2 / 2: 1 if the right slope explains the errors [-]
    hold: int           # number of blocks until the sums may grow
    S: Annotated[Floats, (HYPOTHESIS_COUNT,)]   # sum of each hypothesis [-]
    X: Annotated[Floats, (HYPOTHESIS_COUNT,)]   # its misfit [-]


BEND = math.radians(2e-4)**2
"""Power density of the acceleration between target and program that is no lateness [rad2/s3]: errors of elements,
mount, refraction. With noise of 0.03 deg the memory of a line is 10 s."""

LINE_RATE = 1e-3        # standard deviation of the rate of a new line [rad/s]
LATENESS_PRIOR = 0.25   # information about the lateness before the first block [1/s2]: 2 s
MIN_BLOCK_COUNT = 250   # number of blocks before the sums grow: 5 s
MAX_ACCELERATION = math.radians(0.1)    # largest acceleration of a program in use: the lowest orbit [rad/s2]
MAX_ROW_TRAVEL = math.radians(2.0)      # largest travel between two rows: the interpolation bends [rad]
MAX_JUMP = 0.7          # largest travel of beam less program from block to block, over the noise of a block [-]
RIGHT_BLOCK_COUNT, MAX_RIGHT = 250, 1.2     # number of blocks in the mean `right`; its limit [-]
MAX_RIGHT_X = 12.0      # largest contribution of a block to this mean [-]
HOLD_BLOCK_COUNT = 500  # number of blocks for which the sums stay 0 after the target has left its program
SMOOTHING_BLOCK_COUNT = 4   # number of blocks in the smoothed innovations
SMOOTHED_VARIANCE = 1.0 / (2.0 * SMOOTHING_BLOCK_COUNT - 1.0)   # variance of a smoothed innovation of variance 1 [-]
CAUTION, MISFIT_WEIGHT = 0.1, 2.0   # shares of what is subtracted [-]
MAX_STEP = 4.0          # largest step of a block [-]; this avoids an alarm after a few errors with interference
MAX_S = 14.0
"""Largest sum of a right slope [-]. `pedestal study wrong-slope` states the largest one of its targets."""


@compiled
def restart(state: SlopeRatio) -> None:
    """Clear the memory."""
    state.n = 0


@compiled
def _usable(program: ProgramTrack, t: Seconds, sight: LineOfSight) -> bool:
    """Return True if a program moves as a satellite does at t, and has enough rows; sight: its motion."""
    i = interval(program.times, t)
    travel = math.sqrt(dot(sight.du, sight.du)) * (program.times[i + 1] - program.times[i])
    return travel < MAX_ROW_TRAVEL and dot(sight.ddu, sight.ddu) < MAX_ACCELERATION**2


@compiled
def _begin(state: SlopeRatio, y: tuple[Vector, Vector, Vector], sigma2: Radians2) -> None:
    """Begin the lines at y, and the sums at 0."""
    for k in range(3):
        for i in range(3):
            state.line[3 * k + i, 0], state.line[3 * k + i, 1] = y[k][i], 0.0
    state.covariance[0], state.covariance[1], state.covariance[2] = sigma2, 0.0, LINE_RATE * LINE_RATE
    state.lateness[:] = 0.0
    state.smoothed[:] = 0.0
    state.right, state.hold = 1.0, 0
    state.S[:] = 0.0
    state.X[:] = 0.0


@compiled
def _gains(state: SlopeRatio, T: Seconds, sigma2: Radians2, walk: float) -> tuple[float, float, float]:
    """Return (gain of a value, gain of a rate, standard deviation of an innovation) of all lines, T after the last
    block."""
    P = state.covariance
    P[0] += T * (2.0 * P[1] + T * P[2] + BEND * T * T / 3.0 + walk)
    P[1] += T * (P[2] + 0.5 * BEND * T)
    P[2] += BEND * T
    variance = P[0] + sigma2
    value, rate = P[0] / variance, P[1] / variance
    P[2] -= rate * P[1]
    P[1] -= value * P[1]
    P[0] -= value * P[0]
    return value, rate, math.sqrt(variance)


@compiled
def _innovation(state: SlopeRatio, k: int, y: Vector, T: Seconds, gains: tuple[float, float, float]) -> Vector:
    """Update the lines of the vector k with y; return its innovation over its standard deviation."""
    value, rate, sigma = gains
    nu = (y.x - state.line[3 * k, 0] - T * state.line[3 * k, 1],
          y.y - state.line[3 * k + 1, 0] - T * state.line[3 * k + 1, 1],
          y.z - state.line[3 * k + 2, 0] - T * state.line[3 * k + 2, 1])
    for i in range(3):
        state.line[3 * k + i, 0] += T * state.line[3 * k + i, 1] + value * nu[i]
        state.line[3 * k + i, 1] += rate * nu[i]
    return Vector(nu[0] / sigma, nu[1] / sigma, nu[2] / sigma)


@compiled
def _innovations(state: SlopeRatio, y: tuple[Vector, Vector, Vector], T: Seconds, beam: monitors.Beam,
                 gains: tuple[float, float, float]) -> tuple[float, float, float, float]:
    """Return a_x, a_e, b_x, b_e of the vectors y, without the part that the lateness explains."""
    u, e, v = (_innovation(state, 0, y[0], T, gains), _innovation(state, 1, y[1], T, gains),
               _innovation(state, 2, y[2], T, gains))
    a_x, a_e, b_x, b_e = dot(u, beam.across), dot(u, beam.up), dot(e, beam.across), dot(e, beam.up)
    q_x, q_e = dot(v, beam.across), dot(v, beam.up)
    known = state.lateness[0] + LATENESS_PRIOR
    a_late, b_late = state.lateness[1] / known, state.lateness[2] / known
    state.lateness[0] += q_x * q_x + q_e * q_e
    state.lateness[1] += a_x * q_x + a_e * q_e
    state.lateness[2] += b_x * q_x + b_e * q_e
    return a_x - a_late * q_x, a_e - a_late * q_e, b_x - b_late * q_x, b_e - b_late * q_e


@compiled
def _add(state: SlopeRatio, h: int, step: float, misfit: float) -> float:
    """Add a block to the sums of hypothesis h; return S less its deductions."""
    state.S[h] += min(step, MAX_STEP)
    if state.S[h] <= 0.0:
        state.S[h] = state.X[h] = 0.0
        return 0.0
    state.X[h] += misfit
    return state.S[h] - MISFIT_WEIGHT * max(state.X[h], 0.0)


@compiled
def _largest(state: SlopeRatio, a_x: float, a_e: float, b_x: float, b_e: float) -> float:
    """Add innovations to all sums; return the largest sum less its deductions."""
    # A_x, A_e, B_x, B_e: smoothed innovations. b a* = c + i d.
    A_x, A_e, B_x, B_e = state.smoothed
    noise = SMOOTHED_VARIANCE
    largest = max(_add(state, 0, 2.0 * a_x * (b_x - CAUTION * a_x), (A_x - B_x)**2 - noise),
                  _add(state, 1, 2.0 * a_e * (b_e - CAUTION * a_e), (A_e - B_e)**2 - noise))
    power, c, d = a_x * a_x + a_e * a_e, a_x * b_x + a_e * b_e, a_x * b_e - a_e * b_x
    for h in range(HYPOTHESIS_COUNT - 2):
        cosine, sine = _TURNS[h]
        step = c - cosine * c + sine * d - CAUTION * (1.0 - cosine) * power
        misfit = (A_x + cosine * B_x - sine * B_e)**2 + (A_e + sine * B_x + cosine * B_e)**2 - 2.0 * noise
        largest = max(largest, _add(state, 2 + h, step, misfit))
    return largest


@compiled
def _take_innovations(state: SlopeRatio, a_x: float, a_e: float, b_x: float, b_e: float) -> float:
    """Take the innovations of a block; return the largest sum less its deductions, 0 while the sums may not grow."""
    smoothed, part = state.smoothed, 1.0 / SMOOTHING_BLOCK_COUNT
    smoothed[0] += part * (a_x - smoothed[0])
    smoothed[1] += part * (a_e - smoothed[1])
    smoothed[2] += part * (b_x - smoothed[2])
    smoothed[3] += part * (b_e - smoothed[3])
    right = 0.5 * ((a_x + b_x)**2 + (a_e + b_e)**2)
    state.right += (min(right, MAX_RIGHT_X) - state.right) / RIGHT_BLOCK_COUNT
    state.hold = HOLD_BLOCK_COUNT if state.right > MAX_RIGHT else max(0, state.hold - 1)
    if state.n < MIN_BLOCK_COUNT or state.hold > 0:
        state.S[:] = 0.0
        state.X[:] = 0.0
        return 0.0
    return _largest(state, a_x, a_e, b_x, b_e)


@compiled
def take(state: SlopeRatio, blocks: monitors.WrongSlope, beam: monitors.Beam, program: ProgramTrack, walk: float,
         gap: Seconds) -> bool:
    """Take the last block of errors, which ends with the beam; return True if the slope is wrong. The test begins
    again after the time `gap` without blocks. walk: growth of the variance of the beam's measured direction by errors
    of the attitude [rad2/s]."""
    t = blocks.block_stamp
    T = t - state.stamp
    state.stamp = t
    if program_track.status(program, t) != Reason.NONE:
        restart(state)
        return False
    sight = line_of_sight(program_track.motion_at(program, t))
    u, e = monitors.means(blocks)
    sigma2 = monitors.mean_variance(blocks)
    d, last = Vector(u.x - sight.u.x, u.y - sight.u.y, u.z - sight.u.z), state.beam
    jump = Vector(d.x - last[0], d.y - last[1], d.z - last[2])
    state.beam[0], state.beam[1], state.beam[2] = d
    if not _usable(program, t, sight):
        restart(state)
        return False
    state.n += 1
    y = (d, e, sight.du)
    if T > gap or state.n == 1 or dot(jump, jump) > MAX_JUMP * MAX_JUMP * sigma2:
        state.n = 1
        _begin(state, y, sigma2)
        return False
    a_x, a_e, b_x, b_e = _innovations(state, y, T, beam, _gains(state, T, sigma2, walk))
    return _take_innovations(state, a_x, a_e, b_x, b_e) > MAX_S
