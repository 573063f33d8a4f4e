"""The time from one contact to the next: closed form, unwinding, trims at any time, a realistic night."""
import math
import pathlib
import random

import numpy as np
import pytest
from scipy.optimize import brentq

from acu_tracker.servo.params import ShaperParameters
from pedestal_station.changeover import Changeovers, slew_time
from pedestal_station.choice import Rules, choose
from pedestal_station.night import Object, Pass, Prediction, Window

RULES = Rules()
SLOW = (ShaperParameters(rate=math.radians(5.0), acceleration=math.radians(2.0), jerk=math.radians(10.0), h0=0.5),
        ShaperParameters(rate=math.radians(2.0), acceleration=math.radians(1.0), jerk=math.radians(10.0), h0=0.5))
FAST = (ShaperParameters(), ShaperParameters())
EARTH_M, EARTH_RATE, MU = 6371e3, 7.292e-5, 3.986e14    # radius, rad/s, m3/s2
LATITUDE = math.radians(47.0)


class Circle:
    """Circular orbit over a sphere that turns."""

    def __init__(self, altitude, inclination, node, phase):
        self.a, self.inclination, self.node, self.phase = EARTH_M + altitude, inclination, node, phase

    def enu(self, times):
        u, node = self.phase + math.sqrt(MU / self.a**3) * times, self.node - EARTH_RATE * times
        x, y, z = np.cos(u), np.sin(u) * math.cos(self.inclination), np.sin(u) * math.sin(self.inclination)
        x, y = x * np.cos(node) - y * np.sin(node), x * np.sin(node) + y * np.cos(node)
        up, north = x * math.cos(LATITUDE) + z * math.sin(LATITUDE), z * math.cos(LATITUDE) - x * math.sin(LATITUDE)
        return np.stack([self.a * y, self.a * north, self.a * up - EARTH_M], axis=1)


def sky(orbit, times):
    east, north, up = orbit.enu(times).T
    return np.stack([np.unwrap(np.arctan2(east, north)), np.arctan2(up, np.hypot(east, north))])


def passes_of(name, orbit, priority, turn):
    """Return the passes of a day above 5 deg, with the azimuth on a turn of the cables."""
    times = np.arange(0.0, 86400.0, 10.0)
    up = sky(orbit, times)[1] > math.radians(5.0)
    edges = np.flatnonzero(np.diff(up.astype(int)))
    passes = []
    for rise, set_ in zip(edges[~up[edges]], edges[up[edges]][0 if not up[0] else 1:], strict=False):
        rise, set_ = float(times[rise + 1]), float(times[set_])
        if set_ - rise < 60.0:
            continue
        azimuth, elevation = sky(orbit, np.arange(rise, set_ + 0.5, 1.0))
        azimuth += 2.0 * math.pi * turn
        prediction = Prediction((azimuth[0], azimuth[-1]), (elevation[0], elevation[-1]), (0.0, 0.0), 0.0, (0.0, 0.0),
                                (0.0, 0.0), False, (), 0.0, (0.0, 0.0), 0.0, 0.0)
        window = Window(rise, (), rise, set_, elevation.max(), False)
        passes.append(Pass(Object(name, '', pathlib.Path('file'), 1, orbit, priority), len(passes) + 1, window,
                           prediction))
    return passes


def leo_night(seed, satellites, most=1000):
    """Return the first passes of a day, in the order of rise."""
    draw = random.Random(seed)
    passes = []
    for k in range(satellites):
        orbit = Circle(draw.uniform(400e3, 1400e3), math.radians(draw.uniform(50.0, 99.0)), draw.uniform(0.0, 6.28),
                       draw.uniform(0.0, 6.28))
        passes += passes_of(f'S{k}', orbit, draw.choice([1.0, 1.0, 2.0, 3.0, 5.0]), draw.choice([-1, 0, 0, 1]))
    return sorted(passes, key=lambda each: each.window.rise)[:most]


def axis_state(each, axis, t):
    """Return (encoder angle, rate) of a pass."""
    times = np.append(np.linspace(each.window.rise, t, 500), t + 0.01)
    angles = sky(each.object.orbit, times)[axis]
    first = (each.prediction.azimuth, each.prediction.elevation)[axis][0]
    return first + angles[-2] - angles[0], (angles[-1] - angles[-2]) / 0.01


def slew(axes, one, end, other, begin):
    """Return the time that the antenna needs from one track to another one."""
    longest = 0.0
    for axis, shaper in enumerate(axes):
        (a1, v1), (a2, v2) = axis_state(one, axis, end), axis_state(other, axis, begin)
        v1, v2 = (max(-shaper.rate, min(shaper.rate, v)) for v in (v1, v2))
        longest = max(longest, float(slew_time(np.array(a2 - a1), np.array(v1), np.array(v2), shaper)))
    return longest


def fastest(D, v1, v2, a, v_max):
    """Return the least time from v1 to v2 over D, of all peak rates that lead there."""
    def distance(v):
        return (v + v1) / 2.0 * abs(v - v1) / a + (v + v2) / 2.0 * abs(v - v2) / a

    peaks = np.linspace(-v_max, v_max, 2001)
    errors = [distance(v) - D for v in peaks]
    roots = [brentq(lambda v: distance(v) - D, peaks[k], peaks[k + 1], xtol=1e-14)
             for k in range(2000) if errors[k] * errors[k + 1] < 0.0]
    cruises = [(v, (D - distance(v)) / v) for v in (-v_max, v_max)] + [(v, 0.0) for v in roots]
    return min((abs(v - v1) + abs(v - v2)) / a + cruise for v, cruise in cruises if cruise >= 0.0)


def test_a_slew_is_the_fastest_one_between_two_rates():
    draw, shaper = random.Random(1), SLOW[0]
    for _ in range(300):
        D, v1, v2 = draw.uniform(-0.5, 0.5), *(draw.uniform(-shaper.rate, shaper.rate) for _ in range(2))
        time = float(slew_time(np.array(D), np.array(v1), np.array(v2), shaper))
        assert time - shaper.acceleration / shaper.jerk == pytest.approx(
            fastest(D, v1, v2, shaper.acceleration, shaper.rate), abs=1e-6)


class Still:
    """An object that stays at an azimuth, at 45 deg of elevation."""

    def __init__(self, azimuth):
        self.azimuth = azimuth

    def enu(self, times):
        return np.outer(np.ones_like(times), [math.sin(self.azimuth), math.cos(self.azimuth), 1.0]) * 1e7


def still_pass(rise, azimuth):
    prediction = Prediction((azimuth, azimuth), (0.25 * math.pi,) * 2, (0.0, 0.0), 0.0, (0.0, 0.0), (0.0, 0.0), False,
                            (), 0.0, (0.0, 0.0), 0.0, 0.0)
    return Pass(Object('A', '', pathlib.Path('file'), 1, Still(azimuth), 1.0), 1,
                Window(rise, (), rise, rise + 600.0, 1.0, False), prediction)


def test_unwinding_a_turn_takes_its_time():
    """360 deg / rate + v / a from rest to rest, the jerk and the setup, at the same angle on the sky."""
    passes = [still_pass(0.0, -0.1), still_pass(500.0, 2.0 * math.pi - 0.1), still_pass(500.0, -0.1)]
    changeover = Changeovers(passes, SLOW, RULES)
    turn = 360.0 / 5.0 + 5.0 / 2.0 + 2.0 / 10.0
    assert changeover(0, 1) == pytest.approx(RULES.setup + turn)
    assert changeover(0, 2) == pytest.approx(RULES.setup + 2.0 / 10.0)


def test_an_early_turn_counts_from_both_sides():
    """The azimuth of a pass that leaves its keyhole on another turn is taken where the slew is longer."""
    one, other = still_pass(0.0, 0.0), still_pass(500.0, 0.0)
    one = one._replace(prediction=one.prediction._replace(azimuth=(0.0, 2.0 * math.pi)))
    changeover = Changeovers([one, other], SLOW, RULES)
    assert changeover(0, 1) == pytest.approx(RULES.setup + 360.0 / 5.0 + 5.0 / 2.0 + 2.0 / 10.0)


@pytest.mark.parametrize('axes', [SLOW, FAST])
def test_the_antenna_can_make_every_changeover_at_every_trim(axes):
    passes = leo_night(2, 12)
    changeover, judged = Changeovers(passes, axes, RULES), 0
    for i, one in enumerate(passes):
        for j, other in enumerate(passes):
            gap = changeover(i, j) if abs(one.window.rise - other.window.rise) < 1000.0 and i != j else math.inf
            first = max(one.window.rise + RULES.min_pass, other.window.rise - gap)
            last = min(one.window.set, other.window.set - RULES.min_pass - gap)
            for end in np.linspace(first, last, 9) if first <= last else ():
                assert RULES.setup + slew(axes, one, end, other, end + gap) <= gap + 0.01
                judged += 1
    assert judged > 200


@pytest.mark.parametrize('satellites', [12, pytest.param(40, marks=pytest.mark.thorough)])
def test_a_night_of_leo_satellites(satellites):
    """The antenna gets from each contact to the next one; the plan has a bound when its time is over."""
    passes = leo_night(3, satellites, 200)
    changeover = Changeovers(passes, SLOW, RULES)
    exact, greedy = choose(passes, changeover, RULES)
    assert greedy.value <= exact.value <= exact.bound
    contacts = sorted((share.begin, share.end, each) for share, each in zip(exact.shares, passes, strict=True)
                      if share.taken)
    for (_, end, one), (begin, _, other) in zip(contacts, contacts[1:], strict=False):
        assert RULES.setup + slew(SLOW, one, end, other, begin) <= begin - end + 0.01
    hasty = choose(passes, changeover, Rules(time_limit=0.001))[0]
    assert greedy.value <= hasty.value <= exact.bound and exact.value <= hasty.bound
