"""Isolation against errors that are put in: a known share of the ship's motion, and noise that knows nothing of it."""
import math

import numpy as np
import pytest
from scipy import signal
from scipy.spatial.transform import Rotation

from pedestal_common.geometry import line_of_sight
from pedestal_results import isolation

DT, N = 0.02, 6000
T = DT * np.arange(N)


@pytest.fixture(scope='module')
def ship():
    """(target ENU (n, 3), attitude (n, 4), deck rate (n, 3), offsets (n, 2) from the direction on a level deck):
    a target passes a ship that rolls, pitches and yaws about a heading of 60 deg."""
    roll = 0.06 * np.sin(0.55 * T) + 0.03 * np.sin(0.83 * T + 1.0)
    pitch = 0.02 * np.sin(0.9 * T + 0.3)
    yaw = math.radians(30.0) + 0.02 * np.sin(0.31 * T)
    turns = Rotation.from_euler('ZYX', np.column_stack((yaw, pitch, roll)))
    rate = (turns[:-1].inv() * turns[1:]).as_rotvec() / DT
    rate = np.vstack((rate[:1], 0.5 * (rate[1:] + rate[:-1]), rate[-1:]))
    target = np.column_stack((400e3 - 5e3 * T, 150e3 + 1e3 * T, np.full(N, 400e3)))
    moved = np.empty((N, 2))
    level = Rotation.from_euler('Z', math.radians(30.0)).inv().apply(target)
    for k, direction in enumerate(turns.inv().apply(target)):
        azimuth, elevation = line_of_sight.angles(*level[k])
        moved[k] = line_of_sight.offsets(azimuth, elevation, *direction / np.linalg.norm(direction))
    return target, turns.as_quat(), rate, moved


def test_the_motion_is_what_the_deck_sees(ship):
    target, attitude, rate, moved = ship
    found = isolation.measure(DT, np.zeros((N, 2)), target, attitude, rate)
    assert found.motion == pytest.approx(np.sqrt(np.mean(moved**2)), rel=0.02)   # the mean attitude is not quite level
    assert math.isnan(found.isolation)


@pytest.mark.parametrize('lag', [0.0, 0.1])
def test_a_thousandth_of_the_motion_is_60_db_with_and_without_a_lag(ship, lag):
    target, attitude, rate, moved = ship
    late = np.column_stack([np.interp(T - lag, T, column) for column in moved.T])
    found = isolation.measure(DT, 1e-3 * late + 0.01, target, attitude, rate)
    assert found.isolation == pytest.approx(60.0, abs=0.3)
    assert found.limit > 75.0


@pytest.mark.thorough
@pytest.mark.parametrize('pole', [0.0, 0.98])
def test_noise_alone_gives_the_floor_and_hides_only_what_is_below_it(ship, pole):
    """White noise and noise of 1 s correlation: the rms of the coherent part over draws is the floor."""
    target, attitude, rate, moved = ship
    random = np.random.default_rng(5)
    coherent, floors = [], []
    for _ in range(25):
        white = random.standard_normal((N, 2))
        noise = 1e-4 * math.sqrt(1.0 - pole**2) * signal.lfilter([1.0], [1.0, -pole], white, axis=0)
        found = isolation.measure(DT, noise, target, attitude, rate)
        coherent.append(found.coherent)
        floors.append(found.floor)
    found = isolation.measure(DT, noise + 1e-2 * moved, target, attitude, rate)
    assert found.isolation == pytest.approx(40.0, abs=1.0)
    assert found.floor == pytest.approx(floors[-1], rel=0.3)
    expected = math.sqrt(np.mean(np.square(coherent)))
    if not pole:
        assert expected == pytest.approx(1e-4 * math.sqrt(9.0 / N), rel=0.15)
    assert np.mean(floors) == pytest.approx(expected, rel=0.15)
