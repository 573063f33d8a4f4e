"""Step track on a main lobe that moves, with the noise of a level that is averaged."""
import math

import numpy as np
import pytest

from acu_tracker.search import step_track
from acu_tracker.search.step_track import StepTrackParameters
from pedestal_common.parameters import record

B, T, TAU = 0.0175, 0.005, 0.1


def tracked(peak, seconds, noise=0.05, present=lambda t: True, **parameters):
    """(times, offsets of the beam (n, 2), record): the level is a Gaussian beam's about peak(t), late by TAU."""
    p = record(StepTrackParameters(**parameters))[0]
    s = step_track.StepTrack.zeros()[0]
    step_track.start(s, 0.0, 0.0, 0.0)
    rng = np.random.default_rng(3)
    z, out = 46.0 - 12.0 * (np.hypot(*peak(0.0)) / B)**2, []
    t = T * np.arange(round(seconds / T))
    for now in t:
        x, e = step_track.step(s, p, B, TAU, now, z + noise * rng.standard_normal(), present(now))
        px, pe = peak(now)
        z += T / TAU * (46.0 - 12.0 * ((x - px)**2 + (e - pe)**2) / B**2 - z)
        out.append((x, e))
    return t, np.array(out), s


def test_four_starts_two_decibels_off_return_to_the_peak():
    """The acceptance test of the GD 7200: rms of the four below 0.1 dB (operations.md 2.2)."""
    off = B * math.sqrt(2.0 / 12.0)
    losses = []
    for direction in ((off, 0.0), (-off, 0.0), (0.0, off), (0.0, -off)):
        _, _, s = tracked(lambda t, place=direction: place, 200.0)
        losses.append(12.0 * np.sum((s['place'] - direction)**2) / B**2)
    assert math.sqrt(np.mean(np.square(losses))) < 0.1


def test_the_peak_of_a_parabola_is_found_exactly():
    for theta0 in (-0.3, 0.0, 0.11):
        d = 0.08
        plus, minus = (-12.0 * (aside - theta0)**2 for aside in (d, -d))
        assert step_track.peak(plus, minus, d, 1.0) == pytest.approx(theta0, abs=1e-12)


def test_it_moves_by_one_step_a_cycle_at_most_and_not_within_the_deadband():
    _, _, s = tracked(lambda t: (0.4 * B, 0.01 * B), 19.0, noise=0.0)
    assert s['place'] == pytest.approx([0.08 * B, 0.0])
    t, out, _ = tracked(lambda t: (0.4 * B, 0.0), 60.0)
    assert np.abs(np.diff(out, axis=0)).max() <= 0.16 * B * (1 + 1e-9)


def test_a_target_that_drifts_is_followed():
    rate = 0.05 * B / 20.0
    t, out, _ = tracked(lambda t: (rate * t, -0.5 * rate * t), 600.0)
    error = np.hypot(out[:, 0] - rate * t, out[:, 1] + 0.5 * rate * t)[t > 60.0]
    assert math.sqrt(np.mean((12.0 * (error / B)**2)**2)) < 0.25
    assert error.max() < 0.3 * B


def test_without_a_signal_it_rests():
    t, out, s = tracked(lambda t: (0.3 * B, 0.0), 10.0, present=lambda t: t < 0.2)
    assert s['phase'] == step_track.REST_PHASE
    assert np.all(out[t > 0.25] == 0.0)
