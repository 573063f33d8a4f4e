"""Open-loop and closed-loop response of the current, speed and position loops to a multisine, on the simulated plant.

A signal is added inside a loop at its break point while the axis moves at a constant rate, where friction is a
constant and the bias keeps the teeth closed. The signal sent on from there is E, the returned one -Y; at the excited
frequencies the open loop is L = Y / E, the closed loop T = L / (1 + L). It uses no model of a controller:

    current     added to i_ref, every 100 us        E = i_ref - i_q            Y = i_q
    speed       added to the rate command, 0.5 ms   E = rate - mean speed / N  Y = mean speed / N from the encoders
    position    added between ACU and drive, T      E = rate the drive gets    Y = -(rate the ACU commands)
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
SWEEP_START_ANGLES_RAD = (-2.0, 0.15)
"""Where the axes start [rad]."""

SWEEP_RATES_RAD_S = (0.1, 0.03)
"""Rates of the axes [rad/s]: far above the excitation and the Stribeck rate, inside the travel for a whole record."""


@dataclasses.dataclass(frozen=True)
class Sweep:
    """A multisine: `points` frequencies, evenly spaced in log from `lowest` to `highest` [Hz], on whole periods of
    `period` [s]; `dropped` periods to settle, `kept` to measure; largest value `peak`."""
    period: float
    lowest: float
    highest: float
    points: int
    dropped: int
    kept: int
    peak: float

    def bins(self):
        """Frequencies as whole multiples of 1 / period."""
        return np.unique(np.round(np.geomspace(self.lowest, self.highest, self.points) * self.period).astype(int))

    def frequencies(self):
        """Excited frequencies (points,) [Hz], or fewer where two fall on one."""
        return self.bins() / self.period

    def signal(self, step):
        """The whole record (n,) at one value per `step` [s]: equal amplitudes, Schroeder's phases (IEEE Trans.
        Information Theory 16 (1970) 85), which keep the peak low."""
        n = round(self.period / step)
        k = np.arange(len(self.bins()))
        spectrum = np.zeros(n // 2 + 1, complex)
        spectrum[self.bins()] = np.exp(-1j * math.pi * k * (k + 1) / len(k))
        one = np.fft.irfft(spectrum, n)
        return np.tile(self.peak / np.abs(one).max() * one, self.dropped + self.kept)


CURRENT_SWEEP = Sweep(0.1, 10.0, 4000.0, 60, 5, 5, 1.5)
"""Peak in A."""

SPEED_SWEEP = Sweep(1.0, 1.0, 900.0, 120, 2, 4, 0.015)
"""Peak in rad/s of the load: 6 Nm of a motor, less than the bias."""

POSITION_SWEEP = Sweep(8.0, 0.25, 95.0, 300, 2, 3, 0.012)
"""Peak in rad/s: half of what would open the teeth at the paper's 5 Nm of bias. Up to nearly half of 1 / 5 ms."""


@dataclasses.dataclass(frozen=True)
class Response:
    """Open loop (n,) complex at the frequencies (n,) [Hz]; deviation (n,): its relative standard deviation [-]."""
    frequency: np.ndarray
    open_loop: np.ndarray
    deviation: np.ndarray

    @property
    def closed_loop(self):
        """T = L / (1 + L) (n,)."""
        return self.open_loop / (1.0 + self.open_loop)


def response(sweep, sent, returned):
    """Response of a loop from the signals sent on from its break point and returned to it, two records (n,)."""
    E, Y = (np.fft.rfft(x.reshape(sweep.dropped + sweep.kept, -1)[sweep.dropped:], axis=1)[:, sweep.bins()]
            for x in (sent, returned))
    with np.errstate(invalid='ignore'):  # nothing comes back of a drive that has tripped
        L = Y.mean(axis=0) / E.mean(axis=0)
        return Response(sweep.frequencies(), L, np.std(Y / E / L, axis=0) / math.sqrt(sweep.kept - 1))


@compiled
def _inner_loops(s, c, substeps, rate, current, speed, wanted, made):
    """One axis from rest: rate (n,) [rad/s] commanded each speed period, current (5 n,) [A] added to both i_ref each
    current period, to the speed (n,) [rad/s] of the axis and i_ref, i_q of both motors (5 n, 2) [A]."""
    m1, m2, k1, k2 = s.motor_1, s.motor_2, c.motor_1, c.motor_2
    axis.begin_period(s, c, False)        # brakes off, windings cold throughout
    for n in range(len(rate)):
        axis.speed_control(s, c, rate[n], 0.0, 1, True, True)
        speed[n] = c.per_2N * (m1.measured + m2.measured)
        i_1, i_2 = m1.i_ref, m2.i_ref
        for k in range(n * axis.CURRENT_LOOP_STEP_COUNT, (n + 1) * axis.CURRENT_LOOP_STEP_COUNT):
            m1.i_ref, m2.i_ref = i_1 + current[k], i_2 + current[k]
            wanted[k, 0], wanted[k, 1], made[k, 0], made[k, 1] = m1.i_ref, m2.i_ref, m1.i_q, m2.i_q
            axis.current_control(m1, k1)
            axis.current_control(m2, k2)
            for _ in range(substeps):
                axis.plant_step(s, c, 0.0)


def _run_inner(drive, index, rate, current):
    """(speed (n,) [rad/s], i_ref, i_q (5 n, 2) [A]) of axis `index` of a drive (AduParameters), with signals added to
    its rate command (n,) [rad/s] and current references (5 n,) [A]."""
    drive = dataclasses.replace(drive, initial_azimuth=SWEEP_START_ANGLES_RAD[0],
                                initial_elevation=SWEEP_START_ANGLES_RAD[1])
    speed, wanted, made = np.zeros(len(rate)), np.zeros((len(current), 2)), np.zeros((len(current), 2))
    [s], [c] = drive_unit.initial_state(drive), drive_unit.constants(drive)
    _inner_loops(s[AXES[index]], c[AXES[index]], c['substeps'], SWEEP_RATES_RAD_S[index] + rate, current, speed,
                 wanted, made)
    return speed, wanted, made


def current(drive, sweep=CURRENT_SWEEP):
    """Responses of the current loops of the azimuth's motors: {name: Response}."""
    added = sweep.signal(axis.CURRENT_LOOP_PERIOD_S)
    _, wanted, made = _run_inner(drive, 0, np.zeros(len(added) // axis.CURRENT_LOOP_STEP_COUNT), added)
    return {f'current/{motor}': response(sweep, wanted[:, j] - made[:, j], made[:, j])
            for j, motor in enumerate(MOTOR_FIELDS)}


def speed(drive, sweep=SPEED_SWEEP):
    """Responses of the speed loops of both axes: {name: Response}."""
    added, responses = sweep.signal(axis.SPEED_LOOP_PERIOD_S), {}
    for i, name in enumerate(AXES):
        measured, _, _ = _run_inner(drive, i, added, np.zeros(len(added) * axis.CURRENT_LOOP_STEP_COUNT))
        responses[f'speed/{name}'] = response(sweep, SWEEP_RATES_RAD_S[i] + added - measured, measured)
    return responses


MOVING_CASE_PARAMETERS = {
    'acu.tracker.handover': False, 'scenario.program.time_offset': 0.0, 'scenario.program.interval': 1.0,
    'adu.initial_azimuth': SWEEP_START_ANGLES_RAD[0], 'adu.initial_elevation': SWEEP_START_ANGLES_RAD[1],
    'tracking_receiver.target.kind': 'ramp',
    'tracking_receiver.target.angle.azimuth': SWEEP_START_ANGLES_RAD[0],
    'tracking_receiver.target.angle.elevation': SWEEP_START_ANGLES_RAD[1],
    'tracking_receiver.target.angle.azimuth_rate': SWEEP_RATES_RAD_S[0],
    'tracking_receiver.target.angle.elevation_rate': SWEEP_RATES_RAD_S[1]}
"""Both axes follow a program track of constant rates."""


def case(name, scenario, parameters):
    """The Case of a position loop: a scenario with parameters changed, moving at constant rates."""
    return Case(name, scenario, {**MOVING_CASE_PARAMETERS, **parameters})


def position(case, axes=AXES, sweep=POSITION_SWEEP):
    """Responses of the position loops of a case: {name: Response}."""
    loaded = dataclasses.replace(case, duration=(sweep.dropped + sweep.kept) * sweep.period).loaded()
    loop = closed_loop.Loop(loaded)
    added = np.zeros((loop.steps, 2))
    added[:-1] = sweep.signal(loop.period_ns * 1e-9)[:, np.newaxis]
    commanded = loop.run(added)['acu/rate_command']['velocity']
    return {f'position/{name}/{case.name}': response(sweep, (commanded + added)[:-1, i], -commanded[:-1, i])
            for i, name in enumerate(AXES) if name in axes}


def _crossings(f, y, angle):
    """(frequencies [Hz], angles [rad]) of the zeros of y (n,): both linear in log f, the angle along the short way."""
    i = np.flatnonzero(y[:-1] * y[1:] <= 0.0)
    share = y[i] / (y[i] - y[i + 1])
    change = np.angle(np.exp(1j * (angle[i + 1] - angle[i])))
    return f[i] * (f[i + 1] / f[i]) ** share, angle[i] + share * change


def margins(measured):
    """{metric: (value, unit)} of a Response; NaN where the band has no such frequency.

    crossover: where |L| first falls below 1. phase_margin: the smallest phase shift, of either sign, that puts a point
    of |L| = 1 on -1. gain_margin: the smallest gain that puts a point on -1. bandwidth: where |T| first falls below
    -3 dB. peak: of |T|.
    """
    f, L, T = measured.frequency, measured.open_loop, np.abs(measured.closed_loop)
    gain, from_minus_one = np.log(np.abs(L)), np.angle(-L)
    crossover, margin = _crossings(f, gain, from_minus_one)
    margin = np.abs(np.angle(np.exp(1j * margin)))
    near = np.where(np.abs(from_minus_one) < 0.5 * math.pi, from_minus_one, np.nan)
    _, at_minus = _crossings(f, near, gain)
    at_minus = at_minus[at_minus < 0.0]
    below = _crossings(f, np.log(T) - 0.5 * math.log(0.5), T)[0]
    return {'bandwidth_hz': (below[0] if below.size else math.nan, 'Hz'),
            'crossover_hz': (crossover[0] if crossover.size else math.nan, 'Hz'),
            'gain_margin_db': (-20.0 / math.log(10.0) * at_minus.max() if at_minus.size else math.nan, 'dB'),
            'phase_margin_deg': (math.degrees(margin.min()) if margin.size else math.nan, 'deg'),
            'peak_db': (20.0 * math.log10(T.max()), 'dB')}
