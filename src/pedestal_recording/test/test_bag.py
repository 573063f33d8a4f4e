import hashlib
import math
import os
import pathlib
import threading

import numpy as np
import pytest
import yaml
from mcap.reader import NonSeekingReader, make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from pedestal_common.graph import nodes, topics
from pedestal_common.wire import commands, messages
from pedestal_recording import bag, columns
from pedestal_recording.bag import load
from pedestal_recording.verify import verify
from pedestal_recording.writer import Writer

T = 5_000_000
METADATA = {'scenario': 'test', 'pacing': 'lockstep', 'seed': 7}
NODES = ('ship_motion', 'ins', 'tracking_receiver', 'acu', 'adu', 'recorder', 'operator')
RECORDED = [topic for topic in nodes.recorded(NODES) if topic.rate not in topics.REALTIME_RATES]
NAMES = [topic.name for topic in RECORDED]


def made(name, k, rng):
    """A message of a topic with random numbers and the stamp of step k."""
    topic = topics.TOPIC_BY_NAME[name]
    kind = topic.type.rpartition('/')[2]
    if kind == 'Clock':
        message = messages.Clock(clock=messages.Time(sec=0, nanosec=0))
        messages.put_stamp(message.clock, k * T)
        return message
    if kind == 'String':
        return messages.String(data='autotrack' if k else 'standby')
    if kind == 'DiagnosticStatus':
        return commands.reply_message(commands.Command('stop', 'test', str(k)), commands.Reply(True, 'mode is stop'))
    if kind == 'DiagnosticArray':
        return diagnostics('acu', k)
    if kind == 'JointState':
        message = messages.template(name)
        for values in (message.position, message.velocity, message.effort):
            values[:] = rng.normal(size=values.size)
    elif kind == 'JointTrajectory':
        message = messages.template(name)
        [point] = message.points
        for values in (point.positions, point.velocities, point.accelerations):
            values[:] = rng.normal(size=values.size)
    elif kind == 'Odometry':
        message = messages.template(name)
        for part in (message.pose.pose.position, message.pose.pose.orientation, message.twist.twist.linear,
                     message.twist.twist.angular):
            for field in ('x', 'y', 'z'):
                setattr(part, field, float(rng.normal()))
    elif kind == 'Imu':
        message = messages.template(name)
        for part in (message.orientation, message.angular_velocity, message.linear_acceleration):
            part.x, part.y, part.z = map(float, rng.normal(size=3))
        message.orientation_covariance[[0, 4, 8]] = abs(rng.normal(size=3))
    elif kind == 'Vector3Stamped':
        message = messages.Vector3Stamped(header=messages.header('beam'),
                                          vector=messages.vector3(math.nan, float(rng.normal()), 45.0))
    else:
        raise AssertionError(kind)
    messages.put_stamp(message.header.stamp, k * T)
    return message


def diagnostics(node, k):
    array = messages.DiagnosticArray(header=messages.header(''), status=[messages.DiagnosticStatus(
        level=0, name=node, message='well', hardware_id='pedestal', values=[])])
    messages.put_stamp(array.header.stamp, k * T)
    return array


def run(steps=450, latency=4):
    """[(topic, stamp, message)] of a lockstep run in canonical order; angle_error comes `latency` steps late."""
    rng = np.random.default_rng(1)
    rows = []
    for k in range(steps):
        for topic in RECORDED:
            name = topic.name
            if topic.rate == 'second' and k % 200 == 0:
                rows += [(name, k * T, diagnostics(node, k)) for node in topic.writers]
            elif topic.rate == 'step' and not (name == 'tracking_receiver/angle_error' and k >= steps - latency) \
                    or topic.rate == 'once' and k == 0 or topic.rate in topics.EVENT_RATES and k in (0, 100):
                rows.append((name, k * T, made(name, k, rng)))
    return rows


@pytest.fixture(scope='module')
def rows():
    return [(name, stamp, messages.serialize(message)) for name, stamp, message in run()]


def write(directory, rows, metadata=METADATA):
    writer = Writer(directory, RECORDED, metadata)
    for name, stamp, data in rows:
        writer.write(NAMES.index(name), stamp, stamp, data)
    writer.close()
    return directory


@pytest.fixture(scope='module')
def recording(rows, tmp_path_factory):
    return write(tmp_path_factory.mktemp('bags') / 'whole', rows)


def counts(rows):
    return {name: sum(row[0] == name for row in rows) for name in NAMES}


def same(ours, theirs):
    """Every leaf of our message equals that of another library's."""
    for field in ours.__dataclass_fields__:
        if field == '__msgtype__' or field.isupper():
            continue
        a, b = getattr(ours, field), getattr(theirs, field)
        if hasattr(a, '__dataclass_fields__'):
            same(a, b)
        elif isinstance(a, list) and a and hasattr(a[0], '__dataclass_fields__'):
            assert len(a) == len(b)
            for one, other in zip(a, b):
                same(one, other)
        elif isinstance(a, (str, list)):
            assert list(a) == list(b)
        else:
            np.testing.assert_array_equal(np.asarray(a, float), np.asarray(b, float))


def test_rosbags_reads_what_was_written(recording, rows):
    with AnyReader([recording]) as reader:
        assert {c.topic.lstrip('/'): c.msgcount for c in reader.connections} == counts(rows)
        assert reader.message_count == len(rows)
        assert {c.topic: c.msgtype for c in reader.connections} == {'/' + t.name: t.type for t in RECORDED}
        got = [(c.topic.lstrip('/'), stamp, bytes(data)) for c, stamp, data in reader.messages()]
        assert sorted(got) == sorted(rows)
        for connection, _, data in list(reader.messages())[:200]:
            same(messages.deserialize(data, connection.msgtype), reader.deserialize(data, connection.msgtype))
        qos = next(c for c in reader.connections if c.topic == '/acu/mode').ext.offered_qos_profiles[0]
        assert qos.durability.name == 'TRANSIENT_LOCAL' and qos.depth == 1


def test_mcap_and_mcap_ros2_support_read_what_was_written(recording, rows):
    with open(recording / 'whole_0.mcap', 'rb') as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == 'ros2'
        summary = reader.get_summary()
        assert summary.statistics.message_count == len(rows)
        assert summary.statistics.message_end_time == rows[-1][1]
        assert len(summary.chunk_indexes) == summary.statistics.chunk_count == 3
        [record] = reader.iter_metadata()
        assert record.name == 'pedestal' and record.metadata == {k: str(v) for k, v in METADATA.items()}
        decoded = list(reader.iter_decoded_messages(log_time_order=False))
    assert [(d.channel.topic.lstrip('/'), d.message.log_time, d.message.data) for d in decoded] == rows
    for row in decoded[:600]:
        same(messages.deserialize(row.message.data, row.schema.name), row.decoded_message)
    for name in NAMES:
        numbers = [d.message.sequence for d in decoded if d.channel.topic == '/' + name]
        assert numbers == list(range(1, len(numbers) + 1))


def test_configuration_comes_back_and_is_indexed(tmp_path):
    more = {'scenario': {'yaml': 'scenario: {}\n'}, 'parameters': {'acu': yaml.safe_dump({'a.b': 1e-7, 'c': '12:30'})}}
    writer = Writer(tmp_path / 'b', RECORDED, METADATA, more)
    writer.close()
    content = bag.read(tmp_path / 'b')
    assert content.metadata == {key: str(value) for key, value in METADATA.items()}
    assert content.configuration == {'scenario': 'scenario: {}\n', 'parameters': {'acu': {'a.b': 1e-7, 'c': '12:30'}}}
    with open(content.file, 'rb') as stream:
        reader = make_reader(stream)
        assert {record.name: record.metadata for record in reader.iter_metadata()} == {
            'pedestal': content.metadata, **more}
        assert reader.get_summary().statistics.metadata_count == 3


def test_a_bag_that_does_not_say_how_it_was_made_is_no_gap(recording):
    content = bag.read(recording)
    assert content.configuration == {'scenario': '', 'parameters': {}}
    report = verify(load(recording))
    assert report.complete and report.made == 'made by: a graph started by hand, lockstep, git unknown'
    assert report.made in report.lines()


def test_file_without_its_summary_reads_from_the_front(recording, rows):
    with open(recording / 'whole_0.mcap', 'rb') as stream:
        assert len(list(NonSeekingReader(stream).iter_messages(log_time_order=False))) == len(rows)


def test_message_index_finds_one_topic_in_a_span(recording):
    with open(recording / 'whole_0.mcap', 'rb') as stream:
        found = list(make_reader(stream).iter_messages('/acu/estimate', starting_at=300 * T, ending_before=310 * T))
    assert [message.log_time for _, _, message in found] == [k * T for k in range(300, 310)]


def test_metadata_file_says_what_rosbag2_wants(recording, rows):
    information = yaml.safe_load((recording / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert information['version'] == 9 and information['storage_identifier'] == 'mcap'
    assert information['ros_distro'] == 'jazzy' and information['message_count'] == len(rows)
    assert information['relative_file_paths'] == ['whole_0.mcap'] == [f['path'] for f in information['files']]
    assert information['duration']['nanoseconds'] == rows[-1][1]
    clock = information['topics_with_message_count'][0]['topic_metadata']
    assert clock['name'] == '/clock' and clock['offered_qos_profiles'][0]['history'] == 'keep_all'
    # rosidl's own hash of rosgraph_msgs/msg/Clock
    assert clock['type_description_hash'] == 'RIHS01_692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564'


def test_equal_messages_give_equal_files_wherever_they_are(recording, rows, tmp_path):
    again = write(tmp_path / 'another name', rows) / 'another name_0.mcap'
    assert hashlib.sha256(again.read_bytes()).digest() == hashlib.sha256(
        (recording / 'whole_0.mcap').read_bytes()).digest()


def test_read_gives_topics_metadata_and_messages(recording, rows):
    for path in (recording, recording / 'whole_0.mcap', str(recording)):
        content = bag.read(path)
        assert content.topics == {topic.name: topic.type for topic in RECORDED}
        assert content.metadata == {'scenario': 'test', 'pacing': 'lockstep', 'seed': '7'}
        assert [(name, log, data) for name, log, _, data in content.raw()] == rows
    assert [m.data for _, _, _, m in content.messages('/acu/mode')] == ['standby', 'autotrack']


@pytest.mark.parametrize('name', [n for n in NAMES if topics.TOPIC_BY_NAME[n].rate == 'step' and n != 'clock'])
def test_table_equals_message_by_message(recording, name):
    content = bag.read(recording)
    table = content.table(name)
    decoded = [message for _, _, _, message in content.messages(name)]
    np.testing.assert_array_equal(table.pop('t'), [messages.nanoseconds(m.header.stamp) / 1e9 for m in decoded])
    kind = content.topics[name].rpartition('/')[2]
    if kind == 'JointState':
        expected = {f'{joint}.{field}': [getattr(m, field)[i] for m in decoded]
                    for i, joint in enumerate(decoded[0].name) for field in ('position', 'velocity', 'effort')
                    if len(getattr(decoded[0], field))}
    elif kind == 'JointTrajectory':
        expected = {f'{joint}.{field}': [getattr(m.points[0], plural)[i] for m in decoded]
                    for i, joint in enumerate(topics.AXES)
                    for field, plural in (('position', 'positions'), ('velocity', 'velocities'),
                                          ('acceleration', 'accelerations'))}
    elif kind == 'Vector3Stamped':
        expected = {field: [getattr(m.vector, field) for m in decoded] for field in 'xyz'}
    elif kind == 'Odometry':
        parts = {'position': lambda m: m.pose.pose.position, 'orientation': lambda m: m.pose.pose.orientation,
                 'twist.linear': lambda m: m.twist.twist.linear, 'twist.angular': lambda m: m.twist.twist.angular}
        expected = {f'{part}.{field}': [getattr(get(m), field) for m in decoded] for part, get in parts.items()
                    for field in ('xyzw' if part == 'orientation' else 'xyz')}
    else:
        expected = {f'{part}.{field}': [getattr(getattr(m, part), field) for m in decoded]
                    for part in ('orientation', 'angular_velocity', 'linear_acceleration')
                    for field in ('xyzw' if part == 'orientation' else 'xyz')}
        expected.update({f'orientation_variance.{axis}': [m.orientation_covariance[4 * i] for m in decoded]
                         for i, axis in enumerate('xyz')})
    assert set(table) == set(expected)
    for column, values in expected.items():
        np.testing.assert_array_equal(table[column], values, err_msg=column)


def test_table_of_text_clock_and_diagnostics(recording):
    content = bag.read(recording)
    mode = content.table('acu/mode')
    assert mode['data'] == ['standby', 'autotrack'] and mode['t'].tolist() == [0.0, 0.5]
    assert list(content.table('diagnostics')) == ['t']
    np.testing.assert_array_equal(content.table('clock')['t'], np.arange(450) * T / 1e9)


def test_numbers_that_a_message_marks_as_no_data_are_nan_in_the_table():
    """REP 145 and sensor_msgs/Imu; an export must not show such an orientation as an attitude."""
    data = []
    for variance in (1e-6, -1.0):
        message = messages.template('ship/imu/data')
        message.angular_velocity.x, message.orientation_covariance[0] = 0.1, variance
        data.append(messages.serialize(message))
    made = columns.table(data, 'sensor_msgs/msg/Imu', [0, 1])
    np.testing.assert_array_equal(made['orientation.w'], [1.0, math.nan])
    np.testing.assert_array_equal(made['angular_velocity.x'], [0.1, 0.1])
    assert columns.table(data, 'sensor_msgs/msg/Imu', [0, 1], as_sent=True)['orientation.w'].tolist() == [1.0, 1.0]


def test_table_of_messages_that_differ_in_names_and_length():
    data = []
    for k, names in enumerate((('a', 'b'), ('b', 'a'), ('a',), ('a', 'b'))):
        message = messages.template('joint_states')
        message.name, message.position = list(names), np.zeros(len(names))
        message.velocity = message.effort = np.zeros(len(names))
        message.position[:] = 10 * k + np.arange(len(names))
        messages.put_stamp(message.header.stamp, k * T)
        data.append(messages.serialize(message))
    table = columns.table(data, 'sensor_msgs/msg/JointState', np.zeros(4, np.int64))
    np.testing.assert_array_equal(table['a.position'], [0, 11, 20, 30])
    np.testing.assert_array_equal(table['b.position'], [1, 10, np.nan, 31])


def serialized(name, k):
    return messages.serialize(made(name, k, np.random.default_rng(1)))


def unlike(kind):
    """Return bytes that another program may send on joint_states."""
    arm = messages.template('joint_states')
    arm.name, arm.position = ['shoulder'], np.ones(1)
    arm.velocity = arm.effort = np.zeros(0)
    return {'empty': b'', 'head': b'\0\1\0\0', 'ff': b'\0\1\0\0' + b'\xff' * 20, 'zeros': b'\0\1\0\0' + bytes(20),
            'text': messages.serialize(messages.String(data='hello')), 'arm': messages.serialize(arm)}[kind]


@pytest.mark.parametrize('name', ['joint_states', 'clock', 'acu/mode', 'diagnostics', 'target/truth'])
@pytest.mark.parametrize('kind', ['empty', 'head', 'ff', 'zeros'])
def test_foreign_message_is_left_out_counted_and_named(tmp_path, name, kind):
    good = serialized(name, 1)
    path = write(tmp_path / 'b', [(name, T, good), (name, 2 * T, unlike(kind)), (name, 3 * T, good)])
    content = bag.read(path)
    assert [data for _, _, _, data in content.raw(name)] == [good, good] == [
        messages.serialize(message) for _, _, _, message in content.messages(name)]
    assert len(content.table(name)['t']) == 2
    [line] = content.foreign
    size = len(unlike(kind))
    assert line.startswith(f'{name}: 1 foreign message left out, at 0.010000 s ({size} bytes): {size} bytes are no ')
    assert content.foreign == verify(content).foreign


def test_message_of_another_robot_is_foreign_in_a_recording_of_the_graph_only(tmp_path):
    rows = [('joint_states', k * T, unlike('arm') if k == 1 else serialized('joint_states', k)) for k in range(3)]
    ours, other = (bag.read(write(tmp_path / name, rows, metadata))
                   for name, metadata in (('ours', {'pacing': 'realtime'}), ('other', {})))
    assert ours.rows('joint_states').size == 2 and 'no number of azimuth' in ours.foreign[0]
    assert other.rows('joint_states').size == 3 and not other.foreign


def test_messages_of_another_publisher_are_no_gap(tmp_path):
    writer = Writer(tmp_path / 'b', topics.TOPICS, {'pacing': 'realtime'})
    index = [topic.name for topic in topics.TOPICS].index('joint_states')
    for k in range(5):
        writer.write(index, k * T, k * T, serialized('joint_states', k))
        writer.write_foreign(index, k * T, k * T, serialized('joint_states', 0))
    writer.close()
    content = bag.read(tmp_path / 'b')
    assert content.rows('joint_states').size == 5
    assert content.foreign == ['joint_states: 5 foreign messages left out, at 0.000000 s (132 bytes), 0.005000 s '
                               '(132 bytes), 0.010000 s (132 bytes) and 2 more: sent by another publisher']
    check = verify(content)
    assert (check.steps, [row.problems for row in check.topics if row.name == 'joint_states']) == (5, [[]])


def unreadable(tmp_path, recording):
    whole = (recording / 'whole_0.mcap').read_bytes()
    corrupt = bytearray(whole)
    corrupt[len(whole) // 2] ^= 0xff
    return {'empty file': b'', 'not an MCAP': b'SQLite format 3\0' * 9, 'inside a record': whole[:len(whole) // 2],
            'without a summary': whole[:8], 'broken record': bytes(corrupt), 'does not end': whole[:-8]}


@pytest.mark.parametrize('what', ['empty file', 'not an MCAP', 'inside a record', 'without a summary', 'broken record',
                                  'does not end'])
def test_unreadable_file_is_one_line(tmp_path, recording, what):
    file = tmp_path / 'x.mcap'
    file.write_bytes(unreadable(tmp_path, recording)[what])
    with pytest.raises(bag.BagError, match=what) as error:
        bag.read(file)
    assert str(file) in str(error.value) and '\n' not in str(error.value)


def test_missing_and_ambiguous_paths(tmp_path):
    with pytest.raises(bag.BagError, match='No such file'):
        bag.read(tmp_path / 'none')
    with pytest.raises(bag.BagError, match='0 .mcap files'):
        bag.read(tmp_path)


def test_any_cut_reads_up_to_its_last_chunk(tmp_path, recording, rows):
    whole = (recording / 'whole_0.mcap').read_bytes()
    file = tmp_path / 'cut.mcap'
    held = []
    for size in np.linspace(8, len(whole) - 1, 40).astype(int):
        file.write_bytes(whole[:size])
        content = bag.load(file)
        assert content.damage
        got = [(name, log, data) for name, log, _, data in content.raw()]
        assert got == rows[:len(got)]
        held.append(len(got))
    assert held[0] == 0 and held[-1] == len(rows) and len(set(held)) == 4


def test_existing_directory_is_never_overwritten(recording):
    before = (recording / 'whole_0.mcap').read_bytes()
    with pytest.raises(bag.BagError, match='exists already'):
        Writer(recording, RECORDED, METADATA)
    assert (recording / 'whole_0.mcap').read_bytes() == before


def test_directory_that_cannot_be_made(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(bag.BagError, match='Not a directory'):
        Writer(tmp_path / 'file' / 'bag', RECORDED, METADATA)


def test_flush_leaves_every_message_so_far_in_the_file(tmp_path, rows):
    writer = Writer(tmp_path / 'b', RECORDED, METADATA)
    for name, stamp, data in rows[:100]:
        writer.write(NAMES.index(name), stamp, stamp, data)
    assert copied(writer).index.size == 0
    writer.flush()
    content = copied(writer)
    assert [(name, log, data) for name, log, _, data in content.raw()] == rows[:100]
    assert 'without a summary' in content.damage


def copied(writer):
    copy = writer.path.with_suffix('.mcap')
    copy.write_bytes(writer.file.read_bytes())
    return bag.load(copy)


def test_a_bag_that_is_being_written_is_refused(tmp_path):
    writer = Writer(tmp_path / 'b', RECORDED, METADATA)
    with pytest.raises(bag.BagError, match='b_0.mcap: is being written; wait until its recorder has ended'):
        bag.load(tmp_path / 'b')
    writer.close()
    bag.read(tmp_path / 'b')


def test_verify_accepts_a_whole_run_with_a_delayed_topic(recording, rows):
    report = verify(load(recording))
    assert report.complete, report.lines()
    assert report.steps == 450 and report.period == 0.005
    assert {check.name: check.count for check in report.topics} == counts(rows)
    late = next(check for check in report.topics if check.name == 'tracking_receiver/angle_error')
    assert late.last == 445 * T / 1e9
    assert 'complete' in report.lines()[-1] and '450 steps of 5 ms' in report.lines()[-1]


def without(rows, name, steps):
    return [row for row in rows if not (row[0] == name and row[1] // T in steps)]


FAULTS = {
    'missing 1 step at 0.500000 s': lambda rows: without(rows, 'acu/estimate', {100}),
    'missing 3 steps from 0.500000 to 0.510000 s': lambda rows: without(rows, 'joint_states', {100, 101, 102}),
    'missing 1 step at 0.000000 s': lambda rows: without(rows, 'ship/truth', {0}),
    'missing 1 step at 2.245000 s': lambda rows: without(rows, 'joint_states', {449}),
    'missing 250 steps from 1.000000 to 2.245000 s': lambda rows: without(rows, 'acu/reference', set(range(200, 450))),
    'no message': lambda rows: without(rows, 'target/truth', set(range(450))),
    '1 doubled, the first at 0.': lambda rows: rows[:300] + rows[299:],
    '1 of 3 of acu missing, the first at 1.000000 s': lambda rows: [
        row for row in rows if not (row[0] == 'diagnostics' and row[1] == 200 * T and b'acu' in row[2])],
}


@pytest.mark.parametrize('line', FAULTS)
def test_verify_names_the_gap(tmp_path, rows, line):
    report = verify(load(write(tmp_path / 'b', FAULTS[line](rows))))
    assert not report.complete
    problems = [problem for check in report.topics for problem in check.problems]
    assert len(problems) == 1 and problems[0].startswith(line)
    assert any(line in text for text in report.lines()) and 'NOT complete, 1 problem:' in report.lines()[-1]


def test_verify_finds_swapped_messages(tmp_path, rows):
    places = [i for i, row in enumerate(rows) if row[0] == 'joint_states']
    swapped = list(rows)
    a, b = places[20], places[21]
    swapped[a], swapped[b] = rows[b], rows[a]
    report = verify(load(write(tmp_path / 'b', swapped)))
    problems = [problem for check in report.topics for problem in check.problems]
    assert problems == ['1 stamps go back, the first from 0.105000 to 0.100000 s']


def test_the_disk_stores_a_recording_while_it_is_written(tmp_path, rows, monkeypatch):
    """The flushed messages are in the file when its storing begins; storings do not queue."""
    stored, begun = [], threading.Event()

    def slow(descriptor):
        stored.append((os.fstat(descriptor).st_ino, os.fstat(descriptor).st_size))
        begun.wait(60.0)
    monkeypatch.setattr(os, 'fdatasync', slow)
    writer = Writer(tmp_path / 'b', RECORDED, METADATA)
    for name, stamp, data in rows[:500]:
        writer.write(NAMES.index(name), stamp, stamp, data)
    writer.flush()
    for _ in range(3):
        writer.synchronise()
    begun.set()
    writer._storing.join()
    file = (tmp_path / 'b' / 'b_0.mcap').stat()
    assert stored == [(file.st_ino, file.st_size)] and file.st_size > 10_000
    writer.close()


def drive_counts(k, step, lost):
    array = diagnostics('adu', k)
    array.status[0].values = [messages.KeyValue(key=key, value=str(value))
                              for key, value in (('step', step), ('lost_steps', lost))]
    return 'diagnostics', k * T, messages.serialize(array)


@pytest.mark.parametrize('absent, problems', (
    (('adu/truth', 'adu/motor_states', 'target/truth'), 0),             # a rotator, servo drives, one's own receiver
    (('ship/truth', 'ship/imu/data_raw', 'acu/program_track'), 0),      # ashore, without an operator
    (('acu/estimate',), 1), (('joint_states',), 1)))
def test_a_graph_that_was_started_by_hand_needs_no_message_of_simulated_equipment(tmp_path, rows, absent, problems):
    """Its drive counts its steps from midnight, and has lost some before the recorder started."""
    kept = [row for row in rows if row[0] not in (*absent, 'diagnostics')]
    kept += [drive_counts(k, 8_640_000 + k, 500 + k // 100) for k in (0, 200, 400)]
    metadata = {'scenario': '', 'pacing': 'realtime', 'seed': 7, 'start': 0}
    report = verify(load(write(tmp_path / 'by_hand', sorted(kept, key=lambda row: row[1]), metadata)))
    assert report.lost == (4, 400) and sum(len(check.problems) for check in report.topics) == problems
    assert report.made == 'made by: a graph started by hand, realtime, git unknown'


def test_verify_finds_what_the_recorder_lost(tmp_path, rows):
    writer = Writer(tmp_path / 'b', RECORDED, METADATA)
    for i, (name, stamp, data) in enumerate(rows):
        if i == 200:
            writer.skip(NAMES.index('clock'), 3)
        writer.write(NAMES.index(name), stamp, stamp, data)
    writer.close()
    assert any('3 messages lost, by the sequence numbers' in line for line in verify(load(tmp_path / 'b')).lines())


def test_verify_finds_damage_and_wrong_counts(tmp_path, rows, recording):
    path = write(tmp_path / 'b', rows)
    text = (path / 'metadata.yaml').read_text()
    (path / 'metadata.yaml').write_text(text.replace('message_count: 450', 'message_count: 449', 1))
    assert verify(load(path)).problems == ['metadata.yaml counts 449 of clock instead of 450']
    (path / 'metadata.yaml').write_text(': [')
    assert verify(load(path)).problems[0].startswith('metadata.yaml cannot be read')
    (path / 'metadata.yaml').unlink()
    assert verify(load(path)).problems == ['metadata.yaml is missing']
    file = path / 'b_0.mcap'
    file.write_bytes(file.read_bytes()[:file.stat().st_size // 2])
    report = verify(load(path))
    assert not report.complete and 'inside a record' in report.problems[0]
    assert 0 < sum(check.count for check in report.topics) < len(rows)


def test_verify_of_nothing(tmp_path):
    report = verify(load(write(tmp_path / 'b', [])))
    assert not report.complete and report.steps == 0
    with pytest.raises(bag.BagError):
        verify(load(pathlib.Path(tmp_path / 'none')))


def test_a_disk_that_takes_a_chunk_partly_leaves_a_whole_bag_without_a_hole(tmp_path, rows):
    class Disk:
        """A file that takes only so many bytes."""

        def __init__(self, stream, room):
            self.stream, self.room = stream, room

        def write(self, data):
            taken = min(len(data), self.room - self.stream.tell())
            if not taken:
                raise OSError(28, 'No space left on device')
            return self.stream.write(data[:taken])

        def __getattr__(self, name):
            return getattr(self.stream, name)

    writer = Writer(tmp_path / 'b', RECORDED, METADATA)
    writer._disk.stream = Disk(writer._disk.stream, 400_000)
    errors = []
    for name, stamp, data in rows:
        try:
            writer.write(NAMES.index(name), stamp, stamp, data)
        except bag.BagError as error:
            errors.append(str(error))
    writer.close()
    assert errors == [f'{tmp_path}/b/b_0.mcap: No space left on device']
    assert [row[:2] + row[3:] for row in bag.read(tmp_path / 'b').raw()] == [
        row for row in rows if row[1] < 1_000_000_000]
    assert not verify(load(tmp_path / 'b')).problems
    with open(writer.file, 'rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert len(list(reader.iter_messages())) == reader.get_summary().statistics.message_count == writer.messages
        assert reader.get_summary().statistics.metadata_count == len(list(reader.iter_metadata())) == 1
