"""Identification of the rate loop of an axis on the drive core, and the feed-forward gains that follow from the loop.

Small sines of a few low frequencies are added to a constant rate. At that rate friction is constant and the bias
torque keeps the teeth closed. W(jw) is the response of the antenna's rate without the known delay: transport plus half
a period of the hold, which the ACU's prediction covers. Least squares fit the series

    1 / W(jw) = f_1 + f_2 jw + f_3 (jw)^2 + f_4 (jw)^3.

The rate command k_v v + k_a a needs k_v = f_1, k_a = f_2 (paper 003, eq. 14 to 18, as corrected in
acu_tracker.servo.feedforward).
"""
import dataclasses
import math

import numpy as np

from acu_tracker.servo import feedforward
from adu_drive import drive_unit
from adu_drive.params import WindParameters
from pedestal_common.compiled import compiled
from pedestal_common.graph import topics
from pedestal_common.parameters import record

SINE_FREQUENCIES_HZ = np.array([0.25, 0.5, 1.0, 1.5, 2.0, 2.5])
"""Frequencies of the excitation, each with whole periods in COMMON_PERIOD_S [Hz]."""
COMMON_PERIOD_S = 4.0
"""Period of the sum of the sines [s]."""
SETTLING_PERIODS, MEASURED_PERIODS = 1, 2
"""Numbers of common periods to settle and to measure."""
SERIES_TERMS = 4
"""Number of terms of the series of 1 / W."""
IDENTIFICATION_RATES_RAD_S = (0.1, 0.06)
"""Constant rates of azimuth and elevation, above the excitation and inside the travel for a whole record [rad/s]."""
SINE_PEAK_RAD_S = 0.004
"""Peak of each sine [rad/s]."""


@dataclasses.dataclass(frozen=True)
class RateLoop:
    """Identified rate loop of one axis: W (n,) complex at w (n,) [rad/s]; f (SERIES_TERMS,): series of 1 / W."""
    w: np.ndarray
    W: np.ndarray
    f: np.ndarray

    @property
    def k_v(self):
        """Feed-forward gain of the reference's rate [-]."""
        return float(self.f[0])

    @property
    def k_a(self):
        """Feed-forward gain of the reference's acceleration [s]."""
        return float(self.f[1])

    def error(self, k_v, k_a):
        """Return |1 - (k_v + k_a jw) W| (n,), the relative angle error that a feed-forward leaves."""
        return np.abs(1.0 - (k_v + 1j * k_a * self.w) * self.W)


def series(w, W, terms=SERIES_TERMS):
    """Return f (terms,) of the least-squares fit 1 / W(jw) = f_1 + f_2 jw + f_3 (jw)^2 + ..."""
    basis = (1j * w[:, np.newaxis]) ** np.arange(terms)
    wanted = 1.0 / W
    return np.linalg.lstsq(np.concatenate((basis.real, basis.imag)), np.concatenate((wanted.real, wanted.imag)),
                           rcond=None)[0]


def response(commanded, position, T, delay, w):
    """Return W (n,) at w (n,) [rad/s] of a rate loop, without its delay and its hold.

    commanded (m,): rates [rad/s], each held for T [s] from t_k + delay [s] on; position (m,): angle [rad] at t_k.
    The record contains whole periods of each w. A linear trend is removed.
    """
    t = T * (np.arange(len(commanded)) - 0.5 * (len(commanded) - 1))
    waves = np.cos(w * t[:, np.newaxis]), np.sin(w * t[:, np.newaxis])
    basis = np.column_stack((np.ones_like(t), t, *waves))
    fit = np.linalg.lstsq(basis, np.column_stack((commanded, position)), rcond=None)[0][2:]
    U, Y = (fit[:len(w)] - 1j * fit[len(w):]).T
    return 1j * w * Y / (U * np.sinc(0.5 * w * T / math.pi)) * np.exp(1j * w * (delay + 0.5 * T))


@compiled
def _drive(state, constants, inputs, outputs, rate, torque, position):
    """Fill position (n, 2) [rad] with the encoders before each step with the commands rate and torque (n, 2)."""
    u, y = inputs[0], outputs[0]
    for k in range(len(rate)):
        position[k, 0], position[k, 1] = y.azimuth.position, y.elevation.position
        u.azimuth.rate, u.elevation.rate = rate[k, 0], rate[k, 1]
        u.azimuth.torque, u.elevation.torque = torque[k, 0], torque[k, 1]
        drive_unit.step(state[0], constants[0], inputs[0], outputs[0])


def identify(scenario, torque=True) -> dict:
    """Return {axis: RateLoop} of a scenario's drive in still air.

    torque: True to include the ACU's torque feed-forward. Raises ValueError if the period of the drive does not divide
    COMMON_PERIOD_S or if the travel is too short.
    """
    acu, drive = scenario.node_parameters('acu'), scenario.node_parameters('adu')
    axes = [getattr(drive, name) for name in topics.AXES]
    duration = (SETTLING_PERIODS + MEASURED_PERIODS) * COMMON_PERIOD_S
    start = {f'initial_{name}': 0.5 * (axis.limits.lower + axis.limits.upper - rate * duration)
             for name, axis, rate in zip(topics.AXES, axes, IDENTIFICATION_RATES_RAD_S)}
    drive = dataclasses.replace(drive, wind=WindParameters(), initially_enabled=True, **start)
    w = 2.0 * math.pi * SINE_FREQUENCIES_HZ
    steps = round(COMMON_PERIOD_S / drive.period)
    if abs(steps * drive.period - COMMON_PERIOD_S) > 1e-9:
        raise ValueError(f'adu.period = {drive.period:g} s: must divide {COMMON_PERIOD_S:g} s, the period of the '
                         'identification')
    for name, axis, turn in zip(topics.AXES, axes, IDENTIFICATION_RATES_RAD_S):
        if axis.limits.upper - axis.limits.lower < 1.1 * turn * duration:
            raise ValueError(f'adu.{name}.limits: travel must be at least '
                             f'{1.1 * turn * duration:g} rad to identify the drive')
    # Because Schroeder's phases keep the peak of the sum low, the sines have these phases.
    k = np.arange(len(w))
    angle = w * drive.period * np.arange(steps)[:, np.newaxis] - math.pi * k * (k + 1) / len(k)
    v, a = SINE_PEAK_RAD_S * np.cos(angle).sum(axis=1), -SINE_PEAK_RAD_S * (w * np.sin(angle)).sum(axis=1)
    v, acceleration = (np.tile(motion, SETTLING_PERIODS + MEASURED_PERIODS) for motion in (v, a))
    rate = v[:, np.newaxis] + IDENTIFICATION_RATES_RAD_S
    torques = np.zeros_like(rate)
    for i, name in enumerate(topics.AXES if torque else ()):
        known = record(getattr(acu, name).feedforward)[0]
        torques[:, i] = [feedforward.torque(*motion, known) for motion in zip(rate[:, i], acceleration)]
    state, constants = drive_unit.initial_state(drive), drive_unit.constants(drive)
    inputs, outputs = np.zeros(1, drive_unit.INPUTS_DTYPE), np.zeros(1, drive_unit.OUTPUTS_DTYPE)
    inputs['enable'] = 1
    drive_unit.read(state[0], constants[0], outputs[0])
    position = np.empty_like(rate)
    _drive(state, constants, inputs, outputs, rate, torques, position)
    kept = slice(SETTLING_PERIODS * steps, None)
    loops = {}
    for i, name in enumerate(topics.AXES):
        W = response(rate[kept, i], position[kept, i], drive.period, drive.transport_delay, w)
        loops[name] = RateLoop(w, W, series(w, W))
    return loops
