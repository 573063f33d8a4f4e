"""Search, acquisition and loss in the closed loop of their scenarios, under seeds that nobody tuned for."""
import numpy as np
import pytest

from acu_tracker.modes import Mode
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario.variant import Variant
from pedestal_studies.system import acquisition as study


def run(name, seed, duration=None, **parameters):
    return closed_loop.Loop(Variant(name, seed=seed, duration=duration).with_(parameters).load()).run()


def went_through(run):
    return list(run.table('acu/mode')['data'])


def assert_on_target(run, seconds=2.0):
    """Locked, in autotrack, within a tenth of a beamwidth for the last seconds."""
    last = run.t > run.t[-1] - seconds
    assert np.all(run['acu/mode'][last] == Mode.AUTOTRACK)
    assert study.off_axis(run)[last].max() < 0.1


@pytest.mark.parametrize('late, pattern', [(2.0, 'raster'), (2.5, 'spiral'), (1.5, 'square')])
def test_a_late_satellite_is_found_by_a_search(late, pattern):
    one = run('late_tle', 11, **{'scenario.program.time_offset': -late, 'acu.search.pattern': pattern})
    assert went_through(one) == ['program', 'search', 'acquire', 'autotrack']
    assert_on_target(one)


def test_a_side_lobe_is_left_for_the_main_lobe():
    one = run('sidelobe', 12)
    assert went_through(one) == ['program', 'autotrack', 'acquire', 'autotrack']
    off = study.off_axis(one)
    begun = one.t[np.flatnonzero(one['acu/mode'] == Mode.ACQUIRE)[0]]
    assert off[np.searchsorted(one.t, begun) - 1] == pytest.approx(1.68, abs=0.05)
    assert_on_target(one, 10.0)


def test_without_an_expected_level_the_side_lobe_is_not_seen():
    """What the scenario shows is the check: without it the antenna stays on the false null."""
    one = run('sidelobe', 12, 10.0, **{'acu.acquisition.expected_dbhz': 0.0})
    assert went_through(one) == ['program', 'autotrack']
    assert study.off_axis(one)[-1] == pytest.approx(1.68, abs=0.05)


def test_a_drop_out_ends_in_autotrack():
    one = run('fade', 13)
    assert went_through(one) == ['program', 'autotrack', 'search', 'acquire', 'autotrack']
    assert_on_target(one)
    assert 10.0 < study.tracked_after(one, True) < 30.0


def test_a_hidden_target_is_bridged():
    one = run('blockage', 14)
    assert went_through(one) == ['program', 'autotrack']
    assert_on_target(one)
    assert 9.5 < study.tracked_after(one, True) < 11.0


def test_a_manoeuvre_while_it_coasts():
    one = run('manoeuvre_in_coast', 15)
    assert went_through(one) == ['preset', 'autotrack', 'search', 'acquire', 'autotrack']
    assert_on_target(one)


def test_step_track_follows_the_level():
    one = run('steptrack_geo', 16)
    assert went_through(one) == ['preset', 'steptrack']
    settled = study.off_axis(one)[one.t > study.STEPTRACK_SETTLING_TIME_S]
    assert settled.max() < 0.3
    assert np.sqrt(np.mean((12.0 * settled**2)**2)) < 0.25
