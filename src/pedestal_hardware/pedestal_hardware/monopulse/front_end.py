"""Law of a receiver of I/Q samples: from the samples of three channels to angle errors.

A block of samples is mixed down by a numerically controlled oscillator (NCO) and integrated over the parts of a step
(integrate and dump). Each integral is divided by the square root of its noise power. These are the voltages of
tracking_receiver_sim.detector, whose functions make errors, C/N0 and lock of them.

The noise power is the power of the sum channel that is orthogonal to its integrals. A frequency-locked loop (FLL) of
second order keeps the NCO on the carrier. Its frequency error is the phase between two integrals. A constant Doppler
rate causes no lasting error. There is no phase lock, because each difference is measured against the sum of the same
integral. The differences are multiplied by a complex matrix, which contains phases, slopes and cross-coupling.

The module `scan` has the law of a feed with one output, which calls the functions of carrier, noise and lock here.

Arguments: s state, c constants, o outputs (records of this module); samples (n, channels) complex64; dumps (parts,
channels) complex128.
"""
import math

import numpy as np

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.record import Record
from tracking_receiver_sim import detector
from tracking_receiver_sim.detector import Voltages

STATUS_TEXTS = dict(LOCKED='locked', NO_LOCK='no lock', SEARCH='search for the carrier',
                    NOT_FINITE='samples hold NaN or infinity', NO_SCAN='no scan reference, or it stands still',
                    WRONG_SCAN='the scan reference is not that of feed.scan_rate', WAIT='no samples so far')
STATUS_TEXT_BY_CODE = tuple(STATUS_TEXTS.values())
Status = codes(STATUS_TEXTS)

State = np.dtype([
    *((name, detector.State.dtype[name]) for name in detector.State.dtype.names),
    ('phase', 'f8'), ('turn', 'f8'), ('rate', 'f8'), ('last_real', 'f8'), ('last_imag', 'f8'), ('error', 'f8'),
    ('carrier', 'i8'), ('unlocked_ns', 'i8'), ('noise', 'f8'), ('blocks', 'i8'), ('bad', 'i8'),
    ('ratio_real', 'f8', 2), ('ratio_imag', 'f8', 2), ('skew', 'f8', 2)], align=True)
"""State, with the state of the detector.

    phase, turn, rate   phase of the NCO [rad], its frequency [rad/sample], change of the frequency in a block
    last_...            last integral of the sum channel
    error               frequency error, smoothed [rad/sample]
    carrier             1 if the search has found a carrier, which the loop follows
    unlocked_ns         time without lock since the search
    noise               noise power of a sample of the sum channel
    blocks, bad         number of blocks that the noise is made of; of blocks that hold NaN or infinity
    ratio_...           received difference over sum, smoothed: cross-elevation, elevation
    skew                imaginary part of the multiplied difference over the sum, smoothed; 0 with the right phases
"""

Constants = np.dtype([
    *((name, detector.Constants.dtype[name]) for name in detector.Constants.dtype.names),
    ('part', 'i8'), ('block_ns', 'i8'), ('loop_gain', 'f8'), ('error_gain', 'f8'), ('noise_gain', 'f8'),
    ('largest_error', 'f8'), ('give_up_ns', 'i8'), ('ratio_gain', 'f8'),
    ('matrix_real', 'f8', (2, 2)), ('matrix_imag', 'f8', (2, 2))], align=True)
"""Constants, with the constants of the detector.

    part, block_ns      samples of an integral; time of a block [ns]
    ..._gain            share of the way to its input that a filter moves in a block
    largest_error       largest frequency error of a lock [rad/sample]
    give_up_ns          time without lock after which the carrier is searched again
    matrix_...          calibration matrix
"""


class Outputs(Record):
    """Outputs of a block: errors [rad], NaN while not locked; C/N0 [dB-Hz]; 1 while locked; index of
    STATUS_TEXT_BY_CODE.
    """
    cross_elevation: float
    elevation: float
    cn0_dbhz: float
    locked: int
    status: int


RATIO_TIME_S = 1.0  # time constant of the ratios of difference and sum [s]
ERROR_TIME_S = 0.05  # time constant of the smoothed frequency error [s]
SMALLEST_POWER = 1e-30  # smallest noise power of a sample, in place of 0 in a stream of zeros


def constants(p) -> np.ndarray:
    """Return Constants (1,) of MonopulseParameters."""
    c, carrier = np.zeros(1, Constants), p.carrier
    detector.set_constants(c, p.antenna, p.receiver, p.period)
    c['part'], c['block_ns'] = p.block // p.receiver.samples_per_step, round(p.period * 1e9)
    c['loop_gain'], c['noise_gain'] = carrier.loop_gain, -math.expm1(-p.period / carrier.noise_time)
    c['error_gain'], c['ratio_gain'] = -math.expm1(-p.period / ERROR_TIME_S), -math.expm1(-p.period / RATIO_TIME_S)
    c['largest_error'] = 2.0 * math.pi * carrier.largest_residual / p.source.rate
    c['give_up_ns'] = round(carrier.give_up * 1e9)
    matrix = np.array(p.calibration.matrix)
    c['matrix_real'], c['matrix_imag'] = matrix.real, matrix.imag
    return c


def initial_state(p) -> np.ndarray:
    """Return State (1,) before the first block of MonopulseParameters: noise in the channels, no carrier."""
    s = np.zeros(1, State)
    s['agc_power'] = s['level_power'] = 1.0
    s['turn'] = 2.0 * math.pi * p.carrier.centre / p.source.rate
    return s


@compiled
def finite(samples):
    """Return True if all samples are finite."""
    total = 0.0
    for i in range(samples.shape[0]):
        for channel in range(samples.shape[1]):
            # 0 times a number that is not finite is NaN.
            total += 0.0 * samples[i, channel].real + 0.0 * samples[i, channel].imag
    return total == 0.0


@compiled
def dump(s, c, samples, dumps):
    """Mix samples down, integrate each part into `dumps`, and return the energy of the sum channel. The phase of the
    NCO advances."""
    cos_turn, sin_turn = math.cos(s.turn), math.sin(s.turn)
    re, im = math.cos(s.phase), -math.sin(s.phase)
    energy = 0.0
    for k in range(dumps.shape[0]):
        s_re = s_im = x_re = x_im = e_re = e_im = 0.0
        for i in range(k * c.part, (k + 1) * c.part):
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
    s.phase = (s.phase + samples.shape[0] * s.turn) % (2.0 * math.pi)
    return energy


@compiled
def follow(s, c, dumps):
    """Turn the NCO towards the carrier, by the phase between the integrals of the sum."""
    re = im = 0.0
    before = complex(s.last_real, s.last_imag)
    for k in range(dumps.shape[0]):
        product = dumps[k, 0] * before.conjugate()
        re += product.real
        im += product.imag
        before = dumps[k, 0]
    s.last_real, s.last_imag = before.real, before.imag
    turn = math.atan2(im, re) / c.part
    # The gain of the rate gives the loop two equal poles.
    s.rate += 0.25 * c.loop_gain * c.loop_gain * turn
    s.turn += c.loop_gain * turn + s.rate
    s.error += c.error_gain * (turn - s.error)


@compiled
def note_noise(s, c, energy, dumps):
    """Update the noise power: the energy of the sum channel that is not in its integrals."""
    in_dumps = 0.0
    for k in range(dumps.shape[0]):
        in_dumps += (dumps[k, 0].real**2 + dumps[k, 0].imag**2) / c.part
    noise = (energy - in_dumps) / (dumps.shape[0] * (c.part - 1))
    s.blocks += 1
    # The mean of the first blocks, then a low-pass.
    s.noise += max(c.noise_gain, 1.0 / s.blocks) * (noise - s.noise)


@compiled
def multiplied(c, row, x, e):
    """Return a row of the calibration matrix times the differences x, e."""
    return (complex(c.matrix_real[row, 0], c.matrix_imag[row, 0]) * x
            + complex(c.matrix_real[row, 1], c.matrix_imag[row, 1]) * e)


@compiled
def note_ratios(s, c, dumps):
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
            true += multiplied(c, i, dumps[k, 1], dumps[k, 2]) * of_sum
        s.ratio_real[i] += c.ratio_gain * (ratio.real / power - s.ratio_real[i])
        s.ratio_imag[i] += c.ratio_gain * (ratio.imag / power - s.ratio_imag[i])
        s.skew[i] += c.ratio_gain * (true.imag / power - s.skew[i])


@compiled
def skip(s, count):
    """Skip a block of `count` samples that are not all finite. Only the phase of the NCO advances."""
    s.bad += 1
    s.phase = (s.phase + count * s.turn) % (2.0 * math.pi)
    s.last_real = s.last_imag = 0.0


@compiled
def voltage_scale(s, c):
    """Return the factor by which an integral becomes a voltage, whose noise has the power 1."""
    return 1.0 / math.sqrt(c.part * max(s.noise, SMALLEST_POWER))


@compiled
def lock(s, c, good):
    """Update lock and search after a block. good: True if its samples are finite."""
    found = good and s.carrier != 0 and abs(s.error) <= c.largest_error
    detector.lock(s, c, s.level_power - 1.0 if found else 0.0, c.block_ns)
    s.unlocked_ns = 0 if s.locked != 0 else s.unlocked_ns + c.block_ns
    if s.carrier != 0 and s.unlocked_ns > c.give_up_ns:
        s.carrier = 0


@compiled
def report(s, c, good, o):
    """Set the outputs after a block. good: True if its samples are finite."""
    x, e = detector.errors(s, c) if good and s.locked != 0 else (math.nan, math.nan)
    o.cross_elevation, o.elevation, o.cn0_dbhz, o.locked = x, e, detector.cn0_dbhz(s, c), s.locked
    o.status = (Status.NOT_FINITE if not good else Status.LOCKED if s.locked != 0 else
                Status.NO_LOCK if s.carrier != 0 else Status.SEARCH)


@compiled
def step(s, c, samples, dumps, o):
    """Take the samples of one block. A block with a number that is not finite changes only lock and phase."""
    good = finite(samples)
    if good:
        energy = dump(s, c, samples, dumps)
        if s.carrier != 0:
            follow(s, c, dumps)
        note_noise(s, c, energy, dumps)
        scale = voltage_scale(s, c)
        detector.begin(s)
        for k in range(dumps.shape[0]):
            total = scale * dumps[k, 0]
            x = scale * multiplied(c, 0, dumps[k, 1], dumps[k, 2])
            e = scale * multiplied(c, 1, dumps[k, 1], dumps[k, 2])
            detector.put(s, c, Voltages(total.real, total.imag, x.real, x.imag, e.real, e.imag))
        if s.locked != 0:
            note_ratios(s, c, dumps)
    else:
        skip(s, samples.shape[0])
    lock(s, c, good)
    report(s, c, good, o)


@compiled
def use_carrier(s, turn):
    """Begin to follow a carrier that the search has found. turn: its frequency [rad/sample]."""
    s.turn, s.rate, s.carrier, s.unlocked_ns, s.error = turn, 0.0, 1, 0, 0.0
    s.last_real = s.last_imag = 0.0


@compiled
def pass_gap(s, search):
    """Continue after a gap in the samples. search: True to search the carrier again."""
    s.last_real = s.last_imag = 0.0
    if search:
        s.carrier, s.locked, s.timer_ns, s.unlocked_ns = 0, 0, 0, 0


class Search:
    """Search for the carrier in the samples of the sum channel, by an FFT over a window of Hann.

    The carrier is the strongest bin of the Doppler window if its level over the floor, the median of the bins, exceeds
    the threshold. For white noise alone the strongest of 4096 bins is at 9.5 dB.
    """

    def __init__(self, p):
        self.rate, self.threshold, size = p.source.rate, p.carrier.threshold, p.carrier.bins
        self.window = np.hanning(size).astype(np.float32)
        self.samples, self.count = np.zeros(size, np.complex64), 0
        frequency = np.fft.fftfreq(size, 1.0 / self.rate)
        # Both frequencies are those of the samples, which repeat with the sample rate.
        away = np.abs((frequency - p.carrier.centre + 0.5 * self.rate) % self.rate - 0.5 * self.rate)
        self.bins = np.flatnonzero(away <= max(0.5 * p.carrier.span, self.rate / size))
        self.level = -math.inf

    def clear(self):
        """Forget the samples before a gap."""
        self.count = 0

    def put(self, samples) -> 'float | None':
        """Take samples (n,) of the sum channel. Return the frequency of a carrier [rad/sample], or None."""
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

    def _look(self):
        power = np.abs(np.fft.fft(self.samples * self.window))**2
        best = int(self.bins[np.argmax(power[self.bins])])
        # The power of a bin of noise has an exponential distribution, whose median is its mean times ln 2.
        floor = max(float(np.median(power)) / math.log(2.0), SMALLEST_POWER)
        self.level = 10.0 * math.log10(max(float(power[best]) / floor, SMALLEST_POWER))
        if not self.level > self.threshold:
            return None
        size = len(power)
        return 2.0 * math.pi * (best - size if best >= size // 2 else best) / size
