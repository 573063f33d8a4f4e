"""Identification of the rate loop of each axis by a simulated test of the drive, for `pedestal tune --feedforward`.
The test adds small sines of a few low frequencies to a constant rate. At this rate the friction is constant, and the
bias torque keeps the teeth in contact.

W(jw) is the frequency response of the rate loop, from the rate command to the rate of the axis, at the angular
frequency w [rad/s], without its known delay. This delay is the transport delay plus half a period, because the drive
holds each command for one period. The prediction of the ACU covers it. Least squares fit the terms f_1 to f_4 of

    1 / W(jw) = f_1 + f_2 jw + f_3 (jw)^2 + f_4 (jw)^3.

The feed-forward adds k_v v + k_a a to the rate command, from rate v [rad/s] and acceleration a [rad/s2] of the
reference. It needs k_v = f_1 [-] and k_a = f_2 [s]. Source: Lin 2020, eq. 14 to 18, as corrected in
acu_tracker.servo.controllers.
"""
import dataclasses
import math
from typing import Annotated

import numpy as np

from acu_tracker.servo import controllers
from adu_drive import drive_unit
from drive_law.params import AduParameters, WindParameters
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_common.compiled import compiled
from pedestal_common.graph import topics
from pedestal_common.parameters import record
from pedestal_common.quantities import Complexes, Floats, Pairs, Records, Seconds

SINE_FREQUENCIES_HZ = np.array([0.25, 0.5, 1.0, 1.5, 2.0, 2.5])
"""Frequencies of the sines [Hz]. Each has a whole number of periods in COMMON_PERIOD_S."""
COMMON_PERIOD_S = 4.0  # period of the sum of all sines [s]
SETTLING_PERIODS, MEASURED_PERIODS = 1, 2  # numbers of common periods
SERIES_TERMS = 4  # number of terms of the series of 1 / W
IDENTIFICATION_RATES_RAD_S = (0.1, 0.06)
"""Constant rates of azimuth and elevation [rad/s], larger than the sum of the sines, so the axis never turns back. A
whole test stays inside the travel."""
SINE_PEAK_RAD_S = 0.004  # amplitude of each sine [rad/s]


@dataclasses.dataclass(frozen=True)
class RateLoop:
    """Identified rate loop of one axis."""
    w: Floats       # angular frequencies [rad/s]
    W: Complexes    # response without the known delay at w [-]
    f: Annotated[Floats, (SERIES_TERMS,)]   # terms of the series of 1 / W, see the module

    @property
    def k_v(self) -> float:
        """Feed-forward gain of the reference's rate [-]."""
        return float(self.f[0])

    @property
    def k_a(self) -> Seconds:
        """Feed-forward gain of the reference's acceleration."""
        return float(self.f[1])

    def error(self, k_v: float, k_a: Seconds) -> Floats:
        """Return |1 - (k_v + k_a jw) W|, the relative angle error that a feed-forward leaves at w [-]."""
        return np.abs(1.0 - (k_v + 1j * k_a * self.w) * self.W)


def series(w: Floats, W: Complexes, terms: int = SERIES_TERMS) -> Floats:
    """Return f of the least-squares fit 1 / W(jw) = f_1 + f_2 jw + f_3 (jw)^2 + ... at w [rad/s]."""
    basis = (1j * w[:, np.newaxis]) ** np.arange(terms)
    wanted = 1.0 / W
    return np.linalg.lstsq(np.concatenate((basis.real, basis.imag)), np.concatenate((wanted.real, wanted.imag)),
                           rcond=None)[0]


def response(commanded: Floats, position: Floats, T: Seconds, delay: Seconds, w: Floats) -> Complexes:
    """Return the response W of a rate loop at w [rad/s], without the delay and the hold of the commands. Command k
    acts from t_k + delay on, for the period T; the position is that at t_k. The m samples contain a whole number of
    periods of each w. A linear trend is removed."""
    t = T * (np.arange(len(commanded)) - 0.5 * (len(commanded) - 1))
    waves = np.cos(w * t[:, np.newaxis]), np.sin(w * t[:, np.newaxis])
    basis = np.column_stack((np.ones_like(t), t, *waves))
    fit = np.linalg.lstsq(basis, np.column_stack((commanded, position)), rcond=None)[0][2:]
    U, Y = (fit[:len(w)] - 1j * fit[len(w):]).T
    return 1j * w * Y / (U * np.sinc(0.5 * w * T / math.pi)) * np.exp(1j * w * (delay + 0.5 * T))


@compiled
def _drive(state: Records, constants: Records, inputs: Records, outputs: Records, rate: Pairs, torque: Pairs,
           position: Pairs, motors: Floats) -> None:
    """Run the drive with n commands: rate commands [rad/s] and torque feed-forward [Nm]. Fill position with the
    encoder angles [rad] before each command, motors (n, 2, 4) with angles [rad] and torques [Nm] of both motors of
    both axes, on the motor shaft. The other arguments are the records of the unit of the drive, each in an array of
    one."""
    u, y = inputs[0], outputs[0]
    for k in range(len(rate)):
        position[k, 0], position[k, 1] = y.azimuth.position, y.elevation.position
        for j in range(2):
            motors[k, 0, j], motors[k, 0, 2 + j] = y.azimuth.motor_position[j], y.azimuth.motor_torque[j]
            motors[k, 1, j], motors[k, 1, 2 + j] = y.elevation.motor_position[j], y.elevation.motor_torque[j]
        u.azimuth.rate, u.elevation.rate = rate[k, 0], rate[k, 1]
        u.azimuth.torque, u.elevation.torque = torque[k, 0], torque[k, 1]
        drive_unit.step(state[0], constants[0], inputs[0], outputs[0])


def respond(drive: AduParameters, rate: Pairs, torque: Pairs) -> tuple[Pairs, Floats]:
    """Return (encoder angles [rad], motors (n, 2, 4)) of a drive that receives n commands in still air, as `_drive`
    fills them. drive: with the angles at the start. Row k is the time of command k."""
    drive = dataclasses.replace(drive, wind=WindParameters(), initially_enabled=True)
    state, constants = drive_unit.initial_state(drive), drive_unit.constants(drive)
    inputs, outputs = drive_unit.Inputs.zeros(), drive_unit.Outputs.zeros()
    inputs['enable'] = 1
    drive_unit.read(state[0], constants[0], outputs[0])
    position, motors = np.empty_like(rate), np.empty((len(rate), 2, 4))
    _drive(state, constants, inputs, outputs, rate, torque, position, motors)
    return position, motors


def identify(scenario: Scenario, torque: bool = True) -> dict[str, RateLoop]:
    """Return the RateLoop of each axis of the drive in a scenario, in still air. torque: True if the commands include
    the torque feed-forward of the ACU. Raises ValueError if the period of the drive does not divide COMMON_PERIOD_S or
    if the travel is too short."""
    acu, drive = scenario.node_parameters('acu'), scenario.node_parameters('adu')
    axes = [getattr(drive, name) for name in topics.AXES]
    duration = (SETTLING_PERIODS + MEASURED_PERIODS) * COMMON_PERIOD_S
    start = {f'initial_{name}': 0.5 * (axis.limits.lower + axis.limits.upper - rate * duration)
             for name, axis, rate in zip(topics.AXES, axes, IDENTIFICATION_RATES_RAD_S)}
    drive = dataclasses.replace(drive, **start)
    w = 2.0 * math.pi * SINE_FREQUENCIES_HZ
    steps = round(COMMON_PERIOD_S / drive.period)
    if abs(steps * drive.period - COMMON_PERIOD_S) > 1e-9:
        raise ValueError(f'adu.period = {drive.period:g} s: must divide {COMMON_PERIOD_S:g} s, the period of the '
                         'identification')
    for name, axis, turn in zip(topics.AXES, axes, IDENTIFICATION_RATES_RAD_S):
        if axis.limits.upper - axis.limits.lower < 1.1 * turn * duration:
            raise ValueError(f'adu.{name}.limits: travel must be at least '
                             f'{1.1 * turn * duration:g} rad to identify the drive')
    # Because the phases of Schroeder keep the peak of the sum low, the sines have these phases.
    k = np.arange(len(w))
    angle = w * drive.period * np.arange(steps)[:, np.newaxis] - math.pi * k * (k + 1) / len(k)
    v, a = SINE_PEAK_RAD_S * np.cos(angle).sum(axis=1), -SINE_PEAK_RAD_S * (w * np.sin(angle)).sum(axis=1)
    v, acceleration = (np.tile(motion, SETTLING_PERIODS + MEASURED_PERIODS) for motion in (v, a))
    rate = v[:, np.newaxis] + IDENTIFICATION_RATES_RAD_S
    torques = np.zeros_like(rate)
    for i, name in enumerate(topics.AXES if torque else ()):
        known = record(getattr(acu, name).feedforward)[0]
        torques[:, i] = [controllers.torque(*motion, known) for motion in zip(rate[:, i], acceleration)]
    position, _ = respond(drive, rate, torques)
    kept = slice(SETTLING_PERIODS * steps, None)
    loops = {}
    for i, name in enumerate(topics.AXES):
        W = response(rate[kept, i], position[kept, i], drive.period, drive.transport_delay, w)
        loops[name] = RateLoop(w, W, series(w, W))
    return loops
