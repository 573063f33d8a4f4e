"""The command excite: a multisine on the rate command of one axis, and what ends it."""
import numpy as np
import pytest

from acu_tracker.alarms import annunciator, table
from acu_tracker.operating import diagnosis
from pedestal_common.multisine import Sweep

T = 0.005
SWEEP = Sweep(8.0, 0.25, 90.0, 100, 0, 1, 0.02)
EXCITE = {'axis': 'elevation', 'peak': 0.02, 'duration': 3.0}


@pytest.fixture
def axes(Axes):
    made = Axes().run(0.1)
    assert made.ask('stop').granted
    return made.run(1.0)


def excited(axes):
    return bool(axes.unit.parts['state']['excitation']['count'])


def sent(axes, steps):
    return np.array(axes.rates[-steps:])


def test_the_command_is_that_of_the_controller_plus_the_multisine(axes):
    still = sent(axes, 10)
    assert axes.ask('excite', **EXCITE).granted and excited(axes)
    assert dict(diagnosis.of(axes.unit).values)['excited'] == 'elevation'
    axes.run(3.0)
    rates, once = sent(axes, 600), SWEEP.once(T)
    # An ideal axis returns the multisine through its controller with a delay of one step, -K_p times the angle that
    # it has caused; what the controller adds is small at once, and only on the excited axis.
    assert rates[0, 1] == pytest.approx(once[1], rel=0.05) and np.abs(rates[:, 0]).max() < 1e-6 + np.abs(still).max()
    spectrum = np.fft.rfft(rates[:, 1] - np.mean(rates[:, 1]))
    fast = np.arange(len(spectrum)) > 600 * T * 40.0       # above 40 Hz the loop does not act
    expected = np.fft.rfft(once[1:601] - once[1:601].mean())
    assert np.abs(spectrum - expected)[fast].sum() < 0.15 * np.abs(expected[fast]).sum()


def test_it_ends_by_itself_and_leaves_no_trace(axes):
    assert axes.ask('excite', **EXCITE).granted
    axes.run(3.0 - T)
    assert excited(axes)
    axes.run(4.0)
    assert not excited(axes) and np.abs(sent(axes, 100)).max() < 1e-6
    assert 'excited' not in dict(diagnosis.of(axes.unit).values)


@pytest.mark.parametrize('verb', ['stop', 'standby', 'preset'])
def test_any_mode_ends_it(axes, verb):
    assert axes.ask('excite', **EXCITE).granted
    axes.run(0.5)
    assert axes.ask(verb).granted and not excited(axes)


def test_a_refused_mode_and_an_old_alarm_do_not_end_it_but_a_new_alarm_does(axes):
    alarms = axes.unit.alarms
    annunciator.set_condition(alarms, table.ALARM_INDEX['drive silent'], True, float(axes.k * T) - 1.0)
    assert axes.ask('excite', **EXCITE).granted and not axes.ask('program').granted
    axes.run(0.5)
    assert excited(axes)
    annunciator.set_condition(alarms, table.ALARM_INDEX['steps lost'], True, float(axes.k * T))
    axes.run(2.0 * T)
    assert not excited(axes)


def test_a_silence_and_a_limit_of_the_angle_end_it(axes):
    assert axes.ask('excite', **EXCITE).granted
    axes.run(0.1)
    axes.k += 100
    assert not excited(axes.run(T))
    # A preset that moves beyond the limit is held there.
    limit = axes.unit.parameters.elevation.limits.high
    assert axes.ask('preset', elevation=limit - 0.1, elevation_rate=0.1, moves=60).granted
    axes.run(1.0)
    assert axes.ask('excite', **EXCITE).granted
    axes.run(2.0)
    assert not excited(axes) and axes.angle[1] <= limit


@pytest.mark.parametrize(('changes', 'said'), [
    ({'peak': 0.2}, 'peak = 0.2 rad/s: must be 1e-06 to 0.1'), ({'axis': 'roll'}, 'must be one of azimuth, elevation'),
    ({'duration': 601}, 'duration = 601 s: must be 1 to 600'), ({'highest': 100.0}, 'must be 0.125 to 100 Hz'),
    ({'lowest': 50.0, 'highest': 40.0}, 'lowest below highest'), ({'lowest': 0.1}, 'must be 0.125 to 100 Hz'),
    ({'period': 3.0001}, 'period = 3.0001 s: must be a multiple of the step, 0.005 s'),
    ({'points': 151}, 'points = 151: must be 2 to 150')])
def test_wrong_arguments_are_refused_with_name_value_and_range(axes, changes, said):
    reply = axes.ask('excite', **{**EXCITE, **changes})
    assert not reply.granted and said in reply.text and not excited(axes)


def test_the_peak_is_limited_by_the_rate_of_the_axis(Axes):
    slow = Axes(**{'elevation.limits.rate': 0.1, 'elevation.shaper.rate': 0.1}).run(0.1)
    slow.ask('stop')
    reply = slow.run(0.1).ask('excite', **EXCITE)
    assert not reply.granted and 'must be at most 0.1 of elevation.limits.rate, 0.01 rad/s' in reply.text


@pytest.mark.parametrize('mode', ['standby', 'stow', 'rate'])
def test_it_is_refused_in_other_modes_and_while_it_runs(axes, mode):
    axes.ask(mode)
    reply = axes.run(0.2).ask('excite', **EXCITE)
    assert not reply.granted and f'mode is {mode}, must be one of stop, preset' in reply.text
    axes.ask('stop')
    assert axes.run(0.2).ask('excite', **EXCITE).granted
    assert 'is running' in axes.ask('excite', **EXCITE).text


def test_a_wrong_excitation_changes_no_bit_of_the_commands(axes, Axes):
    other = Axes().run(0.1)
    other.ask('stop')
    other.run(1.0)
    axes.ask('excite', **{**EXCITE, 'highest': 100.0})
    assert np.array_equal(axes.run(1.0).rates, other.run(1.0).rates)
