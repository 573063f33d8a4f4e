import math

import numpy as np
import pytest
from scipy import signal

from acu_tracker import control_unit, feedforward, position_loop
from acu_tracker.params import AxisParameters, Feedforward
from pedestal_common.parameters import build, record

T = 0.005
WIDE = {'limits.rate': 100.0, 'limits.acceleration': 1e5}


class Axis:
    """One axis that obeys the rate command exactly; `target(t)` gives its raw angle, rate and acceleration."""

    def __init__(self, target, **parameters):
        self.target, self.angle, self.velocity, self.k = target, 0.0, 0.0, 0
        self.state, self.outputs = np.zeros(1, position_loop.AXIS), np.zeros(1, control_unit.OUTPUTS)
        self.put(**parameters)
        position_loop.seat(self.state[0], self.p, -T, 0.0, 0.0)

    def put(self, **parameters):
        """Change live parameters."""
        self.values = {**getattr(self, 'values', {}), **parameters}
        self.p = record(build(AxisParameters, self.values))[0]

    def run(self, steps):
        """Rows of angle, command, integral before the command takes effect."""
        rows = []
        for _ in range(steps):
            t_k, t_m = self.k * T, (self.k + 0.5) * T
            raw = self.target(position_loop.instant(self.p, t_k, t_m))
            position_loop.step(self.state[0], self.p, *raw, t_k, t_m, self.angle, self.velocity, T, self.outputs[0],
                               0)
            rows.append((self.angle, self.state['command'][0], self.state['integral'][0]))
            self.velocity = rows[-1][1]
            self.angle += T * self.velocity
            self.k += 1
        return np.array(rows).T


def still(angle):
    return lambda t: (angle, 0.0, 0.0)


def pid(bandwidth, integral=0.0, derivative=0.0, derivative_time=0.003):
    return {'controller': 'pid', 'pid.bandwidth': bandwidth, 'pid.integral': integral,
            'pid.derivative': derivative, 'pid.derivative_time': derivative_time}


@pytest.mark.parametrize('K_p, K_i, K_d, tau', [
    (20.0, 0.0, 0.0, 0.003), (12.0, 40.0, 0.0, 0.0), (30.0, 60.0, 0.2, 0.0), (54.85, 0.0, 0.49, 0.003)])
def test_pid_step_response_is_that_of_the_discrete_transfer_function(K_p, K_i, K_d, tau):
    # u = (K_p + K_i T z / (z - 1) + K_d (z - 1) / ((tau + T) z - tau)) e, angle = T / (z - 1) u
    integrator, lag = np.array([1.0, -1.0]), np.array([tau + T, -tau])
    controller = np.polyadd(np.polymul(np.polyadd(K_p * integrator, [K_i * T, 0.0]), lag),
                            K_d * np.polymul(integrator, integrator))
    numerator = T * controller
    denominator = np.polymul(np.polymul(integrator, lag), integrator)
    closed = signal.dlti(numerator, np.polyadd(denominator, numerator), dt=T)
    _, (expected,) = signal.dstep(closed, n=400)
    angles, _, _ = Axis(still(0.01), **pid(K_p, K_i / K_p**2, K_d, tau), **WIDE).run(400)
    np.testing.assert_allclose(angles, 0.01 * expected[:, 0], atol=1e-14)


def test_pid_lags_a_ramp_by_the_rate_over_its_gain():
    """The error is that of t_k: no step of delay, no feed-forward in it."""
    axis = Axis(lambda t: (0.1 * t, 0.1, 0.0), **pid(20.0))
    angles, _, _ = axis.run(400)
    assert 0.1 * 399 * T - angles[-1] == pytest.approx(0.1 / 20.0, rel=1e-9)


@pytest.mark.parametrize('controller', ['pid', 'feedforward'])
def test_command_keeps_rate_and_acceleration(controller):
    _, commands, _ = Axis(still(1.0), controller=controller,
                          **{'limits.rate': 0.5, 'limits.acceleration': 4.0, 'shaper.rate': 0.5,
                             'shaper.acceleration': 4.0}).run(2000)
    assert commands.max() == pytest.approx(0.5, rel=1e-9) and commands.max() <= 0.5
    assert np.abs(np.diff(commands, prepend=0.0)).max() <= 4.0 * T * (1 + 1e-12)


def test_integral_does_not_wind_up_while_the_command_is_limited():
    values = pid(20.0, 0.25)
    angles, commands, integrals = Axis(still(1.0), **values, **{**WIDE, 'limits.rate': 0.5, 'shaper.rate': 0.5}
                                       ).run(2000)
    saturated = commands == 0.5
    assert saturated.sum() > 300 and integrals[saturated].max() <= 1e-12
    linear, _, _ = Axis(still(0.02), **values, **WIDE).run(2000)
    # The overshoot is no more than that of the same loop that was never limited, from where it left the limit.
    assert angles.max() - 1.0 <= 1.5 * (linear.max() - 0.02) + 1e-3
    assert angles[-1] == pytest.approx(1.0, abs=1e-6)


def test_integral_leaves_the_limit():
    axis = Axis(still(-0.01), **pid(20.0, 0.25), **{'limits.rate': 0.5, 'shaper.rate': 0.5})
    axis.state['integral'], axis.state['command'] = 2.0, 0.5
    _, (command,), (integral,) = axis.run(1)
    assert command == 0.5 and integral == 2.0 - 0.01 * 100.0 * T and axis.outputs['rate_limited'][0, 0]


def test_raw_target_beyond_the_travel_is_held_at_its_end():
    axis = Axis(lambda t: (1.0 + t, 1.0, 0.0), **pid(20.0), **{'limits.high': 0.3})
    angles, _, _ = axis.run(400)
    assert angles[-1] == pytest.approx(0.3, abs=1e-6) and axis.outputs['angle_limited'][0, 0]


def test_torque_is_what_inertia_and_friction_take():
    c = record(Feedforward(inertia=280.0, friction=60.0, friction_rate=0.002))[0]
    assert feedforward.torque(0.1, 0.5, c) == pytest.approx(200.0)
    assert feedforward.torque(-0.1, 0.0, c) == pytest.approx(-60.0)
    assert feedforward.torque(0.002, 0.0, c) == pytest.approx(60.0 * math.tanh(1.0))


def tracking(t):
    """A target on the move: 0.2 rad/s and 0.1 rad/s2."""
    return 0.2 * t + 0.05 * t * t, 0.2 + 0.1 * t, 0.1


@pytest.mark.parametrize('integral', [0.0, 0.25])
@pytest.mark.parametrize('old, new', [(a, b) for a in position_loop.CONTROLLERS for b in position_loop.CONTROLLERS
                                      if a != b])
def test_switching_while_tracking_does_not_move_the_command(old, new, integral):
    axis = Axis(tracking, controller=old, **WIDE, **{f'{name}.integral': integral for name in ('pid', 'feedforward')})
    _, before, _ = axis.run(400)
    normal = np.abs(np.diff(before[-100:])).max()
    axis.put(controller=new)
    _, after, _ = axis.run(800)
    assert abs(after[0] - before[-1]) <= normal
    # Then it settles as the new controller does by itself: the fading integral, or the shaper, sets the pace.
    assert np.abs(np.diff(after)).max() < (20.0 * T * before[-1] if new == 'pid' else 30.0 * T)
    fresh = Axis(tracking, **axis.values)
    fresh.run(1200)
    assert axis.angle == pytest.approx(fresh.angle, abs=1e-7)
