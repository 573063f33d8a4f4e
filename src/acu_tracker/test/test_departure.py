"""Autotrack that departs from the program while the level falls: what comes first decides. On an ideal axis."""
import math

import pytest

from acu_tracker.estimation import departure

START, ELEVATION, CN0 = 4.0, 0.6, 46.0
JERK = 2.0
"""Of the target from START on, across the line of sight [rad/s3]; the program stays behind."""
B = 0.0175  # beamwidth [rad]
SIGMA = 5e-4  # noise of an error at CN0 [rad]
MAX_FALL = 10.75  # largest fall of the level [dB]


def leave(Rig, delay, fall=43.0, offset=0.0, **parameters):
    """(rig, distance between target and program [beamwidths]) after a target that is tracked has left its program, or
    after a second. From `delay` s after START on the level falls by `fall` dB/s, in all by MAX_FALL; offset: error of
    the program before [beamwidths]."""
    def target(t):
        s = max(t - START, 0.0)
        return 0.5 + JERK * s**3 / 6.0 / math.cos(ELEVATION), ELEVATION
    rig = Rig(target, at=(0.5, ELEVATION), initial_mode='program', sigma=SIGMA, **parameters)
    rig.program(target=lambda t: (0.5, ELEVATION + offset * B))
    rig.run(START, cn0_dbhz=CN0)
    assert rig.mode == 'autotrack'
    gone = 0.0
    while rig.mode == 'autotrack' and rig.k * rig.T < START + 1.0:
        t = rig.k * rig.T - START
        gone = JERK * t**3 / 6.0 / B
        drop = min(fall * max(t - delay, 0.0), MAX_FALL)
        rig.sigma = SIGMA * 10.0**(0.05 * drop)
        rig.step(cn0_dbhz=CN0 - drop)
    return rig, gone


GONE = 1.4  # distance of target and program [beamwidths] at which the level begins to fall
LATE_S = (6.0 * GONE * B / JERK)**(1.0 / 3.0)


def test_a_beam_that_moves_before_its_level_falls_has_left_its_target(Rig):
    """The level begins to fall when the target has left by GONE beamwidths."""
    rig, gone = leave(Rig, LATE_S)
    assert (rig.mode, rig.reason) == ('program', 'departed from the program')
    assert GONE + departure.MAX_BEAMWIDTHS < gone < GONE + departure.MAX_BEAMWIDTHS + 0.7


@pytest.mark.parametrize('delay, fall, offset', [(0.0, 43.0, 0.0), (LATE_S, 5.9, 0.0), (LATE_S, 43.0, 3.1)],
                         ids=['the level falls first', 'the level falls slowly', 'the program was wrong before'])
def test_the_target_is_tracked_on(Rig, delay, fall, offset):
    rig, gone = leave(Rig, delay, fall, offset)
    assert (rig.mode, rig.reason) == ('autotrack', 'locked') and gone > 18.0


@pytest.mark.parametrize('fallback', ['coast', 'search', 'preset'])
def test_the_program_is_followed_whatever_the_fallback_is_because_it_is_right(Rig, fallback):
    rig, _ = leave(Rig, LATE_S, fallback=fallback)
    assert (rig.mode, rig.reason) == ('program', 'departed from the program')


def test_two_departures_soon_after_the_lock_are_a_divergence_until_a_reset():
    state = departure.Departure.zeros()
    departure.initialise(state)
    one = state[0]

    def end(begun, ended, by_departure=True):
        departure.restart(one, begun)
        return departure.note_end(one, ended, by_departure)
    assert not end(0.0, 5.0) and not end(6.0, 7.0, False) and end(8.0, 9.0)
    departure.release(one)
    assert not end(10.0, 11.0) and not end(12.0, 12.1 + departure.HOLD_TIME_S) and end(30.0, 31.0)
    departure.release(one)
    assert not end(40.0, 41.0) and not end(100.0, 41.1 + departure.SUCCESSION_TIME_S)


def test_a_program_that_replaces_another_one_is_no_departure(Rig):
    """In a fade the operator gives a program that begins 1.2 beamwidths off the target."""
    rig = Rig(lambda t: (0.5, ELEVATION), at=(0.5, ELEVATION), initial_mode='program', sigma=SIGMA)
    rig.program(target=rig.target)
    rig.run(START, cn0_dbhz=CN0)
    for k, drop in enumerate((*[1.0] * 5, *[2.2] * 5, *[4.0] * 40)):
        if k == 8:
            rig.program(target=lambda t: (0.5, ELEVATION + 1.2 * B))
        rig.step(cn0_dbhz=CN0 - drop)
    assert (rig.mode, rig.reason) == ('autotrack', 'locked')
