import hashlib
import importlib.util
import json
import os
import pathlib
import random
import resource
import signal
import subprocess
import time

import domains
import pytest

rclpy = pytest.importorskip('rclpy')
from rclpy.duration import Duration  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402

from pedestal_common.graph import nodes, topics  # noqa: E402
from pedestal_common.node import run  # noqa: E402
from pedestal_common.node.middleware import message_class  # noqa: E402
from pedestal_common.wire import messages  # noqa: E402
from pedestal_recording import bag  # noqa: E402
from pedestal_recording.verify import verify  # noqa: E402

LIMIT = 30.0
RECORDED = nodes.recorded([name for name in nodes.NODE_NAMES if name != 'station'])     # which is no part of a graph
NODES = ('ship_motion', 'ins', 'tracking_receiver', 'acu', 'adu', 'recorder', 'operator')

_spec = importlib.util.spec_from_file_location('bag_test_messages', pathlib.Path(__file__).with_name('test_bag.py'))
_bag_test = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_bag_test)


PROFILE = """<dds xmlns="http://www.eprosima.com"><profiles>
<data_writer profile_name="quick" is_default_profile="true">
<times><heartbeatPeriod><sec>0</sec><nanosec>5000000</nanosec></heartbeatPeriod></times>
</data_writer></profiles></dds>"""
"""Fast DDS asks for acknowledgements every 5 ms, not every 3 s (if no test before made a writer in this process)."""


@pytest.fixture
def domain(monkeypatch, tmp_path_factory):
    """A ROS domain that no other test on this machine uses."""
    for number in domains.candidates():
        if (lock := domains.hold(number)) is None:
            continue
        with lock:
            monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
            monkeypatch.setenv('ROS_DOMAIN_ID', str(number))
            profile = tmp_path_factory.mktemp('dds') / 'profile.xml'
            profile.write_text(PROFILE)
            monkeypatch.setenv('FASTRTPS_DEFAULT_PROFILES_FILE', str(profile))
            yield number
            while Recorder.started:
                Recorder.started.pop().kill()
            return


class Recorder:
    """The recorder as a process; the fixture `domain` ends those that a failing test leaves."""
    started = []

    def __init__(self, directory, pacing, *arguments, nodes=NODES, **options):
        known = ('-p', f'graph.nodes:={",".join(nodes)}') if nodes else ()
        self.process = subprocess.Popen(
            [*run.command('recorder_node'), '--ros-args', '-p', f'bag:={directory}', '-p', f'graph.pacing:={pacing}',
             *known, *arguments],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)
        self.started.append(self.process)

    def end(self, number=signal.SIGINT):
        """(exit code, JSON of the last line of stdout, stderr but for mere information) after the signal; None sends
        none."""
        if number is not None:
            self.process.send_signal(number)
        try:
            out, err = self.process.communicate(timeout=LIMIT)
        except subprocess.TimeoutExpired:
            self.process.kill()
            out, err = self.process.communicate()
            pytest.fail(f'the recorder did not end: {out} {err}')
        return self.process.returncode, json.loads(out.splitlines()[-1]) if out else None, ''.join(
            line for line in err.splitlines(keepends=True) if not line.startswith('[INFO]'))


class Graph:
    """Writers of every topic, which keep everything until it is acknowledged."""

    def __init__(self, domain):
        self.context = rclpy.Context()
        rclpy.init(args=[], context=self.context, domain_id=domain)
        self.node = rclpy.create_node(nodes.REPLAY_NODE, context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.publishers = {}
        for topic in RECORDED:
            latched = topics.QOS_BY_RATE[topic.rate].latched
            durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
            profile = QoSProfile(history=HistoryPolicy.KEEP_ALL, depth=1, reliability=ReliabilityPolicy.RELIABLE,
                                 durability=durability)
            self.publishers[topic.name] = self.node.create_publisher(message_class(topic.type), topic.name, profile)

    def await_recorder(self):
        """Until it reads everything but samples, and commands, of which a lockstep recorder has the replies only."""
        end = time.monotonic() + LIMIT
        while any(not self.publishers[topic.name].get_subscription_count() for topic in RECORDED
                  if topic.rate not in topics.REALTIME_RATES):
            assert time.monotonic() < end, 'the recorder never subscribed'
            time.sleep(0.01)
        time.sleep(0.3)  # the recorder's side of the discovery

    def publish(self, rows):
        """As nodes do: a change between two answers, and all that was sent has arrived in the end."""
        for name, _, data in rows:
            if name in ANSWERS:
                self.acknowledged()
            self.publishers[name].publish(data)
            if name in ANSWERS:
                self.acknowledged()
        self.acknowledged()

    def acknowledged(self):
        for publisher in self.publishers.values():
            assert publisher.wait_for_all_acked(Duration(seconds=LIMIT))

    def close(self):
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)


@pytest.fixture
def graph(domain):
    graph = Graph(domain)
    yield graph
    graph.close()


@pytest.fixture(scope='module')
def rows():
    """(topic, stamp, bytes) of a run; bytes as DDS delivers them, filled up to whole words."""
    made = [(name, stamp, messages.serialize(message)) for name, stamp, message in _bag_test.run()]
    return [(name, stamp, data + bytes(-len(data) % 4)) for name, stamp, data in made]


ANSWERS = {topic.name: next(answer.name for answer in RECORDED
                            if answer.rate == 'step' and answer.writers == topic.writers)
           for topic in RECORDED if topic.rate in topics.EVENT_RATES}
"""{topic that changes now and then: what its writer says in every step}."""


def shuffled(rows, seed):
    """An arrival that keeps each topic's own order and a change between two answers of its writer."""
    rng = random.Random(seed)
    groups = {}
    for row in rows:
        groups.setdefault(ANSWERS.get(row[0], row[0]), []).append(row)
    for group in groups.values():
        group.sort(key=lambda row: (row[1], row[0] not in ANSWERS))
    out = []
    while groups:
        oldest = min(group[0][1] for group in groups.values())
        name = rng.choice([name for name, group in groups.items() if group[0][1] <= oldest + 20_000_000])
        out.append(groups[name].pop(0))
        if not groups[name]:
            del groups[name]
    return out


@pytest.mark.thorough
def test_lockstep_any_arrival_gives_the_same_file(tmp_path, graph, rows):
    hashes = set()
    for seed in (1, 2):
        recorder = Recorder(tmp_path / str(seed), 'lockstep', '-p', 'scenario:=test', '-p', 'seed:=7')
        graph.await_recorder()
        graph.publish(shuffled(rows, seed))
        code, said, err = recorder.end()
        assert (code, err) == (0, '')
        content = bag.read(tmp_path / str(seed))
        assert [(name, log, data) for name, log, _, data in content.raw()] == rows
        assert content.metadata['scenario'] == 'test' and content.metadata['seed'] == '7'
        assert said['messages'] == len(rows) and said['lost'] == 0 and said['bytes'] == content.file.stat().st_size
        assert said['sha256'] == hashlib.sha256(content.file.read_bytes()).hexdigest()
        assert verify(bag.load(tmp_path / str(seed))).complete
        hashes.add(said['sha256'])
        graph.close()
        graph.__init__(int(os.environ['ROS_DOMAIN_ID']))
    assert len(hashes) == 1


def test_lockstep_ends_by_itself_after_the_duration(tmp_path, graph, rows):
    recorder = Recorder(tmp_path / 'b', 'lockstep', '-p', 'duration:=2.245')
    graph.await_recorder()
    graph.publish(shuffled(rows, 4))
    code, said, err = recorder.end(None)
    assert (code, err, said['messages']) == (0, '', len(rows))
    assert verify(bag.load(tmp_path / 'b')).complete


@pytest.mark.thorough
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_realtime_records_in_order_of_arrival_at_the_wall_time_of_the_writer(tmp_path, graph, rows, number):
    recorder = Recorder(tmp_path / 'b', 'realtime')
    graph.await_recorder()
    some = [row for row in rows if row[1] < 200_000_000]
    before = time.time_ns()
    graph.publish(some)
    time.sleep(1.2)
    code, said, err = recorder.end(number)
    assert (code, err, said['messages'], said['lost']) == (0, '', len(some), 0)
    content = bag.read(tmp_path / 'b')
    for name in content.topics:
        assert [(log, data) for _, log, _, data in content.raw(name)] == [
            (stamp, data) for topic, stamp, data in some if topic == name]
    published = content.rows('clock').publish
    assert before < published.min() and published.max() < time.time_ns() and (published[1:] > published[:-1]).all()


@pytest.mark.thorough
def test_broken_messages_are_recorded_all_the_same(tmp_path, graph, rows):
    recorder = Recorder(tmp_path / 'b', 'realtime')
    graph.await_recorder()
    before = time.time_ns()
    broken = [('clock', 0, b'\0\1\0\0'), ('joint_states', 0, b'\0\1\0\0' + b'\xff' * 12),
              ('diagnostics', 0, b'\0\1\0\0')]
    graph.publish(broken + rows[:60])
    code, said, err = recorder.end()
    assert (code, err, said['messages']) == (0, '', 63)
    content = bag.read(tmp_path / 'b')
    assert [line.split(':')[0] for line in content.foreign] == [name for name, _, _ in broken]
    # Before the first time of the drive, UTC is the log time of a message without a stamp.
    assert [data for _, log, _, data in content.take(content.recorded('joint_states'))
            if before < log < time.time_ns()] == [broken[1][2]]


@pytest.mark.thorough
def test_a_message_before_the_start_may_have_the_stamp_of_the_start(tmp_path, graph):
    """As the program track has; a later stamp is from the future."""
    start = time.time_ns() + 600 * 10**9
    recorder = Recorder(tmp_path / 'b', 'realtime', '-p', f'graph.start:={start}')
    status = {}

    def take(array):
        for found in array.status:
            if found.name == 'recorder':
                status.update({'level': found.level[0], **{value.key: value.value for value in found.values}})
    subscription = graph.node.create_subscription(message_class('diagnostic_msgs/msg/DiagnosticArray'), 'diagnostics',
                                                  take, 10)
    graph.await_recorder()
    for count, stamp, level, wrong in ((1, start, 0, '0'), (2, start + 10**9, 1, '1')):
        track = messages.template('acu/program_track')
        messages.put_stamp(track.header.stamp, stamp)
        graph.publishers['acu/program_track'].publish(messages.serialize(track))
        end = time.monotonic() + LIMIT
        while status.get('messages') != str(count) and time.monotonic() < end:
            graph.executor.spin_once(timeout_sec=0.1)
        assert (status['messages'], status['level'], status['without valid stamp']) == (str(count), level, wrong)
    graph.node.destroy_subscription(subscription)
    code, said, err = recorder.end()
    assert (code, err, said['messages']) == (0, '', 2)
    assert [log for _, log, _, _ in bag.read(tmp_path / 'b').raw()] == [start, start]


@pytest.mark.thorough
def test_lost_messages_end_a_lockstep_recorder_with_topic_and_count(tmp_path, graph, rows):
    joints = [row for row in rows[:44] if row[0] == 'joint_states']
    for name, _, data in joints[:-1]:
        graph.publishers[name].publish(data)
    recorder = Recorder(tmp_path / 'b', 'lockstep')
    graph.await_recorder()
    graph.publish(joints[-1:])
    code, said, err = recorder.end(None)
    lost = len(joints) - 1
    assert (code, said['lost'], said['messages']) == (1, lost, 1)
    assert err == f'recorder: error: lost {lost} of joint_states\n'
    lines = verify(bag.load(tmp_path / 'b')).lines()
    assert any(f'{lost} messages lost, by the sequence numbers' in line for line in lines)


@pytest.mark.thorough
def test_a_realtime_recorder_that_comes_late_or_hears_two_writers_has_lost_nothing(tmp_path, graph, rows):
    """Each writer has numbers of its own."""
    joints = [row for row in rows if row[0] == 'joint_states']
    for name, _, data in joints[:10]:
        graph.publishers[name].publish(data)
    recorder = Recorder(tmp_path / 'b', 'realtime')
    graph.await_recorder()
    stranger = graph.node.create_publisher(message_class('sensor_msgs/msg/JointState'), 'joint_states', 10)
    time.sleep(0.3)
    for name, _, data in joints[10:60]:
        graph.publishers[name].publish(data)
        stranger.publish(data)
        time.sleep(0.005)
    graph.acknowledged()
    assert stranger.wait_for_all_acked(Duration(seconds=LIMIT))
    code, said, err = recorder.end()
    assert (code, err, said['lost'], said['messages']) == (0, '', 0, 100)


@pytest.mark.thorough
def test_messages_of_a_foreign_node_are_marked_and_no_loss(tmp_path, domain, graph, rows):
    """The foreign node publishes messages of the type, and bytes of no message."""
    joints = [row for row in rows if row[0] == 'joint_states'][:100]
    recorder = Recorder(tmp_path / 'b', 'realtime')
    graph.await_recorder()
    graph.publish(joints[:60])
    node = rclpy.create_node('stranger', context=graph.context)
    stranger = node.create_publisher(message_class('sensor_msgs/msg/JointState'), 'joint_states', QoSProfile(
        depth=1000, reliability=ReliabilityPolicy.RELIABLE))
    time.sleep(0.5)
    for number, (name, _, data) in enumerate(joints[60:]):
        graph.publishers[name].publish(data)
        if number % 2 == 0:
            stranger.publish(data if number else b'\0\1\0\0' + b'\xff' * 20)
        time.sleep(0.005)
    graph.acknowledged()
    assert stranger.wait_for_all_acked(Duration(seconds=LIMIT))
    code, said, err = recorder.end()
    assert (code, err, said['lost'], said['messages']) == (0, '', 0, 120)
    content = bag.read(tmp_path / 'b')
    assert [data for _, _, _, data in content.raw('joint_states')] == [data for _, _, data in joints]
    assert [line.partition(' left out')[0] for line in content.foreign] == [
        'joint_states: 1 foreign message', 'joint_states: 19 foreign messages']
    assert not [row.problems for row in verify(content).topics if row.name == 'joint_states' and row.problems]
    node.destroy_node()


@pytest.mark.thorough
def test_messages_of_a_foreign_node_in_lockstep_are_marked_and_no_loss(tmp_path, graph, rows):
    """The foreign node publishes a message of the type, and bytes of no message."""
    recorder = Recorder(tmp_path / 'b', 'lockstep')
    graph.await_recorder()
    arrival, half = shuffled(rows, 5), len(rows) // 2
    graph.publish(arrival[:half])
    node = rclpy.create_node('stranger', context=graph.context)
    stranger = node.create_publisher(message_class('sensor_msgs/msg/JointState'), 'joint_states', QoSProfile(
        depth=1000, reliability=ReliabilityPolicy.RELIABLE))
    time.sleep(0.5)
    for data in (next(data for name, _, data in rows if name == 'joint_states'), b'\0\1\0\0' + b'\xff' * 20):
        stranger.publish(data)
    assert stranger.wait_for_all_acked(Duration(seconds=LIMIT))
    graph.publish(arrival[half:])
    code, said, err = recorder.end()
    assert (code, err, said['lost'], said['messages']) == (0, '', 0, len(rows) + 2)
    content = bag.read(tmp_path / 'b')
    assert [(name, log, data) for name, log, _, data in content.raw()] == rows
    assert [line.partition(' left out')[0] for line in content.foreign] == ['joint_states: 1 foreign message'] * 2
    assert verify(content).complete
    node.destroy_node()


def refused(tmp_path, *arguments, directory, **options):
    recorder = Recorder(directory, 'realtime', *arguments, **options)
    code, said, err = recorder.end(None)
    assert code == 1 and 'bytes' not in said
    assert err.startswith('recorder') and err.count('\n') == 1
    return err


@pytest.mark.thorough
def test_a_directory_that_exists_or_cannot_be_made_is_refused(tmp_path, domain):
    (tmp_path / 'there').mkdir()
    (tmp_path / 'file').write_text('')
    assert f'{tmp_path / "there"} exists already' in refused(tmp_path, directory=tmp_path / 'there')
    assert 'Not a directory' in refused(tmp_path, directory=tmp_path / 'file' / 'bag')
    assert '/proc/bag: ' in refused(tmp_path, directory='/proc/bag')
    assert not list((tmp_path / 'there').iterdir())


@pytest.mark.thorough
def test_a_full_disk_is_one_line_and_what_was_written_stays_readable(tmp_path, graph, rows):
    size = 400_000

    def small_files():
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    recorder = Recorder(tmp_path / 'b', 'lockstep', preexec_fn=small_files)
    graph.await_recorder()
    graph.publish(shuffled(rows, 3))
    code, said, err = recorder.end(None)
    assert code == 1 and err.count('\n') == 1
    assert f'{tmp_path}/b/b_0.mcap: File too large' in err
    assert said['bytes'] <= size
    content = bag.read(tmp_path / 'b')
    got = [(name, log, data) for name, log, _, data in content.raw()]
    assert len(got) == said['messages'] and got == [row for row in rows if row[1] < 1_000_000_000]
    assert not verify(bag.load(tmp_path / 'b')).problems


def test_a_lockstep_recorder_must_know_the_graph(tmp_path, domain):
    recorder = Recorder(tmp_path / 'b', 'lockstep', nodes=())
    code, _, err = recorder.end(None)
    assert code == 1 and 'graph.nodes' in err and err.count('\n') == 1
