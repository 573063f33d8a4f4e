"""Law of a receiver of I/Q samples: from the samples of three channels to angle errors.

A block of samples is mixed down by a numerically controlled oscillator (NCO) and integrated over the parts of a step.
Each integral (dump), divided by the square root of its noise power, is a voltage of receiver_law.detector, whose
functions make errors, C/N0 and lock.

The noise power is the power of the sum channel that is orthogonal to its integrals. A frequency-locked loop of second
order keeps the NCO on the carrier, by the phase between two integrals. A constant Doppler rate causes no lasting
error. There is no phase lock, because each difference is measured against the sum of the same integral.

Samples have the shape (n, channels), dumps the shape (parts, channels).
"""
import math
from typing import Annotated, TypeAlias

import numpy as np

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.quantities import (
    Bit,
    Complexes,
    DecibelHertz,
    Floats,
    Nanoseconds,
    Pair,
    Radians,
    RadiansPerSample,
    Records,
)
from pedestal_common.record import Record
from pedestal_hardware.monopulse.blocks import Samples
from pedestal_hardware.monopulse.params import MonopulseParameters
from receiver_law import detector
from receiver_law.detector import Voltages

STATUS_TEXTS = dict(LOCKED='locked', NO_LOCK='no lock', SEARCH='search for the carrier',
                    NOT_FINITE='samples hold NaN or infinity', NO_SCAN='no scan reference, or it stands still',
                    WRONG_SCAN='the scan reference is not that of feed.scan_rate', WAIT='no samples so far')
STATUS_TEXT_BY_CODE = tuple(STATUS_TEXTS.values())
Status = codes(STATUS_TEXTS)

Matrix2: TypeAlias = Annotated[Floats, (2, 2)]


class State(detector.State):
    """State, with the state of the detector."""
    phase: Radians              # of the NCO
    turn: RadiansPerSample      # frequency of the NCO
    rate: RadiansPerSample      # change of this frequency in a block
    last_real: float            # last integral of the sum channel
    last_imag: float
    error: RadiansPerSample     # frequency error, smoothed
    carrier: Bit                # 1 if the search has found a carrier, which the loop follows
    unlocked_ns: Nanoseconds    # time without lock since the search
    noise: float                # noise power of a sample of the sum channel
    blocks: int                 # number of blocks that the noise is made of
    bad: int                    # number of blocks that hold NaN or infinity
    ratio_real: Pair            # received difference over sum, smoothed: cross-elevation, elevation
    ratio_imag: Pair
    skew: Pair                  # imaginary part of the multiplied difference over the sum, smoothed; 0 with the right
                                # phases


class Constants(detector.Constants):
    """Constants. A gain is the share of the way to its input that a filter moves in a block."""
    part: int                   # samples of an integral
    block_ns: Nanoseconds       # time of a block
    loop_gain: float
    error_gain: float
    noise_gain: float
    largest_error: RadiansPerSample     # largest frequency error of a lock
    give_up_ns: Nanoseconds     # time without lock after which the carrier is searched again
    ratio_gain: float
    matrix_real: Matrix2        # calibration matrix
    matrix_imag: Matrix2


class Outputs(Record):
    """Outputs of a block."""
    cross_elevation: Radians    # error, NaN while not locked
    elevation: Radians
    cn0_dbhz: DecibelHertz
    locked: Bit
    status: int                 # index of STATUS_TEXT_BY_CODE


RATIO_TIME_S = 1.0  # time constant of the ratios of difference and sum [s]
ERROR_TIME_S = 0.05  # time constant of the smoothed frequency error [s]
SMALLEST_POWER = 1e-30  # smallest noise power of a sample, in place of 0 in a stream of zeros


def constants(params: MonopulseParameters) -> Records:
    """Return the Constants (1,)."""
    record, carrier = Constants.zeros(), params.carrier
    detector.set_constants(record, params.antenna, params.receiver, params.period)
    record['part'], record['block_ns'] = params.block // params.receiver.samples_per_step, round(params.period * 1e9)
    record['loop_gain'], record['noise_gain'] = carrier.loop_gain, -math.expm1(-params.period / carrier.noise_time)
    record['error_gain'] = -math.expm1(-params.period / ERROR_TIME_S)
    record['ratio_gain'] = -math.expm1(-params.period / RATIO_TIME_S)
    record['largest_error'] = 2.0 * math.pi * carrier.largest_residual / params.source.rate
    record['give_up_ns'] = round(carrier.give_up * 1e9)
    matrix = np.array(params.calibration.matrix)
    record['matrix_real'], record['matrix_imag'] = matrix.real, matrix.imag
    return record


def initial_state(params: MonopulseParameters) -> Records:
    """Return the State (1,) before the first block: noise in the channels, no carrier."""
    state = State.zeros()
    state['agc_power'] = state['level_power'] = 1.0
    state['turn'] = 2.0 * math.pi * params.carrier.centre / params.source.rate
    return state


@compiled
def finite(samples: Samples) -> bool:
    """Return True if all samples are finite."""
    total = 0.0
    for i in range(samples.shape[0]):
        for channel in range(samples.shape[1]):
            # 0 times a number that is not finite is NaN.
            total += 0.0 * samples[i, channel].real + 0.0 * samples[i, channel].imag
    return total == 0.0


@compiled
def dump(state: State, constants: Constants, samples: Samples, dumps: Complexes) -> float:
    """Integrate the parts of samples, mixed down, into `dumps`. Return the energy of the sum. The NCO advances."""
    cos_turn, sin_turn = math.cos(state.turn), math.sin(state.turn)
    re, im = math.cos(state.phase), -math.sin(state.phase)
    energy = 0.0
    for k in range(dumps.shape[0]):
        s_re = s_im = x_re = x_im = e_re = e_im = 0.0
        for i in range(k * constants.part, (k + 1) * constants.part):
            a, b = float(samples[i, 0].real), float(samples[i, 0].imag)
            energy += a * a + b * b
            s_re += a * re - b * im
            s_im += a * im + b * re
            a, b = float(samples[i, 1].real), float(samples[i, 1].imag)
            x_re += a * re - b * im
            x_im += a * im + b * re
            a, b = float(samples[i, 2].real), float(samples[i, 2].imag)
            e_re += a * re - b * im
            e_im += a * im + b * re
            re, im = re * cos_turn + im * sin_turn, im * cos_turn - re * sin_turn
        dumps[k, 0], dumps[k, 1], dumps[k, 2] = complex(s_re, s_im), complex(x_re, x_im), complex(e_re, e_im)
    state.phase = (state.phase + samples.shape[0] * state.turn) % (2.0 * math.pi)
    return energy


@compiled
def follow(state: State, constants: Constants, dumps: Complexes) -> None:
    """Turn the NCO towards the carrier, by the phase between the integrals of the sum."""
    re = im = 0.0
    before = complex(state.last_real, state.last_imag)
    for k in range(dumps.shape[0]):
        product = dumps[k, 0] * before.conjugate()
        re += product.real
        im += product.imag
        before = dumps[k, 0]
    state.last_real, state.last_imag = before.real, before.imag
    turn = math.atan2(im, re) / constants.part
    # The gain of the rate gives the loop two equal poles.
    state.rate += 0.25 * constants.loop_gain * constants.loop_gain * turn
    state.turn += constants.loop_gain * turn + state.rate
    state.error += constants.error_gain * (turn - state.error)


@compiled
def note_noise(state: State, constants: Constants, energy: float, dumps: Complexes) -> None:
    """Update the noise power: the energy of the sum channel that is not in its integrals."""
    in_dumps = 0.0
    for k in range(dumps.shape[0]):
        in_dumps += (dumps[k, 0].real**2 + dumps[k, 0].imag**2) / constants.part
    noise = (energy - in_dumps) / (dumps.shape[0] * (constants.part - 1))
    state.blocks += 1
    # The mean of the first blocks, then a low-pass.
    state.noise += max(constants.noise_gain, 1.0 / state.blocks) * (noise - state.noise)


@compiled
def multiplied(constants: Constants, row: int, x: complex, e: complex) -> complex:
    """Return a row of the calibration matrix times the differences x, e."""
    return (complex(constants.matrix_real[row, 0], constants.matrix_imag[row, 0]) * x
            + complex(constants.matrix_real[row, 1], constants.matrix_imag[row, 1]) * e)


@compiled
def note_ratios(state: State, constants: Constants, dumps: Complexes) -> None:
    """Update the ratios of difference and sum, and the skew of the phases."""
    power = 0.0
    for k in range(dumps.shape[0]):
        power += dumps[k, 0].real**2 + dumps[k, 0].imag**2
    power = max(power, SMALLEST_POWER)
    for i in range(2):
        ratio = true = 0.0j
        for k in range(dumps.shape[0]):
            of_sum = dumps[k, 0].conjugate()
            ratio += dumps[k, i + 1] * of_sum
            true += multiplied(constants, i, dumps[k, 1], dumps[k, 2]) * of_sum
        state.ratio_real[i] += constants.ratio_gain * (ratio.real / power - state.ratio_real[i])
        state.ratio_imag[i] += constants.ratio_gain * (ratio.imag / power - state.ratio_imag[i])
        state.skew[i] += constants.ratio_gain * (true.imag / power - state.skew[i])


@compiled
def skip(state: State, count: int) -> None:
    """Skip a block of `count` samples that are not all finite. Only the phase of the NCO advances."""
    state.bad += 1
    state.phase = (state.phase + count * state.turn) % (2.0 * math.pi)
    state.last_real = state.last_imag = 0.0


@compiled
def voltage_scale(state: State, constants: Constants) -> float:
    """Return the factor by which an integral becomes a voltage, whose noise has the power 1."""
    return 1.0 / math.sqrt(constants.part * max(state.noise, SMALLEST_POWER))


@compiled
def lock(state: State, constants: Constants, good: bool) -> None:
    """Update lock and search after a block. good: True if its samples are finite."""
    found = good and state.carrier != 0 and abs(state.error) <= constants.largest_error
    detector.lock(state, constants, state.level_power - 1.0 if found else 0.0, constants.block_ns)
    state.unlocked_ns = 0 if state.locked != 0 else state.unlocked_ns + constants.block_ns
    if state.carrier != 0 and state.unlocked_ns > constants.give_up_ns:
        state.carrier = 0


@compiled
def report(state: State, constants: Constants, good: bool, outputs: Outputs) -> None:
    """Set the outputs after a block. good: True if its samples are finite."""
    x, e = detector.errors(state, constants) if good and state.locked != 0 else (math.nan, math.nan)
    outputs.cross_elevation, outputs.elevation = x, e
    outputs.cn0_dbhz, outputs.locked = detector.cn0_dbhz(state, constants), state.locked
    outputs.status = (Status.NOT_FINITE if not good else Status.LOCKED if state.locked != 0 else
                Status.NO_LOCK if state.carrier != 0 else Status.SEARCH)


@compiled
def step(state: State, constants: Constants, samples: Samples, dumps: Complexes, outputs: Outputs) -> None:
    """Take the samples of one block. A block with a number that is not finite changes only lock and phase."""
    good = finite(samples)
    if good:
        energy = dump(state, constants, samples, dumps)
        if state.carrier != 0:
            follow(state, constants, dumps)
        note_noise(state, constants, energy, dumps)
        scale = voltage_scale(state, constants)
        detector.begin(state)
        for k in range(dumps.shape[0]):
            total = scale * dumps[k, 0]
            x = scale * multiplied(constants, 0, dumps[k, 1], dumps[k, 2])
            e = scale * multiplied(constants, 1, dumps[k, 1], dumps[k, 2])
            detector.put(state, constants, Voltages(total.real, total.imag, x.real, x.imag, e.real, e.imag))
        if state.locked != 0:
            note_ratios(state, constants, dumps)
    else:
        skip(state, samples.shape[0])
    lock(state, constants, good)
    report(state, constants, good, outputs)


@compiled
def use_carrier(state: State, turn: RadiansPerSample) -> None:
    """Begin to follow a carrier that the search has found. turn: its frequency."""
    state.turn, state.rate, state.carrier, state.unlocked_ns, state.error = turn, 0.0, 1, 0, 0.0
    state.last_real = state.last_imag = 0.0


@compiled
def pass_gap(state: State, search: bool) -> None:
    """Continue after a gap in the samples. search: True to search the carrier again."""
    state.last_real = state.last_imag = 0.0
    if search:
        state.carrier, state.locked, state.timer_ns, state.unlocked_ns = 0, 0, 0, 0


class Search:
    """Search for the carrier in the samples of the sum channel, by an FFT over a window of Hann. The carrier is the
    strongest bin of the Doppler window if its level over the median of the bins exceeds the threshold. For white noise
    alone the strongest of 4096 bins is at 9.5 dB."""

    def __init__(self, params: MonopulseParameters) -> None:
        self.rate, self.threshold, size = params.source.rate, params.carrier.threshold, params.carrier.bins
        self.window = np.hanning(size).astype(np.float32)
        self.samples, self.count = np.zeros(size, np.complex64), 0
        frequency = np.fft.fftfreq(size, 1.0 / self.rate)
        # Both frequencies are those of the samples, which repeat with the sample rate.
        away = np.abs((frequency - params.carrier.centre + 0.5 * self.rate) % self.rate - 0.5 * self.rate)
        self.bins = np.flatnonzero(away <= max(0.5 * params.carrier.span, self.rate / size))
        self.level = -math.inf

    def clear(self) -> None:
        """Forget the samples before a gap."""
        self.count = 0

    def put(self, samples: Samples) -> RadiansPerSample | None:
        """Take samples (n,) of the sum channel. Return the frequency of a carrier, or None."""
        size = len(self.samples)
        while len(samples):
            taken = samples[:size - self.count]
            self.samples[self.count:self.count + len(taken)] = taken
            self.count, samples = self.count + len(taken), samples[len(taken):]
            if self.count == size:
                self.count = 0
                found = self._look()
                if found is not None:
                    return found
        return None

    def _look(self) -> RadiansPerSample | None:
        power = np.abs(np.fft.fft(self.samples * self.window))**2
        best = int(self.bins[np.argmax(power[self.bins])])
        # The power of a bin of noise has an exponential distribution, whose median is its mean times ln 2.
        floor = max(float(np.median(power)) / math.log(2.0), SMALLEST_POWER)
        self.level = 10.0 * math.log10(max(float(power[best]) / floor, SMALLEST_POWER))
        if not self.level > self.threshold:
            return None
        size = len(power)
        return 2.0 * math.pi * (best - size if best >= size // 2 else best) / size
