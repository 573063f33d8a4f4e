"""Tables read back by other means than those that wrote them: messages by rosbags, files by csv and pyarrow."""
import csv
import math
import struct
import sys

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from pedestal import cli
from pedestal_common.graph import topics
from pedestal_common.wire import commands, messages
from pedestal_recording.writer import Writer

T = 5_000_000
VALUES = (0.1, -0.0, 5e-324, math.pi, -1e300, math.nan, math.inf, -math.inf, 1 / 3, 2.0**53 + 2.0)
TEXTS = ('plain', 'a, "quoted"\nsecond line', 'Grüße; ok=1', '')


def run():
    """[(topic, stamp, message)]: numbers that are hard to write, texts that are hard to quote."""
    rows = []
    for k, value in enumerate(VALUES):
        joints = messages.template('joint_states')
        joints.position[:], joints.velocity[:] = (value, k), (-value, 0.5)
        error = messages.Vector3Stamped(header=messages.header('beam'), vector=messages.vector3(value, 0.25, 46.4))
        estimate = messages.template('acu/estimate')
        estimate.points[0].accelerations[:] = value, -value
        truth = messages.template('ship/truth')
        truth.twist.twist.angular.y = value
        for name, message in (('joint_states', joints), ('tracking_receiver/angle_error', error),
                              ('acu/estimate', estimate), ('ship/truth', truth)):
            messages.put_stamp(message.header.stamp, k * T + 2_000_000_001_000_000_001)
            rows.append((name, k * T, message))
        rows.append(('acu/mode', k * T, messages.String(data=TEXTS[k % len(TEXTS)])))
    points = []
    for time in range(3):
        point = messages.trajectory_point(2)
        point.positions[:] = 0.1 * time, 0.2
        point.velocities = point.accelerations = np.zeros(0)
        point.time_from_start = messages.Duration(sec=time, nanosec=500_000_000)
        points.append(point)
    rows.append(('acu/program_track', 0, messages.program_track(points)))
    array = messages.DiagnosticArray(header=messages.header(''), status=[
        messages.DiagnosticStatus(level=level, name=name, message=TEXTS[1], hardware_id='', values=[
            messages.KeyValue(key='locked', value='1'), messages.KeyValue(key='gain', value='0.5')])
        for level, name in ((0, 'acu'), (2, 'adu'))])
    rows.append(('diagnostics', 0, array))
    for k, text in enumerate(TEXTS):
        reply = commands.Reply(k % 2 == 0, text)
        rows.append(('acu/command_result', k * T, commands.reply_message(commands.Command(
            'preset', 'Ada, "tower"', str(k), {'azimuth': str(k)}), reply)))
    return rows


@pytest.fixture(scope='module')
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp('bags') / 'made'
    names = [topic.name for topic in topics.TOPICS]
    writer = Writer(path, topics.TOPICS, {'scenario': 'test', 'pacing': 'lockstep'})
    for name, stamp, message in run():
        writer.write(names.index(name), stamp, stamp, messages.serialize(message))
    writer.close()
    return path


@pytest.fixture(scope='module')
def expected(recording):
    """{topic: [{header: value}]} from the messages as another library reads them."""
    rows = {}
    with AnyReader([recording]) as reader:
        for connection, log, data in reader.messages():
            name, message = connection.topic.lstrip('/'), reader.deserialize(data, connection.msgtype)
            stamp = log
            if hasattr(message, 'header'):
                stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            of_topic = rows.setdefault(name, [])
            for row in tabulated(name, message):
                of_topic.append({'t [s]': stamp / 1e9, 'stamp [ns]': stamp, **row})
    return rows


def tabulated(name, message):
    if name == 'joint_states':
        return [{f'{axis}.{field} [{unit}]': getattr(message, field)[i] for i, axis in enumerate(message.name)
                 for field, unit in (('position', 'rad'), ('velocity', 'rad/s'), ('effort', 'Nm'))}]
    if name == 'tracking_receiver/angle_error':
        v = message.vector
        return [{'x [rad]': v.x, 'y [rad]': v.y, 'z [dB-Hz]': v.z}]
    if name == 'acu/estimate':
        return [{f'{axis}.{field} [{unit}]': values[i] for i, axis in enumerate(topics.AXES)
                 for field, unit, values in (('position', 'rad', message.points[0].positions),
                                             ('velocity', 'rad/s', message.points[0].velocities),
                                             ('acceleration', 'rad/s2', message.points[0].accelerations))}]
    if name == 'acu/program_track':
        return [{'time_from_start [s]': point.time_from_start.sec + point.time_from_start.nanosec / 1e9,
                 'azimuth.position [rad]': point.positions[0], 'elevation.position [rad]': point.positions[1]}
                for point in message.points]
    if name == 'ship/truth':
        p, q = message.pose.pose.position, message.pose.pose.orientation
        v, w = message.twist.twist.linear, message.twist.twist.angular
        return [{**{f'position.{k} [m]': getattr(p, k) for k in 'xyz'},
                 **{f'orientation.{k}': getattr(q, k) for k in 'xyzw'},
                 **{f'twist.linear.{k} [m/s]': getattr(v, k) for k in 'xyz'},
                 **{f'twist.angular.{k} [rad/s]': getattr(w, k) for k in 'xyz'}}]
    if name == 'acu/mode':
        return [{'data': message.data}]
    if name == 'acu/command_result':
        return [{'level': message.level, 'name': message.name, 'hardware_id': message.hardware_id,
                 'message': message.message,
                 'values': '; '.join(f'{pair.key}={pair.value}' for pair in message.values)}]
    return [{'level': status.level, 'name': status.name, 'message': status.message,
             'values': '; '.join(f'{pair.key}={pair.value}' for pair in status.values)} for status in message.status]


def bits(value):
    """A value such that equality means the same bits; every NaN is one."""
    if isinstance(value, str):
        return value
    return 'NaN' if value != value else struct.pack('<d', value)


def export(*arguments):
    return cli.main(['export', *map(str, arguments)])


def test_csv_reads_back_to_the_last_bit(recording, expected, tmp_path, capsys):
    assert export(recording, '--output', tmp_path) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(topics.TOPICS) + 1     # and pointing_error.csv
    assert {file.name for file in tmp_path.iterdir()} == {
        'pointing_error.csv', *(f'{topic.name.replace("/", ".")}.csv' for topic in topics.TOPICS)}
    for name, rows in expected.items():
        with open(tmp_path / f'{name.replace("/", ".")}.csv', newline='', encoding='utf-8') as file:
            found = list(csv.DictReader(file))
        assert len(found) == len(rows)
        for row, want in zip(found, rows):
            assert set(row) == set(want)
            for header, value in want.items():
                if header == 'stamp [ns]':
                    assert int(row[header]) == value
                else:
                    assert bits(row[header] if isinstance(value, str) else float(row[header])) == bits(value), header
    assert ',NaN,' in (tmp_path / 'joint_states.csv').read_text()


def test_topics_of_no_message_give_the_stamps_alone(recording, tmp_path):
    assert export(recording, '--output', tmp_path, '--topics', '/ship/imu/data') == 0
    assert [file.name for file in tmp_path.iterdir()] == ['ship.imu.data.csv']
    assert (tmp_path / 'ship.imu.data.csv').read_text() == 't [s],stamp [ns]\n'


def test_parquet_reads_back_to_the_last_bit(recording, expected, tmp_path):
    parquet = pytest.importorskip('pyarrow.parquet')
    assert export(recording, '--output', tmp_path, '--format', 'parquet') == 0
    for name, rows in expected.items():
        made = parquet.read_table(tmp_path / f'{name.replace("/", ".")}.parquet')
        assert made.schema.metadata[b'topic'] == name.encode() and made.schema.metadata[b'scenario'] == b'test'
        assert str(made.schema.field('stamp [ns]').type) == 'int64'
        columns = {header: made.column(header).to_pylist() for header in made.column_names}
        assert set(columns) == set(rows[0])
        for header, values in columns.items():
            assert [bits(value) for value in values] == [bits(row[header]) for row in rows], header


def test_parquet_without_its_library_is_one_line(recording, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, 'pyarrow', None)
    assert export(recording, '--output', tmp_path / 'new', '--format', 'parquet') == 2
    error = capsys.readouterr().err
    assert 'pedestal_recording[parquet]' in error and error.count('\n') == 1
    assert not (tmp_path / 'new').exists()


def test_a_table_that_is_there_is_not_replaced_unasked(recording, tmp_path, capsys):
    file = tmp_path / 'acu.mode.csv'
    file.write_text('mine')
    assert export(recording, '--output', tmp_path) == 2
    error = capsys.readouterr().err
    assert f'{file} exists already; --overwrite replaces' in error and error.count('\n') == 1
    assert file.read_text() == 'mine' and list(tmp_path.iterdir()) == [file]
    assert export(recording, '--output', tmp_path, '--overwrite') == 0
    assert file.read_text().startswith('t [s],stamp [ns],data\n0.0,0,plain\n')


def foreign(path):
    """A bag with a topic whose type nobody here knows and one that is."""
    known = topics.TOPIC_BY_NAME['acu/mode']
    writer = Writer(path, [known, known._replace(name='other', type='std_msgs/msg/Header')], {})
    writer.write(0, 0, 0, messages.serialize(messages.String(data='stow')))
    writer.write(1, 0, 0, b'\0\1\0\0\0\0\0\0')
    writer.close()
    data = writer.file.read_bytes()
    writer.file.write_bytes(data.replace(b'std_msgs/msg/Header', b'my_msgs/msg/Unknown'))
    return path


def test_a_type_that_is_not_known(tmp_path, capsys):
    path = foreign(tmp_path / 'bag')
    assert export(path) == 0
    said = capsys.readouterr()
    assert said.err == ('pedestal: left out: other is of the unknown type my_msgs/msg/Unknown\n')
    assert [file.name for file in (path / 'export').iterdir()] == ['acu.mode.csv']
    assert export(path, '--topics', 'other') == 1
    assert 'of the unknown type my_msgs/msg/Unknown' in capsys.readouterr().err


def cut(path):
    file = next(path.glob('*.mcap'))
    file.write_bytes(file.read_bytes()[:-40])


BAD = {'missing': (lambda path: None, 'No such file'), 'empty folder': (lambda path: path.mkdir(), '0 .mcap files'),
       'empty file': (lambda path: path.write_bytes(b''), 'empty file'),
       'text': (lambda path: path.write_text('hello, world'), 'not an MCAP file'),
       'truncated': (lambda path: cut(foreign(path)), 'the file ends at byte')}


@pytest.mark.parametrize('verb', ['export', 'replay'])
@pytest.mark.parametrize('what', BAD)
def test_a_bag_that_is_none(verb, what, tmp_path, capsys):
    make, text = BAD[what]
    make(tmp_path / 'bag')
    assert cli.main([verb, str(tmp_path / 'bag')]) == 1
    error = capsys.readouterr().err
    assert str(tmp_path / 'bag') in error and text in error and error.count('\n') == 1
    assert not (tmp_path / 'bag' / 'export').exists()


@pytest.mark.parametrize('verb', ['export', 'replay'])
def test_a_bag_that_is_being_written(verb, tmp_path, capsys):
    writer = Writer(tmp_path / 'bag', topics.TOPICS, {})
    assert cli.main([verb, str(tmp_path / 'bag')]) == 1
    error = capsys.readouterr().err
    assert f'{writer.file}: is being written' in error and error.count('\n') == 1
    writer.close()


@pytest.mark.parametrize('verb', ['export', 'replay'])
def test_an_unknown_topic_names_the_nearest(verb, recording, capsys):
    assert cli.main([verb, str(recording), '--topics', 'joint_states', 'acu/rate_comand']) == 1
    error = capsys.readouterr().err
    assert "no topic acu/rate_comand in it; did you mean 'acu/rate_command'?" in error and error.count('\n') == 1
