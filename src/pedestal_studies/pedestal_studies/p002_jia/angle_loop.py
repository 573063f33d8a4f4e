"""The angle loop of a phased array on one axis, on a grid of 1 ms: Jia 2025's loop, and a loop with a target filter.

Each loop is one compiled function of the laws that the nodes run. Symbols of Jia 2025: R, v: angle [rad] and rate
[rad/s] that the loop predicts; T: time between two updates [s]; alpha, beta: gains from the error to R and to v T [-].
beta follows from alpha (Benedict and Bordner). The grid, with h = GRID_STEP_S:

    stamp    (i-1) h                 i h                 (i+1) h
                |------ sample i ------|---- sample i+1 ----|
                        target[i]           target[i+1]             (targets: middles of the intervals)

Sample i is measured over the interval that ends at its stamp i h, against the beam in force in this interval. A
command with the stamp i h is in force from the interval that begins at i h + delay on.
"""
import dataclasses
import math
from typing import NamedTuple

import numpy as np

from acu_tracker.estimation.filters import axis_filter, kalman
from acu_tracker.estimation.filters.measurement import AxisMeasurement
from acu_tracker.estimation.params import CaParameters, FilterParameters
from acu_tracker.geometry import attitude as attitudes
from acu_tracker.servo import controllers
from adu_drive.array import electronic_beam
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Radians, Radians2, Records, Seconds
from pedestal_common.record import Record
from receiver_law import monopulse, smoothing
from tracking_receiver_sim.params import AntennaParameters, ReceiverParameters

GRID_STEP_S = 1e-3  # step of the grid [s]
GRID_STEP_NS = round(GRID_STEP_S * 1e9)

SMOOTHING_CODES = {'S0': smoothing.SMOOTHING_NONE, 'S1': smoothing.SMOOTHING_RECURSION,
                   'S2': smoothing.SMOOTHING_MOVING_AVERAGE}
"""{smoothing of the receiver: its code}. S0: no smoothing, the last sample; S1: the recursion of Jia 2025, eq. (1);
S2: the moving average. The paper calls eq. (1) a moving average, so S1 and S2 are two readings of it."""

SMOOTHING_SAMPLES = 20  # number n of samples in the smoothing S1 and S2, as in the paper's example

FULL_SCALE_BEAMWIDTHS, K_M = ReceiverParameters().full_scale, AntennaParameters().slope


class Smoothers(Record):
    """Smoother of the receiver."""
    error: smoothing.Smoother


class Target(NamedTuple):
    """Target and carrier, such as a ship, on the grid."""
    angle: Floats       # true angle of the target [rad]
    attitude: Floats    # part of it that the attitude of the carrier causes, as the loop receives it [rad]
    rate: Floats        # rate of this part, as the loop receives it [rad/s]
    noise: Floats       # of the samples [rad]


class Beam(NamedTuple):
    """Records (1,) of adu_drive.array.electronic_beam, of which only the azimuth is used."""
    state: Records
    constants: Records
    inputs: Records
    outputs: Records


class Receiver(NamedTuple):
    """Constants of a receiver."""
    slope: float        # true slope divided by assumed slope [-]
    beamwidth: Radians  # 0 for a linear receiver
    lost_power_ratio: float     # least power of a received signal over the power on the axis of the beam [-]


class PaperLoopConstants(NamedTuple):
    """Constants of a PaperLoop."""
    form: int           # code of controllers.LOOP_FORMS
    alpha: float        # gain [-]
    period: int         # time between two updates, in samples
    delta: float        # share of the carrier's rate that is compensated [-]
    smoothing: int      # code of SMOOTHING_CODES


class FilterLoopConstants(NamedTuple):
    """Constants of a FilterLoop."""
    filter: Records     # axis_filter.Constants (1,)
    variance: Radians2  # of a measurement
    period: int         # as in FilterLoop, in samples
    hold: int           # as in FilterLoop, in samples
    delay: Seconds      # assumed delay of the beam
    tau: Seconds        # time constant of the low-pass for the acceleration


@dataclasses.dataclass(frozen=True)
class PaperLoop:
    """Loop of Jia 2025."""
    alpha: float = 0.1      # gain from the error to the angle [-]
    period: int = 10        # time between two updates of the loop, in samples of the grid
    delay: int = 0          # time from a command to its effect, in samples
    smoothing: str = 'S1'   # key of SMOOTHING_CODES
    form: str = 'type_1'    # one of controllers.LOOP_FORMS
    delta: float = 0.0      # share of the carrier's rate that is compensated [-]
    slope: float = 1.0      # as in Receiver, here and below
    beamwidth: Radians = 0.0
    lost_power_ratio: float = 0.0

    def run(self, target: Floats, rate: Floats | None = None, noise: Floats | None = None) -> tuple[Floats, Floats]:
        """Return (beam, smoothed error in the loop) [rad] of a target [rad].

        rate: rate of the target due to the carrier [rad/s]. noise: noise of the samples [rad]. None for zeros.
        """
        zeros, beam, errors = np.zeros(len(target)), np.zeros(len(target)), np.zeros(len(target))
        constants = PaperLoopConstants(controllers.LOOP_FORMS.index(self.form), self.alpha, self.period, self.delta,
                                       SMOOTHING_CODES[self.smoothing])
        _paper_loop(constants, Receiver(self.slope, self.beamwidth, self.lost_power_ratio),
                    Target(np.asarray(target), zeros, zeros if rate is None else rate,
                           zeros if noise is None else noise),
                    Smoothers.zeros(), _beam(self.delay, self.period), beam, errors)
        return beam, errors


@dataclasses.dataclass(frozen=True)
class FilterLoop:
    """Loop with a target filter, whose input is the beam in force + error of the receiver. The command is its
    prediction for the middle of the interval in which the command will be in force."""
    jerk: float         # noise of the constant-acceleration filter [rad/s3/sqrt(Hz)]
    sigma: Radians      # noise of one sample
    period: int = 10    # number of samples that are averaged to one measurement
    hold: int = 1       # time between two commands, in samples
    delay: int = 20     # true time from a command to its effect, in samples
    assumed_delay: int | None = None    # delay that the loop assumes, in samples; None: the true delay
    use_ins: bool = False   # True if the filter works in the earth frame, with the attitude of the INS
    stamp_error: int = 0    # error of the stamps of the INS, in samples
    tau: Seconds = 0.05     # time constant of the low-pass for the acceleration from the INS; 0: acceleration not used

    def run(self, target: Floats, noise: Floats | None = None, attitude: Floats | None = None,
            rate: Floats | None = None) -> tuple[Floats, Floats]:
        """Return (beam, innovation of the filter) [rad] of a target [rad]. noise: noise of the samples [rad].
        attitude, rate: rotation by the carrier as the INS measures it, needed with use_ins."""
        n = len(target)
        zeros, beam, errors = np.zeros(n), np.zeros(n), np.zeros(n)
        measured = np.maximum(np.arange(n) - self.stamp_error, 0)
        c = axis_filter.constants(FilterParameters(kind='ca', ca=CaParameters(noise=self.jerk)))
        if self.use_ins:
            assert attitude is not None and rate is not None
            attitude, rate = attitude[measured], rate[measured]
        else:
            attitude = rate = zeros
        delay = self.delay if self.assumed_delay is None else self.assumed_delay
        constants = FilterLoopConstants(c, self.sigma**2 / self.period, self.period, self.hold, GRID_STEP_S * delay,
                                        self.tau)
        _filter_loop(constants, Target(np.asarray(target), attitude, rate, zeros if noise is None else noise),
                     Smoothers.zeros(), axis_filter.Filter.zeros(), _beam(self.delay, self.hold),
                     beam, errors)
        return beam, errors


def _beam(delay: int, hold: int) -> Beam:
    return Beam(electronic_beam.initial_state(0.0, 0.0),
                electronic_beam.constants(GRID_STEP_S, transport_delay=delay * GRID_STEP_S,
                                          timeout=2 * hold * GRID_STEP_S),
                electronic_beam.Inputs.zeros(),
                electronic_beam.Outputs.zeros())


@compiled
def receiver_reading(offset: Radians, receiver: Receiver) -> Radians:
    """Return the error that a receiver measures for an offset of the target, NaN if the signal is lost. With the
    beamwidth 0 the error is linear, else it follows the monopulse pattern within full scale."""
    slope, beamwidth, lost_power_ratio = receiver
    if beamwidth == 0.0:
        return slope * offset
    # The offset across the axis is 0, and the cross-coupling of the axes is 0 (its cosine is 1, its sine 0).
    S, D, _ = monopulse.channels(offset / beamwidth, 0.0, slope * K_M, 1.0, 0.0)
    if S * S < lost_power_ratio:
        return math.nan
    return beamwidth * max(-FULL_SCALE_BEAMWIDTHS, min(D / (K_M * S), FULL_SCALE_BEAMWIDTHS))


@compiled
def command(inputs: electronic_beam.Inputs, stamp: int, due: bool, beam: Radians) -> None:
    """Put a command with a stamp, in samples of the grid, into the inputs of the beam; due: True for a new one."""
    inputs.stamp_ns = inputs.command_stamp_ns = stamp * GRID_STEP_NS
    inputs.due = 1 if due else 0
    inputs.position[0] = beam


@compiled
def _paper_loop(constants: PaperLoopConstants, receiver: Receiver, target: Target, smoothers: Records, plant: Beam,
                beam: Floats, errors: Floats) -> None:
    form, alpha, period, delta, kind = constants
    s, beta, T = smoothers[0].error, kalman.benedict_bordner(alpha), period * GRID_STEP_S
    R = v = error = 0.0
    for i in range(len(target.angle)):
        beam[i] = plant.outputs[0].position[0]
        sample = receiver_reading(target.angle[i] - beam[i], receiver) + target.noise[i]
        if not math.isnan(sample):
            smoothing.begin(s)
            smoothing.put(s, sample, 1.0 / SMOOTHING_SAMPLES)
        if i % period == 0:
            error = math.nan if math.isnan(sample) else smoothing.smoothed(s, kind, 1, SMOOTHING_SAMPLES)
            R, v = controllers.beam_step(form, R, v, error, alpha, beta, T, delta * target.rate[i])
        errors[i] = error
        command(plant.inputs[0], i, i % period == 0, R)
        electronic_beam.step(plant.state[0], plant.constants[0], plant.inputs[0], plant.outputs[0])


@compiled
def _filter_loop(constants: FilterLoopConstants, target: Target, smoothers: Records, filters: Records, plant: Beam,
                 beam: Floats, errors: Floats) -> None:
    s, f, c = smoothers[0].error, filters[0], constants.filter[0]
    period, hold, rate = constants.period, constants.hold, target.rate
    # beam_command [rad]: newest command; last_sample: last sample of the newest measurement.
    running, beam_command, acceleration = False, 0.0, 0.0
    for i in range(len(target.angle)):
        beam[i] = plant.outputs[0].position[0]
        if i % period == 0:
            smoothing.begin(s)
        # The angle of the target minus the rotation of the carrier is the angle in the earth frame.
        smoothing.put(s, beam[i] + (target.angle[i] - beam[i] + target.noise[i]) - target.attitude[i], 0.0)
        if i > 0 and constants.tau > 0.0:
            acceleration = attitudes.smoothed_acceleration(acceleration, rate[i], rate[i - 1], GRID_STEP_S,
                                                           constants.tau)
        if (i + 1) % period == 0:
            y = smoothing.smoothed(s, smoothing.SMOOTHING_NONE, period, period)
            if running:
                m = AxisMeasurement(y, constants.variance, math.nan, 0.0)
                axis_filter.predict(f, c, period * GRID_STEP_S)
                errors[i] = axis_filter.innovation(f, c, m).nu
                axis_filter.correct(f, c, m)
            else:
                axis_filter.start(f, c, y, constants.variance, 1.0)
            running = True
            last_sample = i
        if running and i % hold == 0:
            # The prediction goes from the stamp to the middle of the interval in which the command is in force.
            lead = constants.delay + 0.5 * hold * GRID_STEP_S
            earth = axis_filter.outlook(f, c, (i - last_sample + 0.5 * period) * GRID_STEP_S + lead).angle
            beam_command = (earth + target.attitude[i]
                            + attitudes.rotation_angle(rate[i], acceleration, 0.5 * GRID_STEP_S + lead))
        command(plant.inputs[0], i, running and i % hold == 0, beam_command)
        electronic_beam.step(plant.state[0], plant.constants[0], plant.inputs[0], plant.outputs[0])


def is_stable(loop: PaperLoop, size: Radians = 1e-9, seconds: Seconds = 20.0) -> bool:
    """Return True if the error of a loop falls after a step of `size`. Its largest values in the second and in the
    last third of the time are compared."""
    n = round(seconds / GRID_STEP_S)
    error = np.abs(size - loop.run(np.full(n, size))[0])
    middle, last = error[n // 3:2 * n // 3].max(), error[2 * n // 3:].max()
    return last <= middle < 1e3 * size


def delay_limit(loop: PaperLoop, highest: int = 400) -> int:
    """Return the largest delay at which a loop is stable, in samples up to `highest`, by bisection."""
    low, high = 0, highest
    while high - low > 1:
        middle = (low + high) // 2
        if is_stable(dataclasses.replace(loop, delay=middle)):
            low = middle
        else:
            high = middle
    return low


def spectral_radius(loop: PaperLoop) -> float:
    """Return the largest modulus of the eigenvalues of a loop over one period; below 1 the loop is stable.

    The receiver is linear. The state is V = v T, the smoothed error E, and the commands C_k, C_k-1, ... that are in
    force in the samples of the next period (and of the moving average before it). In sample j = 1 ... period after
    update k, the command k - age is in force, with age = -floor((j - 1 - delay) / period). n is SMOOTHING_SAMPLES.
    With a target at 0:

        S1:      E <- E (1 - 1/n) - slope C_k-age / n       for each sample
        S0, S2:  E <- - slope times the mean of C_k-age over the samples in the smoothing
        type 1:  V <- (1 - beta) V + beta E,  C_k+1 = C_k + (1 - alpha) V + alpha E
        type 2:  V <- V + beta E,             C_k+1 = C_k + V + (alpha + beta) E

    The right sides have the old values of V and C_k. The lines of V and C_k+1 have the new value of E.
    """
    M, beta, n = loop.period, kalman.benedict_bordner(loop.alpha), SMOOTHING_SAMPLES
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
