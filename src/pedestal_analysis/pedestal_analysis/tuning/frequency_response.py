"""Open-loop and closed-loop response of the current, speed and position loops to a multisine, on the simulated plant.

A signal is added inside a loop at its break point while the axis moves at a constant rate. At that rate friction is
constant and the bias torque keeps the teeth closed. E is the signal after the break point, -Y the signal that returns
to it. At the excited frequencies the open loop is L = Y / E and the closed loop T = L / (1 + L). The method needs no
model of a controller.

A current period of a run has two steps of the plant. With them the swing of the motors in their meshes is damped too
well, and the margins of the speed loop are up to 0.9 dB and 3 deg too good. Because of this error, the current and the
speed loop are measured with SUB_STEP_COUNT steps.

    current     added to i_ref, every 100 us        E = i_ref - i_q            Y = i_q
    speed       added to the rate command, 0.5 ms   E = rate - mean speed / N  Y = mean speed / N from the encoders
    position    added between ACU and drive, T      E = rate to the drive      Y = -(rate commanded by the ACU)
"""
import dataclasses
import math

import numpy as np

from adu_drive import axis, drive_unit
from pedestal_analysis.trials.cases import Case
from pedestal_bringup.loop import closed_loop
from pedestal_common.compiled import compiled
from pedestal_common.graph.topics import AXES

MOTOR_FIELDS = ('motor_1', 'motor_2')
"""Fields of the motors in the state of an axis."""
SWEEP_START_ANGLES_RAD = (-2.0, 0.15)
"""Initial angles of azimuth and elevation [rad]."""

SWEEP_RATES_RAD_S = (0.1, 0.03)
"""Constant rates of the axes, far above the excitation and the Stribeck rate, with room for a whole record [rad/s].

A slow axis moves at RATE_SHARE of its largest rate. The excitation is at most PEAK_SHARE of the rate.
"""

RATE_SHARE, PEAK_SHARE = 1.0 / 3.0, 0.5
"""Largest ratios of the rate of a measurement to the largest rate of the axis, and of excitation to rate [-]."""

SUB_STEP_COUNT = 10
"""Number of plant steps in a current period while the current and the speed loop are measured."""


@dataclasses.dataclass(frozen=True)
class Sweep:
    """A multisine with the largest value `peak`.

    It has `points` frequencies, logarithmically spaced from `lowest` to `highest` [Hz], each with whole periods in
    `period` [s]. `dropped` periods settle and `kept` periods are measured.
    """
    period: float
    lowest: float
    highest: float
    points: int
    dropped: int
    kept: int
    peak: float

    def bins(self):
        """Return the frequencies as integer multiples of 1 / period."""
        return np.unique(np.round(np.geomspace(self.lowest, self.highest, self.points) * self.period).astype(int))

    def frequencies(self):
        """Return the excited frequencies (points,) [Hz]; less if several round to the same frequency."""
        return self.bins() / self.period

    def signal(self, step):
        """Return the whole record (n,) with one value per `step` [s].

        The amplitudes are equal. The phases of Schroeder (IEEE Trans. Information Theory 16 (1970) 85) keep the peak
        low.
        """
        n = round(self.period / step)
        k = np.arange(len(self.bins()))
        spectrum = np.zeros(n // 2 + 1, complex)
        spectrum[self.bins()] = np.exp(-1j * math.pi * k * (k + 1) / len(k))
        one = np.fft.irfft(spectrum, n)
        return np.tile(self.peak / np.abs(one).max() * one, self.dropped + self.kept)


CURRENT_SWEEP = Sweep(period=0.1, lowest=10.0, highest=4000.0, points=60, dropped=5, kept=5, peak=1.5)
"""Sweep of the current loop; peak in A."""

SPEED_SWEEP = Sweep(period=1.0, lowest=1.0, highest=900.0, points=120, dropped=2, kept=4, peak=0.015)
"""Sweep of the speed loop; peak in rad/s of the load: 6 Nm of a motor, less than the bias torque."""

FLEXIBLE_SPEED_SWEEP = dataclasses.replace(SPEED_SWEEP, period=8.0, lowest=0.25, points=400, dropped=3, kept=2)
"""Sweep of the speed loop of a flexible axis, whose swing is narrow and decays slowly."""

POSITION_SWEEP = Sweep(period=8.0, lowest=0.25, highest=95.0, points=300, dropped=2, kept=3, peak=0.012)
"""Sweep of the position loop, up to nearly half of 1 / 5 ms; peak in rad/s.

The peak is half of the value that opens the teeth at the 5 Nm of bias torque of the paper.
"""


@dataclasses.dataclass(frozen=True)
class Response:
    """Open loop (n,) complex at the frequencies (n,) [Hz]; deviation (n,): relative standard deviation [-]."""
    frequency: np.ndarray
    open_loop: np.ndarray
    deviation: np.ndarray

    @property
    def closed_loop(self):
        """Closed loop T = L / (1 + L) (n,)."""
        return self.open_loop / (1.0 + self.open_loop)


def response(sweep, sent, returned):
    """Return the Response of a loop from the records (n,) of the signals after its break point and returned to it."""
    E, Y = (np.fft.rfft(x.reshape(sweep.dropped + sweep.kept, -1)[sweep.dropped:], axis=1)[:, sweep.bins()]
            for x in (sent, returned))
    with np.errstate(invalid='ignore'):  # a tripped drive returns no signal
        L = Y.mean(axis=0) / E.mean(axis=0)
        return Response(sweep.frequencies(), L, np.std(Y / E / L, axis=0) / math.sqrt(sweep.kept - 1))


@compiled
def _inner_loops(s, c, substeps, rate, current, speed, wanted, made):
    """Run one axis from rest; fill speed (n,) [rad/s] of the axis and wanted (i_ref), made (i_q) (5 n, 2) [A].

    rate (n,) [rad/s]: command of each speed period; current (5 n,) [A]: added to both i_ref in each current period.
    """
    m1, m2, k1, k2 = s.motor_1, s.motor_2, c.motor_1, c.motor_2
    axis.begin_period(s, c, False)        # brakes off; the windings stay cold
    for n in range(len(rate)):
        axis.speed_control(s, c, rate[n], 0.0, 1, True, True)    # feed-forward torque, enable, powered, no brake
        speed[n] = c.per_2N * (m1.measured + m2.measured)
        i_1, i_2 = m1.i_ref, m2.i_ref
        for k in range(n * axis.CURRENT_LOOP_STEP_COUNT, (n + 1) * axis.CURRENT_LOOP_STEP_COUNT):
            m1.i_ref, m2.i_ref = i_1 + current[k], i_2 + current[k]
            wanted[k, 0], wanted[k, 1], made[k, 0], made[k, 1] = m1.i_ref, m2.i_ref, m1.i_q, m2.i_q
            axis.current_control(m1, k1)
            axis.current_control(m2, k2)
            for _ in range(substeps):
                axis.plant_step(s, c, 0.0)


def _rate(index, *largest):
    """Return the rate [rad/s] at which axis `index` is measured; largest: its rate limits [rad/s]."""
    return min(SWEEP_RATES_RAD_S[index], RATE_SHARE * min(largest))


def _run_inner(drive, index, rate, current):
    """Return (speed (n,) [rad/s], i_ref, i_q (5 n, 2) [A]) of axis `index` of a drive (AduParameters).

    rate (n,) [rad/s]: rate command; current (5 n,) [A]: signal added to the current references.
    """
    drive = dataclasses.replace(drive, initial_azimuth=SWEEP_START_ANGLES_RAD[0],
                                initial_elevation=SWEEP_START_ANGLES_RAD[1])
    speed, wanted, made = np.zeros(len(rate)), np.zeros((len(current), 2)), np.zeros((len(current), 2))
    [s], [c] = drive_unit.initial_state(drive), drive_unit.constants(drive, SUB_STEP_COUNT)
    _inner_loops(s[AXES[index]], c[AXES[index]], c['substeps'], rate, current, speed, wanted, made)
    return speed, wanted, made


def current(drive, sweep=CURRENT_SWEEP):
    """Return the Responses {name: Response} of the current loops of both azimuth motors."""
    added = sweep.signal(axis.CURRENT_LOOP_PERIOD_S)
    rate = np.full(len(added) // axis.CURRENT_LOOP_STEP_COUNT, _rate(0, drive.azimuth.limits.rate))
    _, wanted, made = _run_inner(drive, 0, rate, added)
    return {f'current/{motor}': response(sweep, wanted[:, j] - made[:, j], made[:, j])
            for j, motor in enumerate(MOTOR_FIELDS)}


def speed(drive, sweep=SPEED_SWEEP, axes=AXES):
    """Return the Responses {name: Response} of the speed loops of some axes."""
    responses = {}
    for i, name in ((AXES.index(name), name) for name in axes):
        rate = _rate(i, getattr(drive, name).limits.rate)
        command = rate + _at_most(sweep, rate).signal(axis.SPEED_LOOP_PERIOD_S)
        measured, _, _ = _run_inner(drive, i, command, np.zeros(len(command) * axis.CURRENT_LOOP_STEP_COUNT))
        responses[f'speed/{name}'] = response(sweep, command - measured, measured)
    return responses


def _at_most(sweep, *rates):
    """Return a Sweep for axes that move at `rates` [rad/s]."""
    return dataclasses.replace(sweep, peak=min(sweep.peak, PEAK_SHARE * min(rates)))


MOVING_CASE_PARAMETERS = {
    'acu.tracker.handover': False, 'scenario.program.time_offset': 0.0, 'scenario.program.interval': 1.0,
    'adu.initial_azimuth': SWEEP_START_ANGLES_RAD[0], 'adu.initial_elevation': SWEEP_START_ANGLES_RAD[1],
    'tracking_receiver.target.kind': 'ramp',
    'tracking_receiver.target.angle.azimuth': SWEEP_START_ANGLES_RAD[0],
    'tracking_receiver.target.angle.elevation': SWEEP_START_ANGLES_RAD[1]}
"""Parameters for a program track of constant rates on both axes, which `position` sets."""


def case(name, scenario, parameters):
    """Return the Case of a position loop: a scenario with changed parameters, moving at constant rates."""
    return Case(name, scenario, {**MOVING_CASE_PARAMETERS, **parameters})


def _moving(case):
    """Return the Case with the rates at which its axes are measured, and these rates [rad/s]."""
    loaded = case.loaded()
    drive, acu = (loaded.node_parameters(node) for node in ('adu', 'acu'))
    rates = [_rate(i, getattr(drive, name).limits.rate, getattr(acu, name).limits.rate,
                   getattr(acu, name).shaper.rate) for i, name in enumerate(AXES)]
    moved = {f'tracking_receiver.target.angle.{name}_rate': rate for name, rate in zip(AXES, rates)}
    return dataclasses.replace(case, parameters={**case.parameters, **moved}), rates


def position(case, axes=AXES, sweep=POSITION_SWEEP):
    """Return the Responses {name: Response} of the position loops of a case."""
    case, rates = _moving(case)
    loaded = dataclasses.replace(case, duration=(sweep.dropped + sweep.kept) * sweep.period).loaded()
    loop = closed_loop.Loop(loaded)
    added = np.zeros((loop.steps, 2))
    added[:-1] = _at_most(sweep, *rates).signal(loop.period_ns * 1e-9)[:, np.newaxis]
    commanded = loop.run(added)['acu/rate_command']['velocity']
    return {f'position/{name}/{case.name}': response(sweep, (commanded + added)[:-1, i], -commanded[:-1, i])
            for i, name in enumerate(AXES) if name in axes}


def _crossings(f, y, angle):
    """Return (frequencies [Hz], angles [rad]) at the zeros of y (n,), both interpolated linearly in log f.

    The angle changes by the short way round.
    """
    i = np.flatnonzero(y[:-1] * y[1:] <= 0.0)
    share = y[i] / (y[i] - y[i + 1])
    change = np.angle(np.exp(1j * (angle[i + 1] - angle[i])))
    return f[i] * (f[i + 1] / f[i]) ** share, angle[i] + share * change


def without_gain_margin(names):
    """Return a line on the loops of these names, which have no gain margin; [] without a name."""
    if not names:
        return []
    return [f'no gain margin of {", ".join(names)}: the open loop does not reach -180 deg in the measured band, so no '
            'higher gain makes the loop unstable there']


def margins(measured, above=0.0):
    """Return {metric: (value, unit)} of a Response; NaN if the band has no such frequency.

    crossover     first frequency from `above` [Hz] on at which |L| falls below 1
    phase_margin  smallest phase shift, of either sign, that moves a point of |L| = 1 to -1
    gain_margin   smallest gain that moves a point to -1
    bandwidth     first frequency at which |T| falls below -3 dB
    peak          largest |T|
    """
    f, L, T = measured.frequency, measured.open_loop, np.abs(measured.closed_loop)
    gain, from_minus_one = np.log(np.abs(L)), np.angle(-L)
    crossover, margin = _crossings(f, gain, from_minus_one)
    crossover = crossover[crossover >= above]
    margin = np.abs(np.angle(np.exp(1j * margin)))
    # Points of L on the negative real axis, by the logarithm of their gain; a gain above 1 (log above 0) is left out.
    near = np.where(np.abs(from_minus_one) < 0.5 * math.pi, from_minus_one, np.nan)
    _, at_minus = _crossings(f, near, gain)
    at_minus = at_minus[at_minus < 0.0]
    below = _crossings(f, np.log(T) - 0.5 * math.log(0.5), T)[0]
    return {'bandwidth_hz': (below[0] if below.size else math.nan, 'Hz'),
            'crossover_hz': (crossover[0] if crossover.size else math.nan, 'Hz'),
            'gain_margin_db': (-20.0 / math.log(10.0) * at_minus.max() if at_minus.size else math.nan, 'dB'),
            'phase_margin_deg': (math.degrees(margin.min()) if margin.size else math.nan, 'deg'),
            'peak_db': (20.0 * math.log10(T.max()), 'dB')}
