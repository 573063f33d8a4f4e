"""Methods of the position loop's frequency response: margins, bandwidth and resonance, by the command `excite`.

The axis moves at a constant rate while the control unit adds a multisine to its rate command. The recorded command is
the signal E of tuning.frequency_response, and the multisine less the command is its signal Y. Because the multisine is
periodic, the correlation of both over a period shows its place in the recording, to the step.
"""
import dataclasses
import functools
import math

import numpy as np
from scipy import signal

from acu_tracker.servo.excitation import MAX_PEAK_RAD_S, MAX_PEAK_SHARE, MAX_SINES
from pedestal_common.multisine import Sweep
from pedestal_common.quantities import Floats, RadiansPerSecond
from pedestal_recording import recording as recordings
from pedestal_workbench.acceptance import servo
from pedestal_workbench.acceptance.exercise import Action, Antenna, Exercise, Performed
from pedestal_workbench.acceptance.method import Arguments, Measured, Method, of_parts
from pedestal_workbench.tuning import frequency_response
from pedestal_workbench.tuning.frequency_response import Response

SWEEP = Sweep(period=8.0, lowest=0.25, highest=95.0, points=MAX_SINES, dropped=1, kept=6, peak=0.012)
SPARE_S = 2.0           # time of the excitation around dropped and kept periods [s]
TIME_S = SPARE_S + (SWEEP.dropped + SWEEP.kept) * SWEEP.period     # of the whole excitation [s]
RATE_RAD_S, MIN_PERIODS, QUIET_RATIO = 0.025, 3, 5.0
"""Largest constant rate [rad/s], at which a bad tooth meets few of the periods. Least number of used periods, and
their largest distance from the median of all periods over the least distance [-]."""
FRICTION_SHARE = 0.003
"""Share of a value by which it depends on the constant rate, by the friction [-]. Means of 8 seeds are 0.0024 off."""
MIN_CORRELATION = 0.3   # least correlation of the command and the multisine [-]
MIN_NOTCH_DB, MAX_NOISE = 3.0, 0.1      # least depth of a notch [dB], largest noise of its frequencies over |L| [-]


def _sweep(antenna: Antenna, arguments: Arguments) -> tuple[Sweep, RadiansPerSecond]:
    """Return the multisine of an exercise, and the constant rate [rad/s]."""
    axis, drive = servo.plan(antenna, arguments), servo.drive_of(antenna, str(arguments['axis']))
    limits = getattr(antenna.acu, axis.name).limits
    rate = min(RATE_RAD_S, frequency_response.RATE_SHARE * axis.rate, axis.travel / (TIME_S + 2.0))
    sweep = frequency_response.in_contact(drive, SWEEP, antenna.period)
    largest = min(sweep.peak, frequency_response.PEAK_SHARE * rate, MAX_PEAK_RAD_S, MAX_PEAK_SHARE * limits.rate)
    return dataclasses.replace(sweep, peak=largest), rate


def _exercise(antenna: Antenna, arguments: Arguments) -> Exercise:
    axis = servo.plan(antenna, arguments)
    sweep, rate = _sweep(antenna, arguments)
    half = 0.5 * rate * (TIME_S + 2.0)
    excite = (f'excite axis={axis.name} peak={sweep.peak!r} duration={TIME_S} period={sweep.period} '
              f'lowest={sweep.lowest} highest={sweep.highest!r} points={sweep.points}')
    return axis.exercise(servo.BEGIN_S + 2.0 + TIME_S, half, rate,
                         axis.preset(servo.BEGIN_S, -half, rate, 2.0 + TIME_S),
                         Action(servo.BEGIN_S + 1.0, 'acu', excite), start=-half)


def _signals(performed: Performed, arguments: Arguments) -> tuple[Sweep, Floats, Floats]:
    """Return (multisine, one period of it (n,), rate command (periods, n) of the quiet periods). Raises ValueError."""
    sweep, _ = _sweep(performed.antenna, arguments)
    name, bag, n = str(arguments['axis']), performed.recording, round(sweep.period / performed.antenna.period)
    if missing := recordings.missing(bag, 'joint_states', 'acu/rate_command'):
        raise ValueError(f'the recording holds no {missing}')
    t = bag.table('joint_states')['t']
    first = int(np.searchsorted(t, performed.begin + performed.times('excite')[0] + 0.5 * SPARE_S
                                + sweep.dropped * sweep.period))
    kept = slice(first, first + sweep.kept * n)
    command = recordings.at(bag, t, 'acu/rate_command', [f'{name}.velocity'])[kept, 0]
    if len(command) < sweep.kept * n or not np.isfinite(command).all():
        raise ValueError('the recording does not hold every step of the multisine')
    rows, bins = command.reshape(sweep.kept, n), sweep.bins()
    U = np.fft.rfft(rows, axis=1)[:, bins]
    usual = np.median(U.real, axis=0) + 1j * np.median(U.imag, axis=0)
    apart = np.median(np.abs(U - usual) / np.abs(usual), axis=1)
    quiet = np.sort(np.argsort(apart)[:max(MIN_PERIODS, int((apart < QUIET_RATIO * apart.min()).sum()))])
    once, correlation = sweep.once(performed.antenna.period), np.zeros(n // 2 + 1, complex)
    D = np.fft.rfft(once)[bins]
    correlation[bins] = usual * D.conj() / max(np.abs(usual) @ np.abs(D), 1e-300)
    found = np.fft.irfft(correlation, n) * 0.5 * n
    if not found.max() > MIN_CORRELATION:
        raise ValueError(f'the rate command holds no multisine: its correlation is {found.max():.2g}, must be above '
                         f'{MIN_CORRELATION:g}')
    return dataclasses.replace(sweep, dropped=0), np.roll(once, int(np.argmax(found))), rows[quiet]


def _response(sweep: Sweep, added: Floats, sent: Floats) -> Response:
    """Return the open loop; added (n,): multisine; sent: rate command of whole periods."""
    rows = sent.reshape(-1, len(added))
    kept = dataclasses.replace(sweep, kept=len(rows))
    return frequency_response.response(kept, rows.ravel(), (added - rows).ravel())


def _margin(metric: str, performed: Performed, arguments: Arguments) -> Measured:
    """Return a metric of the open loop, with the jackknife over the periods, and FRICTION_SHARE."""
    sweep, added, sent = _signals(performed, arguments)

    def of(kept: Floats) -> float:
        value = float(frequency_response.margins(_response(sweep, added, kept))[metric][0])
        if not math.isfinite(value):
            raise ValueError(f'the band from {sweep.lowest:g} to {sweep.highest:g} Hz does not show this value')
        return value
    found = of_parts(list(sent), of)
    return found.widened(FRICTION_SHARE * found.value)


def _resonance(performed: Performed, arguments: Arguments) -> Measured:
    """Return the lowest frequency at which the open loop has a notch. Without a notch, the highest frequency is the
    lower bound: no resonance is below it."""
    response = _response(*_signals(performed, arguments))
    known = response.deviation < MAX_NOISE
    if known.sum() < 2:
        raise ValueError('the recording shows the open loop at no two frequencies')
    f = response.frequency[known]
    level = 20.0 * np.log10(np.abs(response.open_loop[known]) * f)
    notches, _ = signal.find_peaks(-level, prominence=MIN_NOTCH_DB)
    k = notches[0] if len(notches) else -1
    return Measured(float(f[k]), float(np.gradient(f)[k]))


METHODS = tuple(
    Method(name, f'{doc}, by a multisine at a constant rate', unit, '>=', (servo.AXIS,), _exercise, measure)
    for name, doc, unit, measure in (
        ('gain_margin', 'gain margin of the position loop', 'dB', functools.partial(_margin, 'gain_margin_db')),
        ('phase_margin', 'phase margin of the position loop', 'deg', functools.partial(_margin, 'phase_margin_deg')),
        ('bandwidth', 'bandwidth of the position loop', 'Hz', functools.partial(_margin, 'bandwidth_hz')),
        ('resonance', 'lowest resonance of the structure on locked motors, a notch in the open loop; without a notch, '
         'the highest frequency, as its lower bound', 'Hz', _resonance)))
