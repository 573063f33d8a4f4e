"""The time of the stamps: steady, slewed towards the system's clock, and never back."""
import numpy as np
import pytest

from pedestal_common.realtime import utc

MS, S = 1_000_000, 1_000_000_000
BEGIN = 1_790_000_000 * S


def readings(clock, offsets, period=5 * MS):
    """UTC less steady time, less BEGIN [ns] at readings `period` apart of a system clock that is off by `offsets`."""
    return np.array([clock.at(k * period, BEGIN + k * period + offset) - BEGIN - k * period
                     for k, offset in enumerate(offsets)])


def test_it_is_the_systems_clock_where_that_is_steady():
    assert not readings(utc.Utc(0, BEGIN), [0] * 50).any()


def test_a_slewed_clock_is_followed():
    """chrony slews by up to 500 ppm by default: 2.5 us in 5 ms."""
    off = np.arange(2000) * 2_000
    assert np.abs(readings(utc.Utc(0, BEGIN), off.tolist()) - off).max() <= 2_500


def test_jitter_is_not_followed_and_no_step():
    clock, jitter = utc.Utc(0, BEGIN), np.random.default_rng(1).integers(-900_000, 900_000, 4000)
    off = readings(clock, jitter.tolist())
    assert clock.steps == 0
    assert np.abs(np.diff(off)).max() <= round(utc.MAX_SLEW_RATE * 5 * MS)


@pytest.mark.parametrize('step', [50 * MS, 3600 * S])
def test_a_step_forward_is_taken_and_named(step):
    clock = utc.Utc(0, BEGIN)
    off = readings(clock, [0] * 10 + [step] * 10)
    assert (clock.steps, clock.last_step, clock.ahead) == (1, step, 0)
    assert off.tolist() == [0] * 10 + [step] * 10


@pytest.mark.parametrize('step', [50 * MS, 3600 * S])
def test_a_step_back_is_named_and_slewed(step):
    clock = utc.Utc(0, BEGIN)
    off = readings(clock, [0] * 10 + [-step] * 1000)
    assert (clock.steps, clock.last_step) == (1, -step)
    assert (np.diff(off)[10:] == -2_500).all() and clock.ahead == step - 1000 * 2_500


def test_a_process_that_slept_goes_on_at_the_right_time():
    clock = utc.Utc(0, BEGIN)
    clock.at(5 * MS, BEGIN + 5 * MS)
    assert clock.at(20 * S, BEGIN + 20 * S + MS) == BEGIN + 20 * S + MS
    assert clock.steps == 0


@pytest.mark.parametrize('seed', range(20))
def test_it_never_goes_back(seed):
    rng = np.random.default_rng(seed)
    clock, steady, last = utc.Utc(0, BEGIN), 0, BEGIN
    for _ in range(200):
        steady += int(rng.choice([0, 1, 5 * MS, 30 * S]))
        now = clock.at(steady, BEGIN + steady + int(rng.choice([0, 3 * MS, 7200 * S]) * rng.uniform(-1.0, 1.0)))
        assert now >= last
        last = now
