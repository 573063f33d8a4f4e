"""Methods of the position loop's frequency response: margins, bandwidth and resonance, by the command `excite`.

The axis moves at a constant rate while the control unit adds a multisine to its rate command. The recorded command is
the signal E of tuning.frequency_response, and the multisine less the command is its signal Y. Because the multisine is
periodic, the correlation of both over a period shows its place in the recording, to the step.
"""
import dataclasses
import math
from collections.abc import Callable

import numpy as np
from scipy import signal

from acu_tracker.servo.excitation import MAX_PEAK_RAD_S, MAX_PEAK_SHARE, MAX_SINES
from pedestal_common.multisine import Sweep
from pedestal_common.quantities import Floats, RadiansPerSecond
from pedestal_recording import recording as recordings
from pedestal_results.intervals import pseudo_values
from pedestal_workbench.acceptance import servo
from pedestal_workbench.acceptance.exercise import Action, Antenna, Exercise, Performed
from pedestal_workbench.acceptance.method import Arguments, Measured, Method
from pedestal_workbench.tuning import frequency_response
from pedestal_workbench.tuning.frequency_response import Response

SWEEP = Sweep(period=8.0, lowest=0.25, highest=95.0, points=MAX_SINES, dropped=1, kept=5, peak=0.012)
SPARE_S = 2.0           # time of the excitation before the settling [s]
MIN_CORRELATION = 0.3   # least correlation of the command and the multisine [-]
MIN_NOTCH_DB, MAX_NOISE = 3.0, 0.1      # least depth of a notch [dB], largest noise of its frequencies over |L| [-]


def _sweep(antenna: Antenna, arguments: Arguments) -> tuple[Sweep, RadiansPerSecond]:
    """Return the multisine of an exercise, and the constant rate [rad/s]."""
    axis, drive = servo.plan(antenna, arguments), servo.drive_of(antenna, str(arguments['axis']))
    limits = getattr(antenna.acu, axis.name).limits
    time = SPARE_S + (SWEEP.dropped + SWEEP.kept) * SWEEP.period
    rate = min(frequency_response.moving_rate(axis.number, axis.rate), axis.travel / (time + 2.0))
    sweep = frequency_response.in_contact(drive, SWEEP, antenna.period)
    largest = min(sweep.peak, frequency_response.PEAK_SHARE * rate, MAX_PEAK_RAD_S, MAX_PEAK_SHARE * limits.rate)
    return dataclasses.replace(sweep, peak=largest), rate


def _exercise(antenna: Antenna, arguments: Arguments) -> Exercise:
    axis = servo.plan(antenna, arguments)
    sweep, rate = _sweep(antenna, arguments)
    time = SPARE_S + (sweep.dropped + sweep.kept) * sweep.period
    half = 0.5 * rate * (time + 2.0)
    excite = (f'excite axis={axis.name} peak={sweep.peak!r} duration={time} period={sweep.period} '
              f'lowest={sweep.lowest} highest={sweep.highest!r} points={sweep.points}')
    return axis.exercise(servo.BEGIN_S + 2.0 + time, half, rate,
                         axis.preset(servo.BEGIN_S, -half, rate, 2.0 + time),
                         Action(servo.BEGIN_S + 1.0, 'acu', excite), start=-half)


def _signals(performed: Performed, arguments: Arguments) -> tuple[Sweep, Floats, Floats]:
    """Return (multisine, rate command, record of the multisine) of the kept periods. Raises ValueError."""
    sweep, _ = _sweep(performed.antenna, arguments)
    name, bag, n = str(arguments['axis']), performed.recording, round(sweep.period / performed.antenna.period)
    if missing := recordings.missing(bag, 'joint_states', 'acu/rate_command'):
        raise ValueError(f'the recording holds no {missing}')
    t = bag.table('joint_states')['t']
    first = int(np.searchsorted(t, performed.begin + servo.executed_at(performed, 1) + SPARE_S
                                + sweep.dropped * sweep.period))
    kept = slice(first, first + sweep.kept * n)
    command = recordings.at(bag, t, 'acu/rate_command', [f'{name}.velocity'])[kept, 0]
    if len(command) < sweep.kept * n or not np.isfinite(command).all():
        raise ValueError('the recording does not hold every step of the multisine')
    once = sweep.once(performed.antenna.period)
    mean = command.reshape(sweep.kept, n).mean(axis=0)
    U, D = (np.fft.rfft(x) for x in (mean, once))
    chosen = np.zeros(len(U))
    chosen[sweep.bins()] = 1.0
    correlation = np.fft.irfft(chosen * U * D.conj(), n) / (np.abs(chosen * U) @ np.abs(D)) * 0.5 * n
    shift = int(np.argmax(correlation))
    if correlation[shift] < MIN_CORRELATION:
        raise ValueError(f'the rate command holds no multisine: its correlation is {correlation[shift]:.2g}, must be '
                         f'at least {MIN_CORRELATION:g}')
    return sweep, command, np.tile(np.roll(once, shift), sweep.kept)


def _measured(performed: Performed, arguments: Arguments, statistic: Callable[[Response], float]) -> Measured:
    """Return a statistic of the open loop, with the jackknife over the periods."""
    sweep, sent, added = _signals(performed, arguments)
    rows = list(np.stack((sent.reshape(sweep.kept, -1), (added - sent).reshape(sweep.kept, -1)), axis=1))

    def of(kept: list[Floats]) -> float:
        part = dataclasses.replace(sweep, dropped=0, kept=len(kept))
        value = statistic(frequency_response.response(part, *np.concatenate(kept, axis=1)))
        if not math.isfinite(value):
            raise ValueError(f'the band from {sweep.lowest:g} to {sweep.highest:g} Hz does not show this value')
        return value
    return Measured(of(rows), servo.half_width(pseudo_values(rows, of)))


def _margin(metric: str) -> Callable[[Performed, Arguments], Measured]:
    return lambda performed, arguments: _measured(
        performed, arguments, lambda response: float(frequency_response.margins(response)[metric][0]))


def _resonance(performed: Performed, arguments: Arguments) -> Measured:
    """Return the lowest frequency at which the open loop has a notch, the highest one for none."""
    sweep, sent, added = _signals(performed, arguments)
    response = frequency_response.response(dataclasses.replace(sweep, dropped=0), sent, added - sent)
    known = response.deviation < MAX_NOISE
    f = response.frequency[known]
    level = 20.0 * np.log10(np.abs(response.open_loop[known]) * f)
    notches, _ = signal.find_peaks(-level, prominence=MIN_NOTCH_DB)
    k = notches[0] if len(notches) else -1
    return Measured(float(f[k]), float(np.gradient(f)[k]))


METHODS = tuple(
    Method(name, f'{doc}, by a multisine at a constant rate', unit, '>=', (servo.AXIS,), _exercise, measure)
    for name, doc, unit, measure in (
        ('gain_margin', 'gain margin of the position loop', 'dB', _margin('gain_margin_db')),
        ('phase_margin', 'phase margin of the position loop', 'deg', _margin('phase_margin_deg')),
        ('bandwidth', 'bandwidth of the position loop', 'Hz', _margin('bandwidth_hz')),
        ('resonance', 'lowest resonance of the structure on locked motors, a notch in the open loop; without one the '
         'highest frequency', 'Hz', _resonance)))
