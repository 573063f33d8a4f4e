"""The numbers of a message as a record, for one message in a node and for the many of a bag.

A node takes the messages it hears into a record of records, its compiled step answers it with another, and that is put
into the messages it says; a recomputation fills the same records from the columns of a bag. So what a node makes of
its messages exists once.

HEARD, SAID = of('joint_states', 'ship/truth'), of('acu/rate_command')
    one field per topic: stamp [ns], then the numbers; a message that did not come, or is not to be sent, has stamp NEVER
"""
import numpy as np

from pedestal_common import messages, topics

NEVER = -2**63


def _type(*fields):
    return np.dtype([('stamp', 'i8'), *((name, 'f8', (size,)) for name, size in fields)], align=True)


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
    'Vector3Stamped': (_type(('vector', 3)), ('x', 'y', 'z')),
    'Odometry': _spatial(('position', 3), ('orientation', 4), ('twist_linear', 3), ('twist_angular', 3)),
    'Imu': _spatial(('orientation', 4), ('angular_velocity', 3), ('linear_acceleration', 3)),
}
_MOTORS = _joints(messages.MOTORS)
_AXES = list(messages.AXES)


def _kind(topic):
    return _MOTORS if topic == 'adu/motor_states' else _KINDS[topics.BY_NAME[topic].type.rpartition('/')[2]]


def of(*names) -> np.dtype:
    """The record of these topics."""
    return np.dtype([(name, _kind(name)[0]) for name in names], align=True)


def columns(topic) -> tuple:
    """What the numbers of a topic's record are called, in its order; the names of a bag's columns."""
    return _kind(topic)[1]


def numbers(record, topic) -> np.ndarray:
    """The numbers of a topic's records (n,) without the stamp, as (n, len(columns(topic)))."""
    return np.column_stack([record[name] for name in _kind(topic)[0].names[1:]]) if columns(topic) else \
        np.zeros((len(record), 0))


def put_numbers(record, topic, values):
    """Write numbers (n, len(columns(topic))) into a topic's records (n,)."""
    at = 0
    for name in _kind(topic)[0].names[1:]:
        size = record[name].shape[1]
        record[name] = values[:, at:at + size]
        at += size


def take(record, message):
    """Take the numbers of a message into a record (np.void); None leaves them as they are and says NEVER."""
    if message is None:
        record['stamp'] = NEVER
    else:
        record['stamp'] = messages.nanoseconds(message.header.stamp)
        _TAKE[type(message)](record, message)


def _take_joints(record, message):
    names = message.name
    for field, values in (('position', message.position), ('velocity', message.velocity), ('effort', message.effort)):
        # The usual case costs a tenth of looking for each name.
        usual = names == _AXES and len(values) == len(_AXES)
        record[field] = values if usual else messages.by_name(names, values, messages.AXES)


def _take_vector(record, message):
    v = message.vector
    record['vector'] = v.x, v.y, v.z


def _take_odometry(record, message):
    pose, twist = message.pose.pose, message.twist.twist
    p, q, v, w = pose.position, pose.orientation, twist.linear, twist.angular
    record['position'], record['orientation'] = (p.x, p.y, p.z), (q.x, q.y, q.z, q.w)
    record['twist_linear'], record['twist_angular'] = (v.x, v.y, v.z), (w.x, w.y, w.z)


def _take_imu(record, message):
    q, w, f = message.orientation, message.angular_velocity, message.linear_acceleration
    record['orientation'] = q.x, q.y, q.z, q.w
    record['angular_velocity'], record['linear_acceleration'] = (w.x, w.y, w.z), (f.x, f.y, f.z)


def put(message, record):
    """Put a record (np.void) into a message of its topic."""
    messages.put_stamp(message.header.stamp, int(record['stamp']))
    _PUT[type(message)](message, record)


def _put_joints(message, record):
    message.position[:], message.velocity[:], message.effort[:] = (
        record['position'], record['velocity'], record['effort'])


def _put_trajectory(message, record):
    point = message.points[0]
    point.positions[:], point.velocities[:], point.accelerations[:] = (
        record['position'], record['velocity'], record['acceleration'])


def _put_xyz(target, values):
    target.x, target.y, target.z = values.tolist()


def _put_xyzw(target, values):
    target.x, target.y, target.z, target.w = values.tolist()


def _put_vector(message, record):
    _put_xyz(message.vector, record['vector'])


def _put_odometry(message, record):
    pose, twist = message.pose.pose, message.twist.twist
    _put_xyz(pose.position, record['position'])
    _put_xyzw(pose.orientation, record['orientation'])
    _put_xyz(twist.linear, record['twist_linear'])
    _put_xyz(twist.angular, record['twist_angular'])


def _put_imu(message, record):
    _put_xyzw(message.orientation, record['orientation'])
    _put_xyz(message.angular_velocity, record['angular_velocity'])
    _put_xyz(message.linear_acceleration, record['linear_acceleration'])


_TAKE = {messages.JointState: _take_joints, messages.Vector3Stamped: _take_vector,
         messages.Odometry: _take_odometry, messages.Imu: _take_imu}
_PUT = {messages.JointState: _put_joints, messages.JointTrajectory: _put_trajectory,
        messages.Vector3Stamped: _put_vector, messages.Odometry: _put_odometry, messages.Imu: _put_imu}
