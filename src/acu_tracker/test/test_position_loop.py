import math

import numpy as np
import pytest
from scipy import signal

from acu_tracker import position_loop
from acu_tracker.params import Limits, PositionLoop
from pedestal_common.parameters import record

T = 0.005


def respond(reference, loop, limits, steps):
    """The loop on an axis that obeys the rate command: (angles, commands, integrals)."""
    c, lim = record(loop)[0], record(limits)[0]
    p = integral = command = 0.0
    history = []
    for _ in range(steps):
        command, integral, _, _ = position_loop.rate_command(reference - p, -command, integral, command, 0.0, T, c,
                                                             lim)
        history.append((p, command, integral))
        p += T * command
    return np.array(history).T


@pytest.mark.parametrize('kp, ki, kd', [(20.0, 0.0, 0.0), (12.0, 40.0, 0.0), (30.0, 60.0, 0.2)])
def test_step_response_is_that_of_the_discrete_transfer_function(kp, ki, kd):
    # u (1 + Kd z^-1) = (Kp + Ki T z / (z - 1)) e, p = T / (z - 1) u
    controller = np.array([kp + ki * T, -kp]), np.array([1.0, -1.0])
    numerator = np.convolve(np.convolve(controller[0], [T]), [1.0, 0.0])
    denominator = np.convolve(np.convolve(controller[1], [1.0, -1.0]), [1.0, kd])
    closed = signal.dlti(numerator, np.polyadd(denominator, numerator), dt=T)
    _, (expected,) = signal.dstep(closed, n=400)
    angles, _, _ = respond(0.01, PositionLoop(kp=kp, ki=ki, kd=kd), Limits(rate=100.0, acceleration=1000.0), 400)
    np.testing.assert_allclose(angles, 0.01 * expected[:, 0], atol=1e-14)


def test_command_keeps_rate_and_acceleration():
    limits = Limits(rate=0.5, acceleration=4.0)
    _, commands, _ = respond(1.0, PositionLoop(), limits, 2000)
    assert commands.max() == 0.5
    assert np.abs(np.diff(commands, prepend=0.0)).max() <= 4.0 * T * (1 + 1e-12)


def test_integral_does_not_wind_up_while_the_command_is_limited():
    limits = Limits(rate=0.5, acceleration=1000.0)
    angles, commands, integrals = respond(1.0, PositionLoop(kp=20.0, ki=100.0), limits, 2000)
    saturated = commands == 0.5
    assert saturated.sum() > 300 and integrals[saturated].max() <= 1e-12
    linear, _, _ = respond(0.02, PositionLoop(kp=20.0, ki=100.0), Limits(rate=100.0, acceleration=1000.0), 2000)
    # The overshoot is no more than that of the same loop that was never limited, from where it left the limit.
    assert angles.max() - 1.0 <= 1.5 * (linear.max() - 0.02) + 1e-3
    assert angles[-1] == pytest.approx(1.0, abs=1e-6)


def test_integral_leaves_the_limit():
    c, lim = record(PositionLoop(kp=0.0, ki=100.0))[0], record(Limits(rate=0.5))[0]
    command, integral, limited, _ = position_loop.rate_command(-0.01, 0.0, 2.0, 0.5, 0.0, T, c, lim)
    assert limited and command == 0.5 and integral == 2.0 - 0.01 * 100.0 * T


def test_torque_is_what_inertia_and_friction_take():
    c = record(PositionLoop(inertia=280.0, friction=60.0, friction_rate=0.002))[0]
    assert position_loop.torque_feedforward(0.1, 0.5, c) == pytest.approx(200.0)
    assert position_loop.torque_feedforward(-0.1, 0.0, c) == pytest.approx(-60.0)
    assert position_loop.torque_feedforward(0.002, 0.0, c) == pytest.approx(60.0 * math.tanh(1.0))
