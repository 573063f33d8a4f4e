"""Search and acquire as one law, on a dish with side lobes whose beam is where it is demanded."""
import math
from collections import namedtuple

import numpy as np
import pytest

from acu_tracker.search import acquisition, level, pattern
from acu_tracker.search.acquisition import SearchParameters
from acu_tracker.search.level import AcquisitionParameters
from pedestal_common.parameters import record

B, T, TAU, AXIS, NOISE = 0.0175, 0.005, 0.1, 70.0, 14.0


def dish(x, e):
    """Level [dB] of the cosine taper in both axes, x and e in beamwidths: side lobes of -23 dB."""
    def taper(v):
        u = 3.7352430 * v
        return math.cos(u) / (1.0 - (2.0 * u / math.pi)**2)
    return 20.0 * math.log10(abs(taper(x) * taper(e)) + 1e-4)


class Antenna:
    """Acquire about a place where there is nothing; the target is at `target` [beamwidths]."""

    def __init__(self, target, slope=1.0, lock=40.0, **parameters):
        self.p = record(AcquisitionParameters(**parameters))[0]
        self.target, self.slope, self.lock = target, slope, lock
        s = acquisition.Acquisition.zeros()
        acquisition.initialise(s)
        self.s, self.z, self.t = s[0], dish(*target) + AXIS, 0.0
        for k in range(450):
            level.take(self.s['level'], self.p, NOISE + (-1.0)**k, self.t, False)
            level.learn(self.s['level'], self.p, NOISE + (-1.0)**k, T)
            self.t += T
        acquisition.begin_acquire(self.s, self.t)

    def step(self):
        x, e, _, _ = acquisition.acquired(self.s, B, self.t)
        off = np.array(self.target) - (x / B, e / B)
        power = 10.0**(0.1 * self.z)
        power += T / TAU * (10.0**(0.1 * max(AXIS + dish(*off), NOISE)) - power)
        self.z = 10.0 * math.log10(power)
        level.take(self.s['level'], self.p, self.z, self.t, self.z > self.lock)
        if self.z > self.lock:
            acquisition.take_error(self.s, (-x, -e), tuple(self.slope * off * B))
        acquisition.acquire(self.s, self.p, B, self.t, math.nan)
        self.t += T

    def run(self, seconds):
        """The phases it went through."""
        phases = [self.s['phase']]
        for _ in range(round(seconds / T)):
            self.step()
            if self.s['phase'] != phases[-1]:
                phases.append(self.s['phase'])
        return [acquisition.ACQUISITION_PHASES[phase] for phase in phases]


@pytest.mark.parametrize('target', [(0.0, 0.0), (0.35, -0.3), (-0.7, 0.1), (1.68, 0.0), (0.0, -1.68)])
def test_it_gets_onto_its_target_from_wherever_the_level_led(target):
    one = Antenna(target)
    phases = one.run(16.0)
    assert phases[-1] == 'checked' and phases.count('check') == 1
    assert one.s['centre'] / B == pytest.approx(target, abs=0.02)
    assert not acquisition.failed(one.s, one.p, one.t)


def test_a_level_that_is_expected_needs_no_look_around():
    assert Antenna((0.3, 0.0), expected_dbhz=AXIS).run(6.0) == ['settle', 'peak', 'check', 'checked']
    assert 'look around' in Antenna((1.68, 0.0), expected_dbhz=AXIS).run(6.0)


def test_a_slope_must_be_wrong_twice():
    one = Antenna((0.2, 0.1), slope=-1.0)
    assert one.run(14.0)[-5:] == ['peak', 'check', 'peak', 'check', 'wrong slope']


def test_without_a_lock_or_a_signal_it_gives_up():
    one = Antenna((0.2, 0.1), lock=math.inf)
    assert one.run(14.0)[-1] == 'check' and not acquisition.failed(one.s, one.p, one.t)
    one.run(17.0)
    assert acquisition.failed(one.s, one.p, one.t)
    gone = Antenna((9.0, 9.0))
    gone.run(0.5)
    gone.s['phase'] = acquisition.Phase.CHECK
    gone.run(1.0)
    assert acquisition.failed(gone.s, gone.p, gone.t)


def test_stages_of_a_search():
    p, s = record(SearchParameters(rounds=2))[0], acquisition.Acquisition.zeros()[0]
    acquisition.begin_search(s, p, B, 100.0, math.nan)
    small, full = (pattern.duration(acquisition.area(s, p, TAU, B, stage)) for stage in (False, True))

    At = namedtuple('At', 'offset over')        # offset [beamwidths]; over: whether all rounds are over

    def at(t):
        point, over = acquisition.searched(s, p, TAU, B, 100.0 + p['wait'] + t)
        return At(math.hypot(point.x, point.y) / B, over)

    assert at(-0.1) == At(0.0, False)
    assert at(small - 1e-3).offset == pytest.approx(1.5 + 0.35, abs=0.01)
    assert at(small + 1e-6).offset == pytest.approx(0.0, abs=1e-6)
    assert at(small + full - 1e-3).offset == pytest.approx(5.0 + 0.35, abs=0.01)
    assert not at(2.0 * (small + full) - 1e-3).over and at(2.0 * (small + full)).over


@pytest.mark.parametrize('sigma, radius', [(math.nan, 1.5), (0.5, 1.5), (1.5, 3.0), (9.0, 5.0)])
def test_the_small_area_is_two_sigma(sigma, radius):
    s = acquisition.Acquisition.zeros()[0]
    acquisition.begin_search(s, record(SearchParameters())[0], B, 0.0, sigma * B)
    assert s['radius'] == pytest.approx(radius * B)
