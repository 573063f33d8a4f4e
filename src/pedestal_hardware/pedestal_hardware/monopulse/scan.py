"""Law of a receiver of a scanned feed: from the samples of one signal and of the scan reference to angle errors.

A block of samples is mixed down and integrated as in `front_end`; the reference is averaged over the same parts. The
power of an integral, less that of its noise, is linear in the averaged reference r to first order (`feed`):

    power = a + b_x Re r + b_e Im r

Least squares over the parts of a window, which holds one scan at least, give a and b. This synchronous demodulation
needs no whole number of scans. Because power is averaged, noise causes no bias. Fading at the rate of the scan causes
an error.

The product of difference and sum becomes b k_m / g, and the sum power becomes a. Samples have the shape (n, 2):
signal, reference. Dumps have the shape (parts, 2): integral of the signal, mean of the reference.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Complexes, Nanoseconds, Pair, Radians, Records, Vector3
from pedestal_common.record import Record
from pedestal_hardware.monopulse import feed, front_end
from pedestal_hardware.monopulse.blocks import Samples
from pedestal_hardware.monopulse.front_end import Constants, Outputs, State
from pedestal_hardware.monopulse.params import MonopulseParameters
from receiver_law import detector
from receiver_law.detector import Voltages

MIN_SPREAD = 0.05  # smallest variance of the averaged reference, over its power; of a complete scan up to 0.5
MAX_NOISE_SHARE = 0.01  # of the power of the averaged reference; it reduces the modulation by twice as much

MAX_RATE_SHARE, MAX_MEAN, MAX_REVERSALS = 0.2, 0.25, 0.5
"""Largest deviation of the rate of the scan over the rate of the parameters, largest mean of the reference over its
amplitude, largest number of turns by more than 110 deg in a scan [-]."""

REVERSAL_COSINE = -0.34  # cosine of the turn of the reference, 110 deg, above which the turn counts as a reversal


class Window(Record):
    """Window of a fit."""
    blocks: int             # number of blocks in it so far
    parts: float            # number of integrals in it
    sum: Vector3            # sums of Re r, Im r and power of the integrals
    square: Vector3         # sums of Re r^2, Re r Im r, Im r^2
    product: Pair           # sums of power Re r, power Im r
    energy: float           # sum over the integrals of the mean power of the samples of the reference
    lagged: float           # likewise of the mean product of each sample with the one before, which has no noise
    age_ns: Nanoseconds     # time from the middle of the window to the middle of its last block
    last: int               # number of blocks of a complete window
    idle: int               # number of blocks since a window was complete
    scale: float            # k_m / g: difference over sum of a modulation of 1 [-]
    rotation: complex       # factor that turns the received reference
    expected: Radians       # angle of the scan from one integral to the next, by the parameters
    smoothing: float        # share of the way to its input that a value below moves in an integral
    scan: int               # status of the scan of the last window: LOCKED, NO_SCAN or WRONG_SCAN
    before: complex         # last averaged reference, 0 without one
    count: int              # number of the averaged references
    advance: Radians        # angle from one averaged reference to the next, smoothed
    reversals: float        # number of turns of the reference by more than 110 deg in a scan [-], smoothed
    mean: complex           # mean of the reference, over its amplitude, smoothed
    slope: Pair             # modulation in both directions, smoothed [-]


def initial_window(params: MonopulseParameters) -> Records:
    """Return the Window (1,) before the first block."""
    window, steps = Window.zeros(), params.steps_per_error
    window['last'], window['age_ns'] = steps, round(0.5 * (steps - 1) * params.period * 1e9)
    window['scale'] = params.antenna.slope / feed.modulation_slope(params)
    window['rotation'] = complex(math.cos(params.feed.reference_phase), math.sin(params.feed.reference_phase))
    integral = params.period / params.receiver.samples_per_step
    window['expected'] = 2.0 * math.pi * params.feed.scan_rate * integral
    window['smoothing'] = -math.expm1(-integral / front_end.RATIO_TIME_S)
    window['scan'] = front_end.Status.LOCKED
    return window


def constants(params: MonopulseParameters) -> Records:
    """Return the front_end.Constants (1,). The detector takes one sample in each window."""
    record, time = front_end.constants(params), params.steps_per_error * params.period
    record['samples'] = 1
    record['agc_gain'] = -math.expm1(-time / params.receiver.agc_time_constant)
    record['level_gain'] = -math.expm1(-time / params.receiver.cn0_time_constant)
    return record


@compiled
def dump(state: State, constants: Constants, window: Window, samples: Samples, dumps: Complexes) -> float:
    """Integrate each part of samples, mixed down, into `dumps`. Return the energy of the signal. The NCO advances."""
    cos_turn, sin_turn = math.cos(state.turn), math.sin(state.turn)
    re, im = math.cos(state.phase), -math.sin(state.phase)
    energy = 0.0
    for k in range(dumps.shape[0]):
        s_re = s_im = r_re = r_im = power = lagged = last_re = last_im = 0.0
        for i in range(k * constants.part, (k + 1) * constants.part):
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
        dumps[k, 0], dumps[k, 1] = complex(s_re, s_im), window.rotation * complex(r_re, r_im) / constants.part
        window.energy += power / constants.part
        window.lagged += lagged / (constants.part - 1)
    state.phase = (state.phase + samples.shape[0] * state.turn) % (2.0 * math.pi)
    return energy


@compiled
def clear(window: Window) -> None:
    """Begin a window."""
    window.blocks, window.parts, window.energy, window.lagged = 0, 0.0, 0.0, 0.0
    for i in range(3):
        window.sum[i] = window.square[i] = 0.0
    window.product[0] = window.product[1] = 0.0


@compiled
def begin_again(window: Window) -> None:
    """Begin a window after a gap: the next reference does not continue the last one."""
    clear(window)
    window.before = 0.0j


@compiled
def watch(window: Window, r: complex) -> None:
    """Update rate and reversals with the averaged reference r."""
    product = r * window.before.conjugate()
    size = abs(product)
    if size > 0.0:
        window.count += 1
        # The mean of the first values, then a low-pass.
        gain = max(window.smoothing, 1.0 / window.count)
        window.advance += gain * (math.atan2(product.imag, product.real) - window.advance)
        reversal = 2.0 * math.pi / window.expected if product.real < REVERSAL_COSINE * size else 0.0
        window.reversals += gain * (reversal - window.reversals)
    window.before = r


@compiled
def add(window: Window, dumps: Complexes) -> None:
    """Add the integrals of a block to the window."""
    window.blocks += 1
    for k in range(dumps.shape[0]):
        power = dumps[k, 0].real**2 + dumps[k, 0].imag**2
        x, e = dumps[k, 1].real, dumps[k, 1].imag
        window.parts += 1.0
        window.sum[0] += x
        window.sum[1] += e
        window.sum[2] += power
        window.square[0] += x * x
        window.square[1] += x * e
        window.square[2] += e * e
        window.product[0] += power * x
        window.product[1] += power * e
        watch(window, dumps[k, 1])


@compiled
def judge(window: Window, part: int, least: float) -> int:
    """Return the status of the scan, LOCKED, NO_SCAN or WRONG_SCAN, and update the mean of the reference. part:
    samples of an integral; least: smallest variance of the averaged reference in any direction."""
    power = window.lagged / window.parts
    noise = (window.energy - window.lagged) / window.parts
    if not (power > 0.0 and noise <= MAX_NOISE_SHARE * part * power and least >= MIN_SPREAD * power):
        return front_end.Status.NO_SCAN
    gain = max(window.parts * window.smoothing, window.parts / max(window.count, 1))
    mean = complex(window.sum[0], window.sum[1]) / (window.parts * math.sqrt(power))
    window.mean += min(gain, 1.0) * (mean - window.mean)
    if (abs(window.advance - window.expected) > MAX_RATE_SHARE * window.expected or window.reversals > MAX_REVERSALS
            or abs(window.mean) > MAX_MEAN):
        return front_end.Status.WRONG_SCAN
    return front_end.Status.LOCKED


@compiled
def fit(window: Window, part: int) -> tuple[float, float, float]:
    """Return (a, b_x, b_e) of the window in powers of integrals, and set `scan`. b is 0 without a good reference."""
    n = window.parts
    x, e, power = window.sum[0] / n, window.sum[1] / n, window.sum[2] / n
    xx, xe, ee = window.square[0] / n - x * x, window.square[1] / n - x * e, window.square[2] / n - e * e
    # The smaller eigenvalue of the covariance of the reference.
    window.scan = judge(window, part, 0.5 * (xx + ee) - math.hypot(0.5 * (xx - ee), xe))
    if window.scan != front_end.Status.LOCKED:
        return power, 0.0, 0.0
    px, pe = window.product[0] / n - power * x, window.product[1] / n - power * e
    determinant = xx * ee - xe * xe
    b_x, b_e = (px * ee - pe * xe) / determinant, (pe * xx - px * xe) / determinant
    # b belongs to the received reference; its amplitude does not count.
    amplitude = math.sqrt(window.lagged / n)
    return power - b_x * x - b_e * e, amplitude * b_x, amplitude * b_e


@compiled
def take(state: State, constants: Constants, window: Window) -> None:
    """Take a complete window: its modulation becomes one sample of the detector."""
    a, b_x, b_e = fit(window, constants.part)
    # One scale for the window, so that a noise floor that is still changing causes no modulation.
    scale = front_end.voltage_scale(state, constants)**2
    b_x, b_e = scale * b_x, scale * b_e
    root = math.sqrt(max(scale * a, front_end.SMALLEST_POWER))
    difference_x, difference_e = complex(window.scale * b_x / root, 0.0), complex(window.scale * b_e / root, 0.0)
    x = front_end.multiplied(constants, 0, difference_x, difference_e).real
    e = front_end.multiplied(constants, 1, difference_x, difference_e).real
    detector.begin(state)
    detector.put(state, constants, Voltages(root, 0.0, x, 0.0, e, 0.0))
    carrier, gain = max(state.agc_power - 1.0, 1.0), min(window.parts * window.smoothing, 1.0)
    window.slope[0] += gain * (b_x / carrier - window.slope[0])
    window.slope[1] += gain * (b_e / carrier - window.slope[1])
    window.idle = 0
    clear(window)


@compiled
def step(state: State, constants: Constants, window: Window, samples: Samples, dumps: Complexes,
         outputs: Outputs) -> bool:
    """Take the samples of one block. Return True if an error is to be published: the block completes a window, or
    holds a number that is not finite. Such a block begins a new window."""
    good = front_end.finite(samples)
    window.idle += 1
    if good:
        energy = dump(state, constants, window, samples, dumps)
        if state.carrier != 0:
            front_end.follow(state, constants, dumps)
        front_end.note_noise(state, constants, energy, dumps)
        add(window, dumps)
    else:
        front_end.skip(state, samples.shape[0])
        begin_again(window)
    complete = window.blocks == window.last
    if complete:
        take(state, constants, window)
    # Without a complete window the level is not known any more.
    front_end.lock(state, constants, good and window.idle <= 2 * window.last)
    front_end.report(state, constants, good, outputs)
    if good and state.carrier != 0 and window.scan != front_end.Status.LOCKED:
        outputs.cross_elevation = outputs.elevation = math.nan
        outputs.status = window.scan
    return complete or not good
