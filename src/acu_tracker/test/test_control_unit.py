"""The whole unit on an ideal axis: the rate command is obeyed exactly, `delay` late."""
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from acu_tracker import control_unit, modes
from acu_tracker.control_unit import INVALID_INPUTS
from acu_tracker.modes import AUTOTRACK, MODES, PRESET, PROGRAM, REASONS, STANDBY, STOW
from acu_tracker.params import AcuParameters
from pedestal_common import line_of_sight
from pedestal_common.parameters import ParameterError, build

T = 0.005
ASHORE = Rotation.from_quat(line_of_sight.ASHORE)


def level(t):
    return ASHORE


def rolling(t):
    """10 deg roll in 8 s, 5 deg pitch in 7 s, some yaw; bow about north-east."""
    return Rotation.from_euler('ZYX', [0.8 + 0.03 * math.sin(0.5 * t), 0.087 * math.sin(2 * math.pi * t / 7 + 1),
                                       0.1745 * math.sin(2 * math.pi * t / 8)])


def body_rate(attitude, t, h=1e-4):
    return (attitude(t - h).inv() * attitude(t + h)).as_rotvec() / (2 * h)


class Rig:
    """The unit with an ideal axis, receiver and INS around it. `target(t)` gives earth azimuth, elevation."""

    def __init__(self, target=lambda t: (0.5, 0.6), at=(0.4, 0.5), attitude=level, stabilised=False, delay=0.0,
                 error_latency=0.0, sigma=0.0, **parameters):
        params = build(AcuParameters, {'command_delay': delay, 'receiver_latency': error_latency, **parameters})
        self.params, self.target, self.attitude = params, target, attitude
        self.delay, self.latency = delay, error_latency
        self.constants, self.state = control_unit.constants(params), control_unit.initial_state(params)
        self.inputs, self.outputs = np.zeros(1, control_unit.INPUTS), np.zeros(1, control_unit.OUTPUTS)
        self.times, self.angles = np.zeros(2000), np.zeros((2000, 2))
        self.angle, self.velocity = np.array(at, float), np.zeros(2)
        self.commands, self.passed, self.k = [(0.0, 0.0)] * (round(delay / T) + 1), [], 0
        self.receiver_on, self.sigma, self.rng = True, sigma, np.random.default_rng(7)
        self.inputs['encoder_valid'], self.inputs['stabilised'] = 1, stabilised

    def deck(self, t):
        """The target's deck angles near the encoder."""
        A, E = self.target(t)
        x, y, z = self.attitude(t).inv().apply([math.cos(E) * math.sin(A), math.cos(E) * math.cos(A), math.sin(E)])
        return np.array([math.atan2(-y, x), math.asin(z)])

    def error(self, t, angle):
        return line_of_sight.offsets(*angle, *line_of_sight.direction(*self.deck(t)))

    def step(self, **changes):
        u, t = self.inputs, self.k * T
        u['stamp'], u['position'], u['velocity'] = t, self.angle, self.velocity
        u['encoder_valid'], u['cn0_dbhz'] = 1, 70.0
        self.passed.append((t, *self.error(t, self.angle)))
        late = 1 + round(self.latency / T)
        u['error_valid'] = self.receiver_on and late <= len(self.passed)
        u['error_stamp'], dx, de = self.passed[-min(late, len(self.passed))]
        u['cross_elevation'], u['elevation'] = np.array([dx, de]) + self.sigma * self.rng.standard_normal(2)
        u['attitude_stamp'], u['attitude_valid'] = t, 1
        u['quaternion'], u['deck_rate'] = self.attitude(t).as_quat(), body_rate(self.attitude, t)
        for name, value in changes.items():
            u[name] = value
        control_unit.step(self.state, self.constants, u, self.outputs, self.times, self.angles)
        self.commands.append(tuple(self.outputs['rate'][0]))
        self.velocity = np.array(self.commands[-1 - round(self.delay / T)])
        self.angle = self.angle + T * self.velocity
        self.k += 1
        return self.outputs[0]

    def ask(self, mode):
        return control_unit.request(self.state, self.constants, self.inputs, self.outputs, mode, self.times,
                                    self.angles)

    def run(self, seconds, **changes):
        """Steps of this many seconds; columns: rates (2), pointing error (2)."""
        rows = []
        for _ in range(round(seconds / T)):
            error = self.error(self.k * T, self.angle)
            o = self.step(**changes)
            rows.append((*o['rate'], *error))
        return np.array(rows)

    def program(self, start=0.0, rows=100, target=None):
        self.times[:rows] = start + np.arange(rows)
        self.angles[:rows] = [(target or self.target)(t) for t in self.times[:rows]]
        self.inputs['program_count'] = rows

    @property
    def mode(self):
        return MODES[self.outputs['mode'][0]]

    @property
    def reason(self):
        return REASONS[self.outputs['reason'][0]]

    @property
    def invalid(self):
        return {name for i, name in enumerate(INVALID_INPUTS) if self.outputs['invalid_input'][0] >> i & 1}


def moving(t):
    return 0.5 + 0.05 * t + 0.002 * t * t, 0.6 + 0.02 * t


QUICK = {'tracker.lock_count': 20}


def test_parameters_are_checked():
    build(AcuParameters, {})
    for name, value, words in (('azimuth.shaper.rate', 3.0, 'shaper.rate'), ('elevation.stow', 2.0, 'stow'),
                               ('command_delay', 0.5, 'command_delay'), ('step_gap', 0.006, 'step_gap'),
                               ('azimuth.shaper.jerk', 100.0, 'h0'), ('azimuth.limits.low', 5.0, 'low'),
                               ('tracker.coast_time', 0.05, 'coast_time'), ('initial_mode', 'park', 'standby')):
        with pytest.raises(ParameterError, match=words):
            build(AcuParameters, {name: value})


@pytest.mark.parametrize('values, line', [
    ({'receiver_latency': 0.31}, 'receiver_latency = 0.31 s: must be 0 to 60 periods, 0.3 s'),
    ({'attitude_latency': 0.31, 'attitude_timeout': 1.0}, 'attitude_latency = 0.31 s: must be 0 to 60 periods, 0.3 s'),
    ({'attitude_latency': 0.2}, 'attitude_latency = 0.2 s: must be below attitude_timeout - '
                                'command_delay - half a period = 0.1975 s'),
])
def test_latencies_that_cannot_be_bridged_are_refused(values, line):
    with pytest.raises(ParameterError) as error:
        build(AcuParameters, values)
    assert str(error.value) == line


def test_constants_hold_the_parameters():
    c = control_unit.constants(build(AcuParameters, {'azimuth.a_max': 0.123, 'command_delay': 0.01}))
    assert c['p']['azimuth']['a_max'] == 0.123 and c['ahead'] == 0.0125


@pytest.mark.parametrize('delay, latency', [(0.0, 0.0), (0.01, 0.0), (0.02, 0.015)])
def test_autotrack_points_at_an_accelerating_target(delay, latency):
    rig = Rig(moving, initial_mode='autotrack', delay=delay, error_latency=latency, **QUICK)
    errors = rig.run(12.0)[:, 2:]
    assert rig.mode == 'autotrack' and not rig.invalid
    assert np.abs(errors[-400:]).max() < 2e-6


def test_what_the_known_delay_is_worth():
    """With the delay left out of the prediction the feed-forward of a sine comes late."""
    def swinging(t):
        return 0.3 * math.sin(0.8 * t), 0.6

    worst = []
    for ahead in (0.02 + 0.5 * T, 0.5 * T):
        rig = Rig(swinging, initial_mode='program', at=(0.0, 0.6), delay=0.02, **{'tracker.handover': False})
        rig.times[:] = 0.05 * np.arange(2000)
        rig.angles[:], rig.inputs['program_count'] = [swinging(t) for t in rig.times], 2000
        rig.constants['ahead'] = ahead
        worst.append(np.abs(rig.run(12.0)[1600:, 2:]).max())
    assert worst[0] < 1e-6 and worst[1] > 1e-4


def test_request_between_two_steps():
    rig = Rig(moving)
    assert not rig.ask(STOW)
    assert (rig.mode, rig.reason) == ('standby', 'encoder invalid')
    rig.run(0.5)
    assert not rig.ask(PROGRAM)
    assert (rig.mode, rig.reason) == ('standby', 'no program track')
    rig.program()
    assert rig.ask(PROGRAM)
    assert rig.mode == 'program'
    rates = rig.run(2.0)[:, :2]
    assert rig.mode == 'autotrack'
    assert np.abs(np.diff(rates, axis=0, prepend=0.0)).max() <= rig.params.azimuth.limits.acceleration * T
    assert rig.ask(STANDBY)
    rig.run(0.1)
    assert rig.mode == 'standby' and not np.any(rig.outputs['rate'])


@pytest.mark.parametrize('latency', [0.0, 0.02])
def test_measurement_is_the_encoder_at_the_stamp_of_the_error(latency):
    """The antenna swings by 0.3 rad/s about a fixed target: the estimate must not see it."""
    rig = Rig(error_latency=latency)
    for k in range(400):
        rig.angle = np.array([0.5 + 0.05 * math.sin(6 * k * T), 0.6 - 0.03 * math.sin(5 * k * T)])
        o = rig.step()
    np.testing.assert_allclose(o['estimate'][:, 0], [0.5, 0.6], atol=1e-9)
    assert np.abs(o['innovation']).max() < 1e-9


def test_error_between_two_encoder_stamps():
    """The receiver measures half-way between two steps of an antenna that swings by up to 0.3 rad/s."""
    rig = Rig()
    for k in range(1, 400):
        before, here = (np.array([0.5 + 0.05 * math.sin(6 * t), 0.6]) for t in ((k - 1) * T, k * T))
        rig.angle, rig.k = here, k
        dx, de = rig.error(k * T, 0.5 * (before + here))
        o = rig.step(error_stamp=(k - 0.5) * T, cross_elevation=dx, elevation=de)
        if k == 1:
            assert rig.invalid == {'error_stamp'}
    np.testing.assert_allclose(o['estimate'][:, 0], [0.5, 0.6], atol=1e-9)


def test_azimuth_is_as_much_noisier_as_cross_elevation_is_shorter():
    rig = Rig(target=lambda t: (0.5, 1.2), at=(0.5, 1.2))
    rig.step()
    t = rig.state['tracker'][0]
    assert t['azimuth']['p11'] == pytest.approx(t['elevation']['p11'] / math.cos(1.2)**2, rel=1e-9)


def test_cross_elevation_becomes_azimuth():
    rig = Rig(target=lambda t: (0.51, 1.2), at=(0.5, 1.2))
    for _ in range(50):
        o = rig.step()
    assert abs(rig.inputs['cross_elevation'][0]) < 0.0037
    np.testing.assert_allclose(o['estimate'][:, 0], [0.51, 1.2], atol=1e-9)


@pytest.mark.parametrize('mode', ['autotrack', 'program'])
@pytest.mark.parametrize('delay', [0.0, 0.02])
def test_stabilised_on_a_rolling_deck(mode, delay):
    rig = Rig(lambda t: (1.1 + 0.01 * t, 0.7 + 0.005 * t), attitude=rolling, stabilised=True, delay=delay,
              initial_mode=mode, at=(0.5, 0.7), **QUICK, **{'tracker.handover': False})
    rig.program()
    rows = rig.run(14.0)
    assert rig.mode == mode and not rig.invalid
    unstabilised = np.ptp(rows[800:, :2], axis=0) * 8 / (2 * math.pi)
    assert unstabilised.min() > 0.1
    assert np.abs(rows[800:, 2:]).max() < 4e-5
    # The estimate is that of the earth angles: no ship in it.
    o = rig.outputs[0]
    t = rig.state['stamp'][0]
    np.testing.assert_allclose(o['estimate'][:, 0], [1.1 + 0.01 * t, 0.7 + 0.005 * t], atol=1e-6)
    np.testing.assert_allclose(o['estimate'][:, 1], [0.01, 0.005], atol=1e-5)


def test_reference_is_the_deck_direction_by_brute_force():
    rig = Rig(lambda t: (1.1 + 0.01 * t, 0.7), attitude=rolling, stabilised=True, initial_mode='program',
              at=(0.5, 0.7), **{'tracker.handover': False})
    rig.program()
    rig.run(10.0)
    o, t = rig.outputs[0], rig.state['stamp'][0]
    h = 1e-3
    before, here, after = (rig.deck(t + d) for d in (-h, 0.0, h))
    np.testing.assert_allclose(o['reference'][:, 0], here, atol=2e-5)
    np.testing.assert_allclose(o['reference'][:, 1], (after - before) / (2 * h), atol=2e-4)
    np.testing.assert_allclose(o['reference'][:, 2], (after - 2 * here + before) / h**2, atol=2e-2)


def test_noise_in_is_less_noise_out():
    rig = Rig(moving, initial_mode='autotrack', sigma=5e-4, **QUICK)
    rig.constants['p']['tracker']['receiver']['sigma_floor'] = 5e-4
    errors = rig.run(20.0)[1000:, 2:]
    assert np.sqrt(np.mean(errors**2)) < 0.4 * 5e-4
    assert np.abs(rig.outputs['nis']).max() < 25.0


def test_every_mode_moves_without_a_bump():
    """Command and reference stay continuous through standby -> stow -> preset -> program -> autotrack -> standby."""
    rig = Rig(moving, at=(0.3, 0.3), **QUICK, **{'elevation.stow': 0.4})
    rig.program()
    largest = np.array([rig.params.azimuth.limits.acceleration, rig.params.elevation.limits.acceleration]) * T
    rig.step()
    commands = [np.zeros(2)]
    for request, seconds, mode in ((STOW, 2.0, 'stow'), (PRESET, 2.0, 'preset'), (PROGRAM, 0.05, 'program'),
                                   (None, 3.0, 'autotrack'), (STANDBY, 1.0, 'standby')):
        reference = rig.angle.copy()
        assert request is None or rig.ask(request)
        o = rig.step()
        assert np.abs(o['reference'][:, 0] - rig.inputs['position'][0]).max() < 1e-2
        commands.append(o['rate'].copy())
        for _ in range(round(seconds / T)):
            o = rig.step()
            commands.append(o['rate'].copy())
            assert np.abs(o['reference'][:, 0] - reference).max() < 2.5 * T
            reference = o['reference'][:, 0].copy()
        assert rig.mode == mode
    assert np.all(np.abs(np.diff(commands, axis=0)) <= largest * (1 + 1e-9))
    assert not np.any(rig.outputs['rate']) and not np.any(rig.outputs['torque'])


def test_handover_and_back_are_smooth():
    rig = Rig(moving, at=(0.5, 0.6), initial_mode='program', **{'tracker.coast_time': 0.5})
    rig.program()
    rows = rig.run(4.0)
    assert (rig.mode, rig.reason) == ('autotrack', 'locked')
    rig.receiver_on = False
    rows = np.vstack([rows, rig.run(0.3)])
    assert rig.mode == 'autotrack' and rig.outputs['coasting'][0] == 1
    rows = np.vstack([rows, rig.run(0.5)])
    assert (rig.mode, rig.reason) == ('program', 'signal lost') and rig.outputs['coasting'][0] == 0
    assert np.isnan(rig.outputs['estimate']).all()
    rig.receiver_on = True
    rows = np.vstack([rows, rig.run(2.0)])
    assert rig.mode == 'autotrack'
    # From the settled program on: through hand-over, coasting, fall-back and hand-over again.
    assert np.abs(np.diff(rows[100:, :2], axis=0)).max() < 1e-3
    assert np.abs(rows[100:, 2:]).max() < 5e-5


def test_a_known_latency_is_no_loss():
    """Errors 0.2 s late, twice coast_after: locks, and coasts and gives up as late as with prompt errors."""
    rig = Rig(moving, error_latency=0.2, initial_mode='autotrack', **QUICK, **{'tracker.coast_time': 0.15})
    errors = rig.run(12.0)[:, 2:]
    assert rig.mode == 'autotrack' and rig.outputs['coasting'][0] == 0
    assert np.abs(errors[-400:]).max() < 2e-6
    rig.receiver_on = False
    rig.run(0.095)
    assert rig.outputs['coasting'][0] == 0
    rig.run(0.02)
    assert rig.mode == 'autotrack' and rig.outputs['coasting'][0] == 1
    rig.run(0.05)
    assert (rig.mode, rig.reason) == ('standby', 'signal lost')


def test_loss_without_a_program_ends_in_standby():
    rig = Rig(moving, initial_mode='autotrack', **QUICK, **{'tracker.coast_time': 0.5})
    rig.run(2.0)
    rig.receiver_on = False
    rows = rig.run(1.0)
    assert (rig.mode, rig.reason) == ('standby', 'signal lost')
    assert not np.any(rows[-1, :2])
    rig.receiver_on = True
    rig.run(1.0)
    assert rig.mode == 'standby'


def test_end_of_the_program():
    rig = Rig(initial_mode='program', **{'tracker.handover': False})
    rig.program(rows=2)
    rig.run(0.9)
    assert rig.mode == 'program'
    rig.run(0.2)
    assert (rig.mode, rig.reason) == ('standby', 'after program track')


def test_requests_are_refused_with_the_reason():
    rig = Rig(at=(0.1, 0.1), stabilised=True)
    rig.receiver_on = False

    def refused(request, **changes):
        rig.step(**changes)
        assert not rig.ask(request) and rig.mode == 'standby'
        return rig.reason

    assert refused(PROGRAM) == 'no program track'
    rig.program(start=10.0)
    assert refused(PROGRAM) == 'before program track'
    rig.program(start=-200.0)
    assert refused(PROGRAM) == 'after program track'
    rig.program(target=lambda t: (0.0, -0.3))
    assert refused(PROGRAM) == 'outside limits'
    rig.program()
    rig.angles[1, 0] = math.nan
    assert refused(PROGRAM) == 'no program track'
    assert refused(AUTOTRACK) == 'receiver not locked'
    assert refused(PRESET, preset=(0.0, 3.0), preset_valid=1) == 'outside limits'
    assert refused(17) == 'unknown mode'
    assert refused(STOW, position=(math.nan, 0.0)) == 'encoder invalid'
    fresh = Rig(stabilised=True)
    fresh.program()
    fresh.step(attitude_valid=0)
    assert not fresh.ask(PROGRAM) and fresh.reason == 'attitude invalid' and 'attitude' in fresh.invalid
    fresh.step()
    assert fresh.ask(PROGRAM)


def test_initial_mode_waits_until_it_can_be():
    rig = Rig(moving, initial_mode='program')
    rig.run(0.1)
    assert (rig.mode, rig.reason) == ('standby', 'no program track')
    rig.program()
    rig.angles[1, 0] = math.nan
    rig.step()
    assert (rig.mode, rig.reason, rig.invalid) == ('standby', 'no program track', {'program'})
    rig.program()
    rig.run(0.1)
    assert rig.mode == 'program'
    assert rig.ask(STANDBY)
    rig.run(0.1)
    assert rig.mode == 'standby'


def test_preset_from_the_topic():
    rig = Rig(initial_mode='preset')
    rig.run(2.0)
    np.testing.assert_allclose(rig.angle, [0.0, 0.5], atol=1e-5)
    rig.step(preset=(-0.4, 0.9), preset_valid=1)
    rig.run(2.0, preset_valid=0)
    np.testing.assert_allclose(rig.angle, [-0.4, 0.9], atol=1e-5)
    rig.step(preset=(math.nan, 0.9), preset_valid=1)
    assert rig.invalid == {'preset'}
    rig.step(preset=(-0.4, 2.0), preset_valid=1)
    rig.run(2.0, preset_valid=0)
    np.testing.assert_allclose(rig.angle, [-0.4, rig.params.elevation.limits.high], atol=1e-5)
    assert rig.outputs['angle_limited'].tolist() == [[0, 1]]


NAN_FIELDS = [
    ('position', (math.nan, 0.5), 'encoder'), ('velocity', (0.0, math.inf), 'encoder'),
    ('cross_elevation', math.nan, 'error'), ('elevation', -math.inf, 'error'), ('cn0_dbhz', math.nan, 'error'),
    ('error_stamp', math.nan, 'error_stamp'), ('attitude_stamp', math.nan, 'attitude'),
    ('quaternion', (math.nan, 0, 0, 1), 'attitude'), ('quaternion', (0, 0, 0, 0), 'attitude'),
    ('deck_rate', (0, math.nan, 0), 'attitude'),
]


@pytest.mark.parametrize('field, value, flag', NAN_FIELDS)
@pytest.mark.parametrize('first', [True, False])
def test_nan_is_flagged_and_never_spreads(field, value, flag, first):
    rig = Rig(moving, attitude=rolling, stabilised=True, initial_mode='autotrack', at=(0.5, 0.6), **QUICK)
    if not first:
        rig.run(1.0)
        assert rig.mode == 'autotrack'
    o = rig.step(**{field: value})
    assert flag in rig.invalid and np.isfinite(o['rate']).all() and np.isfinite(o['torque']).all()
    if flag == 'encoder' and not first:
        assert (rig.mode, rig.reason) == ('standby', 'encoder invalid')
        rig.step()
        assert rig.ask(AUTOTRACK)
    rows = rig.run(2.0)
    assert np.isfinite(rows).all() and not rig.invalid and rig.mode == 'autotrack'
    assert np.abs(rows[-1, 2:]).max() < 1e-4


@pytest.mark.parametrize('stamp', [0.0, -1.0, math.nan, math.inf])
def test_stamp_that_does_not_advance_changes_nothing(stamp):
    rig = Rig(moving, initial_mode='autotrack', **QUICK)
    rig.run(1.0)
    before, rate = rig.state.copy(), rig.outputs['rate'].copy()
    rig.step(stamp=stamp)
    assert rig.invalid == {'stamp'} and rig.reason == 'stamp does not advance'
    assert rig.state.tobytes() == before.tobytes()
    np.testing.assert_array_equal(rig.outputs['rate'], rate)


def test_error_stamps_that_stand_still_go_back_or_lie_ahead():
    rig = Rig(initial_mode='autotrack', **QUICK)
    rig.run(1.0)
    for stamp in (0.99, 0.5, -3.0, 1.2):
        before = rig.state['tracker'].tobytes()
        rig.step(error_stamp=stamp if stamp != 0.99 else rig.state['tracker']['stamp'][0])
        assert rig.invalid == {'error_stamp'} and rig.state['tracker'].tobytes() == before
        assert np.isnan(rig.outputs['innovation']).all()


def test_outlier_is_gated():
    rig = Rig(initial_mode='autotrack', **QUICK)
    rig.run(1.0)
    rig.step(cross_elevation=0.3)
    assert rig.invalid == {'error_gated'} and rig.outputs['nis'][0, 0] > 25.0
    assert np.abs(rig.run(0.5)[:, 2:]).max() < 1e-5


def test_gap_between_steps_sets_targets_to_actual():
    rig = Rig(initial_mode='preset')
    rig.run(0.2)
    rig.k += 100
    moved = rig.angle = rig.angle + 0.2
    o = rig.step()
    assert rig.invalid == {'step_gap'} and rig.mode == 'preset'
    np.testing.assert_allclose(o['reference'][:, 0], moved, atol=1e-12)


def test_attitude_lost_ends_autotrack_after_the_timeout():
    rig = Rig(attitude=rolling, stabilised=True, initial_mode='autotrack', at=(0.5, 0.6), **QUICK)
    rig.run(2.0)
    rig.run(0.15, attitude_valid=0)
    assert rig.mode == 'autotrack' and 'attitude' in rig.invalid
    rig.run(0.1, attitude_valid=0)
    assert (rig.mode, rig.reason) == ('standby', 'attitude invalid')


def test_earth_angles_are_never_taken_for_deck_angles():
    """The attitude fails for the instant of the command before it does for the present one."""
    rig = Rig(lambda t: (1.1, 0.7), attitude=rolling, stabilised=True, delay=0.1, initial_mode='program',
              at=(0.5, 0.6), **{'tracker.handover': False})
    rig.program()
    rig.run(5.0)
    before = rig.outputs['reference'][0][0, 0]
    while rig.mode == 'program':
        assert abs(rig.outputs['reference'][0][0, 0] - before) < 0.02
        rig.step(attitude_valid=0)
    assert rig.reason == 'attitude invalid'


def test_late_attitude_is_predicted_with_rate_and_acceleration():
    """In mode program no loop through the receiver hides an error of the attitude."""
    rig = Rig(attitude=rolling, stabilised=True, initial_mode='program', at=(0.5, 0.6), **{'tracker.handover': False})
    rig.program()
    worst = 0.0
    for k in range(2400):
        late = max(k - 8, 0) * T
        error = rig.error(k * T, rig.angle)
        rig.step(attitude_stamp=late, quaternion=rolling(late).as_quat(), deck_rate=body_rate(rolling, late))
        worst = max(worst, *np.abs(error)) if k > 1200 else 0.0
    assert rig.mode == 'program' and not rig.invalid
    print(f'attitude 40 ms late: worst pointing error {worst:.2e} rad')
    assert worst < 6e-5


def test_program_takes_the_turn_that_holds_the_whole_pass():
    """From 170 deg clockwise by 220 deg: on the near turn it would hit +270 deg, one turn lower it fits."""
    def clockwise(t):
        return (math.radians(170.0 + 2.2 * t) + math.pi) % (2 * math.pi) - math.pi, 0.6

    rig = Rig(clockwise, at=(math.radians(160.0), 0.6), initial_mode='program')
    rig.program(rows=101)
    rig.run(8.0)
    assert rig.mode == 'autotrack'
    assert math.degrees(rig.angle[0]) == pytest.approx(170.0 - 360.0 + 2.2 * 8.0, abs=0.01)
    assert rig.outputs['angle_limited'].tolist() == [[0, 0]]


def test_azimuth_goes_round_at_the_end_of_its_travel():
    def clockwise(t):
        return 4.5 + 0.1 * t, 0.6

    rig = Rig(clockwise, at=(4.5, 0.6), initial_mode='autotrack', **QUICK)
    rows = rig.run(2.0)
    assert rig.angle[0] == pytest.approx(4.7, abs=1e-3)
    rig.run(6.0)
    assert rig.mode == 'autotrack'
    assert rig.angle[0] == pytest.approx(5.3 - 2 * math.pi, abs=1e-4)
    assert np.isfinite(rows).all()


def test_same_inputs_give_the_same_bits():
    first, second = (Rig(moving, attitude=rolling, stabilised=True, initial_mode='autotrack', sigma=1e-4, **QUICK)
                     for _ in range(2))
    first.run(1.0), second.run(1.0)
    assert first.state.tobytes() == second.state.tobytes() and first.outputs.tobytes() == second.outputs.tobytes()


def test_reasons_and_modes_have_names():
    assert MODES[AUTOTRACK] == 'autotrack' and REASONS[modes.BAD_STAMP] == 'stamp does not advance'
    assert len(set(REASONS)) == len(REASONS)
