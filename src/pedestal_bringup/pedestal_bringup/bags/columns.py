"""Messages of one topic as columns: the numbers of many CDR messages read at once through numpy.

Messages of a topic that differ in their numbers only have them at the same places. The first message is walked by the
type's definition to find these places; all messages alike in everything that is not a number are then one array of
bytes, and a column is a slice of it. What is left over (other names, other lengths) is done again the same way.
"""
import re
import struct

import numpy as np
from rosbags.interfaces import Nodetype

from pedestal_common.messages import TYPESTORE

_SIZES = {'bool': 1, 'byte': 1, 'char': 1, 'int8': 1, 'uint8': 1, 'int16': 2, 'uint16': 2, 'int32': 4, 'uint32': 4,
          'int64': 8, 'uint64': 8, 'float32': 4, 'float64': 8}
_DTYPES = {'bool': 'u1', 'byte': 'u1', 'char': 'u1', **{name: f'{name[0]}{size}' for name, size in _SIZES.items()
                                                       if name[0] in 'iuf'}}

STAMPED = {'rosgraph_msgs/msg/Clock'}
STAMPED.update(name for name, (_, fields) in TYPESTORE.fielddefs.items()
               if fields and fields[0] == ('header', (Nodetype.NAME, 'std_msgs/msg/Header')))
"""Types whose bytes 4 to 12 are their stamp."""


ORIENTATION_VARIANCE = {f'orientation_covariance[{4 * i}]': f'orientation_variance.{axis}'
                        for i, axis in enumerate('xyz')}
"""Of an Imu: the diagonal, which says how well an INS knows its attitude."""


class _Walk:
    """The places of one message: numbers [(path, start, dtype)], texts {path: text}, fixed [(start, stop)]."""

    def __init__(self, data, type_name):
        if len(data) < 4:
            raise ValueError(f'{len(data)} bytes are no {type_name}')
        self.data = data
        self.order = '<' if data[1] & 1 else '>'
        self.at = 4
        self.numbers, self.texts, self.fixed = [], {}, [(0, 4)]
        try:
            self._fields(type_name, '')
        except (struct.error, KeyError, UnicodeDecodeError) as error:
            raise ValueError(f'{len(data)} bytes are no {type_name}: {error}') from None

    def _fields(self, type_name, prefix):
        for name, node in TYPESTORE.fielddefs[type_name][1]:
            self._node(node, prefix + name)

    def _align(self, size):
        self.at += -(self.at - 4) % size

    def _length(self):
        self._align(4)
        self.fixed.append((self.at, self.at + 4))
        self.at += 4
        return struct.unpack_from(self.order + 'I', self.data, self.at - 4)[0]

    def _node(self, node, path):
        kind, what = node
        if kind == Nodetype.NAME:
            self._fields(what, path + '.')
        elif kind == Nodetype.BASE and what[0] in ('string', 'wstring'):
            size = self._length()
            if self.at + size > len(self.data):
                raise struct.error(f'{path} is cut off')
            self.fixed.append((self.at, self.at + size))
            self.texts[path] = bytes(self.data[self.at:self.at + size]).rstrip(b'\0').decode()
            self.at += size
        elif kind == Nodetype.BASE:
            size = _SIZES[what[0]]
            self._align(size)
            if self.at + size > len(self.data):
                raise struct.error(f'{path} is missing')
            self.numbers.append((path, self.at, self.order + _DTYPES[what[0]]))
            self.at += size
        else:
            count = what[1] if kind == Nodetype.ARRAY else self._length()
            for i in range(count):
                self._node(what[0], f'{path}[{i}]')


def stamps(data, type_name, log):
    """Header stamps [ns] (n,) of messages; the log times where the type has none or a message is too short."""
    log = np.asarray(log, np.int64)
    if type_name not in STAMPED or not len(data) or min(map(len, data)) < 12:
        return log.copy()
    pairs = np.frombuffer(b''.join([message[4:12] for message in data]), '<u4').reshape(-1, 2)
    return pairs[:, 0].astype(np.int32).astype(np.int64) * 1_000_000_000 + pairs[:, 1]


def table(data, type_name, log):
    """The columns of CDR messages of one type, log times [ns] given.

    `t` [s] is the header stamp, or the log time of a type without one. Then one float array per number:
    JointState     azimuth.position, azimuth.velocity, azimuth.effort, elevation.position, ...
    JointTrajectory  the first point: azimuth.position, azimuth.velocity, azimuth.acceleration, ...
    Vector3Stamped x, y, z
    Odometry       position.x, orientation.w, twist.linear.x, twist.angular.z, ...
    Imu            orientation.w, angular_velocity.x, linear_acceleration.z, orientation_variance.z, ...
    String         data (a list of texts)
    others         the path of the field. Covariances and header are left out; a DiagnosticArray has `t` only.
    A number that a message lacks is NaN in its row. Raises ValueError when bytes are no such message.
    """
    out = {'t': stamps(data, type_name, log) / 1e9}
    if type_name == 'std_msgs/msg/String':
        out['data'] = [_Walk(message, type_name).texts['data'] for message in data]
    elif type_name not in ('diagnostic_msgs/msg/DiagnosticArray', 'rosgraph_msgs/msg/Clock'):
        lengths = np.array([len(message) for message in data], np.int64)
        for length in np.unique(lengths):
            rows = np.flatnonzero(lengths == length)
            block = np.frombuffer(b''.join([data[row] for row in rows]), np.uint8).reshape(rows.size, length)
            _fill(out, block, rows, type_name, len(data))
    return out


def _fill(out, block, rows, type_name, count):
    """Put the numbers of messages of one length (m, length) into rows of the columns."""
    while rows.size:
        walk = _Walk(block[0].tobytes(), type_name)
        fixed = np.concatenate([np.arange(start, stop) for start, stop in walk.fixed])
        alike = (block[:, fixed] == block[0, fixed]).all(axis=1)
        same = block[alike]
        for path, start, dtype in walk.numbers:
            name = column(type_name, path, walk.texts)
            if name is not None:
                size = int(dtype[2:])
                values = np.ascontiguousarray(same[:, start:start + size]).view(dtype)[:, 0]
                if name not in out:
                    out[name] = np.full(count, np.nan)
                out[name][rows[alike]] = values
        block, rows = block[~alike], rows[~alike]


def column(type_name, path, texts):
    """The column of a number at a path, None for one that is left out. texts: {path: text} of the message."""
    if path in ORIENTATION_VARIANCE:
        return ORIENTATION_VARIANCE[path]
    if path.startswith('header.') or 'covariance' in path:
        return None
    short = type_name.rpartition('/')[2]
    if short == 'JointState':
        field, index = re.fullmatch(r'(\w+)\[(\d+)\]', path).groups()
        return f'{texts.get(f"name[{index}]", index)}.{field}'
    if short == 'JointTrajectory':
        match = re.fullmatch(r'points\[0\]\.(position|velocit|acceleration|effort)(?:s|ies)?\[(\d+)\]', path)
        if match is None:
            return None
        field = 'velocity' if match[1] == 'velocit' else match[1]
        return f'{texts.get(f"joint_names[{match[2]}]", match[2])}.{field}'
    if short == 'Vector3Stamped':
        return path.removeprefix('vector.')
    if short == 'Odometry':
        return path.replace('pose.pose.', '').replace('twist.twist.', 'twist.')
    return path


def alike(data, type_name, template, names):
    """Which of the messages (n,) equal a template (CDR bytes) in all but the stamp and the columns of these names; the
    padding that DDS adds at their end does not count."""
    walk = _Walk(template, type_name)
    fixed = [np.arange(start, stop) for start, stop in walk.fixed]
    for path, start, dtype in walk.numbers:
        if not path.startswith(('header.stamp.', 'clock.')) and column(type_name, path, walk.texts) not in names:
            fixed.append(np.arange(start, start + int(dtype[2:])))
    fixed = np.concatenate(fixed)
    wanted = np.frombuffer(template, np.uint8)[fixed]
    size = len(template)
    same = np.array([0 <= len(message) - size < 4 for message in data], bool)
    block = np.frombuffer(b''.join([message[:size] for message, fits in zip(data, same) if fits]), np.uint8)
    same[same] = (block.reshape(-1, size)[:, fixed] == wanted).all(axis=1)
    return same
