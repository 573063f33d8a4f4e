"""Malformed messages on every topic of a station: does a node end, does the antenna move?

    python docs/reliability/messages.py [COUNT] [ashore|ship|array ...]

Raw bytes and well-formed messages with bad numbers and stamps, COUNT of each on every topic (default 10,000), sent by
a node `stranger` beside all nodes of a station in standby, the recorder too: an antenna ashore, one on a ship whose
INS aligns itself, an array of two beams on a ship. Prints a row per topic and ends with exit code 1 if a node ended,
or an axis moved further than without the stranger by more than 1e-4 rad.
"""
import argparse
import contextlib
import dataclasses
import functools
import math
import os
import random
import sys
import tempfile
import time

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from station import NODES, Station, reads

from pedestal_bringup.scenario import scenario
from pedestal_common.graph import domain, nodes, topics
from pedestal_common.node import middleware, subscriptions
from pedestal_common.wire import messages

NUMBERS = (float('nan'), float('inf'), -float('inf'), 1e308, -1e308, 5e-324, 0.0, -0.0, 0.5, -2.0, 1e6)
STAMPS = (0, 1, -1, 2**31 - 1, -2**31, 1_000_000_000)
TEXTS = ('', '\n', '\u2620', 'x' * 70_000, 'adu')
MOVED = 1e-4

JOINTS = 'joint_states', 'beam_1/joint_states', 'beam_2/joint_states'

RECEIVER = tuple(f'tracking_receiver.receiver.{what}.measured=true' for what in ('rate', 'ranging'))
STATIONS = {'ashore': ('leo_pass', RECEIVER),
            'ship': ('ship_align_and_track', (*RECEIVER, 'ship_motion.ship.sea_state=3')),
            'array': ('phased_array_sway', ('scenario.beams=2',))}
"""{kind: (scenario, what is changed of it)}."""


def read_topics():
    """The topics that drive, control unit and receiver ashore read from others."""
    return sorted({name for node in NODES for name in reads(scenario.load('leo_pass'), node)})


def all_topics(station):
    """Every topic of a station, for the recorder reads each; of several beams those of the first."""
    header = station.scenario.header
    names = [link.name for link in nodes.recorded(station.scenario.nodes, topics.TOPIC_FLAGS, header.graph_beams)]
    return [name for name in names if nodes.beam_of(name) in ('', 'beam_1')
            and (header.graph_beams == 0 or not topics.TOPIC_BY_NAME[nodes.plain(name)].flag)]


def sane(name):
    """A good message of a topic."""
    row = topics.TOPIC_BY_NAME[nodes.plain(name)]
    if row.type == 'std_msgs/msg/String':
        return messages.String(data='enabled')
    if row.type == 'diagnostic_msgs/msg/DiagnosticArray':
        said = messages.DiagnosticStatus(level=0, name='stranger', message='all is well', hardware_id='',
                                         values=[messages.KeyValue(key='lost_steps', value='0')])
        return messages.DiagnosticArray(header=messages.header(''), status=[said])
    return messages.template(row.name)


def raw(rng, good):
    """Bytes that are no message, or hardly one: cut, flipped, lengths too large, another encoding, noise."""
    kind = rng.randrange(7)
    data = bytearray(good)
    if kind == 0:
        return bytes(rng.randbytes(rng.choice((0, 1, 3, 4, 11, 24, 200, 5000))))
    if kind == 1:
        return bytes(data[:rng.randrange(len(data))])
    if kind == 2:
        for _ in range(rng.randrange(1, 9)):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    elif kind == 3:
        at = 4 * rng.randrange(1, max(len(data) // 4, 2))
        data[at:at + 4] = rng.choice((b'\xff\xff\xff\xff', b'\xff\xff\xff\x7f', b'\0\0\0\x01', b'\0\0\0\0'))
    elif kind == 4:
        data[:4] = rng.randbytes(4)
    elif kind == 5:
        data += rng.randbytes(rng.randrange(1, 400))
    else:
        data[4:] = rng.randbytes(len(data) - 4)
    return bytes(data)


def well_formed(rng, name):
    """A message of the topic's type whose stamp, names, lengths or numbers are not what they should be."""
    message = sane(name)
    if message.__msgtype__ == 'std_msgs/msg/String':
        message.data = rng.choice(('', 'enabled', 'disabled', 'aligning', 'x' * 70_000, 'fault: \u2620', '\n'))
        return messages.serialize(message)
    _spoil(rng, message)
    stamp = message.clock if message.__msgtype__ == 'rosgraph_msgs/msg/Clock' else message.header.stamp
    messages.put_stamp(stamp, time.time_ns() + rng.choice((0, 0, 10**7, -10**9, 10**10, 10**13)))
    if rng.random() < 0.2:
        stamp.sec, stamp.nanosec = rng.choice(STAMPS), rng.choice((0, 1, 999_999_999, 2**32 - 1))
        stamp.sec = max(min(stamp.sec, 2**31 - 1), -2**31)
    return messages.serialize(message)


def _spoil(rng, message):
    """Put bad values into the fields of a message."""
    for name in (field.name for field in dataclasses.fields(message) if field.name != '__msgtype__'):
        value = getattr(message, name)
        if isinstance(value, np.ndarray) and value.dtype == float and rng.random() < 0.7:
            size = value.size if value.size > 8 or rng.random() < 0.6 else rng.randrange(5)
            setattr(message, name, np.array([rng.choice(NUMBERS) for _ in range(size)]))
        elif isinstance(value, float) and rng.random() < 0.7:
            setattr(message, name, rng.choice(NUMBERS[:2] + NUMBERS[5:]))
        elif isinstance(value, str) and rng.random() < 0.1:
            setattr(message, name, rng.choice(TEXTS))
        elif isinstance(value, list) and rng.random() < 0.3:
            setattr(message, name, value[:rng.randrange(len(value) + 1)])
        elif dataclasses.is_dataclass(value) and name != 'stamp':
            _spoil(rng, value)
        elif isinstance(value, list):
            for part in value:
                if dataclasses.is_dataclass(part):
                    _spoil(rng, part)


class Stranger:
    """A node that sends what it should not, and watches the antenna."""

    def __init__(self, domain_id):
        domain.set_defaults()
        self.context = rclpy.Context()
        rclpy.init(args=[], context=self.context, domain_id=domain_id)
        self.node = rclpy.create_node('stranger', context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.first, self.furthest, self.said = {}, {}, {}
        self.steps = 0
        self.sent_until = {}
        for name in JOINTS:
            self._read(name, functools.partial(self._joints, name))
        self._read('diagnostics', self._diagnostics)

    def _read(self, name, take):
        topic = topics.TOPIC_BY_NAME[nodes.plain(name)]

        def callback(data, info):
            if info['source_timestamp'] > self.sent_until.get(name, 0):     # else it may be our own
                with contextlib.suppress(ValueError):
                    take(messages.deserialize(data, topic.type))
        self.node.create_subscription(middleware.message_class(topic.type), name,
                                      subscriptions.two_argument_callback(callback),
                                      middleware.qos(topic.rate, 'recorded'), raw=True)

    def _joints(self, name, message):
        angles = np.asarray(message.position)
        if angles.shape == (2,):
            moved = float(np.abs(angles - self.first.setdefault(name, angles)).max())
            self.furthest[name] = max(moved, self.furthest.get(name, 0.0))
            self.steps += 1

    def _diagnostics(self, message):
        for status in message.status:
            self.said[status.name] = status

    def spin(self, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.01)

    def until(self, condition, limit=300.0):
        """Spin until condition() holds; raises TimeoutError after limit [s]."""
        end = time.monotonic() + limit
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError(f'nothing within {limit:g} s')
            self.executor.spin_once(timeout_sec=0.01)

    def moved(self, seconds=0.0):
        """How far an axis was at the most from where it was first [rad], begun anew by this; of `seconds`."""
        self.spin(seconds)
        furthest = max(self.furthest.values(), default=0.0)
        self.first.clear()
        self.furthest.clear()
        return furthest

    def send(self, name, count, make):
        """Publish make() count times; how many of them left: Fast DDS sends none that is longer than its type."""
        topic = topics.TOPIC_BY_NAME[nodes.plain(name)]
        publisher = self.node.create_publisher(middleware.message_class(topic.type), name,
                                               middleware.qos(topic.rate, 'written'))
        self.sent_until[name] = math.inf
        self.until(publisher.get_subscription_count)
        sent = 0
        for number in range(count):
            with contextlib.suppress(rclpy_implementation.RCLError):
                publisher.publish(make())
                sent += 1
            if number % 10 == 0:
                self.executor.spin_once(timeout_sec=0.001)
        self.spin(0.5)
        self.node.destroy_publisher(publisher)
        self.sent_until[name] = time.time_ns()
        self.spin(0.3)
        return sent

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


def attack(station, stranger, name, count, seed=1):
    """(messages sent, nodes that ended, how far an axis moved [rad]) of count raw and count well-formed messages."""
    rng = random.Random(f'{name} {seed}')
    good = messages.serialize(sane(name))
    stranger.spin(0.3)
    stranger.moved()
    sent = stranger.send(name, count, lambda: raw(rng, good))
    sent += stranger.send(name, count, lambda: well_formed(rng, name))
    steps = stranger.steps
    stranger.until(lambda: stranger.steps > steps + 20)
    return sent, set(station.processes) - station.alive(), stranger.moved()


def attacked(kind, count):
    """Attack every topic of one of STATIONS; whether it bore that."""
    borne = True
    name, changes = STATIONS[kind]
    with tempfile.TemporaryDirectory() as folder:
        station = Station(folder, int(os.environ.get('ROS_DOMAIN_ID', '77')), name, (
            *changes, 'acu.initial_mode=standby', 'scenario.duration=3600'))
        stranger = Stranger(station.domain_id)
        try:
            station.start(*station.nodes, 'recorder')
            stranger.until(lambda: stranger.steps > 100 and {*station.nodes, 'recorder'} <= set(stranger.said))
            stranger.spin(5.0)
            stranger.moved()
            alone = stranger.moved(20.0)
            print(f'{kind}: {name}; by itself an axis moves by {alone:.1e} rad in 20 s')
            print(f'{"topic":36} {"messages":>9} {"seconds":>8} {"nodes ended":>12} {"moved rad":>10}', flush=True)
            for topic in all_topics(station):
                began = time.monotonic()
                sent, ended, moved = attack(station, stranger, topic, count)
                borne &= not ended and moved - alone < MOVED
                print(f'{topic:36} {sent:9} {time.monotonic() - began:8.0f} '
                      f'{", ".join(sorted(ended)) or "none":>12} {moved:10.1e}', flush=True)
                for node in ended:
                    print(station.log(node)[-1000:])
                station.start(*ended)
            stranger.spin(5.0)
            stranger.said.clear()
            stranger.until(lambda: {*station.nodes, 'recorder'} <= set(stranger.said))
            for node, status in sorted(stranger.said.items()):
                if node in station.processes:
                    print(node, status.level, status.message[:300])
                    print('   ', '; '.join(f'{value.key} {value.value}' for value in status.values
                                           if value.key.startswith('dropped')))
        finally:
            stranger.close()
            station.close()
    return borne


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('count', nargs='?', type=int, default=10_000)
    parser.add_argument('kinds', nargs='*', metavar='station', help=', '.join(STATIONS))
    options = parser.parse_args()
    for kind in options.kinds:
        if kind not in STATIONS:
            parser.error(f'{kind!r} is none of {", ".join(STATIONS)}')
    return int(not all([attacked(kind, options.count) for kind in options.kinds or STATIONS]))


if __name__ == '__main__':
    sys.exit(main())
