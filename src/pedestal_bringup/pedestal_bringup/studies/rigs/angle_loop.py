"""The angle loop of a phased array on one axis, on a grid of 1 ms: paper 002's loop and the one that is better.

Each is one compiled kernel of the laws the nodes run: the receiver's smoothing and pattern, the loop of the beam or a
target filter, the electronic beam. Sample i of the grid is what the receiver measures over the millisecond that ends
at its stamp i GRID, off the beam that stood in it; a target is given at the middles of these milliseconds. A command
stamped i GRID is in force from the millisecond after i GRID + delay on.
"""
import dataclasses
import math

import numpy as np

from acu_tracker.estimation import alpha_beta, axis_filter
from acu_tracker.estimation.measurement import AxisMeasurement
from acu_tracker.estimation.params import CaParameters, FilterParameters
from acu_tracker.geometry import attitude as attitudes
from acu_tracker.servo import beam_loop
from adu_drive import electronic_beam
from pedestal_common.compiled import compiled
from tracking_receiver_sim import monopulse, smoothing
from tracking_receiver_sim.params import AntennaParameters, ReceiverParameters

GRID = 1e-3
GRID_NS = round(GRID * 1e9)

SMOOTHINGS = {'S0': smoothing.NO_SMOOTHING, 'S1': smoothing.RECURSION, 'S2': smoothing.MOVING_AVERAGE}
"""S0: the last sample, S1: paper 002's eq. (1), S2: the moving average it is called."""

LENGTH = 20
"""n of the smoothing in samples: the paper's example."""

FULL_SCALE, K_M = ReceiverParameters().full_scale, AntennaParameters().slope

SMOOTHERS = np.dtype([('error', smoothing.SMOOTHER)], align=True)


@dataclasses.dataclass(frozen=True)
class Paper:
    """Paper 002's loop. period, delay in samples of the grid; slope: true over assumed; beamwidth [rad]: of a receiver
    with a monopulse pattern, 0: linear for ever; lost: power over that on axis below which there is no error."""
    alpha: float = 0.1
    period: int = 10
    delay: int = 0
    smoothing: str = 'S1'
    form: str = 'type_1'
    delta: float = 0.0
    slope: float = 1.0
    beamwidth: float = 0.0
    lost: float = 0.0

    def run(self, target, rate=None, noise=None):
        """(beam (n,), error as the loop had it (n,)) [rad] of a target (n,) [rad] that the carrier's motion alone
        moves at `rate` (n,) [rad/s]; noise (n,) [rad] of the samples."""
        nothing = np.zeros(len(target))
        beam, seen = np.zeros(len(target)), np.zeros(len(target))
        _paper(beam_loop.FORMS.index(self.form), self.alpha, self.period, self.delta, self.slope, self.beamwidth,
               self.lost, SMOOTHINGS[self.smoothing], np.asarray(target), nothing if rate is None else rate,
               nothing if noise is None else noise, np.zeros(1, SMOOTHERS), *_beam(self.delay, self.period), beam,
               seen)
        return beam, seen


@dataclasses.dataclass(frozen=True)
class Better:
    """Beam in force + error into a target filter; the beam is its prediction for the middle of its interval.

    period: block of samples that is one measurement; hold: samples a command stands; delay: true, known: believed
    (None: true), all in samples. jerk: noise of the constant-acceleration filter [rad/s3/sqrt(Hz)]; sigma: of one
    sample [rad]. ins: the filter works in the earth frame; late: error of the INS's stamps in samples; tau: low-pass
    of its acceleration [s], none: without the acceleration.
    """
    jerk: float
    sigma: float
    period: int = 10
    hold: int = 1
    delay: int = 20
    known: int | None = None
    ins: bool = False
    late: int = 0
    tau: float = 0.05

    def run(self, target, noise=None, attitude=None, rate=None):
        """(beam, error as the filter had it (n,)) [rad] of a target (n,) [rad]; attitude, rate (n,) [rad, rad/s]: how
        the carrier turns the target away from where the earth has it, as the INS knows it, on the same instants."""
        n = len(target)
        nothing, beam, seen = np.zeros(n), np.zeros(n), np.zeros(n)
        late = np.maximum(np.arange(n) - self.late, 0)
        constants = axis_filter.constants(FilterParameters(kind='ca', ca=CaParameters(noise=self.jerk)))
        _better(constants, self.sigma**2 / self.period, self.period, self.hold,
                GRID * (self.delay if self.known is None else self.known), self.tau, np.asarray(target),
                nothing if noise is None else noise, attitude[late] if self.ins else nothing,
                rate[late] if self.ins else nothing, np.zeros(1, SMOOTHERS), np.zeros(1, axis_filter.FILTER),
                *_beam(self.delay, self.hold), beam, seen)
        return beam, seen


def _beam(delay, hold):
    """State, constants, inputs, outputs of a beam that has no elevation."""
    return (electronic_beam.initial_state(0.0, 0.0),
            electronic_beam.constants(GRID, delay * GRID, 2 * hold * GRID), np.zeros(1, electronic_beam.INPUTS),
            np.zeros(1, electronic_beam.OUTPUTS))


@compiled
def received(off, slope, beamwidth, lost):
    """What the receiver makes of a target `off` the beam [rad]: linear without a beamwidth, else as its pattern and
    full scale have it; NaN where the signal is lost."""
    if beamwidth == 0.0:
        return slope * off
    S, D, _ = monopulse.channels(off / beamwidth, 0.0, slope * K_M, 1.0, 0.0)
    if S * S < lost:
        return math.nan
    return beamwidth * max(-FULL_SCALE, min(D / (K_M * S), FULL_SCALE))


@compiled
def command(u, stamp, due, beam):
    """Put a command into the inputs of the electronic beam."""
    u.stamp_ns = u.command_stamp_ns = stamp * GRID_NS
    u.due = 1 if due else 0
    u.position[0] = beam


@compiled
def _paper(form, alpha, period, delta, slope, beamwidth, lost, kind, target, rate, noise, smoothers, state, constants,
           inputs, outputs, beam, seen):
    s, beta, T = smoothers[0].error, alpha_beta.benedict_bordner(alpha), period * GRID
    R = v = error = 0.0
    for i in range(len(target)):
        beam[i] = outputs[0].position[0]
        sample = received(target[i] - beam[i], slope, beamwidth, lost) + noise[i]
        if not math.isnan(sample):
            smoothing.begin(s)
            smoothing.put(s, sample, 1.0 / LENGTH)
        if i % period == 0:
            error = math.nan if math.isnan(sample) else smoothing.smoothed(s, kind, 1, LENGTH)
            R, v = beam_loop.step(form, R, v, error, alpha, beta, T, delta * rate[i])
        seen[i] = error
        command(inputs[0], i, i % period == 0, R)
        electronic_beam.step(state[0], constants[0], inputs[0], outputs[0])


@compiled
def _better(constants_of_filter, variance, period, hold, delay, tau, target, noise, attitude, rate, smoothers, filters,
            state, constants, inputs, outputs, beam, seen):
    s, f, c = smoothers[0].error, filters[0], constants_of_filter[0]
    running, aimed, acceleration = False, 0.0, 0.0
    for i in range(len(target)):
        beam[i] = outputs[0].position[0]
        if i % period == 0:
            smoothing.begin(s)
        # The carrier turns the target by the attitude: what is left is where the earth has it.
        smoothing.put(s, beam[i] + (target[i] - beam[i] + noise[i]) - attitude[i], 0.0)
        if i > 0 and tau > 0.0:
            acceleration = attitudes.smoothed_acceleration(acceleration, rate[i], rate[i - 1], GRID, tau)
        if (i + 1) % period == 0:
            y = smoothing.smoothed(s, smoothing.NO_SMOOTHING, period, period)
            if running:
                m = AxisMeasurement(y, variance, math.nan, 0.0)
                axis_filter.predict(f, c, period * GRID)
                seen[i] = axis_filter.innovation(f, m).nu
                axis_filter.correct(f, c, m)
            else:
                axis_filter.start(f, c, y, variance, 1.0)
            running = True
            block = i
        if running and i % hold == 0:
            ahead = delay + 0.5 * hold * GRID                  # from the stamp to the middle of the interval in force
            earth = axis_filter.outlook(f, c, (i - block + 0.5 * period) * GRID + ahead).angle
            aimed = earth + attitude[i] + attitudes.rotation_angle(rate[i], acceleration, 0.5 * GRID + ahead)
        command(inputs[0], i, running and i % hold == 0, aimed)
        electronic_beam.step(state[0], constants[0], inputs[0], outputs[0])


def stable(loop, size=1e-9, seconds=20.0):
    """Whether the paper's loop comes to rest after a step [rad]: its error keeps falling."""
    n = round(seconds / GRID)
    error = np.abs(size - loop.run(np.full(n, size))[0])
    middle, last = error[n // 3:2 * n // 3].max(), error[2 * n // 3:].max()
    return last <= middle < 1e3 * size


def delay_limit(loop, highest=400):
    """Largest delay in samples of the grid with which the paper's loop is stable, by bisection."""
    low, high = 0, highest
    while high - low > 1:
        middle = (low + high) // 2
        if stable(dataclasses.replace(loop, delay=middle)):
            low = middle
        else:
            high = middle
    return low


def spectral_radius(loop):
    """Largest modulus of the eigenvalues of the paper's linear loop over one period.

    State: v T, the smoothing's output, the commands k, k - 1, ... : those that the samples of the next period (and of
    the moving average before it) can meet. Sample j = 1 ... period after the update k meets the command
    k + floor((j - 1 - delay) / period).
    """
    M, beta, n = loop.period, alpha_beta.benedict_bordner(loop.alpha), LENGTH
    first = {'S0': M, 'S1': 1, 'S2': M - n + 1}[loop.smoothing]
    ages = [-((j - 1 - loop.delay) // M) for j in range(first, M + 1)]
    V, E, C = 0, 1, 2
    size = C + max(ages) + 1
    e = np.zeros(size)
    if loop.smoothing == 'S1':
        e[E] = 1.0
        for age in ages:
            e *= 1.0 - 1.0 / n
            e[C + age] -= loop.slope / n
    else:
        for age in ages:
            e[C + age] -= loop.slope / len(ages)
    A = np.zeros((size, size))
    A[E] = e
    if loop.form == 'type_1':
        A[V, V] = 1.0 - beta
        A[C, V] = 1.0 - loop.alpha
    else:
        A[V, V] = A[C, V] = 1.0
    A[V] += beta * e
    A[C] += (loop.alpha if loop.form == 'type_1' else loop.alpha + beta) * e
    A[C, C] += 1.0
    for k in range(C + 1, size):
        A[k, k - 1] = 1.0
    return float(np.abs(np.linalg.eigvals(A)).max())
