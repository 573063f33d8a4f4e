"""The azimuth at the end of its travel: it goes round to its target, and autotrack goes on."""
import math

import numpy as np
import pytest

from acu_tracker.geometry import azimuth_wrap
from acu_tracker.params import AcuParameters
from acu_tracker.program.program_track import NO_TRACK
from acu_tracker.unit import Acu
from pedestal_common.geometry import line_of_sight
from pedestal_common.parameters import build

RATE = math.radians(6.0)
MECHANICAL = ('pid', 'feedforward', 'adrc')


@pytest.fixture(name='BeamRig')
def beam_rig(Rig):
    """The Rig with the errors of a beam: straight to half its width, then those of side lobes, up to 25 deg."""
    class BeamRig(Rig):
        def error(self, t, angle):
            true, width = np.array(super().error(t, angle)), self.params.tracker.receiver.beamwidth
            size = math.hypot(*line_of_sight.offsets(*angle, *line_of_sight.direction(*self.deck(t))))
            self.receiver_on = size < math.radians(25.0)
            return true if size < 0.5 * width else true / size * 0.4 * width * math.sin(math.pi * size / width)
    return BeamRig


def circling(azimuth, elevation=0.7):
    """Return a target that passes `azimuth` at 0 s, clockwise at 6 deg/s."""
    return lambda t: (azimuth + RATE * t, elevation)


def tracking(BeamRig, target, attitude=None, **parameters):
    """Return a BeamRig in autotrack: the program has led to the target, and is over."""
    rig = BeamRig(target, attitude=attitude, stabilised=attitude is not None, initial_mode='program', sigma=2e-4,
                  **BeamRig.QUICK, **{'tracker.receiver.sigma_floor': 2e-4}, **parameters)
    rig.angle = rig.deck(0.0) % (2.0 * math.pi)
    rig.program(start=-1.0, rows=100, target=target)
    followed(rig, 2.0)
    assert rig.mode == 'autotrack'
    rig.track = NO_TRACK
    return rig


def off(rig):
    """Return the true angle [rad] between beam and target."""
    x, y, z = line_of_sight.direction(*rig.deck(rig.k * rig.T))
    return math.acos(min(1.0, np.dot(line_of_sight.direction(*rig.angle), (x, y, z))))


def followed(rig, seconds):
    """(modes, reasons, angle [rad] between beam and target) in each step."""
    rows = []
    for _ in range(round(seconds / rig.T)):
        rig.step()
        rows.append((rig.mode, rig.reason, off(rig)))
    return [list(column) for column in zip(*rows)]


@pytest.mark.parametrize('controller', MECHANICAL)
@pytest.mark.parametrize('late', ({}, {'delay': 0.02, 'error_latency': 0.1}))
def test_autotrack_goes_on_after_a_turn(BeamRig, controller, late):
    rig = tracking(BeamRig, circling(4.4), **late, **{f'{axis}.controller': controller
                                                      for axis in ('azimuth', 'elevation')})
    modes, reasons, away = followed(rig, 7.0)
    assert set(modes) == {'autotrack'} and not rig.state['tracking']['divergence']['diverged'].any()
    assert rig.angle[0] == pytest.approx(4.4 + RATE * 9.0 - 2.0 * math.pi, abs=0.02)
    turn = [k for k, reason in enumerate(reasons) if reason == 'azimuth turn']
    assert turn == list(range(turn[0], turn[-1] + 1)) and 2.5 < len(turn) * rig.T < 4.0
    assert max(away[turn[-1] + 100:]) < 0.25 * rig.params.tracker.receiver.beamwidth
    assert rig.reason == 'none'


def test_a_turn_on_a_rolling_deck(BeamRig):
    """The target circles in earth angles; the deck turns under it."""
    rig = tracking(BeamRig, circling(5.1), attitude=BeamRig.rolling)
    modes, reasons, away = followed(rig, 9.0)
    assert 'azimuth turn' in reasons and set(modes) == {'autotrack'}
    assert max(away[-200:]) < 0.25 * rig.params.tracker.receiver.beamwidth


@pytest.mark.parametrize('speed', (1.0, 2.0))
def test_a_limit_that_holds_the_beam_off_its_target_is_no_divergence(BeamRig, speed):
    """A travel of less than a revolution: the beam stands at its end, in the side lobes of the target."""
    rig = tracking(BeamRig, lambda t: (1.5 + speed * RATE * (t - 2.5), 0.7), **{'azimuth.limits.high': 1.5})
    modes, _, away = followed(rig, 8.0)
    assert not rig.state['tracking']['divergence']['diverged'].any() and modes[-1] != 'autotrack'
    assert rig.reason in ('signal lost', 'no program track') and max(away) > 0.2


def test_a_target_that_comes_back_to_a_limit_is_tracked_again(BeamRig):
    rig = tracking(BeamRig, lambda t: (1.1 + RATE * min(t, 7.87 - t), 0.7), **{'azimuth.limits.high': 1.5})
    modes, reasons, away = followed(rig, 6.0)
    assert set(modes) == {'autotrack'} and 'azimuth turn' not in reasons
    assert max(away) > 0.5 * rig.params.tracker.receiver.beamwidth and away[-1] < 1e-3


def test_a_slope_that_is_reversed_still_diverges_after_a_turn(BeamRig):
    class Reversed(BeamRig):
        def error(self, t, angle):
            return -np.array(super().error(t, angle)) if t > 7.0 else super().error(t, angle)
    rig = tracking(Reversed, circling(4.4))
    followed(rig, 11.0)
    assert rig.state['tracking']['divergence']['diverged'].all()


@pytest.fixture
def turn():
    state = azimuth_wrap.Turn.zeros()[0]
    azimuth_wrap.initialise_turn(state)
    return state


def test_an_error_belongs_to_a_turn_by_its_own_time(turn):
    assert not azimuth_wrap.turn_covers(turn, 0.0)
    azimuth_wrap.begin_turn(turn, 10.0)
    azimuth_wrap.begin_turn(turn, 11.0)
    assert [azimuth_wrap.turn_covers(turn, t) for t in (9.99, 10.0, 99.0)] == [False, True, True]
    azimuth_wrap.watch_turn(turn, 3.0, (0.0, 0.7), 0.02, 12.0)
    assert turn['under_way'] and azimuth_wrap.turn_covers(turn, 12.01)
    azimuth_wrap.watch_turn(turn, 0.005, (0.0, 0.7), 0.02, 13.0)
    assert not turn['under_way']
    assert [azimuth_wrap.turn_covers(turn, t) for t in (12.5, 13.0, 13.01)] == [True, True, False]


@pytest.mark.parametrize(('limits', 'epoch', 'said'), (
    ({}, 0, 'at 1.8 s the azimuth turns back by 360 deg at the end of its travel, for about 2.8 s off the target'),
    ({'azimuth.limits.low': -1.0}, 1_795_723_278_100_000_000,       # 2026-11-26T20:01:18.1 UTC
     'at 20:01:19.9 UTC the azimuth stops at the end of its travel until the target is inside the travel again')))
def test_the_announcement_says_what_the_azimuth_will_do(limits, epoch, said):
    unit = Acu(build(AcuParameters, {**limits}), ())
    unit.epoch = epoch
    times = np.arange(20.0)
    unit.followed.append(unit.parts, times, np.column_stack((4.0 + 0.4 * times, np.full(20, 0.7))))
    unit.inputs['joint_states']['position'][0] = 4.0, 0.7
    unit.inputs['joint_states']['stamp'] = 0
    unit.step(np.zeros(1, np.int64), unit.inputs, unit.outputs)
    assert unit.request('acu/program').granted
    unit.inputs['joint_states']['stamp'] = 5_000_000
    unit.step(np.full(1, 5_000_000, np.int64), unit.inputs, unit.outputs)
    assert unit.diagnose()[:2] == (1, f'no azimuth wrap holds the whole program track: {said}')
