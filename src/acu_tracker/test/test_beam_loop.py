"""The beam's loops: their laws against transfer functions, and in the control unit on a beam that jumps."""
import math

import numpy as np
import pytest
from scipy import signal

from acu_tracker.estimation.filters import kalman
from acu_tracker.geometry import attitude, frames
from acu_tracker.geometry.vector import Vector
from acu_tracker.servo import controllers
from pedestal_common.geometry import line_of_sight

T = 0.01


def step_response(law, alpha, delay, steps):
    """Beam (steps,) that sees a step of 1 from the start on, a command in force `delay` periods late."""
    beta = kalman.benedict_bordner(alpha)
    R, v, commands, beams = 0.0, 0.0, [0.0] * (delay + 1), []
    for _ in range(steps):
        beams.append(commands[-1 - delay])
        R, v = law(R, v, 1.0 - beams[-1], alpha, beta, T, 0.0)
        commands.append(R)
    return np.array(beams)


@pytest.mark.parametrize('alpha, delay', [(0.1, 0), (0.3, 0), (0.1, 4), (0.05, 10)])
def test_step_responses_are_those_of_the_closed_transfer_functions(alpha, delay):
    """By hand from eq. (3): R = z^-1 (R + v T) + alpha nu, nu = e - T z^-1 v, and so on, e = 1 - z^-(1 + delay) R."""
    beta = kalman.benedict_bordner(alpha)
    # v T (1 - z^-1 (1 - beta)) = beta e;  R (1 - z^-1) = (1 - alpha) z^-1 v T + alpha e
    one = np.polymul([1.0, -1.0], [1.0, beta - 1.0])
    type_1 = np.polyadd(alpha * np.array([1.0, beta - 1.0]), [(1.0 - alpha) * beta]), one
    # v T (1 - z^-1) = beta e;  R (1 - z^-1) = v T + alpha e
    two = np.polymul([1.0, -1.0], [1.0, -1.0])
    type_2 = [alpha + beta, -alpha], two
    for law, (numerator, denominator) in ((controllers.type_1, type_1), (controllers.type_2, type_2)):
        numerator = np.polymul(numerator, [1.0, 0.0])
        late = np.polymul(denominator, [1.0] + [0.0] * (delay + 1))
        size = len(late)
        closed = np.polyadd(late, np.pad(numerator, (size - len(numerator), 0)))
        _, (expected,) = signal.dstep(signal.dlti(numerator, closed, dt=T), n=200)
        np.testing.assert_allclose(step_response(law, alpha, delay, 200), expected[:, 0], rtol=0, atol=1e-9)


@pytest.mark.parametrize('law, lag', [(controllers.type_1, 0.2 * T), (controllers.type_2, 0.0)])
@pytest.mark.parametrize('delay', [0, 3])
def test_a_ramp_is_met_late_by_one_period_or_not_at_all(law, lag, delay):
    """type_1: v T exactly, whatever alpha and delay; a compensation of the whole rate takes it away."""
    for compensation, expected in ((0.0, lag), (0.2, 0.0)):
        R, v, commands = 0.0, 0.0, [0.0] * (delay + 1)
        for k in range(4000):
            error = 0.2 * k * T - commands[-1 - delay]
            R, v = law(R, v, error, 0.05, kalman.benedict_bordner(0.05), T, compensation)
            commands.append(R)
        assert error == pytest.approx(expected, abs=1e-11)


def test_rates_of_a_fixed_direction_by_turning_the_deck():
    h, w = 1e-6, np.array([0.1, -0.05, 0.2])
    A, E = 0.7, 0.9
    rates = frames.fixed_rates(Vector(*w), A, E)
    moved = []
    for sign in (-1.0, 1.0):
        mat = np.zeros((3, 3))
        line_of_sight.rotation(*attitude.rotated(np.array([0.0, 0.0, 0.0, 1.0]), tuple(sign * h * w)), mat)
        moved.append(line_of_sight.angles(*line_of_sight.to_deck(mat, *line_of_sight.direction(A, E))))
    np.testing.assert_allclose(rates, np.subtract(moved[1], moved[0]) / (2.0 * h), atol=1e-8)


@pytest.fixture(name='beam')
def beam_rig(Rig):
    """The unit on a beam that follows its command after `delay`; the receiver measures with the beam in force."""
    class BeamRig(Rig):
        def __init__(self, *args, at=(0.5, 0.6), delay=0.0, both=None, **parameters):
            axes = {f'{axis}.{name}': value for axis in ('azimuth', 'elevation')
                    for name, value in {'controller': 'beam', **(both or {})}.items()}
            super().__init__(*args, at=at, delay=delay, **{**Rig.QUICK, **axes, **parameters})
            self.commanded = [tuple(at)] * (1 + round(delay / self.T))

        def step(self, **changes):
            o = super().step(**changes)
            self.commanded.append(tuple(o['reference'][:, 0]))
            self.angle, self.velocity = np.array(self.commanded[-1 - round(self.delay / self.T)]), np.zeros(2)
            return o

        def middle(self, rows):
            """True error in the middle of the interval, of the beam in force in it: the last `rows` steps."""
            errors = []
            for _ in range(rows):
                self.step()
                errors.append(self.error((self.k - 0.5) * self.T, self.angle))
            return np.array(errors)

    return BeamRig


@pytest.mark.parametrize('delay, latency', [(0.0, 0.0), (0.02, 0.015)])
def test_tracked_beam_is_on_the_target_in_the_middle_of_its_interval(beam, delay, latency):
    rig = beam(beam.moving, initial_mode='autotrack', delay=delay, error_latency=latency, **beam.LIVELY)
    rig.run(12.0)
    assert rig.mode == 'autotrack' and not rig.invalid
    assert np.abs(rig.middle(200)).max() < 2e-6
    assert rig.outputs['rate'][0, 0] == pytest.approx(0.05 + 0.004 * rig.k * rig.T, rel=1e-3)


def test_tracked_beam_on_a_rolling_deck(beam):
    rig = beam(lambda t: (1.1 + 0.01 * t, 0.7), attitude=beam.rolling, stabilised=True, delay=0.02,
               initial_mode='autotrack', at=(0.5, 0.7))
    rig.run(10.0)
    assert rig.mode == 'autotrack' and np.abs(rig.middle(400)).max() < 2e-5


@pytest.mark.parametrize('form, lag', [('type_1', 0.05),
                                       ('type_2', 0.0)])
def test_the_papers_forms_in_the_unit(beam, form, lag):
    """A ramp of 0.05 rad/s in azimuth with errors as the receiver has them, in cross-elevation."""
    rig = beam(lambda t: (0.5 + 0.05 * t, 0.6), initial_mode='autotrack', both={'beam.form': form}, delay=0.02)
    rig.run(15.0)
    error = rig.error(rig.k * rig.T, rig.angle)
    assert rig.mode == 'autotrack'
    np.testing.assert_allclose(error, [lag * rig.T * math.cos(0.6), 0.0], atol=2e-7)


def test_compensation_takes_its_share_of_the_ships_roll_away(beam):
    worst = []
    for delta in (0.0, 0.85):
        rig = beam(attitude=beam.rolling, stabilised=True, initial_mode='autotrack', at=(-0.3, 0.6),
                   both={'beam.form': 'type_1', 'beam.rate_compensation': delta})
        rig.run(4.0)
        assert rig.mode == 'autotrack'
        worst.append(np.abs(rig.run(8.0)[:, 2:]).max(axis=0))
    assert worst[0] / worst[1] == pytest.approx(1.0 / 0.15, rel=0.03)


@pytest.mark.parametrize('delta', [(0.0, 0.85), (0.85, 0.0)])
def test_the_compensation_of_one_axis_is_that_axis_own(beam, delta):
    """Only elevation, or only azimuth, takes its share of the roll away; the other axis is as without it."""
    worst = []
    for share in ((0.0, 0.0), delta):
        rig = beam(attitude=beam.rolling, stabilised=True, initial_mode='autotrack', at=(-0.3, 0.6),
                   both={'beam.form': 'type_1'},
                   **{f'{axis}.beam.rate_compensation': s for axis, s in zip(('azimuth', 'elevation'), share)})
        rig.run(4.0)
        worst.append(np.abs(rig.run(8.0)[:, 2:]).max(axis=0))
    assert worst[0] / worst[1] == pytest.approx([1.0 / (1.0 - s) for s in delta], rel=0.05)


def test_errors_that_stay_away_leave_the_papers_beam_on_its_way(beam):
    rig = beam(lambda t: (0.5 + 0.05 * t, 0.6), initial_mode='autotrack', both={'beam.form': 'type_2'})
    rig.run(10.0)
    rig.receiver_on = False
    rows = rig.run(0.5)
    assert rig.outputs['coasting'][0] and np.abs(rows[-1, 2:]).max() < 1e-5


def test_standby_leaves_the_beam_where_it_was_told_to_be(beam):
    """What is in force comes a delay later: sent back as a command it would go round for ever."""
    rig = beam(beam.moving, initial_mode='autotrack', delay=0.02)
    rig.run(5.0)
    last = rig.outputs['reference'][0, :, 0].copy()
    assert rig.ask(0)
    rig.run(0.2)
    assert rig.mode == 'standby' and rig.angle.tolist() == last.tolist()
    assert rig.outputs['reference'][0, :, 0].tolist() == last.tolist()


def test_the_beam_is_held_inside_its_limits(beam):
    rig = beam(lambda t: (0.5, 0.6), initial_mode='preset', **{'azimuth.limits.high': 0.8})
    rig.step(preset=[0.9, 0.3], preset_valid=1)
    assert rig.outputs['reference'][0, :, 0].tolist() != [0.9, 0.3]
    rig = beam(lambda t: (0.5 + 0.1 * t, 0.6), initial_mode='autotrack', **{'azimuth.limits.high': 0.8})
    rig.run(4.0)
    o = rig.outputs[0]
    assert o['reference'][0].tolist() == [0.8, 0.0, 0.0] and o['angle_limited'].tolist() == [1, 0]


@pytest.mark.parametrize('age, beam_age', [(0.0025, 0.0), (0.005, 0.005), (0.012, 0.01)])
def test_an_error_of_before_its_stamp_is_met_with_the_beam_that_stood_then(beam, age, beam_age):
    """The beam jumps at every step; the receiver measures `age` before the stamp it gives."""
    rig = beam(lambda t: (0.5 + 0.02 * t, 0.6), **beam.LIVELY, **{'tracker.receiver.age': age,
                                                                  'tracker.receiver.beam_age': beam_age})
    for k in range(400):
        rig.angle = np.array([0.5 + 0.01 * math.sin(2.0 * k), 0.6 - 0.01 * math.cos(3.0 * k)])
        t = k * rig.T - age
        row = math.ceil(t / rig.T - 1e-9)
        stood = np.array([0.5 + 0.01 * math.sin(2.0 * row), 0.6 - 0.01 * math.cos(3.0 * row)])
        dx, de = rig.error(t, stood)
        o = rig.step(cross_elevation=dx, elevation=de)
    np.testing.assert_allclose(o['estimate'][:, 0], [0.5 + 0.02 * 399 * rig.T, 0.6], atol=1e-7)


@pytest.mark.parametrize('weights', [[0.2] * 5, [0.05] * 20, [1.0 / 13.0] * 13, 0.05 * 0.95**np.arange(300)])
def test_an_error_that_is_a_mean_over_several_steps_is_met_with_the_mean_of_their_beams(beam, weights):
    """Five samples a step, the newest first: the target moves through them, the beam steps along with it."""
    ages, stairs = np.arange(len(weights)) / 5.0 * beam.T, np.arange(len(weights)) // 5
    rate, of_beam = 0.5, {'tracker.receiver.age': np.average(ages, weights=weights),
                          'tracker.receiver.beam_age': np.average(stairs, weights=weights) * beam.T}
    rig = beam(lambda t: (0.5 + rate * t, 0.0), at=(0.5, 0.0), **of_beam)
    for k in range(400):
        rig.angle = np.array([0.5 + rate * k * rig.T - 0.001, 0.0])
        error = 0.001 + rate * np.average(stairs * rig.T - ages, weights=weights)
        o = rig.step(cross_elevation=error, elevation=0.0, cn0_dbhz=70.0 + 1e-9 * k)
    assert o['estimate'][0, 0] == pytest.approx(0.5 + rate * 399 * rig.T, abs=1e-6)
