"""A node of the user in the place of ours inside `pedestal run`: the run has recording, results and verdict, and names
a program that does not fit."""
import os
import pathlib
import subprocess

import pytest
from shared import PEDESTAL

from pedestal_bringup.graph import own_programs
from pedestal_bringup.scenario import scenario
from pedestal_common.graph import nodes
from pedestal_recording import bag as bags
from pedestal_recording.verify import verify
from pedestal_results.recorded_run import RecordedRun

HOW_TO = pathlib.Path(__file__).parents[1] / 'docs' / 'how-to'
BEACON = ('run', HOW_TO / 'beacon.yaml', '--receiver')
OWN = '{"tracking_receiver": [["adu/truth"], ["tracking_receiver/angle_error"]]}'

SHIP = """
import math, sys
import rclpy
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_msgs.msg import String

class Ship(Node):
    def __init__(self):
        super().__init__('boat')
        self.truth = self.create_publisher(Odometry, 'ship/truth', 10)
        self.create_subscription(Clock, 'clock', self.step, 10)

    def step(self, clock):
        t = clock.clock.sec + clock.clock.nanosec * 1e-9
        roll, rate = 0.05 * math.sin(0.5 * t), 0.025 * math.cos(0.5 * t)
        ship = Odometry(child_frame_id='base_link')
        ship.header.stamp, ship.header.frame_id = clock.clock, 'earth'
        q, half = ship.pose.pose.orientation, math.sqrt(0.5)
        q.w = q.z = half * math.cos(roll / 2.0)
        q.x = q.y = half * math.sin(roll / 2.0)
        ship.twist.twist.angular.x = rate
        self.truth.publish(ship)

class Ins(Node):
    def __init__(self):
        super().__init__('gyro')
        self.imu = self.create_publisher(Imu, 'ship/imu/data', 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_publisher(String, 'ins/state', latched).publish(String(data='aligned'))
        self.create_subscription(Odometry, 'ship/truth', self.step, 10)

    def step(self, ship):
        self.imu.publish(Imu(header=ship.header, orientation=ship.pose.pose.orientation,
                             angular_velocity=ship.twist.twist.angular))

rclpy.init()
rclpy.spin({'ship': Ship, 'ins': Ins}[sys.argv[1]]())
"""

UNFIT = """
import sys
import rclpy
from geometry_msgs.msg import Vector3Stamped
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import String
fault = sys.argv[1]
rclpy.init()
node = Node('mine')
if fault == 'dies':
    raise SystemExit('no device at the port')
if fault == 'quality':
    node.create_publisher(Vector3Stamped, 'tracking_receiver/angle_error', qos_profile_sensor_data)
else:
    node.create_publisher(String if fault == 'type' else Vector3Stamped, 'tracking_receiver/angle_error', 10)
if fault == 'owner':
    node.create_publisher(String, 'acu/mode', 10)
rclpy.spin(node)
"""


def test_the_graph_of_a_program_has_the_topics_that_it_publishes():
    graph = nodes.links(own=OWN)
    assert 'target/truth' not in graph and 'tracking_receiver/inject' not in graph
    assert graph['tracking_receiver/angle_error'].writers == ('tracking_receiver',)
    assert graph['adu/truth'].readers == ('tracking_receiver',)
    ins = '{"ins": [[], ["ship/imu/data"]]}'
    assert 'ins/state' not in nodes.reads(nodes.row('acu'), ('acu', 'ins'), (), ins)
    assert 'ins/state' in nodes.reads(nodes.row('acu'), ('acu', 'ins'))
    for wrong in ('[]', '{"acu": [[], []]}', '{"ins": [[], ["nothing"]]}', '{"ins": 5}', 'no JSON'):
        with pytest.raises(ValueError, match='own = '):
            nodes.own_rows(wrong)


@pytest.mark.parametrize('changes, topics', [
    (('scenario.own.receiver=a.py',), {'tracking_receiver/angle_error': ['acu']}),
    (('scenario.pacing=realtime', 'scenario.own.drive=a.py'),
     {'clock': ['recorder'], 'joint_states': ['acu'], 'adu/truth': ['tracking_receiver']})])
def test_a_program_must_publish_what_the_others_wait_for(changes, topics):
    chosen = scenario.load('uav_flyby', changes)
    assert own_programs.needed(chosen, *chosen.own) == topics


@pytest.mark.every_case
@pytest.mark.parametrize('options, text', [
    (('--receiver', 'simulated-i'), "own.receiver = 'simulated-i': must begin with FILE.py or PACKAGE/EXECUTABLE"),
    (('--receiver', 'none.py 5'), 'none.py: no such file'),
    (('--receiver', 'my_package/my_node'), 'my_package/my_node: no such executable in AMENT_PREFIX_PATH'),
    (('--ins', 'a.py'), 'own.ins = a.py: needs ship = true')])
def test_a_program_that_cannot_start_is_refused(options, text, pedestal):
    code, _, errors = pedestal('run', 'uav_flyby', *options)
    assert code and errors.startswith('pedestal: error: ') and text in errors, errors


def run(folder, domain, *options):
    """Return (exit code, output, recording) of a run with separate nodes."""
    done = subprocess.run([*PEDESTAL, *map(str, options), '--bag', 'bag'], cwd=folder,
                          capture_output=True, text=True, env={**os.environ, 'ROS_DOMAIN_ID': str(domain)})
    return done.returncode, done.stdout + done.stderr, folder / 'bag'


@pytest.mark.thorough
def test_a_receiver_of_ones_own_in_lockstep(tmp_path, reserve_domain):
    """Its truth is the truth: a truth that lies 0.5 deg beside its errors is a pointing error of 0.5 deg."""
    code, text, path = run(tmp_path, reserve_domain(), *BEACON, HOW_TO / 'beacon.py')
    assert code == 0 and 'tracked 80 % of 10 s' in text and 'publishes target/truth' in text, text
    known = RecordedRun(bags.read(path))
    assert verify(bags.read(path)).finished and known.parts['tracking'].pointing(lambda e: abs(e).max()) < 0.005
    lying = tmp_path / 'lying.py'
    lying.write_text((HOW_TO / 'beacon.py').read_text().replace(
        'math.sin(ELEVATION_RAD)', 'math.sin(ELEVATION_RAD + math.radians(0.5))'))
    (tmp_path / 'second').mkdir()
    code, text, path = run(tmp_path / 'second', reserve_domain(), *BEACON, lying)
    wrong = RecordedRun(bags.read(path)).parts['tracking']
    assert code == 0 and 0.4 < wrong.pointing(lambda e: abs(e).mean(), 1) < 0.6, text


@pytest.mark.thorough
def test_a_receiver_without_truth_has_its_own_errors_as_results(tmp_path, reserve_domain):
    blind = tmp_path / 'blind.py'
    blind.write_text(''.join(line for line in (HOW_TO / 'beacon.py').read_text().splitlines(True)
                             if 'truths' not in line))
    code, text, path = run(tmp_path, reserve_domain(), *BEACON, blind)
    assert code == 0 and 'no comparison with the truth: no message of target/truth' in text, text
    assert 'measured_pointing_rms_deg' in text and ' pointing_rms_deg' not in text and 'loss_s' not in text
    assert verify(bags.read(path)).finished


@pytest.mark.thorough
def test_a_ship_and_an_ins_of_ones_own_in_lockstep(tmp_path, reserve_domain):
    (tmp_path / 'ship.py').write_text(SHIP)
    code, text, path = run(tmp_path, reserve_domain(), 'run', 'ship_pass', '--duration', '4', '--ship', 'ship.py ship',
                           '--ins', 'ship.py ins')
    assert code == 0 and 'first lock at' in text and verify(bags.read(path)).finished, text
    assert 'ship/imu/data_raw' not in bags.read(path).topics
    assert bags.read(path).table('ins/state')['data'] == ['aligned']


@pytest.mark.thorough
@pytest.mark.parametrize('fault, text', [
    ('quality', 'has the quality of service BEST_EFFORT, VOLATILE: must be RELIABLE, VOLATILE'),
    ('type', 'has the type std_msgs/msg/String: must be geometry_msgs/msg/Vector3Stamped'),
    ('owner', 'publishes acu/mode, which belongs to another node'),
    ('dies', 'ended with exit code 1; its last log lines')])
def test_a_program_that_does_not_fit_is_named(fault, text, tmp_path, reserve_domain):
    (tmp_path / 'mine.py').write_text(UNFIT)
    code, printed, _ = run(tmp_path, reserve_domain(), 'run', 'uav_flyby', '--receiver', f'mine.py {fault}')
    assert code == 1 and text in printed and 'mine.py' in printed, printed


@pytest.mark.thorough
def test_a_drive_of_ones_own_in_lockstep(tmp_path, reserve_domain):
    """It makes the steps: the run is complete, and the same each time. A drive that stops is named."""
    drive = HOW_TO / 'simulated_drive.py'
    code, text, path = run(tmp_path, reserve_domain(), 'run', 'uav_flyby', '--duration', '3', '--drive', drive)
    recording = bags.read(path)
    assert code == 0 and 'first lock at' in text and verify(recording).complete, text
    assert len(recording.rows('joint_states')) == 601
    stops = tmp_path / 'stops.py'
    stops.write_text(drive.read_text().replace(
        '        self.k += 1\n', '        if self.k == 400:\n            return\n        self.k += 1\n'))
    (tmp_path / 'second').mkdir()
    code, text, path = run(tmp_path / 'second', reserve_domain(), 'run', 'uav_flyby', '--duration', '3', '--drive',
                           stops, '--param', 'scenario.deadline=8')
    assert code == 1 and 'adu has fallen silent' in text, text
    again = bags.read(path).table('joint_states')['azimuth.position']
    assert again.tolist() == recording.table('joint_states')['azimuth.position'][:len(again)].tolist()
