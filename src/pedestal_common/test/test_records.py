import math

import numpy as np
import pytest

from pedestal_common import messages, records

TOPICS = ('joint_states', 'adu/motor_states', 'acu/estimate', 'acu/filter', 'tracking_receiver/angle_error',
          'tracking_receiver/range', 'ship/truth', 'ship/imu/data')


def made(topic):
    return {'joint_states': lambda: messages.joint_state(messages.AXES),
            'adu/motor_states': lambda: messages.joint_state(messages.MOTORS),
            'acu/estimate': lambda: messages.joint_trajectory('earth', [messages.trajectory_point()]),
            'acu/filter': lambda: messages.named_numbers(messages.FILTER),
            'tracking_receiver/angle_error': lambda: messages.vector3_stamped('beam'),
            'tracking_receiver/range': lambda: messages.range_message('beam', 0.0175),
            'ship/truth': lambda: messages.odometry('earth', 'base_link'),
            'ship/imu/data': lambda: messages.imu('base_link')}[topic]()


@pytest.mark.parametrize('topic', TOPICS)
def test_what_is_put_into_a_message_has_the_names_of_a_bags_columns(topic):
    """Through the bytes of the message and the definition of its type: another route than `take`."""
    columns = pytest.importorskip('pedestal_bringup.bags.columns')
    record = np.zeros(1, records.of('clock', topic))
    place = records.only(record, topic)
    place.stamp[0] = 3_000_000_007
    place.numbers[:] = np.random.default_rng(1).normal(size=len(records.columns(topic))).astype(np.float32)
    message = made(topic)
    records.put(message, place)
    table = columns.table([messages.serialize(message)], message.__msgtype__, np.zeros(1))
    assert table['t'][0] == 3.000000007
    assert [table[name][0] for name in records.columns(topic)] == place.numbers.tolist()


@pytest.mark.parametrize('topic', ['joint_states', 'tracking_receiver/angle_error', 'tracking_receiver/range',
                                   'ship/truth', 'ship/imu/data'])
def test_what_was_put_is_taken(topic):
    record = np.zeros(2, records.of(topic))
    first, second = records.only(record[:1], topic), records.only(record[1:], topic)
    first.stamp[0] = 5_000_000
    first.numbers[:] = np.arange(1.0, 1.0 + first.numbers.size)
    message = made(topic)
    records.put(message, first)
    records.take(second, message)
    assert record[0] == record[1]
    records.take(second, None)
    assert second.stamp[0] == records.NEVER
    assert second.numbers.tolist() == first.numbers.tolist()


def test_joints_are_taken_by_name():
    record = np.zeros(1, records.of('joint_states'))
    place = records.only(record, 'joint_states')
    message = messages.joint_state(('pump', 'elevation', 'azimuth'))
    message.position[:], message.velocity = (7.0, 2.0, 1.0), np.array((0.5, 4.0))
    records.take(place, message)
    np.testing.assert_array_equal(place.numbers[:4], [1.0, 2.0, math.nan, 4.0])
