"""Bags that are damaged, foreign, wrong or not finished: what each verb that reads one says. Never a traceback."""
import os
import random
import sqlite3

import pytest
from mcap.writer import Writer as McapWriter

from pedestal import cli
from pedestal_common.graph import nodes, topics
from pedestal_common.wire import messages
from pedestal_recording.writer import Writer

RECORDED = nodes.recorded(('tracking_receiver', 'acu', 'adu', 'recorder'))


def message(topic, stamp):
    made = messages.template(topic.name)
    messages.put_stamp(made.clock if topic.name == 'clock' else made.header.stamp, stamp)
    return made


def write(path, stamps, written=RECORDED, close=True):
    """A bag with the stamps [step of 5 ms] on every topic of the steps."""
    writer = Writer(path, written, {'scenario': 'test', 'pacing': 'lockstep'})
    for step in stamps:
        for index, topic in enumerate(written):
            if topic.rate == 'step':
                writer.write(index, step * 5_000_000, step * 5_000_000,
                             messages.serialize(message(topic, step * 5_000_000)))
    if close:
        writer.close()
    return writer


def whole(path):
    return write(path, range(600))


def truncated(path):
    file = whole(path).file
    os.truncate(file, file.stat().st_size * 2 // 3)


def not_one_chunk(path):
    file = whole(path).file
    os.truncate(file, 2_000)


def empty(path):
    whole(path).file.write_bytes(b'')


def no_message(path):
    write(path, [])


def text(path):
    path.mkdir()
    (path / 'notes.mcap').write_text('time_s,azimuth\n0.0,1.0\n')


def encrypted(path):
    path.mkdir()
    (path / 'x.mcap').write_bytes(random.Random(1).randbytes(50_000))


def sqlite(path):
    path.mkdir()
    database = sqlite3.connect(path / 'x_0.db3')
    database.execute('create table topics (id integer)')
    database.commit()
    database.close()


def other_profile(path):
    path.mkdir()
    with open(path / 'x.mcap', 'wb') as stream:
        writer = McapWriter(stream)
        writer.start(profile='', library='other')
        schema = writer.register_schema('pose', 'jsonschema', b'{}')
        channel = writer.register_channel('/pose', 'json', schema)
        for k in range(100):
            writer.add_message(channel, k, b'{"x": 1}', k)
        writer.finish()


def several(path):
    path.mkdir()
    for name in ('a_0.mcap', 'b_0.mcap'):
        (path / name).write_bytes(b'')


def no_bag(path):
    path.mkdir()


def missing(path):
    pass


def wrong_type(path):
    """joint_states and the truth are of the type of a point."""
    point = topics.TOPIC_BY_NAME['tracking_receiver/angle_error'].type
    write(path, range(600), [topic._replace(type=point) if topic.name in ('joint_states', 'target/truth') else topic
                             for topic in RECORDED])


def backwards(path):
    write(path, [*range(300), *range(290, 600)])


WRITERS = []


def being_written(path):
    WRITERS.append(write(path, range(600), close=False))


VERBS = ('verify', 'report', 'recover', 'rerun')
CASES = {
    truncated: {'verify': 'the file ends at byte', 'recover': None,
                '': ('the file ends at byte', 'inside a record', '`pedestal recover` recovers its readable messages')},
    not_one_chunk: {'verify': 'the file ends at byte', 'recover': 'no message in it is readable',
                    '': ('the file ends at byte',)},
    empty: {'': ('_0.mcap: empty file',)},
    no_message: {'verify': 'no topic of the steps of the drive has a message', 'report': None,
                 'recover': 'no message in it is readable', 'rerun': 'contains no configuration'},
    text: {'': ('notes.mcap: not an MCAP file',)},
    encrypted: {'': ('x.mcap: not an MCAP file',)},
    sqlite: {'': ('x_0.db3: an SQLite bag, not an MCAP file', '`ros2 bag convert`')},
    other_profile: {'': ("/pose is encoded as 'json': not a ROS 2 recording",)},
    several: {'': ('2 .mcap files in it, must be one, or NAME_0.mcap, NAME_1.mcap ...',)},
    no_bag: {'': ('0 .mcap files in it, must be one',)},
    missing: {'': ('No such file or directory',)},
    wrong_type: {'verify': 'type geometry_msgs/msg/Vector3Stamped, must be sensor_msgs/msg/JointState',
                 'report': None, 'recover': None, 'rerun': 'contains no configuration'},
    backwards: {'verify': '1 stamps go back, the first from 1.495000 to 1.450000 s',
                'report': 'the stamps of joint_states go back, the first from 1.495000 to 1.450000 s',
                'recover': None, 'rerun': 'contains no configuration'},
    being_written: {'': ('is being written; wait until its recorder has ended',)},
}
"""{maker of a bag: {verb: text of its error, None for success}}; '' stands for all other verbs."""


def test_verify_of_a_recording_that_breaks_off_names_the_repair(tmp_path, capsys):
    truncated(tmp_path / 'bag')
    assert cli.main(['verify', str(tmp_path / 'bag')]) == 1
    assert f"pedestal recover {tmp_path / 'bag'} makes a complete bag" in capsys.readouterr().out.splitlines()[-2]


@pytest.mark.parametrize('make', CASES, ids=lambda make: make.__name__)
def test_bad_bag(make, tmp_path, capsys, one_line):
    path = tmp_path / 'bag'
    make(path)
    before = {file: file.read_bytes() for file in path.glob('*')}
    for verb in VERBS:
        expected = CASES[make].get(verb, CASES[make].get(''))
        code = cli.main([verb, str(path)])
        out, err = capsys.readouterr()
        if expected is None:
            assert (code, err) == (0, ''), verb
        elif isinstance(expected, str) and verb == 'verify':
            assert (code, err) == (1, '') and expected in out and 'NOT complete' in out.splitlines()[-1], out
        else:
            line = one_line(err)
            assert code == 1 and line.startswith('pedestal: error: ') and str(path) in line, verb
            for part in (expected,) if isinstance(expected, str) else expected:
                assert part in line
    (path / 'report.html').unlink(missing_ok=True)
    assert {file: file.read_bytes() for file in path.glob('*')} == before
    for writer in WRITERS:
        writer.close()
    WRITERS.clear()


@pytest.mark.thorough
def test_the_report_of_numbers_that_are_strange_but_readable(tmp_path):
    wrong_type(tmp_path / 'bag')
    assert cli.main(['report', str(tmp_path / 'bag')]) == 0
    whole(tmp_path / 'never off the target')
    assert cli.main(['report', str(tmp_path / 'never off the target')]) == 0
    said = 'joint_states: type geometry_msgs/msg/Vector3Stamped, must be sensor_msgs/msg/JointState'
    assert said in (tmp_path / 'bag' / 'report.html').read_text()
