"""Gear transmission error and cogging of the motors: what they do to a load that turns slowly."""
import math
import types

import numpy as np
import pytest

from adu_drive.plant import mechanics, motors
from drive_law.params import AduParameters
from pedestal_common.parameters import build


def line(signal, angle, per_turn):
    """Amplitude of a once- or many-times-a-turn part of a signal over an angle [rad]."""
    slow = np.linspace(-1.0, 1.0, len(angle))
    series = np.column_stack((np.sin(per_turn * angle), np.cos(per_turn * angle), *(slow ** i for i in range(4))))
    return math.hypot(*np.linalg.lstsq(series, signal, rcond=None)[0][:2])


def turned(drive, rate, **values):
    """Outputs of azimuth while it turns at a rate [rad/s], the first second left out."""
    p = build(AduParameters, {'initial_elevation': 0.7, 'azimuth.friction.breakaway': 60.0, **{
        f'azimuth.{name.replace("__", ".")}': value for name, value in values.items()}})
    return drive(p).run(8.0, azimuth=rate).log['azimuth'][200:]


def test_runout_of_the_pinions_moves_the_load(drive):
    """The mean of two pinions a quarter turn apart: the runout over sqrt 2, while the motors turn evenly."""
    even, uneven = turned(drive, 0.2), turned(drive, 0.2, gear_train__runout=2e-4)
    lag = uneven['load_position'] - uneven['motor_position'].mean(axis=1) / 64.0
    pinion = uneven['motor_position'][:, 0] / 8.0
    assert line(lag, pinion, 1.0) == pytest.approx(2e-4 / math.sqrt(2.0), rel=0.05)
    assert line(even['load_position'] - even['motor_position'].mean(axis=1) / 64.0, pinion, 1.0) < 2e-6


def test_tooth_error_comes_with_the_teeth(drive):
    uneven = turned(drive, 0.2, gear_train__tooth_error=1e-4, gear_train__pinion_teeth=9)
    lag = uneven['load_position'] - uneven['motor_position'].mean(axis=1) / 64.0
    pinion = uneven['motor_position'][:, 0] / 8.0
    # The mean of two sines: 9 teeth, a quarter turn apart less what lash and bias turn the pinions against each other.
    apart = 0.5 * math.pi - np.mean(uneven['motor_position'] @ (1.0, -1.0)) / 8.0
    assert line(lag, pinion, 9.0) == pytest.approx(1e-4 * abs(math.cos(0.5 * 9.0 * apart)), rel=0.02)
    assert line(lag, pinion, 1.0) < 1e-5


def test_motors_make_up_for_their_cogging(drive):
    """Slowly, the torque of the speed loop is the cogging turned round, on each motor."""
    uneven = turned(drive, 0.05, motor_1__cogging=0.5, motor_1__cogging_per_turn=6)
    even = turned(drive, 0.05)
    shaft = uneven['motor_position'][:, 0]
    assert line(uneven['motor_torque'].sum(axis=1), shaft, 6.0) == pytest.approx(0.5, rel=0.2)
    assert line(even['motor_torque'].sum(axis=1), shaft, 6.0) < 0.02


def test_cogging_does_no_work_over_a_turn():
    angle = np.linspace(0.0, 2.0 * math.pi, 4801)[:-1]
    assert abs(np.mean([motors.cogging(x, 1.3, 24.0) for x in angle])) < 1e-12
    assert max(motors.cogging(x, 1.3, 24.0) for x in angle) == pytest.approx(1.3, rel=1e-4)


def test_transmission_error_is_the_sum_of_its_lines():
    c = types.SimpleNamespace(runout=3e-4, tooth_error=5e-5, teeth=17.0)
    for pinion in np.linspace(-9.0, 9.0, 40):
        assert mechanics.transmission_error.py_func(pinion, c) == pytest.approx(
            3e-4 * math.sin(pinion) + 5e-5 * math.sin(17.0 * pinion), abs=1e-18)
