"""Messages of one topic as columns: each number of a message becomes an array over all messages.

Two messages have the same shape if they have the same length and the same bytes outside their numbers, such as names.
Their numbers then stand at the same places, which the definition of the type gives for the first message. All messages
of its shape form one array of bytes, and a column is a slice of this array. The messages of the other shapes follow.
"""
from collections.abc import Collection, Iterable, Sequence

import numpy as np

from pedestal_common.graph import layouts
from pedestal_common.quantities import Bools, Bytes, Floats, Ints, Nanoseconds, Stamps, Table
from pedestal_common.wire import cdr
from pedestal_common.wire.cdr import STAMPED_TYPES

MAX_MESSAGE_SHAPES = 100
"""Largest number of shapes of one length that are read as arrays; further messages are read one by one."""

CELL_LIMITS = 4_000_000, 4
"""Limit of the cells of a table, columns times messages: a base, and the bytes of messages that allow one more cell.

This avoids a huge table from a file whose messages each name other columns.
"""

STATUS_TEXTS = ('name', 'hardware_id', 'message')  # fields of a DiagnosticStatus that are texts


class Shape:
    """The bytes of a message outside its numbers, which all messages of one shape share.

    message: CDR bytes; spans: (start, stop) of these bytes, such as cdr.Places.fixed.
    """

    def __init__(self, message: bytes, spans: Iterable[tuple[int, int]]) -> None:
        self.places = np.concatenate([np.arange(start, stop) for start, stop in spans])
        self._bytes = np.frombuffer(message, np.uint8)[self.places]

    def equals(self, taken: Bytes) -> Bools:
        """Return True for each message of the same length with this shape; taken: its bytes at `places`, as a row."""
        return (taken == self._bytes).all(axis=1)


def stamps(data: Sequence[bytes], type_name: str, log: Stamps | Sequence[Nanoseconds]) -> Stamps:
    """Return the stamps in the headers of messages; the log times, if the type or a message has no header."""
    log = np.asarray(log, np.int64)
    if type_name not in STAMPED_TYPES or not len(data) or min(map(len, data)) < 12:
        return log.copy()
    pairs = np.frombuffer(b''.join([message[4:12] for message in data]), '<u4').reshape(-1, 2)
    return pairs[:, 0].astype(np.int32).astype(np.int64) * 1_000_000_000 + pairs[:, 1]


def table(data: Sequence[bytes], type_name: str, log: Stamps | Sequence[Nanoseconds], start: Nanoseconds = 0,
          as_sent: bool = False) -> Table:
    """Return the columns of the CDR messages of one type.

    The column `t` [s] is the stamp of the header minus start; for a type without header, it is the log time minus
    start. The names of the other columns depend on the type:
    JointState     azimuth.position, azimuth.velocity, azimuth.effort, elevation.position, ...
    JointTrajectory  the first point: azimuth.position, azimuth.velocity, azimuth.acceleration, ...
    Vector3Stamped x, y, z
    Odometry       position.x, orientation.w, twist.linear.x, twist.angular.z, ...
    Imu            orientation.w, angular_velocity.x, linear_acceleration.z, orientation_variance.z, ...
    String         data (a list of texts)
    DiagnosticStatus  level, and lists of texts: name, hardware_id, message, values (values_text)
    others         the path of the field
    Covariances and header are omitted; a DiagnosticArray has `t` only. A number that a message does not hold is NaN in
    its row. A number that its message marks as no data (layouts.NO_DATA_MARKS) is NaN too, except with as_sent=True.
    Raises ValueError for bytes that are no message of the type.
    """
    out: Table = {'t': (stamps(data, type_name, log) - start) / 1e9}
    if type_name == 'std_msgs/msg/String':
        out['data'] = [cdr.Places(message, type_name).texts['data'] for message in data]
    elif type_name not in ('diagnostic_msgs/msg/DiagnosticArray', 'rosgraph_msgs/msg/Clock'):
        lengths = np.array([len(message) for message in data], np.int64)
        most = CELL_LIMITS[0] + int(lengths.sum()) // CELL_LIMITS[1]
        for length in np.unique(lengths):
            rows = np.flatnonzero(lengths == length)
            block = np.frombuffer(b''.join([data[row] for row in rows.tolist()]), np.uint8).reshape(rows.size, length)
            _fill(out, block, rows, type_name, len(data), most, as_sent)
    if type_name == 'diagnostic_msgs/msg/DiagnosticStatus':
        texts = [cdr.Places(message, type_name).texts for message in data]
        out.update({name: [of[name] for of in texts] for name in STATUS_TEXTS})
        out['values'] = [values_text((of[path], of[f'{path[:-3]}value']) for path in of if path.endswith('].key'))
                         for of in texts]
    return out


def values_text(pairs: Iterable[tuple[str, str]]) -> str:
    """Return the values of a DiagnosticStatus as one text, 'key=value; key=value'."""
    return '; '.join(f'{key}={value}' for key, value in pairs)


def _fill(out: Table, block: Bytes, rows: Ints, type_name: str, count: int, most: int, as_sent: bool) -> None:
    """Put the numbers of messages of one length into the columns `out`.

    block: their bytes (m, length); rows: their rows in the columns, of which there are `count`; most: largest number
    of cells in `out`.
    """
    shapes = 0
    while rows.size:
        walk = cdr.Places(block[0].tobytes(), type_name)
        shape = Shape(walk.data, walk.fixed)
        shapes += 1
        tried = len(block) if shapes < MAX_MESSAGE_SHAPES else 1
        alike = shape.equals(block[:tried, shape.places])
        same, where = block[:tried][alike], rows[:tried][alike]
        for path, start, dtype in walk.numbers:
            name = layouts.column(type_name, path, walk.texts)
            if name is not None:
                values = _numbers(same, start, dtype)
                if name not in out:
                    if (len(out) + 1) * count > most:
                        raise ValueError(f'more than {len(out)} columns in {count} messages')
                    out[name] = np.full(count, np.nan)
                out[name][where] = values
        for names, marks, absent in () if as_sent else layouts.no_data(type_name, walk.numbers, walk.texts):
            without = where[absent(*[_numbers(same, start, dtype) for start, dtype in marks])]
            for name in names:
                out[name][without] = np.nan
        block, rows = (block[~alike], rows[~alike]) if tried == len(block) else (block[tried:], rows[tried:])


def _numbers(block: Bytes, start: int, dtype: str) -> Floats:
    return np.ascontiguousarray(block[:, start:start + int(dtype[2:])]).view(dtype)[:, 0]


def alike(data: Sequence[bytes], type_name: str, template: bytes, names: Collection[str]) -> Bools:
    """Return True for each message that equals a template outside its stamp and the named columns.

    The padding that DDS adds at the end of a message does not count.
    """
    walk = cdr.Places(template, type_name)
    equal = [(start, start + int(dtype[2:])) for path, start, dtype in walk.numbers
             if not path.startswith(('header.stamp.', 'clock.'))
             and layouts.column(type_name, path, walk.texts) not in names]
    shape, size = Shape(template, walk.fixed + equal), len(template)
    same = np.array([0 <= len(message) - size < cdr.PADDING_LIMIT_BYTES for message in data], bool)
    block = np.frombuffer(b''.join([message[:size] for message, fits in zip(data, same) if fits]), np.uint8)
    same[same] = shape.equals(block.reshape(-1, size)[:, shape.places])
    return same
