"""Errors that lead the beam off its target too gently for the tests of the slope. Closed loops of scenarios."""
import math

import numpy as np
import pytest

from acu_tracker.modes import Mode, Reason
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.wire.commands import Command
from pedestal_studies.system import target_filters

ONSET_S, PATIENCE_S = 8.0, 12.0
HARD_TARGETS = ('s-motion', 'square', 'chirp', 'quadcopter', 'jet', 'stunt-plane', 'uav-60m', 's-motion-ship',
                'chirp-ship')


def variant(name, seed, parameters=(), duration=ONSET_S + PATIENCE_S):
    chosen = (target_filters.placed(f'{name}/default', seed) if name in target_filters.TARGET_SCENARIOS else
              Variant(name, seed=seed))
    return chosen.with_(dict(parameters), duration=duration)


def turned_over(name, seed, parameters=(), resets=0, factor=0.3, turn=math.pi):
    """(run from ONSET_S on until the alarm, reasons for which autotrack ended, largest error in autotrack
    [beamwidths]). The alarm is reset some times."""
    loop = closed_loop.Loop(variant(name, seed, parameters, ONSET_S + PATIENCE_S * (1 + resets)).load())
    first = round(ONSET_S * 1e9 / loop.period_ns)
    loop.run(last=first)
    acu, reasons = loop.units['acu'], []
    loop.units['tracking_receiver'].command(
        Command('wrong_slope', arguments={'factor': f'{factor:g}', 'turn': f'{turn:.6f}'}))
    state, left = acu.parts['state'], [resets]

    def watch(made):
        if state['mode']['now'] != Mode.AUTOTRACK and (not reasons or reasons[-1] != state['mode']['reason']):
            reasons.append(int(state['mode']['reason']))
        if acu.faults and left[0] == 0:
            return 0
        if acu.faults:
            left[0] -= 1
            assert acu.request('acu/reset_faults')
        return 10
    run = loop.run(watch=watch)
    automatic = run['acu/mode'] == Mode.AUTOTRACK
    off = np.hypot(*run.truth['error'].T) / acu.parameters.tracker.receiver.beamwidth
    return run, reasons, off[automatic].max()


@pytest.mark.parametrize('name, seed', [('uav_flyby', 1), ('uav_tracker_3m', 2), ('quadcopter', 3), ('leo_pass', 3)])
def test_a_weak_slope_of_the_wrong_sign_is_left_soon_and_then_is_an_alarm(name, seed):
    run, reasons, off = turned_over(name, seed)
    assert off < 2.0 and {*reasons} <= {Reason.DEPARTED, Reason.DIVERGED}
    assert run.units['acu'].faults == ('diverged',) and run['acu/mode'][-1] == Mode.PROGRAM
    assert run.units['acu'].request('acu/autotrack') == (False, 'refused: diverged; mode is program')


@pytest.mark.parametrize('fallback', ['coast', 'search', 'standby'])
def test_the_alarm_comes_with_every_fallback(fallback):
    run, reasons, off = turned_over('square', 2, {'acu.fallback': fallback})
    assert off < 2.0 and run.units['acu'].faults == ('diverged',) and run['acu/mode'][-1] == Mode.PROGRAM


def test_a_reset_while_the_slope_is_still_wrong_is_followed_by_the_same_verdict():
    run, _, off = turned_over('square', 1, resets=2)
    ends = np.flatnonzero(np.diff((run['acu/mode'] == Mode.AUTOTRACK).astype(int)) < 0)
    assert off < 2.0 and len(ends) >= 5 and run.units['acu'].faults == ('diverged',)


@pytest.mark.thorough
@pytest.mark.parametrize('name', ['uav_flyby', 'ship_pass', 'uav_tracker_3m', 'station_real', 'quadcopter', 'square',
                                  'leo_station_7m'])
def test_a_weak_slope_of_the_wrong_sign_is_an_alarm_at_any_time(name):
    for seed in range(11, 21):
        run, _, off = turned_over(name, seed)
        assert off < 2.0 and run.units['acu'].faults == ('diverged',), seed


@pytest.mark.thorough
@pytest.mark.parametrize('turn', [0.75 * math.pi, math.pi])
@pytest.mark.parametrize('name', ['square', 'leo_station_7m'])
def test_autotrack_ends_within_two_beamwidths_of_the_target(name, turn):
    for seed in range(21, 31):
        run, _, off = turned_over(name, seed, factor=1.0, turn=turn)
        assert off < 2.0 and run.units['acu'].faults == ('diverged',), seed


def departures(name, seed, parameters, duration):
    """Number of departures, and time of autotrack [s], of a run with a right slope."""
    loop = closed_loop.Loop(variant(name, seed, parameters, duration).load())
    state, seen, before = loop.units['acu'].parts['state'], [], [0]

    def watch(made):
        mode = int(state['mode']['now'])
        if before[0] == Mode.AUTOTRACK != mode:
            seen.append(int(state['mode']['reason']))
        before[0] = mode
        return 20
    run = loop.run(watch=watch)
    return seen.count(Reason.DEPARTED), (run['acu/mode'] == Mode.AUTOTRACK).sum() * loop.period_ns * 1e-9


def interruptions(kind, seed, duration):
    """Parameters of a run with masts that hide the signal at equal distances, with fades of 3 to 60 dB, or with a
    program that is up to 0.3 s late or early."""
    rng, t, faults = np.random.default_rng([seed, 51]), 6.0, []
    if kind == 'program':
        return {'scenario.program.time_offset': rng.uniform(-0.3, 0.3)}
    distance, width = rng.uniform(1.8, 5.0), rng.uniform(0.2, 1.2)
    while t < duration - 2.0:
        depth = 60.0 if kind == 'masts' else rng.uniform(3.0, 60.0)
        width = width if kind == 'masts' else rng.choice([0.1, 0.3, 1.0, 4.0])
        faults.append(f'{t:.3f} fade depth={depth:.1f} duration={width:.2f}')
        t += distance if kind == 'masts' else width + rng.uniform(0.5, 5.0)
    return {'tracking_receiver.inject': '; '.join(faults)}


@pytest.mark.parametrize('name, kind', [('leo_pass', 'masts'), ('uav_flyby', 'fades'), ('square', 'masts'),
                                        ('jet', 'fades'), ('chirp', 'program')])
def test_a_signal_that_is_interrupted_is_no_departure(name, kind):
    count, seconds = departures(name, 4, interruptions(kind, 4, 25.0), 25.0)
    assert count == 0 and seconds > 3.0


@pytest.mark.thorough
@pytest.mark.parametrize('kind', ['masts', 'fades', 'program'])
@pytest.mark.parametrize('name', HARD_TARGETS)
def test_no_interruption_of_a_target_that_turns_hard_is_a_departure(name, kind):
    """Half of the targets turn by 11 deg/s2 while their signal is hidden, and leave the beam behind the mast."""
    counts, times = zip(*(departures(name, seed, interruptions(kind, seed, 30.0), 30.0) for seed in range(31, 39)))
    assert sum(counts) <= (1 if kind == 'fades' else 0) and sum(times) > 20.0
