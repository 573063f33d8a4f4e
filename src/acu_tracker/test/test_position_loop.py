import math

import numpy as np
import pytest
from scipy import signal

from acu_tracker import control_unit
from acu_tracker.geometry.vector import AxisMotion
from acu_tracker.params import AxisParameters
from acu_tracker.servo import controllers, position_loop
from acu_tracker.servo.params import FeedforwardParameters
from acu_tracker.servo.position_loop import Feedback, Instants
from acu_tracker.servo.travel import Ends
from pedestal_common.parameters import build, record

T = 0.005
MECHANICAL = ('pid', 'feedforward', 'adrc')
WIDE = {'limits.rate': 100.0, 'limits.acceleration': 1e5}


class Axis:
    """One axis: its rate obeys the command exactly, or (lag > 0) as y'' = lag (u - y') + acceleration fed forward + d.

    `target(t)` gives the raw angle, rate and acceleration.
    """

    def __init__(self, target, lag=0.0, **parameters):
        self.target, self.lag, self.disturbance = target, lag, 0.0
        self.angle, self.velocity, self.k = 0.0, 0.0, 0
        self.state, self.command, self.values = position_loop.AxisLoop.zeros(), None, {}
        self.put(**parameters)
        position_loop.initialise(self.state[0], self.c['p'], 0.0, 0.0, 0.0)

    def put(self, **parameters):
        """Change live parameters."""
        self.values.update(parameters)
        self.c = control_unit.axis_constants(build(AxisParameters, self.values), T, 0.0)[0]

    def move(self, command, acceleration):
        if not self.lag:
            self.velocity = command
            self.angle += T * command
            return
        settled = command + (acceleration + self.disturbance) / self.lag
        gone = -math.expm1(-self.lag * T) / self.lag
        self.angle += T * settled + gone * (self.velocity - settled)
        self.velocity += self.lag * gone * (settled - self.velocity)

    def run(self, steps):
        """Rows of angle, command, integral, disturbance as observed, before the command takes effect."""
        rows = []
        for _ in range(steps):
            now = Instants(self.k * T, (self.k + 0.5) * T, T)
            raw = AxisMotion(*self.target(position_loop.instant(self.c['p'], now.t_k, now.t_m)))
            limits = self.c['p']['limits']
            feedback = Feedback(float(self.angle), float(self.velocity), math.nan, 0.0, False,
                                Ends(float(limits['low']), float(limits['high'])))
            self.command = position_loop.follow(self.state[0], self.c, raw, feedback, now)
            s = self.state[0]
            rows.append((self.angle, self.command.rate, s['integral'], s['z'][2]))
            self.move(self.command.rate, s['reference']['acceleration'])
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
    angles, *_ = Axis(still(0.01), **pid(K_p, K_i / K_p**2, K_d, tau), **WIDE).run(400)
    np.testing.assert_allclose(angles, 0.01 * expected[:, 0], atol=1e-14)


def test_pid_lags_a_ramp_by_the_rate_over_its_gain():
    """The error is that of t_k: no step of delay, no feed-forward in it."""
    axis = Axis(lambda t: (0.1 * t, 0.1, 0.0), **pid(20.0))
    angles, *_ = axis.run(400)
    assert 0.1 * 399 * T - angles[-1] == pytest.approx(0.1 / 20.0, rel=1e-9)


@pytest.mark.parametrize('controller', MECHANICAL)
def test_command_keeps_rate_and_acceleration(controller):
    _, commands, *_ = Axis(still(1.0), lag=176.0, controller=controller,
                          **{'limits.rate': 0.5, 'limits.acceleration': 4.0, 'shaper.rate': 0.5,
                             'shaper.acceleration': 4.0}).run(2000)
    assert commands.max() == pytest.approx(0.5, rel=1e-3) and commands.max() <= 0.5
    assert np.abs(np.diff(commands, prepend=0.0)).max() <= 4.0 * T * (1 + 1e-12)


def test_integral_does_not_wind_up_while_the_command_is_limited():
    values = pid(20.0, 0.25)
    angles, commands, integrals, _ = Axis(still(1.0), **values, **{**WIDE, 'limits.rate': 0.5, 'shaper.rate': 0.5}
                                       ).run(2000)
    saturated = commands == 0.5
    assert saturated.sum() > 300 and integrals[saturated].max() <= 1e-12
    linear, *_ = Axis(still(0.02), **values, **WIDE).run(2000)
    # The overshoot is no more than that of the same loop that was never limited, from where it left the limit.
    assert angles.max() - 1.0 <= 1.5 * (linear.max() - 0.02) + 1e-3
    assert angles[-1] == pytest.approx(1.0, abs=1e-6)


def test_integral_leaves_the_limit():
    axis = Axis(still(-0.01), **pid(20.0, 0.25), **{'limits.rate': 0.5, 'shaper.rate': 0.5})
    axis.state['integral'], axis.state['command'] = 2.0, 0.5
    _, (command,), (integral,), _ = axis.run(1)
    assert command == 0.5 and integral == 2.0 - 0.01 * 100.0 * T and axis.command.rate_limited


def test_raw_target_beyond_the_travel_is_held_at_its_end():
    axis = Axis(lambda t: (1.0 + t, 1.0, 0.0), **pid(20.0), **{'limits.high': 0.3})
    angles, *_ = axis.run(400)
    assert angles[-1] == pytest.approx(0.3, abs=1e-6) and axis.command.angle_limited


def test_torque_is_what_inertia_and_friction_take():
    c = record(FeedforwardParameters(inertia=280.0, friction=60.0, friction_rate=0.002))[0]
    assert controllers.torque(0.1, 0.5, c) == pytest.approx(200.0)
    assert controllers.torque(-0.1, 0.0, c) == pytest.approx(-60.0)
    assert controllers.torque(0.002, 0.0, c) == pytest.approx(60.0 * math.tanh(1.0))


def tracking(t):
    """A target on the move: 0.2 rad/s and 0.1 rad/s2."""
    return 0.2 * t + 0.05 * t * t, 0.2 + 0.1 * t, 0.1


@pytest.mark.parametrize('integral', [0.0, 0.25])
@pytest.mark.parametrize('old, new', [(a, b) for a in MECHANICAL for b in MECHANICAL
                                      if a != b])
def test_switching_while_tracking_does_not_move_the_command(old, new, integral):
    """Also with the drive's lag, and a disturbance that the running controller has learnt."""
    axis = Axis(tracking, lag=176.0, controller=old, **WIDE,
                **{f'{name}.integral': integral for name in ('pid', 'feedforward')},
                **{'notch.frequency': 40.0, 'shaper.rate': 50.0})
    axis.disturbance = 3.0
    _, before, *_ = axis.run(400)
    normal = np.abs(np.diff(before[-100:])).max()
    axis.put(controller=new)
    _, after, *_ = axis.run(800)
    assert abs(after[0] - before[-1]) <= normal + 1e-12
    # Then it settles as the new controller does by itself.
    fresh = Axis(tracking, lag=176.0, **axis.values)
    fresh.disturbance = 3.0
    fresh.run(1200)
    assert axis.angle == pytest.approx(fresh.angle, abs=1e-7)


def test_notch_takes_its_frequency_out_of_the_feedback_only():
    """What an oscillating encoder puts on the command falls to `depth`; the rate that is fed forward is untouched."""
    def shaken(**parameters):
        axis = Axis(lambda t: (0.2 * t, 0.2, 0.0), **parameters, **{'feedforward.integral': 0.0})
        axis.move = lambda command, acceleration: setattr(
            axis, 'angle', 0.2 * (axis.k + 1) * T + 1e-4 * math.sin(2.0 * math.pi * 25.0 * (axis.k + 1) * T))
        _, commands, *_ = axis.run(800)
        return commands[400:]

    plain, notched = shaken(), shaken(**{'notch.frequency': 25.0, 'notch.depth': 0.2})
    assert np.mean(notched) == pytest.approx(0.2, abs=1e-6)
    assert np.ptp(plain) == pytest.approx(2.0 * 20.0 * 1e-4, rel=1e-2)
    assert np.ptp(notched) == pytest.approx(0.2 * np.ptp(plain), rel=1e-3)


def test_adrc_follows_without_taking_the_reference_for_a_disturbance():
    """On the plant it is told of: an observer that fights the feed-forward would see up to 176 x 0.5 rad/s2."""
    axis = Axis(lambda t: (0.2 * (1 - math.cos(2.5 * t)), 0.5 * math.sin(2.5 * t), 1.25 * math.cos(2.5 * t)),
                lag=176.0, controller='adrc')
    angles, _, _, disturbance = axis.run(2000)
    errors = angles - 0.2 * (1 - np.cos(2.5 * T * np.arange(2000)))
    assert np.abs(disturbance).max() < 0.05 and np.abs(errors[400:]).max() < 1e-5


def test_adrc_finds_a_disturbance_and_cancels_it():
    axis = Axis(still(0.0), lag=176.0, controller='adrc')
    axis.disturbance = 5.0
    angles, commands, _, disturbance = axis.run(400)
    assert disturbance[-1] == pytest.approx(5.0, rel=1e-6) and abs(angles[-1]) < 1e-9
    assert commands[-1] == pytest.approx(-5.0 / 176.0, rel=1e-6)


def test_adrc_knows_of_its_limited_command():
    """A rate limit that the reference exceeds for two seconds leaves no false disturbance behind."""
    limited = {'limits.rate': 0.5, 'shaper.rate': 0.5}
    axis = Axis(still(1.0), lag=176.0, controller='adrc', **limited)
    axis.run(20)
    axis.c['p']['limits']['rate'] = 0.3
    angles, commands, _, disturbance = axis.run(1200)
    assert (commands == 0.3).sum() > 300 and np.abs(disturbance).max() < 0.5
    assert angles[-1] == pytest.approx(1.0, abs=1e-6)
