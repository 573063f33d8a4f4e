"""The level against numpy's moments, and against the chance that noise alone is taken for a target."""
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from acu_tracker.search import level
from acu_tracker.search.level import AcquisitionParameters
from pedestal_common.parameters import record

T = 0.005
P = record(AcquisitionParameters())[0]


@pytest.fixture
def state():
    one = level.Level.zeros()[0]
    one['stamp'] = -math.inf
    return one


def noise(seconds, seed=1, signal=0.0):
    """C/N0 [dB-Hz] of a receiver with 1 ms samples and 0.1 s of smoothing: noise power 1, a carrier of this power."""
    rng = np.random.default_rng(seed)
    n = round(seconds / 1e-3)
    power = 0.5 * ((rng.standard_normal(n) + math.sqrt(2.0 * signal))**2 + rng.standard_normal(n)**2)
    smooth, _ = lfilter([0.01], [1.0, -0.99], power, zi=[0.99])
    return 10.0 * np.log10(np.maximum(smooth[4::5] - 1.0, 0.01) / 1e-3)


def learnt(state, z):
    for value in z:
        level.learn(state, P, value, T)
    return state


def feed(state, z, locked=False, begin=0.0):
    seen = []
    for k, value in enumerate(z):
        level.take(state, P, value, begin + k * T, locked)
        seen.append((level.detected(state, P), state['present']))
    return np.array(seen, bool)


def test_the_first_two_seconds_are_averaged_evenly(state):
    z = noise(2.0)
    learnt(state, z[:-1])
    assert not level.known(state, P)
    learnt(state, z[-1:])
    assert state['mean'] == pytest.approx(z.mean(), rel=1e-12)
    assert state['variance'] == pytest.approx(z.var(), rel=1e-12)


def test_later_ones_push_out_the_earlier(state):
    z = np.concatenate((noise(2.0), noise(20.0, 2) + 2.0))
    learnt(state, z)
    weights = (1.0 - T / 2.0) ** np.arange(len(z))[::-1]
    assert state['mean'] == pytest.approx(np.average(z, weights=weights), abs=1e-3)
    assert state['variance'] == pytest.approx(np.average((z - state['mean'])**2, weights=weights), rel=1e-3)


def test_a_target_that_comes_is_not_learnt_as_noise(state):
    learnt(state, noise(2.1))
    at = level.thresholds(state)
    learnt(state, np.full(2000, 45.0))
    assert level.thresholds(state) == at


def test_thresholds(state):
    state['mean'], state['variance'] = 14.0, 4.0
    assert level.thresholds(state) == (22.0, 23.0, 20.0)
    state['variance'] = 0.25
    assert level.thresholds(state) == (16.0, 17.0, 15.0)


@pytest.mark.thorough
def test_noise_alone_is_no_target_for_an_hour(state):
    learnt(state, noise(2.1))
    seen = feed(state, noise(3600.0, 3))
    assert not seen.any()


def test_a_signal_is_found_and_lost_with_its_times(state):
    learnt(state, noise(2.1))
    at = level.thresholds(state)
    z = np.concatenate((np.full(100, 12.0), np.full(100, at.detect + 0.5), np.full(100, at.track + 0.5),
                        np.full(100, at.loss + 0.5), np.full(100, at.loss - 0.5)))
    seen = feed(state, z)
    assert np.flatnonzero(seen[:, 0])[0] == pytest.approx(100 + 0.2 / T, abs=1)
    assert np.flatnonzero(seen[:, 1])[0] == pytest.approx(200 + 0.2 / T, abs=1)
    assert np.flatnonzero(seen[:, 1])[-1] == pytest.approx(400 + 0.3 / T, abs=2)
    assert seen[300:400, 1].all()                                # between the thresholds it stays
    seen = feed(state, np.tile([at.track + 1.0] * 30 + [at.loss - 1.0] * 30, 5), begin=2.5)
    assert not seen[:, 1].any()                                 # too short a time above


def test_until_the_noise_is_known_the_lock_of_the_receiver_tells(state):
    assert feed(state, np.full(100, 60.0), locked=False).sum() == 0
    assert feed(state, np.full(100, 60.0), locked=True, begin=5.0)[50:].all()
    assert not feed(state, np.full(100, 60.0), locked=False, begin=9.0)[70:].any()


def test_stamps_that_stand_still_and_levels_that_are_none_change_nothing(state):
    learnt(state, noise(2.1))
    level.take(state, P, 40.0, 1.0, False)
    before = state.copy()
    level.take(state, P, math.nan, 2.0, False)
    level.take(state, P, 50.0, 0.5, False)
    assert state == before


def test_another_place_begins_anew(state):
    learnt(state, noise(2.1))
    assert feed(state, np.full(60, 50.0))[-1].all()
    level.restart_times(state)
    assert not level.detected(state, P) and not state['present']
