"""Search, acquire and step track of the whole unit: a beam on an ideal axis, a level with a main lobe."""
import math

import numpy as np
import pytest

from acu_tracker.modes import Mode

B, FLOOR, PEAK, LOCK = 0.0175, 14.0, 50.0, 40.0


class Level:
    """A rig whose receiver has a level: a Gaussian main lobe above the noise, errors only above LOCK."""

    def __init__(self, Rig, shift=(0.0, 0.0), slope=((1.0, 0.0), (0.0, 1.0)), tau=0.1, **parameters):
        self.rig = Rig(at=(0.3, 0.4), **{'tracker.lock_count': 20, **parameters})
        self.shift, self.slope, self.tau = np.array(shift) * B, np.array(slope), tau
        self.z, self.rng, self.log = FLOOR, np.random.default_rng(5), []
        target = self.rig.target
        self.rig.program(target=lambda t: tuple(target(t) - self.shift / (math.cos(target(t)[1]), 1.0)))

    def step(self):
        rig = self.rig
        offset = np.array(rig.error(rig.k * rig.T, rig.angle))
        z = max(PEAK - 12.0 * np.sum(offset**2) / B**2, FLOOR)
        self.z += rig.T / self.tau * (z - self.z)
        x, e = self.slope @ offset
        rig.step(cn0_dbhz=self.z + 0.5 * self.rng.standard_normal(), error_valid=self.z > LOCK, cross_elevation=x,
                 elevation=e)
        self.log.append((rig.k * rig.T, rig.mode, *offset / B))

    def run(self, seconds, until=None):
        for _ in range(round(seconds / self.rig.T)):
            self.step()
            if until and self.rig.mode == until:
                return True
        return False

    def modes(self):
        """Modes in the order in which they came."""
        names = [row[1] for row in self.log]
        return [name for i, name in enumerate(names) if i == 0 or names[i - 1] != name]

    @property
    def state(self):
        return self.rig.state['guidance']['acquisition'][0]


def test_a_late_target_is_found_along_its_track_and_tracked(Rig):
    level = Level(Rig, shift=(2.6, 0.3), **{'search.pattern': 'raster', 'search.wait': 0.5})
    level.run(2.5)
    assert level.state['level']['learnt'] >= 2.0
    assert level.rig.ask(Mode.PROGRAM)
    level.run(3.0)
    assert level.rig.mode == 'program'
    assert level.rig.ask(Mode.SEARCH)
    assert level.run(60.0, 'autotrack')
    assert level.modes() == ['standby', 'program', 'search', 'acquire', 'autotrack']
    level.run(3.0)
    assert level.rig.mode == 'autotrack' and np.hypot(*level.log[-1][2:]) < 0.02


@pytest.mark.parametrize('slope', [((-1.0, 0.0), (0.0, 1.0)), ((1.0, 0.0), (0.0, -1.0)), ((0.0, 1.0), (-1.0, 0.0))])
def test_a_wrong_slope_is_seen_before_the_loop_is_closed(Rig, slope):
    level = Level(Rig, shift=(0.1, 0.1), slope=slope)
    level.run(2.5)
    assert level.rig.ask(Mode.ACQUIRE)
    level.run(0.3)
    assert level.rig.ask(Mode.PROGRAM) and level.rig.ask(Mode.ACQUIRE)
    assert level.run(10.0, 'standby')
    assert level.rig.reason == 'wrong slope'
    assert 'autotrack' not in level.modes()
    assert not level.rig.ask(Mode.AUTOTRACK) and level.rig.reason == 'diverged'


def test_nothing_to_be_found_ends_in_the_program(Rig):
    level = Level(Rig, shift=(30.0, 0.0), **{'search.rounds': 1, 'search.full': 2.0})
    level.run(2.5)
    assert level.rig.ask(Mode.PROGRAM)
    level.run(1.0)
    assert level.rig.ask(Mode.SEARCH)
    assert level.run(60.0, 'program')
    assert level.rig.reason == 'not found'
    assert level.modes() == ['standby', 'program', 'search', 'program']


def test_step_track_finds_the_peak_by_the_level_alone(Rig):
    level = Level(Rig, shift=(0.3, -0.2), **{'steptrack.cycle': 8.0, 'steptrack.dwell': 0.5,
                                                 'tracker.handover': False})
    level.run(2.5)
    assert level.rig.ask(Mode.PROGRAM)
    level.run(1.0)
    assert level.rig.ask(Mode.STEPTRACK)
    level.run(60.0)
    assert level.rig.mode == 'steptrack'
    assert level.state['step_track']['place'] / B == pytest.approx([0.3, -0.2], abs=0.05)


def test_a_lost_signal_sends_step_track_to_search(Rig):
    level = Level(Rig, shift=(30.0, 0.0))
    level.run(2.5)
    assert level.rig.ask(Mode.PROGRAM) and level.rig.ask(Mode.STEPTRACK)
    assert level.run(2.0, 'search')
    assert level.rig.reason == 'signal lost'


def test_hand_overs_are_smooth(Rig):
    """The rate command changes by no more than the acceleration of the shaper allows, whatever the mode does."""
    level = Level(Rig, shift=(2.0, 1.0), **{'search.wait': 0.5})
    rates = []
    level.run(2.5)
    level.rig.ask(Mode.PROGRAM)
    for _ in range(12000):
        if level.rig.k == 800:
            assert level.rig.ask(Mode.SEARCH)
        level.step()
        rates.append(level.rig.outputs['rate'][0].copy())
        if level.rig.mode == 'autotrack' and len(rates) % 400 == 0:
            break
    assert 'autotrack' in level.modes()
    change = np.abs(np.diff(rates, axis=0)).max(axis=0) / level.rig.T
    limits = [axis.limits.acceleration for axis in (level.rig.params.azimuth, level.rig.params.elevation)]
    assert np.all(change <= np.array(limits) * (1 + 1e-9))


def test_standby_can_always_be_had(Rig):
    for mode in (Mode.SEARCH, Mode.ACQUIRE, Mode.STEPTRACK):
        level = Level(Rig, shift=(2.0, 0.0))
        level.run(0.1)
        assert level.rig.ask(mode)
        level.run(0.2)
        assert level.rig.ask(Mode.STANDBY)
        level.run(0.1)
        assert level.rig.mode == 'standby'

