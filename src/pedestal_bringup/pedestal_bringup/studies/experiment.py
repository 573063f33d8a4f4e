"""What the studies share: cases run through the composed cores, metrics of steps and sines, rows and targets."""
import dataclasses
import math
import shlex

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from pedestal_bringup.report import figures
from pedestal_bringup.run import closed_loop, scenario

SIZE = (7.4, 4.6)
"""Of a figure [inch]."""


@dataclasses.dataclass(frozen=True)
class Case:
    """A scenario with some parameters changed: parameters is {'node.key': value}, duration [s] None for its own."""
    name: str
    scenario: str
    parameters: dict = dataclasses.field(default_factory=dict)
    duration: float | None = None

    def loaded(self):
        """The scenario.Scenario of this case."""
        return scenario.load(self.scenario, self.overrides(), duration=self.duration)

    def run(self):
        """The closed loop of this case, a closed_loop.Run."""
        return closed_loop.Loop(self.loaded()).run()

    def overrides(self):
        return [f'{key}={value}' for key, value in self.parameters.items()]

    def command(self):
        """How to run the same through the nodes."""
        duration = [] if self.duration is None else ['--duration', f'{self.duration:g}']
        parameters = [part for override in self.overrides() for part in ('--param', override)]
        return shlex.join(['pedestal', 'run', self.scenario, *duration, *parameters])


def sine_case(case, w, periods):
    """A case of servo_sine with a sine of w [rad/s], for `periods` and a little more, so that the last is whole."""
    step = 0.002
    duration = math.ceil((2.0 * math.pi * periods / w + 0.01) / step) * step
    parameters = {**case.parameters, 'tracking_receiver.target.angle.frequency': w / (2.0 * math.pi)}
    return dataclasses.replace(case, parameters=parameters, duration=round(duration, 3))


@dataclasses.dataclass
class Result:
    """What a study found: rows as of `row`, figures {name: function that draws a Figure}, remarks in sentences.

    shown: the rows that are printed, where they are too many for a terminal; None: all.
    """
    rows: list
    figures: dict
    remarks: list = dataclasses.field(default_factory=list)
    shown: list | None = None


def row(case, metric, value, unit, paper=None, target=None):
    """One row of a study. paper: the printed number or None; target: a text that `meets` reads, or None."""
    return {'case': case, 'metric': metric, 'value': float(value) if math.isfinite(value) else None, 'unit': unit,
            'paper': paper, 'target': target}


def meets(value, target):
    """Whether a value meets a target: '<= 1', '>= 1', '< 1', '> 1', '1 +- 0.1' or '1 to 2'; no value meets none."""
    if value is None:
        return False
    first, word, last = ('', *target.split()) if len(target.split()) == 2 else target.split()
    last = float(last)
    return {'<=': lambda: value <= last, '>=': lambda: value >= last, '<': lambda: value < last,
            '>': lambda: value > last, '+-': lambda: abs(value - float(first)) <= last,
            'to': lambda: float(first) <= value <= last}[word]()


def missed(row):
    """Whether a row has a target and does not meet it."""
    return row['target'] is not None and not meets(row['value'], row['target'])


# Metrics. Angles [rad], times [s], arrays (n,) on one even grid of time. Not by libraries, whose numbers are others:
# control.step_info takes a settling time from the grid instead of between its points; scipy.optimize.curve_fit gives
# amplitude and period of a sine that differ by 7e-13 from those of the published rows.

def overshoot_percent(y, size):
    """How far a step response from 0 goes past its size [%]."""
    return 100.0 * max(float(np.max(y / size)) - 1.0, 0.0)


def settling_time(t, y, size, band=0.02):
    """Time after which y stays within +-band * size of size; NaN if it never does. Linear between samples."""
    off = np.abs(y / size - 1.0) - band
    outside = np.flatnonzero(off > 0.0)
    if outside.size == 0:
        return float(t[0])
    last = outside[-1]
    if last == len(t) - 1:
        return math.nan
    return float(t[last] + (t[last + 1] - t[last]) * off[last] / (off[last] - off[last + 1]))


def crossings(y, size, band=0.005):
    """How often y crosses its final value, moves within +-band * size of it not counted."""
    side = np.sign(y - size)[np.abs(y - size) > band * abs(size)]
    return int(np.sum(side[1:] != side[:-1]))


def whole_periods(t, period, skip):
    """The whole periods of a record from `skip` [s] after its start on, as a mask."""
    t = t - t[0]
    whole = math.floor((t[-1] - skip) / period + 1e-6)
    if whole < 1:
        raise ValueError(f'a record of {t[-1]:g} s has no whole period of {period:g} s after {skip:g} s')
    return (t >= skip - 1e-9) & (t < skip + whole * period - 1e-9)


def harmonic_fit(t, y, w):
    """(offset, a, b) of the least-squares fit y = offset + a sin(w t) + b cos(w t)."""
    basis = np.column_stack((np.ones_like(t), np.sin(w * t), np.cos(w * t)))
    return np.linalg.lstsq(basis, y, rcond=None)[0]


def amplitude_and_period(t, y, period):
    """Amplitude and period of a sine fitted to y by least squares (Gauss-Newton), `period` being near it."""
    w = 2.0 * math.pi / period
    middle = 0.5 * (t[0] + t[-1])
    t = t - middle
    for _ in range(20):
        offset, a, b = harmonic_fit(t, y, w)
        sine, cosine = np.sin(w * t), np.cos(w * t)
        basis = np.column_stack((np.ones_like(t), sine, cosine, t * (a * cosine - b * sine)))
        change = np.linalg.lstsq(basis, y - offset - a * sine - b * cosine, rcond=None)[0][3]
        w += change
        if abs(change) < 1e-13 * w:
            break
    _, a, b = harmonic_fit(t, y, w)
    return math.hypot(a, b), 2.0 * math.pi / w


def residual(t, y, period):
    """What the fundamental leaves of y: y - offset - a sin - b cos."""
    w = 2.0 * math.pi / period
    offset, a, b = harmonic_fit(t, y, w)
    return y - offset - a * np.sin(w * t) - b * np.cos(w * t)


def rms(y):
    return float(np.sqrt(np.mean(np.square(y))))


def peak(y):
    return float(np.max(np.abs(y)))


def panels(rows, columns=1, size=SIZE, **options):
    """(figure, axes (rows, columns)) on one sheet."""
    figure = Figure(figsize=size, layout='constrained')
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def draw_torques(axes, record):
    """Torque of both azimuth motors over time."""
    for i, (colour, style) in enumerate(((figures.MOTOR_1, '-'), (figures.MOTOR_2, '--'))):
        axes.plot(record.t, record['adu/motor_states']['effort'][:, i], style, color=colour, label=f'motor {i + 1}')


def save(draw, path):
    """Draw a figure into a PNG; the same bytes every time."""
    with matplotlib.rc_context(figures.STYLE):
        draw().savefig(path, dpi=150, facecolor='white', metadata={'Software': None})
