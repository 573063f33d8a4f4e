"""What is sent when, and what is refused, without a graph; the live ones are in test/test_replay.py."""
import io

import pytest

pytest.importorskip('rclpy')
from pedestal import cli
from pedestal_common.graph import topics
from pedestal_common.wire import messages  # noqa: E402
from pedestal_recording import bag
from pedestal_recording.writer import Writer
from pedestal_workbench.again import playlist, terminal

T = 5_000_000
OTHER = topics.TOPIC_BY_NAME['joint_states']._replace(name='camera/angle')


def stamped(message, stamp):
    messages.put_stamp(message.header.stamp, stamp)
    return messages.serialize(message)


def framed(topic, frame):
    """A message of a topic in another frame."""
    message = messages.template(topic)
    message.header.frame_id = frame
    return message


def write(path, rows):
    """A bag of (topic, stamp, log time, text of acu/mode or number of the message) in this order."""
    table = (*topics.TOPICS, OTHER)
    names = [topic.name for topic in table]
    writer = Writer(path, table, {})
    for name, stamp, log, content in rows:
        if name == 'acu/mode':
            data = messages.serialize(messages.String(data=content))
        elif name == 'acu/program_track':
            data = stamped(framed('acu/program_track', content), stamp)
        elif name == 'tracking_receiver/angle_error':
            data = stamped(messages.Vector3Stamped(header=messages.header(content), vector=messages.vector3()), stamp)
        else:
            data = stamped(framed('joint_states', content), stamp)
        writer.write(names.index(name), log, log, data)
    writer.close()
    return bag.read(path)


def played(recording, names, start=0.0, duration=None):
    """[(stamp / T, [(topic, bytes)])] of a playlist."""
    steps = playlist.Playlist(recording, names, start, duration).steps()
    return [(stamp / T, list(group)) for stamp, group in steps]


ERROR = 'tracking_receiver/angle_error'
ROWS = [(OTHER.name, 2 * T, 9 * T, 'a'), ('acu/rate_command', 2 * T, 9 * T, 'b'), (ERROR, 2 * T, 9 * T, 'c'),
        ('joint_states', 2 * T, 9 * T, 'd'), ('joint_states', 2 * T, 9 * T, 'e'), ('joint_states', T, 10 * T, 'f'),
        ('acu/mode', 0, 2 * T, 'stow'), ('acu/program_track', T, 0, 'g'), ('acu/mode', 0, 3 * T, 'preset'),
        ('joint_states', 3 * T, 3 * T, 'h'), ('acu/mode', 0, 3 * T, 'program'), (ERROR, 4 * T, 4 * T, 'i')]
ALL = ['acu/mode', 'joint_states', OTHER.name, ERROR, 'acu/rate_command', 'acu/program_track']


def marks(steps):
    """The same with what `write` put into each message."""
    def mark(name, data):
        message = messages.deserialize(data, OTHER.type if name == OTHER.name else topics.TOPIC_BY_NAME[name].type)
        return message.data if name == 'acu/mode' else message.header.frame_id
    return [(stamp, [mark(name, data) for name, data in group]) for stamp, group in steps]


def test_order_is_by_stamp_then_latched_then_table_then_file(tmp_path):
    recording = write(tmp_path / 'bag', ROWS)
    assert marks(played(recording, ALL)) == [
        (1, ['g', 'f']), (2, ['stow', 'd', 'e', 'c', 'b', 'a']), (3, ['preset', 'program', 'h']), (4, ['i'])]
    assert marks(played(recording, [ERROR])) == [(2, ['c']), (4, ['i'])]


def test_start_and_duration_count_from_the_first_step_and_keep_what_holds(tmp_path):
    recording = write(tmp_path / 'bag', ROWS)
    assert marks(played(recording, ALL, 2 * T / 1e9)) == [(3, ['stow', 'g', 'preset', 'program', 'h']), (4, ['i'])]
    assert marks(played(recording, ALL, 3 * T / 1e9)) == [(4, ['program', 'g', 'i'])]
    assert marks(played(recording, ALL, T / 1e9, T / 1e9)) == [
        (2, ['g', 'stow', 'd', 'e', 'c', 'b', 'a']), (3, ['preset', 'program', 'h'])]
    with pytest.raises(ValueError, match=r'--start 1 s: .*bag has no message from there on; .* 0\.015 s long'):
        played(recording, ALL, 1.0)
    with pytest.raises(bag.BagError, match='no message of ship/truth'):
        played(recording, ['ship/truth'])


HEARD_BY_ACU = (ERROR, 'tracking_receiver/angle_rate', 'tracking_receiver/range', 'ship/imu/data', 'ins/state',
                'ins/error', 'weather/temperature', 'weather/pressure', 'weather/humidity', 'acu/program_track',
                'acu/command')


@pytest.mark.parametrize('nodes, expected', [
    (['acu'], {'joint_states', 'adu/state', 'adu/stow_pins', *HEARD_BY_ACU}),
    (['adu'], {'acu/rate_command', 'acu/stow_pins', 'ship/truth', 'adu/inject'}),
    (['acu', 'adu'], {'ship/truth', 'adu/inject', *HEARD_BY_ACU}),
    (['recorder'], {topic.name for topic in topics.TOPICS} | {OTHER.name}),
    ([], {topic.name for topic in topics.TOPICS} | {OTHER.name})])
def test_a_node_gets_what_it_reads_and_no_node_under_test_writes(tmp_path, nodes, expected):
    assert set(playlist.selected_topics(write(tmp_path / 'bag', ROWS), nodes, [])) == expected


REFUSED = {
    'rate': (['--rate', '0'], '--rate 0: must be above 0'),
    'NaN': (['--rate', 'nan'], '--rate nan: must be above 0'),
    'endless': (['--rate', 'inf'], '--rate inf: must be'),
    'start': (['--start', '-1'], '--start -1 s: must be 0 or more'),
    'duration': (['--duration', '0'], '--duration 0: must be above 0'),
    'deadline': (['--deadline', '-2'], '--deadline -2: must be above 0'),
    'node': (['--node', 'acuu'], "--node acuu: unknown node; did you mean 'acu'? must be one of ship_motion, ins,"),
    'lockstep without a node': (['--lockstep'], '--lockstep: set --node to a node that answers the steps; must be'),
    'lockstep with the INS': (['--lockstep', '--node', 'ins'], '--lockstep: ins does not answer steps at their stamp'),
    'paused for ever': (['--paused'], '--paused: standard input must be a terminal'),
    'past the end': (['--start', '7'], 'bag has no message from there on; the recording is 0.015 s long'),
}


def test_a_wait_is_announced_once_where_there_is_no_terminal(capsys):
    line = terminal.StatusLine()
    for text in ('waits for acu', 'waits for acu', 'waits for adu'):
        line.announce(text)
    line.show('2.0 s')
    assert capsys.readouterr().err == 'pedestal: waits for acu\npedestal: waits for adu\n'


@pytest.mark.parametrize('case', REFUSED)
def test_refused_in_one_line(case, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr('sys.stdin', io.StringIO())
    write(tmp_path / 'bag', ROWS)
    options, text = REFUSED[case]
    assert cli.main(['replay', str(tmp_path / 'bag'), *options]) == 2
    error = capsys.readouterr().err
    assert text in error and error.count('\n') == 1


def test_a_node_whose_topics_are_not_there(tmp_path, capsys):
    path = tmp_path / 'bag'
    writer = Writer(path, [topics.TOPIC_BY_NAME['clock']], {})
    writer.write(0, 0, 0, messages.serialize(messages.Clock(clock=messages.Time(sec=0, nanosec=0))))
    writer.close()
    assert cli.main(['replay', str(path), '--node', 'adu']) == 1
    assert 'no input of node adu in the bag; its inputs are ship/truth, acu/rate_command' in capsys.readouterr().err


def test_a_type_that_is_not_the_topics(tmp_path, capsys):
    path = tmp_path / 'bag'
    writer = Writer(path, [topics.TOPIC_BY_NAME['clock']._replace(type='std_msgs/msg/String')], {})
    writer.write(0, 0, 0, messages.serialize(messages.String(data='noon')))
    writer.close()
    assert cli.main(['replay', str(path)]) == 1
    error = capsys.readouterr().err
    assert 'clock is a std_msgs/msg/String; must be a rosgraph_msgs/msg/Clock' in error and error.count('\n') == 1
