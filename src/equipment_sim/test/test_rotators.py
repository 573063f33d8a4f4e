"""Rotators that count, answer and move differently: the protocol, the line and the law with each simulated device.

The time of these tests is a number, and the device answers at once. test/test_rotator.py has nodes and terminals.
"""
import functools

import numpy as np
import pytest

from equipment_sim.rotator import DEVICES, Axes, Habits
from pedestal_common.parameters import ParameterError, build
from pedestal_common.stream import Splitter
from pedestal_hardware.rotator.line import Line
from pedestal_hardware.rotator.protocols import PROTOCOLS
from pedestal_hardware.rotator.unit import Rotator
from pedestal_hardware.rotator_params import RotatorParameters

AWAY_LIMIT_S = 2.0


class Terminal:
    """The connection to a simulated device, as pyserial has it."""

    def __init__(self, protocol, axes):
        self.device, self.axes, self.sent = DEVICES[protocol], axes, []
        self.splitter, self.waiting = Splitter(self.device.end, 512), b''

    @property
    def in_waiting(self):
        return len(self.waiting)

    def read(self, size=1):
        taken, self.waiting = self.waiting[:size], self.waiting[size:]
        return taken

    def write(self, data):
        self.sent.append(bytes(data))
        self.waiting += b''.join(self.device.reply(self.axes, request) for request in self.splitter.take(data))


class Station:
    """A rotator node without ROS: unit and line, with a device."""

    def __init__(self, protocol, habits, **parameters):
        p = build(RotatorParameters, {'protocol': protocol, **parameters})
        self.unit = Rotator(p, ('clock', 'acu/reference', 'acu/mode'))
        self.unit.prepare()
        self.axes = Axes(p.rate, 0.0, build(Habits, habits))
        self.terminal = Terminal(protocol, self.axes)
        self.line = Line('device', functools.partial(PROTOCOLS[protocol], p.azimuth_only), p.period, 0.05)
        self.k = 0
        self.line.ask(self.terminal)

    @property
    def now(self):
        return self.k * self.unit.parameters.period

    def step(self, target=None, mode='preset'):
        """Make a step with a target [deg] of both axes."""
        self.k += 1
        self.axes.advance(self.now)
        self.line.exchange(self.terminal)
        unit, stamp = self.unit, round(self.now * 1e9)
        reference = unit.inputs['acu/reference']
        reference['stamp'] = np.iinfo(np.int64).min if target is None else stamp
        reference['position'] = np.radians((0.0, 0.0) if target is None else target)
        unit.take_text('acu/mode', mode)
        unit.measure(self.line.newest._replace(at=self.now), self.now)
        unit.counts, unit.fault = dict(self.line.counts), self.line.fault.replace('device: not connected so far', '')
        unit.step(np.array([stamp]), unit.inputs, unit.outputs)
        if unit.decision is not None:
            self.line.send(unit.decision)

    def follow(self, target, seconds, mode='preset'):
        """Make the steps of some seconds, until a latched fault."""
        for _ in range(round(seconds / self.unit.parameters.period)):
            self.step(target, mode)
            if 'away' in self.unit.condition or 'counts' in self.unit.condition:
                return

    @property
    def measured(self):
        return np.degrees(self.unit.parts['device']['angle'])


AZIMUTH_ONLY = {'azimuth_only': True, 'elevation': 12.0}
WIDE = {'azimuth.high': 450.0}

# (protocol, habits of the device, parameters of the node, target) that the device must reach
READ = [
    ('rot2prog', {'pulses': 2}, {}, (30.0, 45.0)), ('rot2prog', {'pulses': 1}, {}, (30.0, 45.0)),
    ('rot2prog', {'pulses': 4}, {}, (30.25, 45.5)), ('rot2prog', {'answers_sets': True}, {}, (30.3, 45.0)),
    ('rot2prog', {'echo': True, 'pulses': 2}, {}, (30.5, 45.0)),
    ('rot2prog', {'azimuth': -20.0}, {'azimuth.low': -180.0, 'azimuth.high': 540.0}, (500.0, 30.0)),
    ('gs232', {'elevation': -5.0}, {}, (30.0, 45.0)), ('gs232', {'prompt': True}, {}, (30.0, 45.0)),
    ('gs232', {'signs': True, 'elevation': -5.0}, {}, (30.0, 45.0)), ('gs232', {'decimals': 1}, {}, (30.0, 45.0)),
    ('gs232', {'decimals': 2, 'decimal_comma': True}, {}, (30.0, 45.0)), ('gs232', {'echo': True}, {}, (30.0, 45.0)),
    ('gs232', {'azimuth': 400.0, 'high': 450.0}, WIDE, (440.0, 45.0)), ('gs232', {'line_end': 'cr'}, {}, (3.0, 45.0)),
    ('gs232', {'echo': True, 'prompt': True, 'line_end': 'lfcr'}, {}, (30.0, 45.0)),
    ('easycomm', {'decimal_comma': True}, {}, (30.1, 45.0)), ('easycomm', {'echo': True}, {}, (30.1, 45.0)),
    ('easycomm', {'signs': True, 'elevation': -5.0}, {}, (30.1, 45.0)),
    ('easycomm', {'two_lines': True}, {}, (3.1, 45)),
    ('easycomm', {'elevation': -5.0}, {'elevation.low': -10.0}, (30.1, -7.0)),
    ('easycomm', {'decimals': 3, 'line_end': 'lf'}, {}, (30.1, 170.0)),
    ('easycomm', {'azimuth': -170.0}, {'azimuth.low': -180.0, 'azimuth.high': 180.0}, (170.0, 20.0)),
    ('rotctld', {'decimal_comma': True, 'line_end': 'lf'}, {}, (30.12, 45.0)),
    ('rotctld', {'azimuth': -170.0}, {'azimuth.low': -180.0, 'azimuth.high': 180.0}, (170.0, 20.0)),
]

CONFIGURED = [
    ('gs232', {'circle': '0..360', 'low': 180.0, 'high': 540.0, 'azimuth': 350.0},
     {'azimuth.low': 180.0, 'azimuth.high': 540.0, 'azimuth_circle': '0..360'}, (530.0, 45.0)),
    ('easycomm', {'circle': '-180..180', 'low': 0.0, 'high': 360.0, 'azimuth': 170.0},
     {'azimuth_circle': '-180..180'}, (350.0, 45.0)),
    ('rotctld', {'circle': '0..360', 'low': -180.0, 'high': 180.0, 'azimuth': 10.0},
     {'azimuth.low': -180.0, 'azimuth.high': 180.0, 'azimuth_circle': '0..360'}, (-170.0, 45.0)),
    *((protocol, AZIMUTH_ONLY, {'fixed_elevation': 12.0}, (30.0, 12.0)) for protocol in (
        'gs232', 'gs232_azimuth', 'easycomm', 'rotctld', 'rot1prog')),
    ('gs232', {**AZIMUTH_ONLY, 'signs': True}, {'fixed_elevation': 12.0}, (30.0, 12.0)),
    ('rot1prog', {**AZIMUTH_ONLY, 'echo': True}, {'fixed_elevation': 12.0}, (30.0, 12.0)),
]


@pytest.mark.every_case
@pytest.mark.parametrize(('protocol', 'habits', 'parameters', 'target'), READ + CONFIGURED)
def test_a_device_that_answers_differently_goes_where_the_reference_is(protocol, habits, parameters, target):
    """And no line of its answers is an alarm."""
    station = Station(protocol, habits, **parameters)
    station.follow(target, 90.0)
    step = station.unit.step_deg
    assert station.measured == pytest.approx(target, abs=step), station.unit.diagnose()
    reached = station.axes.angles[0] if habits.get('azimuth_only') else station.axes.angles
    assert reached == pytest.approx(target[0] if habits.get('azimuth_only') else target, abs=step)
    assert station.unit.diagnose().level == 0, station.unit.diagnose()
    assert station.line.counts['refusals'] == 0 and station.line.counts['set_points'] >= 1


def test_the_set_points_of_a_rot2prog_are_in_its_own_pulses_and_never_before_its_answer():
    """Case N4_2: PH = PV = 2."""
    station = Station('rot2prog', {'pulses': 2, 'azimuth': 20.0, 'elevation': 30.0})
    station.follow((30.0, 45.0), 2.0)
    set_points = [sent for sent in station.terminal.sent if sent[11] == 0x2F]
    assert set_points == [b'W0780\x020810\x02/ '] and station.terminal.sent.index(set_points[0]) > 1
    station.follow((30.7, 45.0), 2.0)
    assert any(sent.startswith(b'W0781\x02') for sent in station.terminal.sent)
    assert station.unit.step_deg == pytest.approx(0.5)
    assert ('pulses_per_degree', '2 and 2 pulses per degree') in station.unit.diagnose().values


def test_a_rot2prog_whose_answers_differ_gets_no_set_point():
    station = Station('rot2prog', {'pulses': 2})
    for k in range(20):
        station.axes.habits = build(Habits, {'pulses': 1 + k % 2})
        station.step((30.0, 45.0))
    assert station.line.counts['set_points'] == 0 and 'two equal answers' in station.unit.diagnose().message


def test_other_pulses_of_a_device_trip_the_drive_and_its_reset_adopts_them():
    station = Station('rot2prog', {'pulses': 10})
    station.follow((30.0, 45.0), 2.0)
    station.axes.habits = build(Habits, {'pulses': 4})
    station.step((30.0, 45.0))
    assert station.unit.condition == 'enabled'          # a garbled answer is not enough
    station.follow((30.0, 45.0), 1.0)
    assert station.unit.condition == 'fault: rotator counts differently'
    assert '10 and 10 pulses per degree and now counts 4 and 4' in station.unit.diagnose().message
    assert station.unit.diagnose().level == 2
    for _ in range(10):
        station.step((30.0, 45.0), 'standby')
    assert station.unit.request('adu/reset_faults').granted and station.unit.condition == 'enabled'
    station.follow((50.0, 45.0), 20.0)
    assert station.axes.angles == pytest.approx((50.0, 45.0)) and station.unit.condition == 'enabled'


@pytest.mark.parametrize(('protocol', 'habits', 'reason'), [
    ('rot2prog', {'pulses': 0}, '0 and 0 pulses per degree: must be 1 to 10'),
    ('gs232', AZIMUTH_ONLY, 'the answer has no elevation; the parameter fixed_elevation'),
])
def test_an_answer_that_cannot_be_used_is_refused_by_name_before_any_motion(protocol, habits, reason):
    line = Line('device', functools.partial(PROTOCOLS[protocol], False), 0.2, 0.05)
    terminal = Terminal(protocol, Axes(6.0, 0.0, build(Habits, habits)))
    for _ in range(2):      # the elevation of the first answer may have a line of its own
        with pytest.raises(OSError, match='no position'):
            line.ask(terminal)
    assert reason in line.fault


@pytest.mark.parametrize(('given', 'reason'), [
    ({'protocol': 'rot1prog'}, 'fixed_elevation: must be given'),
    ({'azimuth_circle': '0..360', 'azimuth.high': 450.0}, 'must be travel with a travel above 360 deg'),
    ({'protocol': 'rot2prog', 'azimuth.high': 700.0}, 'at most 639.9 deg, the range of rot2prog'),
    ({'protocol': 'gs232', 'elevation.low': -5.0}, 'must be at least 0 deg'),
    ({'protocol': 'gs232', 'azimuth_circle': '-180..180'}, 'must be at least 0 deg'),
])
def test_parameters_that_no_device_of_the_protocol_has(given, reason):
    with pytest.raises(ParameterError, match=reason):
        build(RotatorParameters, given)


# (protocol, habits, parameters, target) of axes that run away
AWAY = [
    *((protocol, {'turned': True, 'azimuth': 100.0, 'elevation': 60.0}, {}, (90.0, 60.0))
      for protocol in ('gs232', 'easycomm', 'rotctld', 'rot2prog')),
    ('easycomm', {'turned': True, 'azimuth': 90.0, 'elevation': 60.0}, {}, (90.0, 20.0)),
    ('rot1prog', {'turned': True, 'azimuth': 100.0, 'azimuth_only': True}, {'fixed_elevation': 0.0}, (90.0, 0.0)),
    ('easycomm', {'turned': True, 'azimuth': 100.0, 'deaf': True}, {'rate': 1.0}, (90.0, 0.0)),
    ('rot2prog', {'turned': True, 'azimuth': 100.0}, {'period': 0.5}, (90.0, 0.0)),
]


@pytest.mark.every_case
@pytest.mark.parametrize(('protocol', 'habits', 'parameters', 'target'), AWAY)
def test_an_axis_that_goes_away_from_its_set_point_is_stopped_within_two_seconds(protocol, habits, parameters, target):
    station = Station(protocol, habits, **parameters)
    fault = f'fault: {"elevation" if target[0] == habits["azimuth"] else "azimuth"} runs away'
    for _ in range(5):
        station.step(None, 'standby')
    sent, begun = station.line.counts['set_points'], None
    while station.unit.condition == 'enabled' and station.now < 60.0:
        station.step(target)
        if begun is None and station.line.counts['set_points'] > sent:
            begun = station.now
    assert station.unit.condition == fault and station.now - begun <= AWAY_LIMIT_S
    station.step(target)
    stop = station.line._protocol.stop
    assert station.terminal.sent[-2] == stop and 'went away from' in station.unit.diagnose().message
    assert station.unit.diagnose().level == 2
    for _ in range(20):
        station.step(target)
    stops = station.terminal.sent.count(stop)
    assert (stops > 2) if habits.get('deaf') else (stops == 1), 'a deaf device is stopped again'
    reply = station.unit.request('adu/reset_faults')
    assert reply.granted != habits.get('deaf', False), reply
    assert station.unit.condition == ('enabled' if reply.granted else fault)


def test_an_axis_that_ignores_its_set_point_and_runs_through_it_is_stopped():
    """Case N4_2 without the reading of the pulses: the device counts 2 for a degree and gets 10."""
    station = Station('rot2prog', {'pulses': 2, 'azimuth': 20.0, 'elevation': 30.0})
    station.unit._adopt((10, 10))
    station.unit._take_pulses = lambda pulses: None
    station.follow((30.0, 45.0), 20.0)
    assert station.unit.condition == 'fault: azimuth runs away'
    assert station.axes.angles[0] < 30.0 + 6.0 * AWAY_LIMIT_S


def test_a_device_that_wraps_unlike_its_parameters_is_stopped_and_the_parameter_is_named():
    station = Station('easycomm', {'circle': '-180..180', 'low': 0.0, 'azimuth': 170.0})
    station.follow((200.0, 0.0), 20.0)
    assert station.unit.condition == 'fault: azimuth runs away' and station.axes.angles[0] < 200.0
    assert 'jumped by -359 deg: see the parameter azimuth_circle' in station.unit.diagnose().message


def test_an_axis_that_goes_on_beyond_its_travel_without_a_set_point_is_stopped():
    station = Station('easycomm', {'azimuth': 358.0})
    for _ in range(5):
        station.step(None, 'standby')
    station.axes.set_points[0] = 200.0          # by hand, within the travel
    for _ in range(40):
        station.step(None, 'standby')
    assert station.unit.condition == 'enabled'
    station.axes.set_points[0] = 500.0
    while station.axes.angles[0] < 360.0:
        station.step(None, 'standby')
    begun = station.now
    while station.unit.condition == 'enabled' and station.now < begun + 20.0:
        station.step(None, 'standby')
    assert station.unit.condition == 'fault: azimuth runs away' and station.now - begun <= AWAY_LIMIT_S


def test_one_garbled_answer_and_lawful_motions_trip_nothing():
    """Reversals, stops in motion, a target too fast for the axes, an overshoot, a lash of one step, a long silence."""
    station = Station('gs232', {'azimuth': 100.0, 'elevation': 40.0})
    station.follow((150.0, 40.0), 3.0)
    true, station.axes.angles[0] = station.axes.angles[0], 720.0
    station.step((150.0, 40.0))
    station.axes.angles[0] = true
    station.follow((60.0, 40.0), 2.0)           # reversed in motion
    station.follow((60.0, 40.0), 4.0, 'stop')
    for k in range(60):                         # 20 deg/s, the axes have 6 deg/s
        station.step((60.0 + 4.0 * k, 40.0))
    station.follow((300.0, 40.0), 60.0)
    station.axes.set_points[0] += 3.0           # overshoot of half a second
    station.follow((300.0, 40.0), 3.0)
    for k in range(40):
        station.axes.angles[1] = station.axes.set_points[1] = 40.0 + k % 2
        station.step((300.0, 40.0))
    assert station.unit.condition == 'enabled', station.unit.diagnose()


@pytest.mark.parametrize('sense', [1.0, -1.0])
def test_an_axis_that_leaves_a_moving_target_is_stopped_within_two_seconds(sense):
    """In a pass, 1 deg/s: ahead of the target, and back."""
    station, target = Station('rot2prog', {'azimuth': 100.0, 'elevation': 30.0}, period=0.5), 100.0
    for _ in range(40):
        target += 0.5
        station.step((target, 30.0))
    begun, station.axes.go = station.now, lambda azimuth, elevation: None
    station.axes.set_points[0] = 100.0 + sense * 250.0
    while station.unit.condition == 'enabled' and station.now < begun + 10.0:
        target += 0.5
        station.step((target, 30.0))
    assert station.unit.condition == 'fault: azimuth runs away' and station.now - begun <= AWAY_LIMIT_S


class SoftAxes(Axes):
    """Axes that obey after half a second, and accelerate and brake with 4 deg/s2."""
    velocity, goals = (0.0, 0.0), ()

    def advance(self, now):
        self.goals = [*self.goals, (now, list(self.set_points))]
        while self.now < now - 1e-9:
            self.now += 0.02
            goal = [goals for at, goals in self.goals if at <= max(self.now - 0.5, self.goals[0][0])][-1]
            wanted = np.subtract(goal, self.angles)
            wanted = np.sign(wanted) * np.minimum(self.rate, 0.9 * np.sqrt(8.0 * np.abs(wanted)))
            self.velocity += np.clip(wanted - self.velocity, -0.08, 0.08)
            self.angles = list(self.angles + 0.02 * self.velocity)
        self.goals = self.goals[-40:]


@pytest.mark.parametrize('protocol', ['gs232', 'easycomm'])
def test_reversals_and_stops_of_a_slow_and_soft_rotator_are_lawful(protocol):
    """The reference moves as the control unit's does, at 5.7 deg/s towards targets that change in its motion."""
    station, rng = Station(protocol, {'azimuth': 180.0, 'elevation': 45.0}), np.random.default_rng(1)
    station.axes.__class__ = SoftAxes
    reference = np.array((180.0, 45.0))
    for _ in range(40):
        target = rng.uniform(0.0, (360.0, 90.0))
        for _ in range(int(rng.uniform(3, 75))):
            reference += np.clip(target - reference, -1.14, 1.14)
            station.step(reference)
        if rng.uniform() < 0.3:
            station.follow(reference, rng.uniform(0.2, 4.0), 'stop')
            reference = np.array(station.measured)
        assert station.unit.condition == 'enabled', station.unit.diagnose()
