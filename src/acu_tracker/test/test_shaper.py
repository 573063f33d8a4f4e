import math

import numba
import numpy as np
import pytest

from acu_tracker.geometry.vector import AxisMotion
from acu_tracker.servo import shaper
from acu_tracker.servo.params import ShaperParameters
from pedestal_common.parameters import record

RATE, ACCELERATION, JERK, H0, T = 2.3, 30.0, 4000.0, 0.01, 0.005


LIMITS = record(ShaperParameters(rate=RATE, acceleration=ACCELERATION, jerk=JERK, h0=H0))


@numba.njit
def shaped(raw, now, limits, low, high):
    out = np.empty((len(raw), 3))
    k = limits[0]
    for i in range(len(raw)):
        target, _ = shaper.held_inside(AxisMotion(raw[i, 0], raw[i, 1], raw[i, 2]), low, high, k.acceleration,
                                       k.h0 + k.acceleration / k.jerk)
        now, _, _ = shaper.shape(now, target, T, k)
        out[i] = now
    return out


def run(raw, start=(0.0, 0.0, 0.0), low=-1e3, high=1e3):
    return shaped(np.asarray(raw), AxisMotion(*start), LIMITS, low, high)


def still(angle, seconds=1.0):
    return np.array([[angle, 0.0, 0.0]] * round(seconds / T))


@pytest.mark.parametrize('size', [1e-5, 1e-3, 0.02, 0.174, 0.5, 3.0])
def test_step_arrives_without_overshoot_close_to_the_minimum_time(size):
    out = run(still(size, 3.0))
    assert out[:, 0].max() <= size * (1 + 3e-3)
    assert abs(out[-1, 0] - size) < 1e-6 * size
    arrived = T * (np.flatnonzero(np.abs(out[:, 0] - size) > 0.02 * size)[-1] + 2)
    # Bang-bang with the rate limit, the jerk, and the double pole 1/h0 of the linear zone (2 % after 5.83 h0).
    peak = min(math.sqrt(ACCELERATION * size), RATE)
    assert arrived <= size / peak + peak / ACCELERATION + ACCELERATION / JERK + 6 * H0 + T


def test_limits_hold_for_any_raw_reference():
    rng = np.random.default_rng(0)
    raw = np.column_stack([rng.normal(0, 1.0, 4000), rng.normal(0, 3.0, 4000), rng.normal(0, 40.0, 4000)])
    raw[1000:2000] = np.repeat(raw[1000:2000:50], 50, axis=0)
    out = run(raw)
    assert np.abs(out[:, 1]).max() <= RATE
    assert np.abs(out[:, 1]).max() > 0.9 * RATE
    assert np.abs(out[:, 2]).max() <= ACCELERATION
    # Jerk within every sub-step, hence over a step.
    assert np.abs(np.diff(out[:, 2])).max() <= JERK * T * (1 + 1e-12)


def test_rate_limit_is_reached_and_held():
    out = run(still(6.0, 4.0))
    assert out[:, 1].max() <= RATE
    assert out[200, 1] == pytest.approx(RATE, abs=2e-3)


def test_quadratic_reference_is_followed_exactly():
    t = T * np.arange(1, 400)
    raw = np.column_stack([0.1 + 0.4 * t + 0.25 * t * t, 0.4 + 0.5 * t, 0.5 + 0 * t])
    out = run(raw, start=(0.1, 0.4, 0.5))
    np.testing.assert_allclose(out, raw, rtol=0, atol=1e-10)


def test_sine_is_followed_after_a_start_from_rest():
    t = T * np.arange(1, 1200)
    w = 2 * math.pi * 0.4
    raw = 0.5 * np.column_stack([np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)])
    out = run(raw)
    later = t > 0.5
    assert np.abs(out[later, 0] - raw[later, 0]).max() < 5e-6


def test_acceleration_and_rate_are_the_derivatives_of_the_angle():
    out = run(still(0.4), start=(0.0, -0.5, 3.0))
    steps = np.diff(np.concatenate(([0.0], out[:, 0])))
    before = np.concatenate(([-0.5], out[:-1, 1]))
    np.testing.assert_allclose(steps, T * 0.5 * (before + out[:, 1]), atol=JERK * T**3 / 12)


@pytest.mark.parametrize('rate', [0.1, 1.0, 2.2])
def test_stops_at_the_limit(rate):
    t = T * np.arange(1, 800)
    raw = np.column_stack([1.0 + rate * (t - 1.0), rate + 0 * t, 0 * t])
    start = (1.0 - rate, rate, 0.0)
    out = run(raw, start, high=1.0)
    assert out[:, 0].max() <= 1.0 + 1e-4
    assert out[-1, 0] == pytest.approx(1.0, abs=1e-6)
    turned_back = run(np.vstack([raw, still(0.5)]), start, high=1.0)
    assert turned_back[-1, 0] == pytest.approx(0.5, abs=1e-6)


def test_raw_reference_within_the_limits_passes_unchanged():
    for raw, expected in (((0.5, 0.1, 0.2), ((0.5, 0.1, 0.2), False)), ((1.5, -0.1, 0.2), ((1.0, 0.0, 0.0), True)),
                          ((-0.99, -1.0, 0.2), ((-1.0, 0.0, 0.0), True))):
        assert shaper.held_inside(AxisMotion(*raw), -1.0, 1.0, 30.0, 0.02) == expected
