"""Records of messages: encoded and decoded by their places, against rosbags, which builds them from their types."""
import math
import operator

import numpy as np
import pytest

from pedestal_common.graph import layouts, topics
from pedestal_common.wire import messages, records

STAMPED = [topic.name for topic in topics.TOPICS if topic.rate == 'step']
STAMP = 3_000_000_007


def numbers_of(message, topic):
    """The numbers of a message by the attributes of its fields."""
    numbers = []
    for field in layouts.fields(topic):
        path = field.path.replace('\\', '').split('(')[0].rstrip('.[').replace('[0]', '')
        head, _, rest = path.partition('points')
        holder = operator.attrgetter(rest.lstrip('.'))(message.points[0]) if rest else (
            operator.attrgetter(head)(message) if head else message)
        for part in field.components or range(len(topics.TOPIC_BY_NAME[topic].names)):
            numbers.append(float(holder[int(part)] if isinstance(holder, np.ndarray) else getattr(holder, part)))
    return numbers


def filled(topic):
    """(record (1,), numbers) of a message of a topic."""
    record = records.empty(records.of('clock', topic) if topic != 'clock' else records.of(topic), 1)
    numbers = np.random.default_rng(1).normal(size=len(layouts.columns(topic))).astype(np.float32)
    record[topic]['stamp'] = STAMP
    records.numbers(record, topic)[:] = numbers
    return record, numbers.tolist()


@pytest.mark.parametrize('topic', STAMPED)
def test_an_encoded_message_is_what_rosbags_makes_of_it(topic):
    record, numbers = filled(topic)
    data = records.Encoder(topic, messages.template(topic), record).encoded()
    message = messages.deserialize(data, topics.TOPIC_BY_NAME[topic].type)
    assert messages.serialize(message) == data
    assert messages.nanoseconds(message.clock if topic == 'clock' else message.header.stamp) == STAMP
    assert numbers_of(message, topic) == numbers


@pytest.mark.parametrize('topic', STAMPED)
@pytest.mark.parametrize('padding', [b'', b'\0\0'])
def test_what_was_encoded_is_decoded(topic, padding):
    record, numbers = filled(topic)
    data = records.Encoder(topic, messages.template(topic), record).encoded()
    other = records.empty(record.dtype, 1)
    decoder = records.Decoder(topic, other)
    assert (other[topic]['stamp'] == records.NO_STAMP).all()
    stamp, values = decoder.decoded(data + padding)
    assert (stamp, list(values)) == (STAMP, numbers)
    decoder.put(stamp, values)
    assert other[topic] == record[topic]
    decoder.put(records.NO_STAMP, None)
    assert other[topic]['stamp'] == records.NO_STAMP and records.numbers(other, topic)[0].tolist() == numbers


def test_joints_are_taken_by_name_whatever_came_before():
    decoder = records.Decoder('joint_states', records.empty(records.of('joint_states'), 1))
    message = messages.template('joint_states')
    message.name, message.position = ['pump', 'elevation', 'azimuth'], np.array((7.0, 2.0, 1.0))
    message.velocity, message.effort = np.array((0.5, 4.0)), np.zeros(0)
    for _ in range(2):
        np.testing.assert_array_equal(decoder.decoded(messages.serialize(message))[1],
                                      [1.0, 2.0, math.nan, 4.0, math.nan, math.nan])
        plain = decoder.decoded(messages.serialize(messages.template('joint_states')))
        assert plain == (0, (0.0,) * 6)


def test_a_point_that_is_not_there_holds_no_number():
    message = messages.template('acu/reference')
    message.points = []
    decoder = records.Decoder('acu/reference', records.empty(records.of('acu/reference'), 1))
    assert np.isnan(decoder.decoded(messages.serialize(message))[1]).all()


@pytest.mark.parametrize('field, width', [('orientation', 4), ('angular_velocity', 3), ('linear_acceleration', 3)])
def test_a_covariance_that_begins_with_minus_one_is_no_data(field, width):
    """sensor_msgs/Imu and REP 145: only this field has no number, and the next message has all of them again."""
    columns = [column.field for column in layouts.columns('ship/imu/data')]
    decoder = records.Decoder('ship/imu/data', records.empty(records.of('ship/imu/data'), 1))
    for variance, absent in ((-1.0, width), (0.0, 0), (1e-6, 0)):
        message = messages.template('ship/imu/data')
        getattr(message, f'{field}_covariance')[0] = variance
        _, values = decoder.decoded(messages.serialize(message))
        assert [name for name, value in zip(columns, values) if math.isnan(value)] == [field] * absent


@pytest.mark.parametrize('distance, least, largest, known', [
    (5e3, 0.0, math.inf, True), (5e3, 0.0, 0.0, True), (5e3, 0.0, 4e3, False), (5.0, 10.0, 4e3, False),
    (math.inf, 0.0, math.inf, False), (-math.inf, 0.0, 0.0, False), (math.nan, 0.0, 4e3, False)])
def test_a_range_outside_its_limits_is_no_data(distance, least, largest, known):
    """sensor_msgs/Range and REP 117; limits that are both zero were left out by the publisher."""
    message = messages.template('tracking_receiver/range')
    message.range, message.min_range, message.max_range = distance, least, largest
    decoder = records.Decoder('tracking_receiver/range', records.empty(records.of('tracking_receiver/range'), 1))
    value = decoder.decoded(messages.serialize(message))[1][0]
    assert value == distance if known else math.isnan(value)


@pytest.mark.parametrize('data, reason', [(b'', '0 bytes are no sensor_msgs/msg/JointState'),
                                          (b'\0\1\0\0' + b'\xff' * 20, 'are no sensor_msgs/msg/JointState')])
def test_broken_bytes_are_named(data, reason):
    with pytest.raises(ValueError, match=reason):
        records.Decoder('joint_states', records.empty(records.of('joint_states'), 1)).decoded(data)


def test_a_stamp_that_is_none_is_refused():
    message = messages.template('joint_states')
    message.header.stamp.sec = -1
    decoder = records.Decoder('joint_states', records.empty(records.of('joint_states'), 1))
    with pytest.raises(ValueError, match='joint_states: -1 s 0 ns is no stamp'):
        decoder.decoded(messages.serialize(message))


def test_a_text_has_the_code_of_its_row():
    assert [records.code_of('ins/state', text) for text in ('aligning', 'aligned', 'lost')] == [0, 1, 2]
    assert records.empty(records.of('ins/state'), 1)['ins/state'] == topics.NO_TEXT_CODE
