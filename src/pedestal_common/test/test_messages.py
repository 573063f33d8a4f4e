"""Messages: zero padding, round trip, clear errors."""
import pytest

from pedestal_common.wire import messages


def test_padding_is_zero_whatever_came_before():
    """CDR of a string of 2 bytes and one of 7, then a number: everything between is zero."""
    status = messages.DiagnosticStatus(level=1, name='x', message='yyyyyyy', hardware_id='',
                                       values=[messages.KeyValue(key='k', value='v')])
    data = messages.serialize(status)
    again = messages.serialize(messages.deserialize(data, status.__msgtype__))
    assert data == again
    assert data[4:16] == b'\x01\0\0\0' b'\x02\0\0\0' b'x\0\0\0'


def test_round_trip():
    joints = messages.template('joint_states')
    joints.position[:] = 1.0, -2.0
    messages.put_stamp(joints.header.stamp, 12_345_678_901)
    back = messages.deserialize(messages.serialize(joints), joints.__msgtype__)
    assert messages.nanoseconds(back.header.stamp) == 12_345_678_901
    assert (back.name, list(back.position)) == (['azimuth', 'elevation'], [1.0, -2.0])


def test_broken_bytes_are_named():
    with pytest.raises(ValueError, match='3 bytes are no sensor_msgs/msg/JointState'):
        messages.deserialize(b'\0\1\0', 'sensor_msgs/msg/JointState')
