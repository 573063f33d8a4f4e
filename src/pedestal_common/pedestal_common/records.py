"""The numbers of a message as a record, for one message in a node and for the many of a bag.

A node takes the messages it hears into a record of records, its compiled step answers it with another, and that is put
into the messages it says; a recomputation fills the same records from the columns of a bag. So what a node makes of
its messages exists once.

HEARD, SAID = of('joint_states', 'ship/truth'), of('acu/rate_command')
    one field per topic: stamp [ns], then the numbers; one that did not come, or is not to be sent, has stamp NEVER
"""
import math
import typing

import numpy as np

from pedestal_common import messages, topics

NEVER = -2**63
_AXES = list(messages.AXES)


def _type(*fields):
    return np.dtype([('stamp', 'i8'), *((name, 'f8', (size,)) for name, size in fields)])


def _joints(names):
    fields = ('position', 'velocity', 'effort')
    return (_type(*((field, len(names)) for field in fields)),
            tuple(f'{name}.{field}' for field in fields for name in names))


def _spatial(*fields):
    return _type(*fields), tuple(f'{name.replace("twist_", "twist.")}.{letter}' for name, size in fields
                                 for letter in 'xyzw'[:size])


_KINDS = {
    'Clock': (_type(), ()),
    'JointState': _joints(messages.AXES),
    'JointTrajectory': (_type(('position', 2), ('velocity', 2), ('acceleration', 2)),
                        tuple(f'{name}.{field}' for field in ('position', 'velocity', 'acceleration')
                              for name in messages.AXES)),
    'Range': (_type(('range', 1), ('variance', 1)), ('range', 'variance')),
    'Vector3Stamped': (_type(('vector', 3)), ('x', 'y', 'z')),
    'Odometry': _spatial(('position', 3), ('orientation', 4), ('twist_linear', 3), ('twist_angular', 3)),
    'Imu': _spatial(('orientation', 4), ('angular_velocity', 3), ('linear_acceleration', 3),
                    ('orientation_variance', 3)),
}
_NAMED = {'adu/motor_states': _joints(messages.MOTORS),
          'acu/filter': (_type(('position', len(messages.FILTER))),
                         tuple(f'{name}.position' for name in messages.FILTER))}


def _kind(topic):
    return _NAMED[topic] if topic in _NAMED else _KINDS[topics.BY_NAME[topic].type.rpartition('/')[2]]


def of(*names, more=()) -> np.dtype:
    """The record of these topics, `more` whole numbers behind them."""
    return np.dtype([*((name, _kind(name)[0]) for name in names), *((name, 'i8') for name in more)])


def columns(topic) -> tuple:
    """What the numbers of a topic's record are called, in its order; the names of a bag's columns."""
    return _kind(topic)[1]


class Slot(typing.NamedTuple):
    """Where the numbers of a topic are in a record: views of its stamps (n,) [ns] and numbers (n, columns)."""
    stamp: np.ndarray
    numbers: np.ndarray


def slot(record, topic) -> Slot:
    """The Slot of a topic in records (n,)."""
    start = record.dtype.fields[topic][1] // 8
    return Slot(record[topic]['stamp'],
                record.view('f8').reshape(len(record), -1)[:, start + 1:start + 1 + len(columns(topic))])


def only(record, topic) -> Slot:
    """The Slot of a topic in one record (1,), as `take` and `put` want it: stamp (1,), numbers (columns,)."""
    stamp, numbers = slot(record, topic)
    return Slot(stamp, numbers[0])


def take(place, message):
    """Take the numbers of a message into its Slot; None leaves them as they are and says NEVER."""
    if message is None:
        place.stamp[0] = NEVER
    else:
        place.stamp[0] = messages.nanoseconds(message.header.stamp)
        place.numbers[:] = _TAKE[type(message)](message)


def _of_axes(names, fields):
    """The numbers of both axes of three fields; NaN for a name or a number that is not there."""
    # The usual case costs a tenth of looking for each name.
    if names == _AXES and len(fields[0]) == len(fields[1]) == len(fields[2]) == len(_AXES):
        return [value for values in fields for value in values.tolist()]
    return [value for values in fields for value in messages.by_name(names, values, messages.AXES)]


def _joint_numbers(message):
    return _of_axes(message.name, (message.position, message.velocity, message.effort))


def _point_numbers(message):
    if not message.points:
        return math.nan
    point = message.points[0]
    return _of_axes(message.joint_names, (point.positions, point.velocities, point.accelerations))


def _vector_numbers(message):
    v = message.vector
    return v.x, v.y, v.z


def _range_numbers(message):
    return message.range, message.variance


def _odometry_numbers(message):
    pose, twist = message.pose.pose, message.twist.twist
    p, q, v, w = pose.position, pose.orientation, twist.linear, twist.angular
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z, w.x, w.y, w.z


def _imu_numbers(message):
    q, w, f = message.orientation, message.angular_velocity, message.linear_acceleration
    return (q.x, q.y, q.z, q.w, w.x, w.y, w.z, f.x, f.y, f.z, *message.orientation_covariance[::4].tolist())


def put(message, place):
    """Put the numbers of a Slot into its message."""
    if type(message) is messages.Clock:
        messages.put_stamp(message.clock, place.stamp.item())
    else:
        messages.put_stamp(message.header.stamp, place.stamp.item())
        _PUT[type(message)](message, place.numbers)


def _put_joints(message, numbers):
    n = len(message.name)
    message.position[:], message.velocity[:], message.effort[:] = numbers[:n], numbers[n:2 * n], numbers[2 * n:]


def _put_trajectory(message, numbers):
    point = message.points[0]
    point.positions[:], point.velocities[:], point.accelerations[:] = numbers[:2], numbers[2:4], numbers[4:]


def _put_vector(message, numbers):
    v = message.vector
    v.x, v.y, v.z = numbers.tolist()


def _put_range(message, numbers):
    message.range, message.variance = numbers.tolist()


def _put_odometry(message, numbers):
    pose, twist = message.pose.pose, message.twist.twist
    p, q, v, w = pose.position, pose.orientation, twist.linear, twist.angular
    p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z, w.x, w.y, w.z = numbers.tolist()


def _put_imu(message, numbers):
    q, w, f = message.orientation, message.angular_velocity, message.linear_acceleration
    q.x, q.y, q.z, q.w, w.x, w.y, w.z, f.x, f.y, f.z = numbers[:10].tolist()
    message.orientation_covariance[::4] = numbers[10:]


_TAKE = {messages.JointState: _joint_numbers, messages.JointTrajectory: _point_numbers,
         messages.Vector3Stamped: _vector_numbers, messages.Range: _range_numbers,
         messages.Odometry: _odometry_numbers, messages.Imu: _imu_numbers}
_PUT = {messages.JointState: _put_joints, messages.JointTrajectory: _put_trajectory,
        messages.Vector3Stamped: _put_vector, messages.Range: _put_range, messages.Odometry: _put_odometry,
        messages.Imu: _put_imu}
