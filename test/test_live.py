"""A running graph in a viewer: one realtime graph under a plain WebSocket client, and what strangers say to it."""
import base64
import contextlib
import json
import os
import pathlib
import pty
import signal
import socket
import struct
import subprocess
import sys
import time

import limited
import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from ikpy.chain import Chain
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from scipy.spatial.transform import Rotation
from shared import PEDESTAL, begins_with, free_port
from websockets.sync.client import connect as open_socket

from pedestal_bringup.scenario.program import program_message
from pedestal_common.geometry import line_of_sight
from pedestal_common.graph import nodes
from pedestal_common.node import middleware
from pedestal_common.wire import messages
from pedestal_operator.viewers import frames
from pedestal_recording import bag as bags

SOON = 60.0
TRACK = 'acu/program_track'
REFERENCES = pathlib.Path(__file__).parents[1] / 'bags' / 'reference'


class Viewer:
    """Speaks the protocol as Lichtblick does. channels: {topic: what was advertised}; heard: {topic: payloads}."""

    def __init__(self, port):
        self._open, deadline = contextlib.ExitStack(), time.monotonic() + 180.0
        while True:
            try:
                self.socket = self._open.enter_context(open_socket(
                    f'ws://127.0.0.1:{port}', max_size=None, close_timeout=0.1,
                    subprotocols=['foxglove.websocket.v1', 'foxglove.sdk.v1']))
                break
            except OSError:
                assert time.monotonic() < deadline
                time.sleep(0.1)
        self.info, self.channels, self.heard, self._topics = None, {}, {}, {}
        self.until(lambda: self.channels)

    def close(self):
        self._open.close()

    def watch(self, *names):
        for name in names:
            number = len(self._topics) + 1
            self._topics[number], self.heard[name] = name, []
            self.socket.send(json.dumps({'op': 'subscribe', 'subscriptions': [
                {'id': number, 'channelId': self.channels[name]['id']}]}))

    def until(self, condition):
        deadline = time.monotonic() + SOON
        while not (value := condition()):
            assert time.monotonic() < deadline, {name: len(heard) for name, heard in self.heard.items()}
            try:
                self._take(self.socket.recv(timeout=0.1))
            except TimeoutError:
                pass
        return value

    def _take(self, data):
        if isinstance(data, bytes):
            assert data[0] == 1
            self.heard[self._topics[struct.unpack_from('<I', data, 1)[0]]].append(data[13:])
            return
        said = json.loads(data)
        if said['op'] == 'serverInfo':
            self.info = said
        elif said['op'] == 'advertise':
            self.channels |= {channel['topic']: channel for channel in said['channels']}

    def decoded(self, name):
        """The last message, by the advertised schema and a reader that is not ours."""
        channel = self.channels[name]
        schema = Schema(id=1, name=channel['schemaName'], encoding=channel['schemaEncoding'],
                        data=channel['schema'].encode())
        return DecoderFactory().decoder_for(channel['encoding'], schema)(self.heard[name][-1])


@pytest.fixture(scope='module')
def graph(station):
    """(Run, Client, port of its WebSocket)."""
    return station.run, station.client, station.ports['foxglove']


@pytest.fixture
def viewer(graph):
    opened = Viewer(graph[2])
    yield opened
    opened.close()


def test_every_topic_of_the_graph_is_offered_with_its_definition(viewer):
    assert viewer.socket.subprotocol == 'foxglove.sdk.v1' and viewer.info['capabilities'] == []
    offered = dict(viewer.channels)
    assert offered.pop('/transforms')['schemaName'] == 'foxglove.FrameTransforms'
    assert offered.pop('/robot_description')['schemaName'] == 'std_msgs/msg/String'
    assert {name: channel['schemaName'] for name, channel in offered.items()} == {
        f'/{name}': link.type for name, link in nodes.links().items()}
    assert {(channel['encoding'], channel['schemaEncoding']) for channel in offered.values()} == {('cdr', 'ros2msg')}


def test_the_bytes_are_those_of_the_graph_and_a_foreign_reader_reads_them(graph, viewer):
    _, client, _ = graph
    for name in ('joint_states', 'tracking_receiver/angle_error', 'diagnostics'):
        link, shown, told = nodes.links()[name], f'/{name}', []
        subscription = client.node.create_subscription(middleware.message_class(link.type), name, told.append,
                                                       middleware.qos(link.rate), raw=True)
        client.until(lambda told=told: told)
        viewer.watch(shown)
        viewer.until(lambda shown=shown: len(viewer.heard[shown]) >= 3)
        shown_last = viewer.heard[shown][-3:]
        client.until(lambda told=told, wanted=set(shown_last): wanted <= set(told))
        client.node.destroy_subscription(subscription)
    read = viewer.decoded('/joint_states')
    ours = messages.deserialize(viewer.heard['/joint_states'][-1], 'sensor_msgs/msg/JointState')
    assert read.name == ['azimuth', 'elevation'] and read.position == list(ours.position)


def test_who_comes_late_gets_what_is_latched(graph):
    for _ in range(2):
        late = Viewer(graph[2])
        late.watch('/acu/mode', '/robot_description')
        late.until(lambda heard=late.heard: all(heard.values()))
        assert late.decoded('/acu/mode').data == 'standby'
        assert late.decoded('/robot_description').data == frames.PEDESTAL_URDF
        late.close()


def test_the_frames_are_told_and_lead_to_the_beam(graph, viewer):
    viewer.watch('/transforms')
    viewer.until(lambda: viewer.heard['/transforms'])
    schema = descriptor_pb2.FileDescriptorSet()
    schema.ParseFromString(base64.b64decode(viewer.channels['/transforms']['schema']))
    pool = descriptor_pool.DescriptorPool()
    for file in schema.file:
        pool.Add(file)
    made = message_factory.GetMessageClass(pool.FindMessageTypeByName('foxglove.FrameTransforms'))
    told = made.FromString(viewer.heard['/transforms'][-1]).transforms
    assert [(one.parent_frame_id, one.child_frame_id) for one in told] == [
        ('earth', 'base_link'), ('base_link', 'azimuth'), ('azimuth', 'elevation'), ('elevation', 'beam')]
    turn = Rotation.identity()
    for one in told:
        turn = turn * Rotation.from_quat([one.rotation.x, one.rotation.y, one.rotation.z, one.rotation.w])
    joints = graph[1].heard['joint_states'][-1].position
    assert turn.apply([1.0, 0.0, 0.0]) == pytest.approx(line_of_sight.earth_direction(*joints), abs=1e-3)


@pytest.mark.thorough
def test_who_does_not_read_holds_up_nobody(graph, viewer):
    _, client, port = graph
    asleep = Viewer(port)
    asleep.watch(*asleep.channels)
    viewer.watch('/joint_states')
    viewer.until(lambda: len(viewer.heard['/joint_states']) > 400)  # while the buffers of the sleeper run over
    first = len(client.heard['joint_states'])
    client.until(lambda: len(client.heard['joint_states']) > first + 20)
    newest = messages.nanoseconds(client.heard['joint_states'][-1].header.stamp)
    viewer.until(lambda: messages.stamp_of(viewer.heard['/joint_states'][-1]) > newest)
    asleep.close()


def test_the_model_is_latched_for_rviz(graph):
    _, client, _ = graph
    heard = []
    client.node.create_subscription(middleware.message_class('std_msgs/msg/String'), 'robot_description', heard.append,
                                    middleware.qos('change'))
    client.until(lambda: heard)
    assert heard[0].data == frames.PEDESTAL_URDF


def track(*points):
    """An acu/program_track of (azimuth, elevation) [rad], a second apart."""
    return program_message(np.arange(float(len(points))), np.array(points))


def refusals(run):
    return (run.log / 'acu.log').read_text().count('acu/program_track refused')


@pytest.mark.thorough
def test_a_program_track_is_taken_once_whether_its_writer_latches_or_not(graph):
    """`ros2 topic pub` does not latch; a writer that does matches both subscriptions of the control unit."""
    run, client, _ = graph
    kind = middleware.message_class('trajectory_msgs/msg/JointTrajectory')
    writers = [client.node.create_publisher(kind, TRACK, profile) for profile in (10, middleware.qos('once'))]
    for count, writer in enumerate(writers, 1):
        client.until(lambda writer=writer: writer.get_subscription_count() >= 4)  # ACU, recorder, page, live
        time.sleep(0.3)                                                # the readers' side of the discovery
        writer.publish(messages.serialize(track((9.0, 9.0), (float('nan'), 9.0))))
        client.until(lambda count=count: refusals(run) >= count)
        time.sleep(0.3)                                                                 # the other subscription
        assert refusals(run) == count


@pytest.mark.thorough
def test_a_viewer_of_its_own_ends_when_told_to(graph, start_process):
    run, _, port = graph
    live = [*PEDESTAL, 'live', '--port']
    taken = start_process([*live, port], ROS_DOMAIN_ID=str(run.domain_id))
    assert taken.wait(60.0) == 1 and f'127.0.0.1:{port}' in taken.stderr.read()
    own = free_port()
    process = start_process([*live, own], ROS_DOMAIN_ID=str(run.domain_id))
    viewer = Viewer(own)
    viewer.watch('/joint_states')
    viewer.until(lambda: viewer.heard['/joint_states'])
    process.send_signal(signal.SIGTERM)
    output, errors = process.communicate(timeout=60.0)
    assert (process.returncode, errors) == (0, '') and f'ws://127.0.0.1:{own}' in output


def test_the_verbs_of_a_terminal_are_served(graph, run_process, start_process, environment):
    """Each once; test_operating.py has the rest. The antenna is in standby afterwards, as before."""
    run, client, _ = graph

    def verb(*arguments):
        return run_process([*PEDESTAL, *arguments], 60.0, ROS_DOMAIN_ID=str(run.domain_id))
    rows = {(row['case'], row['metric']): row['value'] for row in json.loads(verb('status', '--json').stdout)['rows']}
    assert rows['acu', 'mode'] == 'standby'
    assert verb('ask', 'take', '--who', 'hand').returncode == 0
    done = verb('mode', 'preset', '--az', '20', '--el', '35', '--who', 'hand')
    assert (done.returncode, done.stdout) == (0, 'acu: mode is preset, moving\n'), done.stderr
    client.until(lambda: client.heard['acu/mode'][-1].data == 'preset')
    table = start_process([*PEDESTAL, 'program', 'leo_pass'], ROS_DOMAIN_ID=str(run.domain_id))
    assert 'acu/program_track sent' in begins_with(table, 2)
    table.send_signal(signal.SIGINT)
    assert verb('mode', 'standby', '--who', 'hand').returncode == 0
    assert verb('ask', 'release', '--who', 'hand').returncode == 0
    screen, theirs = pty.openpty()
    console = subprocess.Popen([*PEDESTAL, 'operate', '--who', 'hand'], stdin=theirs, stdout=theirs, stderr=theirs,
                               start_new_session=True, env={**environment, 'ROS_DOMAIN_ID': str(run.domain_id),
                                                            'TERM': 'xterm', 'COLUMNS': '120'})
    try:
        os.close(theirs)
        shown = b''
        while b'jog' not in shown:
            shown += os.read(screen, 65536)
        os.write(screen, b'q')
        with contextlib.suppress(OSError):      # the terminal is closed when the console has ended
            while os.read(screen, 65536):
                pass
        assert console.wait(SOON) == 0
    finally:
        limited.kill_tree(console)
        os.close(screen)


@pytest.mark.thorough
def test_the_recording_has_every_track_once(station):
    """That of the scenario, and two that were refused."""
    lengths = [len(track.points) for track in station.recorded(TRACK)]
    assert lengths.count(lengths[0]) == 1 and lengths.count(2) == 2


@pytest.mark.parametrize(('options', 'said'), (
    (['--frames'], '--frames needs --pacing realtime'),
    (['--pacing', 'realtime', '--foxglove'], "--foxglove needs foxglove: pip install 'pedestal_operator[live]'")))
def test_what_cannot_be_is_refused_before_anything_runs(options, said, pedestal, monkeypatch):
    monkeypatch.setitem(sys.modules, 'foxglove', None)
    assert pedestal('run', 'uav_flyby', *options) == (2, '', f'pedestal: error: {said}\n')


@pytest.mark.parametrize('server', ('rotctld', 'easycomm', 'page', 'foxglove'))
def test_a_port_in_use_ends_a_run_before_anything_runs(server, pedestal, tmp_path):
    with socket.create_server(('127.0.0.1', 0)) as taken:
        port = taken.getsockname()[1]
        told = pedestal('run', 'uav_flyby', '--pacing', 'realtime', '--bag', tmp_path / 'bag', f'--{server}', port)
        assert told == (
            2, '', f'pedestal: error: --{server}: port {port} of 127.0.0.1 is in use: --{server} PORT selects another '
            'port\n')
    assert list(tmp_path.iterdir()) == []


def test_the_files_for_viewers_are_written(pedestal, tmp_path):
    code, said, _ = pedestal('live', '--layouts', tmp_path / 'viewers')
    assert code == 0 and str(tmp_path / 'viewers' / 'tracking.json') in said.splitlines()
    assert (tmp_path / 'viewers' / 'pedestal.urdf').read_text() == frames.PEDESTAL_URDF
    assert pedestal('live', '--layouts', tmp_path / 'viewers')[0] == 2


@pytest.mark.parametrize('name', ['leo_pass', 'ship_pass'])
def test_the_model_points_where_the_recorded_antenna_does(name, tmp_path):
    """Recorded encoders through ikpy, the deck by its true attitude: the beam is on the target that it tracks."""
    file = tmp_path / 'pedestal.urdf'
    file.write_text(frames.PEDESTAL_URDF)
    chain = Chain.from_urdf_file(str(file), base_elements=['base_link'], active_links_mask=[False, True, True, False])
    bag = bags.read(REFERENCES / name)
    joints, target, modes = (bag.table(topic) for topic in ('joint_states', 'target/truth', 'acu/mode'))
    begun = modes['t'][list(modes['data']).index('autotrack')] + 1.0
    ship = bag.table('ship/truth') if name == 'ship_pass' else None
    times = [t for t in joints['t'] if t > begun][::50]
    assert len(times) >= 5
    for t in times:
        i, j = (int(np.argmin(np.abs(table['t'] - t))) for table in (joints, target))
        beam = chain.forward_kinematics([0.0, joints['azimuth.position'][i], joints['elevation.position'][i], 0.0])
        deck = line_of_sight.ASHORE_ATTITUDE if ship is None else [
            ship[f'orientation.{axis}'][int(np.argmin(np.abs(ship['t'] - t)))] for axis in 'xyzw']
        seen = np.array([target[f'position.{axis}'][j] for axis in 'xyz'])
        angle = np.arccos(Rotation.from_quat(deck).apply(beam[:3, 0]) @ seen / np.linalg.norm(seen))
        assert angle < 0.5 * 0.0175, t                                                       # half a beamwidth
