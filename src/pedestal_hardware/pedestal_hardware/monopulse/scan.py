"""Law of a receiver of a scanned feed: from the samples of one signal and of the scan reference to angle errors.

A block of samples is mixed down and integrated as in `front_end`; the reference is averaged over the same parts. The
power of an integral, less that of its noise, is linear in the averaged reference r to first order (`feed`):

    power = a + b_x Re r + b_e Im r

Least squares over the parts of a window, which holds one scan at least, give a and b. This is a synchronous
demodulation. It needs no whole number of scans, and its integrals may straddle a change of the reference. Because
power is averaged, noise causes no bias.

The product of difference and sum becomes b k_m / g, and the sum power becomes a. The functions of
tracking_receiver_sim.detector make an error of both. Fading at the rate of the scan causes an error.

Arguments: s, c, o as in `front_end`; w window (a record of this module); samples (n, 2) complex64: signal, reference;
dumps (parts, 2) complex128: integral of the signal, mean of the reference.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Pair, Vector3
from pedestal_common.record import Record
from pedestal_hardware.monopulse import feed, front_end
from tracking_receiver_sim import detector
from tracking_receiver_sim.detector import Voltages

MIN_SPREAD = 0.05
"""Smallest variance of the averaged reference in any direction, over its power [-]. A complete scan has 0.5, and less
by its averages."""

MAX_NOISE_SHARE = 0.01
"""Largest noise power of the averaged reference, over its power [-]. Its noise makes the fitted modulation too small
by twice this share."""

MAX_RATE_SHARE, MAX_MEAN, MAX_REVERSALS = 0.2, 0.25, 0.5
"""Largest deviation of the rate of the scan over the rate of the parameters, largest mean of the reference over its
amplitude, largest number of turns by more than 110 deg in a scan [-]."""

REVERSAL_COSINE = -0.34  # cosine of the turn of the reference, 110 deg, above which the turn counts as a reversal


class Window(Record):
    """Window of a fit.

    blocks, last        number of blocks in it so far, and of a complete window
        idle                number of blocks since a window was complete
        parts               number of integrals in it
        sum                 sums of Re r, Im r and power of the integrals
        square              sums of Re r^2, Re r Im r, Im r^2
        product             sums of power Re r, power Im r
        energy, lagged      mean power of the samples of the reference, and mean product of each one with the one before,
                            which has no noise; sums over the integrals
        age_ns              time from the middle of the window to the middle of its last block [ns]
        scale               k_m / g: difference over sum of a modulation of 1 [-]
        rotation            factor that turns the received reference
        scan                status of the scan of the last window: LOCKED, NO_SCAN or WRONG_SCAN
        expected            angle of the scan from one integral to the next, by the parameters [rad]
        smoothing           share of the way to its input that a value below moves in an integral
        before, count       last averaged reference, 0 without one; number of these values
        advance             angle from one averaged reference to the next [rad], smoothed
        reversals           number of turns of the reference by more than 110 deg in a scan [-], smoothed
        mean                mean of the reference, over its amplitude, smoothed
        slope               modulation in both directions, smoothed [-]
    """
    blocks: int
    parts: float
    sum: Vector3
    square: Vector3
    product: Pair
    energy: float
    lagged: float
    age_ns: int
    last: int
    idle: int
    scale: float
    rotation: complex
    expected: float
    smoothing: float
    scan: int
    before: complex
    count: int
    advance: float
    reversals: float
    mean: complex
    slope: Pair


def initial_window(p) -> np.ndarray:
    """Return Window (1,) of MonopulseParameters."""
    w, steps = Window.zeros(), p.steps_per_error
    w['last'], w['age_ns'] = steps, round(0.5 * (steps - 1) * p.period * 1e9)
    w['scale'] = p.antenna.slope / feed.modulation_slope(p)
    w['rotation'] = complex(math.cos(p.feed.reference_phase), math.sin(p.feed.reference_phase))
    integral = p.period / p.receiver.samples_per_step
    w['expected'] = 2.0 * math.pi * p.feed.scan_rate * integral
    w['smoothing'] = -math.expm1(-integral / front_end.RATIO_TIME_S)
    w['scan'] = front_end.Status.LOCKED
    return w


def constants(p) -> np.ndarray:
    """Return front_end.Constants (1,) of MonopulseParameters. The detector takes one sample in each window."""
    c, time = front_end.constants(p), p.steps_per_error * p.period
    c['samples'] = 1
    c['agc_gain'] = -math.expm1(-time / p.receiver.agc_time_constant)
    c['level_gain'] = -math.expm1(-time / p.receiver.cn0_time_constant)
    return c


@compiled
def dump(s, c, w, samples, dumps):
    """Mix samples down, integrate each part into `dumps`, and return the energy of the signal. The phase of the NCO
    advances."""
    cos_turn, sin_turn = math.cos(s.turn), math.sin(s.turn)
    re, im = math.cos(s.phase), -math.sin(s.phase)
    energy = 0.0
    for k in range(dumps.shape[0]):
        s_re = s_im = r_re = r_im = power = lagged = last_re = last_im = 0.0
        for i in range(k * c.part, (k + 1) * c.part):
            a, b = float(samples[i, 0].real), float(samples[i, 0].imag)
            energy += a * a + b * b
            s_re += a * re - b * im
            s_im += a * im + b * re
            a, b = float(samples[i, 1].real), float(samples[i, 1].imag)
            r_re += a
            r_im += b
            power += a * a + b * b
            lagged += a * last_re + b * last_im
            last_re, last_im = a, b
            re, im = re * cos_turn + im * sin_turn, im * cos_turn - re * sin_turn
        dumps[k, 0], dumps[k, 1] = complex(s_re, s_im), w.rotation * complex(r_re, r_im) / c.part
        w.energy += power / c.part
        w.lagged += lagged / (c.part - 1)
    s.phase = (s.phase + samples.shape[0] * s.turn) % (2.0 * math.pi)
    return energy


@compiled
def clear(w):
    """Begin a window."""
    w.blocks, w.parts, w.energy, w.lagged = 0, 0.0, 0.0, 0.0
    for i in range(3):
        w.sum[i] = w.square[i] = 0.0
    w.product[0] = w.product[1] = 0.0


@compiled
def begin_again(w):
    """Begin a window after a gap: the next reference does not continue the last one."""
    clear(w)
    w.before = 0.0j


@compiled
def watch(w, r):
    """Update rate and reversals with the averaged reference r."""
    product = r * w.before.conjugate()
    size = abs(product)
    if size > 0.0:
        w.count += 1
        # The mean of the first values, then a low-pass.
        gain = max(w.smoothing, 1.0 / w.count)
        w.advance += gain * (math.atan2(product.imag, product.real) - w.advance)
        reversal = 2.0 * math.pi / w.expected if product.real < REVERSAL_COSINE * size else 0.0
        w.reversals += gain * (reversal - w.reversals)
    w.before = r


@compiled
def add(w, dumps):
    """Add the integrals of a block to the window."""
    w.blocks += 1
    for k in range(dumps.shape[0]):
        power = dumps[k, 0].real**2 + dumps[k, 0].imag**2
        x, e = dumps[k, 1].real, dumps[k, 1].imag
        w.parts += 1.0
        w.sum[0] += x
        w.sum[1] += e
        w.sum[2] += power
        w.square[0] += x * x
        w.square[1] += x * e
        w.square[2] += e * e
        w.product[0] += power * x
        w.product[1] += power * e
        watch(w, dumps[k, 1])


@compiled
def judge(w, part, least):
    """Return the status of the scan, LOCKED, NO_SCAN or WRONG_SCAN, and update the mean of the reference.

    part: samples of an integral; least: smallest variance of the averaged reference in any direction.
    """
    power = w.lagged / w.parts
    noise = (w.energy - w.lagged) / w.parts
    if not (power > 0.0 and noise <= MAX_NOISE_SHARE * part * power and least >= MIN_SPREAD * power):
        return front_end.Status.NO_SCAN
    gain = max(w.parts * w.smoothing, w.parts / max(w.count, 1))
    mean = complex(w.sum[0], w.sum[1]) / (w.parts * math.sqrt(power))
    w.mean += min(gain, 1.0) * (mean - w.mean)
    if (abs(w.advance - w.expected) > MAX_RATE_SHARE * w.expected or w.reversals > MAX_REVERSALS
            or abs(w.mean) > MAX_MEAN):
        return front_end.Status.WRONG_SCAN
    return front_end.Status.LOCKED


@compiled
def fit(w, part):
    """Return (a, b_x, b_e) of the window in powers of integrals, and set `scan`. b is 0 without a good reference.

    part: samples of an integral.
    """
    n = w.parts
    x, e, power = w.sum[0] / n, w.sum[1] / n, w.sum[2] / n
    xx, xe, ee = w.square[0] / n - x * x, w.square[1] / n - x * e, w.square[2] / n - e * e
    # The smaller eigenvalue of the covariance of the reference.
    w.scan = judge(w, part, 0.5 * (xx + ee) - math.hypot(0.5 * (xx - ee), xe))
    if w.scan != front_end.Status.LOCKED:
        return power, 0.0, 0.0
    px, pe = w.product[0] / n - power * x, w.product[1] / n - power * e
    determinant = xx * ee - xe * xe
    b_x, b_e = (px * ee - pe * xe) / determinant, (pe * xx - px * xe) / determinant
    # b belongs to the received reference; its amplitude does not count.
    amplitude = math.sqrt(w.lagged / n)
    return power - b_x * x - b_e * e, amplitude * b_x, amplitude * b_e


@compiled
def take(s, c, w):
    """Take a complete window: its modulation becomes one sample of the detector."""
    a, b_x, b_e = fit(w, c.part)
    # One scale for the window, so that a noise floor that is still changing causes no modulation.
    scale = front_end.voltage_scale(s, c)**2
    b_x, b_e = scale * b_x, scale * b_e
    root = math.sqrt(max(scale * a, front_end.SMALLEST_POWER))
    difference_x, difference_e = complex(w.scale * b_x / root, 0.0), complex(w.scale * b_e / root, 0.0)
    x = front_end.multiplied(c, 0, difference_x, difference_e).real
    e = front_end.multiplied(c, 1, difference_x, difference_e).real
    detector.begin(s)
    detector.put(s, c, Voltages(root, 0.0, x, 0.0, e, 0.0))
    carrier, gain = max(s.agc_power - 1.0, 1.0), min(w.parts * w.smoothing, 1.0)
    w.slope[0] += gain * (b_x / carrier - w.slope[0])
    w.slope[1] += gain * (b_e / carrier - w.slope[1])
    w.idle = 0
    clear(w)


@compiled
def step(s, c, w, samples, dumps, o):
    """Take the samples of one block, and return True if an error is to be published: the block completes a window, or
    holds a number that is not finite. Such a block begins a new window."""
    good = front_end.finite(samples)
    w.idle += 1
    if good:
        energy = dump(s, c, w, samples, dumps)
        if s.carrier != 0:
            front_end.follow(s, c, dumps)
        front_end.note_noise(s, c, energy, dumps)
        add(w, dumps)
    else:
        front_end.skip(s, samples.shape[0])
        begin_again(w)
    complete = w.blocks == w.last
    if complete:
        take(s, c, w)
    # Without a complete window the level is not known any more.
    front_end.lock(s, c, good and w.idle <= 2 * w.last)
    front_end.report(s, c, good, o)
    if good and s.carrier != 0 and w.scan != front_end.Status.LOCKED:
        o.cross_elevation = o.elevation = math.nan
        o.status = w.scan
    return complete or not good
