"""A realtime graph as on a permanent station: nodes are killed, frozen and started again, strangers write what they
should not, clocks are UTC. Each test is a defect that was once measured."""
import contextlib
import importlib.util
import json
import pathlib
import signal
import sys
import time

import numpy as np
import pytest

from pedestal_bringup.scenario.program import Plan
from pedestal_common.graph import topics
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node import middleware
from pedestal_common.wire import messages

pytestmark = pytest.mark.thorough

TOOLS = pathlib.Path(__file__).parents[1] / 'docs' / 'reliability'
PERIOD = 5_000_000
SOON = 60.0
"""Seconds in which something that takes a moment has happened, also on a machine that is busy with other tests."""


def _tool(name):
    spec = importlib.util.spec_from_file_location(name, TOOLS / f'{name}.py')
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


station = _tool('station')
malformed = _tool('messages')


CHANGES = ('scenario.duration=600', 'scenario.program.interval=0.5', 'tracking_receiver.target.kind=sine',
           'tracking_receiver.target.angle.azimuth_amplitude=0.5', 'tracking_receiver.target.angle.elevation=0.6',
           'tracking_receiver.target.angle.elevation_amplitude=0.1', 'tracking_receiver.target.angle.frequency=0.05',
           'adu.command_timeout=40', 'acu.step_gap=0.2')
"""A target that swings for 10 minutes; a busy machine may hold a node up for longer than the defaults let pass."""


class Field:
    """A Station, its operator, and a node that hears everything."""

    def __init__(self, folder, domain_id, connect, *changes):
        self.state_file = folder / 'state.json'
        self.station = station.Station(folder, domain_id, changes=(*CHANGES, f'adu.state_file={self.state_file}',
                                                                   *changes))
        self.operator = connect(domain_id, 'operator')
        self.heard = self.operator.heard

    def begin(self):
        self.station.start(*station.NODES)
        for name in ('joint_states', 'adu/state', 'acu/mode', 'acu/rate_command', 'diagnostics',
                     'tracking_receiver/angle_error'):
            self._hear(name)
        self.until(lambda: self.heard['joint_states'] and self.heard['acu/rate_command'], 300.0)

    def _hear(self, name):
        """Hear a topic, whatever strangers say on it."""
        topic, heard = topics.TOPIC_BY_NAME[name], self.heard.setdefault(name, [])

        def take(data):
            with contextlib.suppress(ValueError):
                heard.append(messages.deserialize(data, topic.type))
        self.operator.node.create_subscription(middleware.message_class(topic.type), name, take,
                                               middleware.qos(topic.rate, 'recorded'), raw=True)

    def until(self, condition, limit=SOON):
        return self.operator.until(condition, limit, self.told)

    def told(self):
        ended = set(self.station.processes) - self.station.alive()
        return (f'ended: {ended}; mode {self.mode}, drive {self.state}; said: {self.operator.said(-6)}; '
                + '; '.join(self.station.log(node)[-300:] for node in ended))

    def wait(self, seconds):
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end, seconds + SOON)

    @property
    def joints(self):
        return self.heard['joint_states'][-1]

    @property
    def mode(self):
        return self.heard['acu/mode'][-1].data if self.heard['acu/mode'] else 'unknown'

    @property
    def state(self):
        return self.heard['adu/state'][-1].data if self.heard['adu/state'] else 'unknown'

    def fresh(self, name):
        """Wait for messages of a topic that were stamped after now."""
        now, heard = time.time_ns(), self.heard[name]
        self.until(lambda: heard and messages.nanoseconds(heard[-1].header.stamp) > now)

    def status(self, node, text):
        """Wait for a diagnostic of a node that comes from now on and holds the text."""
        first = len(self.heard['diagnostics'])
        return self.until(lambda: [status for array in self.heard['diagnostics'][first:] for status in array.status
                                   if status.name == node and text in status.message])[0]

    def close(self):
        self.station.close()


@pytest.fixture(scope='module')
def standing(tmp_path_factory, reserve_domain, connect):
    """A station in standby."""
    with contextlib.closing(Field(tmp_path_factory.mktemp('standing'), reserve_domain(), connect,
                                  'acu.initial_mode=standby')) as field:
        field.begin()
        yield field


@pytest.fixture(scope='module')
def moving(tmp_path_factory, reserve_domain, connect):
    """A station that follows a program, swinging to and fro, and then its receiver."""
    with contextlib.closing(Field(tmp_path_factory.mktemp('moving'), reserve_domain(), connect)) as field:
        field.begin()
        tracks = Plan(field.station.scenario).tracks
        field.operator.write('acu/program_track')
        field.operator.publish('acu/program_track', tracks['acu/program_track'])
        field.until(lambda: field.mode == 'autotrack')
        yield field


def stranger_writes(field, connect, name, stamp, seconds=1.0, until=lambda: True, **numbers):
    """A node `stranger` publishes on a topic for a while; stamp() gives each its stamp [ns]. Then now and then, so
    that its numbers do not come near to those of others, until until() is true."""
    client = connect(field.station.domain_id, 'stranger')
    topic = topics.TOPIC_BY_NAME[name]
    publisher = client.node.create_publisher(middleware.message_class(topic.type), name,
                                             middleware.qos(topic.rate, 'written'))
    client.until(publisher.get_subscription_count)
    message = messages.template(name)
    for field_name, values in numbers.items():
        getattr(message, field_name)[:] = values
    begun = time.monotonic()
    while (passed := time.monotonic() - begun) < seconds or not until():
        assert passed < SOON, field.told()
        messages.put_stamp(message.header.stamp, stamp())
        publisher.publish(messages.serialize(message))
        field.operator.spin(0.003 if passed < seconds else 0.3)
    client.close()


def test_stamps_are_utc_on_the_grid_of_the_start(standing):
    standing.fresh('joint_states')
    before = time.time_ns() - 30 * NS_PER_SECOND
    heard = standing.heard['joint_states'][-100:]
    stamps = np.array([messages.nanoseconds(message.header.stamp) for message in heard])
    assert before < stamps[-1] <= time.time_ns()
    assert not ((stamps - standing.station.start_time) % PERIOD).any() and (np.diff(stamps) > 0).all()


def test_a_second_writer_of_the_command_moves_nothing_and_is_named(standing, connect):
    before = np.array(standing.joints.position)
    first = len(standing.heard['diagnostics'])

    def said():
        return [status.level for array in standing.heard['diagnostics'][first:] for status in array.status
                if status.name == 'adu' and 'another publisher: stranger' in status.message]
    stranger_writes(standing, connect, 'acu/rate_command', time.time_ns, 1.5, said, velocity=(0.5, 0.5))
    assert set(said()) == {2}
    np.testing.assert_allclose(standing.joints.position, before, atol=1e-4)
    assert standing.state == 'enabled'


@pytest.mark.parametrize('name, reader', [('joint_states', 'acu'), ('adu/truth', 'tracking_receiver'),
                                          ('tracking_receiver/angle_error', 'acu')])
def test_a_stamp_of_the_future_makes_nobody_deaf(standing, connect, name, reader):
    stranger_writes(standing, connect, name, lambda: time.time_ns() + 3600 * NS_PER_SECOND, 0.3)
    standing.fresh('acu/rate_command' if reader == 'acu' else 'tracking_receiver/angle_error')
    assert standing.station.alive() == set(station.NODES)


@pytest.mark.parametrize('name', malformed.read_topics())
def test_malformed_messages_end_nobody_and_move_nothing(standing, connect, name):
    stranger = malformed.Stranger(standing.station.domain_id)
    try:
        stranger.until(lambda: stranger.steps, SOON)
        _, ended, moved = malformed.attack(standing.station, stranger, name, 60)
    finally:
        stranger.close()
    assert not ended, standing.told()
    assert moved < malformed.MOVED
    for topic in {'joint_states', 'acu/rate_command', 'tracking_receiver/angle_error'} - {name}:
        standing.fresh(topic)


def test_what_a_stranger_says_of_the_drive_stops_nothing(moving, connect):
    """Not in its first milliseconds either, when the graph does not show yet whose words these are. Once it has gone
    the drive is heard again."""
    moving.until(lambda: moving.mode in ('program', 'autotrack') and moving.state == 'enabled')
    modes = len(moving.heard['acu/mode'])
    for _ in range(3):
        stranger = malformed.Stranger(moving.station.domain_id)
        try:
            stranger.send('adu/state', 20, lambda: messages.serialize(messages.String(data='disabled')))
        finally:
            stranger.close()
    moving.wait(0.5)
    assert 'standby' not in [mode.data for mode in moving.heard['acu/mode'][modes:]]
    assert moving.mode in ('program', 'autotrack')
    assert moving.operator.trigger('adu/disable')[0]
    moving.until(lambda: moving.mode == 'standby')
    assert moving.operator.trigger('adu/enable')[0]
    moving.until(lambda: moving.state == 'enabled')
    for mode in ('program', 'autotrack'):
        moving.until(lambda mode=mode: moving.operator.trigger('acu/reset_faults')
                     and moving.operator.trigger(f'acu/{mode}')[0])


@pytest.mark.excused_by('missed_steps')
def test_a_drive_that_is_killed_goes_on_where_it_was(moving):
    """On the same grid of time, at the same angle, on its brakes at first; the mode is resumed."""
    moving.wait(1.5)
    moving.station.kill('adu')
    moving.status('acu', 'no joint_states for')
    assert moving.operator.trigger('acu/stow') == (
        False, f'refused: no joint_states, the drive is silent; mode is {moving.mode}')
    moving.wait(0.1)
    left, count = json.loads(moving.state_file.read_text()), len(moving.heard['joint_states'])
    moving.station.signal('acu', signal.SIGSTOP)    # who hears the drive late hears it still standing
    moving.station.start('adu')
    moving.fresh('joint_states')
    moving.station.signal('acu', signal.SIGCONT)
    first = moving.heard['joint_states'][count]
    assert (messages.nanoseconds(first.header.stamp) - moving.station.start_time) % PERIOD == 0
    np.testing.assert_allclose(first.position, (left['azimuth'], left['elevation']), atol=1e-5)
    np.testing.assert_allclose(first.velocity, 0.0, atol=1e-4)
    moving.until(lambda: moving.state == 'enabled')
    moving.fresh('acu/rate_command')


@pytest.mark.excused_by('missed_steps')
def test_the_other_nodes_may_be_killed_too(moving):
    for node in ('acu', 'tracking_receiver'):
        moving.station.kill(node)
        moving.wait(0.5)
        moving.station.start(node)
        moving.fresh('acu/rate_command')
        moving.fresh('tracking_receiver/angle_error')
    moving.until(lambda: moving.mode in ('program', 'autotrack'))


@pytest.mark.parametrize('node', ['acu', 'adu'])
@pytest.mark.excused_by(None)
def test_after_a_freeze_the_axes_do_not_jump(moving, node):
    """And the node reports its stall."""
    moving.until(lambda: moving.mode in ('program', 'autotrack') and moving.state == 'enabled')
    moving.wait(0.5)
    moving.station.signal(node, signal.SIGSTOP)
    time.sleep(2.5)
    count = len(moving.heard['joint_states'])
    moving.station.signal(node, signal.SIGCONT)
    moving.status(node, 'stalled for')
    moving.fresh('acu/rate_command')
    moving.wait(1.0)
    rates = np.array([message.velocity for message in moving.heard['joint_states'][count:]])
    limits = moving.station.scenario.node_parameters('adu').azimuth.limits
    assert np.abs(rates).max() < 1.1 * limits.rate          # what the drive lets through, and its overshoot
    assert moving.mode in ('program', 'autotrack')


@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGINT])
def test_a_drive_that_is_told_to_end_stops_its_axes_first(moving, number):
    moving.until(lambda: moving.state == 'enabled')
    moving.station.signal('adu', number)
    moving.until(lambda: moving.station.processes['adu'].poll() is not None)
    assert moving.station.processes['adu'].returncode == 0
    # What it said last stays; a busy machine hears it late.
    moving.until(lambda: np.abs(moving.joints.velocity).max() < 1e-3 and moving.state == 'disabled')
    moving.station.start('adu')
    moving.fresh('joint_states')
    moving.until(lambda: moving.state == 'enabled')
