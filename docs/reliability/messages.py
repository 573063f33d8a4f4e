"""Malformed messages on every topic that a station reads: does a node end, does the antenna move?

    python docs/reliability/messages.py [COUNT]

Raw bytes and well-formed messages with bad numbers and stamps, COUNT of each on every topic (default 10,000), sent by
a node `stranger` beside drive, control unit and receiver in standby. Prints a row per topic and ends with exit code 1
if a node ended, or the antenna moved by more than 1e-4 rad.
"""
import os
import random
import sys
import tempfile
import time

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from station import NODES, Station

from pedestal_common import messages, middleware, nodes, topics
from pedestal_common.unit import OK

NUMBERS = (float('nan'), float('inf'), -float('inf'), 1e308, -1e308, 5e-324, 0.0, -0.0, 0.5, -2.0, 1e6)
STAMPS = (0, 1, -1, 2**31 - 1, -2**31, 1_000_000_000)
MOVED = 1e-4


def read_topics():
    """The topics that the nodes of the station read from others."""
    rows = [nodes.row(node) for node in NODES]
    return sorted({name for row in rows for name in nodes.reads(row, (*NODES, 'operator')) if name != 'clock'})


def sane(name):
    """A good message of a topic."""
    row = topics.BY_NAME[name]
    return messages.String(data='enabled') if row.type == 'std_msgs/msg/String' else messages.template(name)


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
    if topics.BY_NAME[name].type == 'std_msgs/msg/String':
        message.data = rng.choice(('', 'enabled', 'disabled', 'aligning', 'x' * 70_000, 'fault: \u2620', '\n'))
        return messages.serialize(message)
    _spoil(rng, message)
    stamp = message.header.stamp
    messages.put_stamp(stamp, time.time_ns() + rng.choice((0, 0, 10**7, -10**9, 10**10, 10**13)))
    if rng.random() < 0.2:
        stamp.sec, stamp.nanosec = rng.choice(STAMPS), rng.choice((0, 1, 999_999_999, 2**32 - 1))
        stamp.sec = max(min(stamp.sec, 2**31 - 1), -2**31)
    return messages.serialize(message)


def _spoil(rng, message):
    """Put bad values into the fields of a message."""
    for name in message.__dataclass_fields__:
        value = getattr(message, name)
        if isinstance(value, np.ndarray) and value.dtype == float and rng.random() < 0.7:
            size = value.size if value.size > 8 or rng.random() < 0.6 else rng.randrange(5)
            setattr(message, name, np.array([rng.choice(NUMBERS) for _ in range(size)]))
        elif isinstance(value, float) and rng.random() < 0.7:
            setattr(message, name, rng.choice(NUMBERS[:2] + NUMBERS[5:]))
        elif isinstance(value, list) and rng.random() < 0.3:
            setattr(message, name, value[:rng.randrange(len(value) + 1)])
        elif hasattr(value, '__dataclass_fields__') and name != 'stamp':
            _spoil(rng, value)
        elif isinstance(value, list):
            for part in value:
                if hasattr(part, '__dataclass_fields__'):
                    _spoil(rng, part)


class Stranger:
    """A node that sends what it should not, and watches the antenna."""

    def __init__(self, domain_id):
        middleware.set_defaults()
        self.context = rclpy.Context()
        rclpy.init(args=[], context=self.context, domain_id=domain_id)
        self.node = rclpy.create_node('stranger', context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.angles, self.said = {}, {}
        self.steps = 0
        self.sending_joints = False
        self._read('joint_states', self._joints)
        self._read('diagnostics', self._diagnostics)

    def _read(self, name, take):
        topic = topics.BY_NAME[name]

        def callback(data):
            try:
                take(messages.deserialize(data, topic.type))
            except ValueError:
                pass    # our own
        self.node.create_subscription(middleware.message_class(topic.type), name, callback,
                                      middleware.qos(topic.rate, 'recorded'), raw=True)

    def _joints(self, message):
        angles = np.asarray(message.position)
        if message.header.frame_id == 'base_link' and angles.shape == (2,) and not self.sending_joints:
            self.angles.setdefault('first', angles)
            self.angles['last'] = angles
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

    def send(self, name, count, make, pause=0.0005):
        """Publish make() count times."""
        topic = topics.BY_NAME[name]
        publisher = self.node.create_publisher(middleware.message_class(topic.type), name,
                                               middleware.qos(topic.rate, 'written'))
        self.sending_joints = name == 'joint_states'
        self.until(publisher.get_subscription_count)
        for _ in range(count):
            publisher.publish(make())
            self.executor.spin_once(timeout_sec=pause)
        self.spin(0.5)
        self.node.destroy_publisher(publisher)
        self.spin(0.3)
        self.sending_joints = False

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


def attack(station, stranger, name, count, seed=1):
    """(nodes that ended, how far the antenna moved [rad]) while count raw and count well-formed messages were sent."""
    rng = random.Random(f'{name} {seed}')
    good = messages.serialize(sane(name))
    stranger.spin(0.3)
    stranger.angles.pop('first', None)
    stranger.send(name, count, lambda: raw(rng, good))
    stranger.send(name, count, lambda: well_formed(rng, name))
    steps = stranger.steps
    stranger.until(lambda: stranger.steps > steps + 20)
    ended = set(station.processes) - station.alive()
    return ended, float(np.abs(stranger.angles['last'] - stranger.angles['first']).max())


def main(count=10_000):
    failed = False
    with tempfile.TemporaryDirectory() as folder:
        station = Station(folder, int(os.environ.get('ROS_DOMAIN_ID', '77')), changes=(
            'acu.initial_mode=standby', 'scenario.duration=3600'))
        stranger = Stranger(station.domain_id)
        try:
            station.start(*NODES)
            stranger.until(lambda: stranger.steps > 100 and {'acu', 'adu'} <= set(stranger.said)
                           and stranger.said['adu'].level == OK)
            print(f'{"topic":32} {"messages":>9} {"nodes ended":>12} {"moved rad":>10}')
            for name in read_topics():
                ended, moved = attack(station, stranger, name, count)
                failed |= bool(ended) or moved > MOVED
                print(f'{name:32} {2 * count:9} {", ".join(sorted(ended)) or "none":>12} {moved:10.1e}', flush=True)
            stranger.spin(1.5)
            for node, status in sorted(stranger.said.items()):
                print(node, status.level, status.message[:300])
                print('   ', '; '.join(f'{value.key} {value.value}' for value in status.values
                                       if value.key.startswith('dropped')))
        finally:
            stranger.close()
            station.close()
    return int(failed)


if __name__ == '__main__':
    sys.exit(main(*map(int, sys.argv[1:])))
