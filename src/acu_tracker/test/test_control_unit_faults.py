"""The whole unit under inputs that are wrong, late, or missing."""
import math

import numpy as np
import pytest

from acu_tracker.modes import Mode

NAN_FIELDS = [
    ('position', (math.nan, 0.5), 'encoder'), ('velocity', (0.0, math.inf), 'encoder'),
    ('cross_elevation', math.nan, 'error'), ('elevation', -math.inf, 'error'), ('cn0_dbhz', math.nan, 'error'),
    ('error_stamp', math.nan, 'error_stamp'), ('attitude_stamp', math.nan, 'attitude'),
    ('quaternion', (math.nan, 0, 0, 1), 'attitude'), ('quaternion', (0, 0, 0, 0), 'attitude'),
    ('deck_rate', (0, math.nan, 0), 'attitude'),
]


@pytest.mark.parametrize('field, value, flag', NAN_FIELDS)
@pytest.mark.parametrize('first', [True, False])
def test_nan_is_flagged_and_never_spreads(Rig, field, value, flag, first):
    rig = Rig(Rig.moving, attitude=Rig.rolling, stabilised=True, initial_mode='autotrack', at=(0.5, 0.6), **Rig.QUICK)
    if not first:
        rig.run(1.0)
        assert rig.mode == 'autotrack'
    o = rig.step(**{field: value})
    assert flag in rig.invalid and np.isfinite(o['rate']).all() and np.isfinite(o['torque']).all()
    if flag == 'encoder' and not first:
        assert (rig.mode, rig.reason) == ('standby', 'encoder invalid')
        rig.step()
        assert rig.ask(Mode.AUTOTRACK)
    rows = rig.run(2.0)
    assert np.isfinite(rows).all() and not rig.invalid and rig.mode == 'autotrack'
    assert np.abs(rows[-1, 2:]).max() < 1e-4


@pytest.mark.parametrize('stamp', [0.0, -1.0, math.nan, math.inf])
def test_stamp_that_does_not_advance_changes_nothing(Rig, stamp):
    rig = Rig(Rig.moving, initial_mode='autotrack', **Rig.QUICK)
    rig.run(1.0)
    before, rate = rig.state.copy(), rig.outputs['rate'].copy()
    rig.step(stamp=stamp)
    assert rig.invalid == {'stamp'} and rig.reason == 'stamp does not advance'
    assert rig.state.tobytes() == before.tobytes()
    np.testing.assert_array_equal(rig.outputs['rate'], rate)


def test_error_stamps_that_stand_still_go_back_or_lie_ahead(Rig):
    rig = Rig(initial_mode='autotrack', **Rig.QUICK)
    rig.run(1.0)
    for stamp in (0.99, 0.5, -3.0, 1.2):
        tracker = rig.state['tracking']['target']
        before = tracker.copy()
        rig.step(error_stamp=stamp if stamp != 0.99 else tracker['stamp'][0])
        assert rig.invalid == {'error_stamp'} and tracker['stamp'] == before['stamp']
        for name in ('x', 'p', 'mu'):
            after = tracker['filter']['axis']
            assert after[name].tobytes() == before['filter']['axis'][name].tobytes()
        assert np.isnan(rig.outputs['innovation']).all()


@pytest.mark.parametrize('locked', [True, False])
@pytest.mark.parametrize('field, value, flag', [
    ('cn0_dbhz', math.nan, 'error'), ('cn0_dbhz', -math.inf, 'error'), ('error_stamp', 1.2, 'error_stamp'),
    ('error_stamp', -3.0, 'error_stamp'), ('error_stamp', math.nan, 'error_stamp')])
def test_a_message_that_a_mode_goes_by_the_level_of_is_judged_locked_or_not(Rig, field, value, flag, locked):
    rig = Rig(initial_mode='stop', at=(0.5, 0.6))
    rig.run(1.0, error_came=1)
    said = {'error_came': 1, 'error_valid': locked}
    rig.step(**said, **{field: value})
    assert rig.invalid == ({flag} if locked else set())
    assert rig.ask(Mode.STEPTRACK)
    rig.step(**said)
    assert not rig.invalid and rig.mode == 'steptrack'
    rig.step(**said, **{field: value})
    assert rig.invalid == {flag}
    rig.step(**said)
    assert not rig.invalid
    rig.step(error_came=0, error_valid=0, **{field: value})
    assert not rig.invalid and rig.mode == 'steptrack'


def test_outlier_is_gated(Rig):
    rig = Rig(initial_mode='autotrack', **Rig.QUICK)
    rig.run(1.0)
    rig.step(cross_elevation=0.3)
    assert rig.invalid == {'error_gated'} and rig.outputs['nis'][0, 0] > 25.0
    assert rig.outputs['gated'] == 1
    rig.put(**{f'{axis}.filter.{name}': value for axis in ('azimuth', 'elevation')
               for name, value in (('kind', 'imm_ukf'), ('rate_measurement', True))})
    rig.run(0.5, range=800.0, range_variance=1.0, error_rate_sigma=1e-4)
    rig.step(range=900.0, range_variance=1.0, error_rate=(0.5, 0.0), error_rate_sigma=1e-4)
    assert not rig.invalid
    assert [rig.outputs[name][0] for name in ('gated', 'rates_gated', 'ranges_gated')] == [1, 1, 1]
    assert np.abs(rig.run(0.5)[:, 2:]).max() < 1e-5


def test_gap_between_steps_sets_targets_to_actual(Rig):
    rig = Rig(initial_mode='preset')
    rig.run(0.2)
    rig.k += 100
    moved = rig.angle = rig.angle + 0.2
    o = rig.step()
    assert rig.invalid == {'step_gap'} and rig.mode == 'preset'
    np.testing.assert_allclose(o['reference'][:, 0], moved, atol=1e-12)


def test_attitude_lost_ends_autotrack_after_the_timeout(Rig):
    rig = Rig(attitude=Rig.rolling, stabilised=True, initial_mode='autotrack', at=(0.5, 0.6), **Rig.QUICK)
    rig.run(2.0)
    rig.run(0.15, attitude_valid=0)
    assert rig.mode == 'autotrack' and 'attitude' in rig.invalid
    rig.run(0.1, attitude_valid=0)
    assert (rig.mode, rig.reason) == ('standby', 'attitude invalid')


def test_earth_angles_are_never_taken_for_deck_angles(Rig):
    """The attitude fails for the instant of the command before it does for the present one."""
    rig = Rig(lambda t: (1.1, 0.7), attitude=Rig.rolling, stabilised=True, delay=0.1, initial_mode='program',
              at=(0.5, 0.6), **{'tracker.handover': False})
    rig.program()
    rig.run(5.0)
    before = rig.outputs['reference'][0][0, 0]
    while rig.mode == 'program':
        assert abs(rig.outputs['reference'][0][0, 0] - before) < 0.02
        rig.step(attitude_valid=0)
    assert rig.reason == 'attitude invalid'
