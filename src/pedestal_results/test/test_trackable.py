"""Shares of a run are shares of the time in which the target could be tracked; the verdict names the rest. The time
lost in a keyhole is the announced one."""
import numpy as np
import pytest

from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.program import Plan
from pedestal_results import results, trackable
from pedestal_results.recorded_run import RecordedRun


def flown(name, changes, duration=None):
    """Return (RecordedRun, its results)."""
    run = RecordedRun(memory_recording.record(scenario.load(name, changes, duration=duration)))
    return run, {key: value for key, (value, _) in results.measured(run.parts).items()}


def turned(azimuth):
    """Return azimuths in 0 to 2 pi."""
    return np.mod(azimuth, 2.0 * np.pi)


CASES = {
    'mask': ('leo_pass', ('tracking_receiver.receiver.horizon_mask=0.8',), lambda A, E: E >= 0.8,
             'below the horizon mask of 45.8 deg'),
    'floor': ('leo_pass', ('acu.floor=0 0.8; 3 0.8', 'acu.elevation.preset=0.9'), lambda A, E: E >= 0.8,
              'below the floor of the antenna'),
    'elevation': ('leo_pass', ('acu.elevation.limits.high=1.0', 'acu.elevation.stow=0.9'), lambda A, E: E <= 1.0,
                  'outside the travel of the axes'),
    'azimuth': ('uav_flyby', ('acu.azimuth.limits.low=-1', 'acu.azimuth.limits.high=0.3'),
                lambda A, E: (turned(A) >= 2.0 * np.pi - 1.0) | (turned(A) <= 0.3), 'outside the travel of the axes'),
    'sector': ('blockage', (), lambda A, E: ~((turned(A + 0.1) <= 0.3) & (E <= 1.0)), 'in a hidden sector')}


@pytest.mark.every_case
@pytest.mark.parametrize('case', CASES)
def test_shares_are_of_the_time_in_which_the_target_could_be_tracked(case):
    name, changes, visible, text = CASES[case]
    run, found = flown(name, changes)
    tracked, (azimuth, elevation) = run.tracking, run.tracking.target_earth.T
    expected = visible(azimuth, elevation)
    assert 0.2 < expected.mean() < 0.98
    # The floor is looked up in cells of half a degree, and the encoders are off by the resolution of an encoder.
    assert np.mean(tracked.trackable != expected) < 1e-3
    assert found['trackable_time_s'] == pytest.approx(np.sum(expected) * tracked.period, rel=1e-3)
    assert found['tracked_percent'] == pytest.approx(100.0 * np.mean(tracked.mode[expected] == 'autotrack'), abs=0.2)
    counted = expected & tracked.since
    off = np.sum(tracked.distance[counted] > 0.5 * tracked.beamwidth) * tracked.period
    assert found['loss_s'] == pytest.approx(off, abs=0.05)
    rest = np.sum(~expected) * tracked.period
    assert run.verdict.text.endswith(f'; in the run of {tracked.t[-1]:.4g} s the target was {text} for {rest:.3g} s')
    assert f'% of the {found["trackable_time_s"]:.4g} s in which the target could be tracked' in run.verdict.text


def test_a_table_that_sets_in_mid_run_does_not_count_the_time_below_the_horizon(tmp_path):
    path = tmp_path / 'sets.csv'
    path.write_text('t,az,el\n' + ''.join(f'{t},{120 + 0.2 * t},{8 - 0.5 * t}\n' for t in range(31)))
    run, found = flown('track_file', (f'tracking_receiver.target.track_file.path={path}',))
    assert found['trackable_time_s'] == pytest.approx(16.0, abs=0.05)
    assert found['tracked_percent'] > 85.0 and found['loss_s'] == 0.0
    assert 'the target was below the horizon for 13.9 s' in run.verdict.text


def test_a_run_without_a_target_to_be_tracked_has_no_share():
    run, found = flown('leo_pass', ('tracking_receiver.receiver.horizon_mask=1.4',), 5.0)
    assert (found['trackable_time_s'], str(found['tracked_percent'])) == (0.0, 'nan')
    assert run.verdict.word == 'never locked'
    assert run.verdict.text.endswith('the target was below the horizon mask of 80.2 deg for 5 s')


def test_all_reasons_of_a_rest_are_named_and_a_short_rest_is_not():
    bag, _ = flown('uav_flyby', (), 0.5)
    codes = np.repeat([trackable.NONE, trackable.NO_TARGET, trackable.HIDDEN], [100, 200, 40])
    assert trackable.rest(bag.bag, codes, 0.01) == 'outside its track for 2 s and in a hidden sector for 0.4 s'
    assert trackable.rest(bag.bag, codes[:140], 0.01) == ''


@pytest.mark.every_case
@pytest.mark.parametrize('rate, latitude', [(0.05, 47.45), (0.1, 47.42), (0.2, 47.5), (0.35, 47.4)])
def test_a_pass_through_the_keyhole_loses_what_was_announced(rate, latitude):
    """From an azimuth rate that loses almost a minute to one that follows the whole pass, near 86 deg."""
    changes = [*(f'tracking_receiver.target.leo_pass.{text}' for text in (
        'culmination_low_deg=86', 'culmination_high_deg=90', 'search_days=30')),
        'tracking_receiver.target.station.longitude_deg=8.55',
        f'tracking_receiver.target.station.latitude_deg={latitude}', f'acu.azimuth.shaper.rate={rate}',
        f'acu.azimuth.limits.rate={1.05 * rate}', f'acu.azimuth.shaper.acceleration={1.5 * rate}',
        f'acu.azimuth.limits.acceleration={3.0 * rate}']
    _, angles = Plan(scenario.load('leo_pass', changes)).tables['']
    run, found = flown('leo_pass', [*changes, f'adu.initial_azimuth={angles[0, 0]}',
                                    f'adu.initial_elevation={angles[0, 1]}'])
    announced = found.get('keyhole_loss_predicted_s', 0.0)
    assert found['loss_s'] == pytest.approx(announced, rel=0.1, abs=0.15)
    assert (announced > 0.0) == (rate < 0.3)
    assert (f'(announced for the keyhole: {announced:.3g} s)' in run.verdict.text) == (announced > 4.0)
