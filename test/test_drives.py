"""Servo drives in realtime, on a bus of sockets: what a user sees of a healthy antenna and of each thing that fails.

The drives and their node run alone; the test is the control unit, and a second client of the bus."""
import contextlib
import json
import re
import signal
import socket
import struct
import subprocess
import time

import can
import canopen
import pytest
from shared import PEDESTAL, free_port
from std_srvs.srv import Trigger
from test_how_to import FILE, Amplifiers

from pedestal_bringup.graph import processes
from pedestal_bringup.graph.start import START_LEAD_TIME_S
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.sections import ScenarioError
from pedestal_common.wire import messages
from pedestal_recording.bag import load
from pedestal_recording.verify import verify

PRIORITY = ('-p', 'graph.priority:=10')
SOON = 40.0
START = 180.0
"""Seconds in which both nodes have compiled their laws and the drives answer."""

RATE_DRIVE = FILE.with_name('rate_drive.py')

HEARTBEAT = 0.25
STOP = 0.15
"""Seconds in which a drive ramps to standstill from the rate of the test, and closes its brake."""

BUSY = 0.5
"""Seconds for which a busy machine may hold up even a process with priority."""

LABELS = ('azimuth motor 1', 'azimuth motor 2', 'elevation motor 1', 'elevation motor 2')


class Bench:
    """Four simulated drives, and the node that commands them. The test sends frames on the bus, and looks at the
    drives through the diagnostics of both nodes: a busy machine would not let it read every frame."""

    def __init__(self, start_node, connect):
        self.port = free_port()
        self.start_node = start_node
        self.arguments = ('-p', f'bus.port:={self.port}', '-p', 'command_timeout:=400', '-p', 'initial_elevation:=0.5',
                          '-p', 'graph.nodes:=drives,adu', '-p', f'bus.connect_time:={START}', *PRIORITY)
        self.drives = start_node('drives', *self.arguments)
        self.domain = self.drives.domain_id
        self.node = self.start()
        self.client = connect(self.domain)
        self.values = {}
        self.client.read('joint_states')
        self.client.read('adu/state')
        self.client.read('diagnostics', self._note)
        self.client.write('acu/rate_command')
        self.until_state('enabled', START)

    def _note(self, message):
        for status in message.status:
            self.values[status.name] = {value.key: value.value for value in status.values}

    def start(self):
        return self.start_node('drive', *self.arguments, domain_id=self.domain)

    def until_state(self, text, timeout=SOON):
        heard = self.client.heard['adu/state']
        self.client.until(lambda: heard and heard[-1].data == text, timeout, lambda: [text.data for text in heard])

    def until_drives(self, text, drives=LABELS):
        """Wait until the simulated drives state this state."""
        self.client.until(lambda: all(self.values.get('drives', {}).get(f'{label} drive') == text for label in drives),
                          SOON, lambda: self.values.get('drives'))

    def command(self, azimuth, seconds):
        """Command a rate for a time. Return the azimuth before and after."""
        message = messages.template('acu/rate_command')
        before, end = self.azimuth, time.monotonic() + seconds
        while time.monotonic() < end:
            messages.put_stamp(message.header.stamp, time.time_ns())
            message.velocity[:], message.effort[:] = [azimuth, 0.0], [0.0, 0.0]
            self.client.publish('acu/rate_command', message)
            self.client.spin(0.05)
        return before, self.azimuth

    @property
    def azimuth(self):
        return self.client.heard['joint_states'][-1].position[0]

    def send(self, cob, data):
        """Send a frame on the bus."""
        with socket.create_connection(('127.0.0.1', self.port), SOON) as connection:
            connection.sendall(f'< open can0 >< send {cob:X} {len(data)} {data.hex(" ")} >'.encode())
            time.sleep(0.2)

    def rehearse(self, drive, subindex, value):
        """Write one of the objects of the simulated drives by which a fault is rehearsed, by SDO."""
        self.send(0x601 + drive, struct.pack('<BHBHxx', 0x2B, 0x2F00, subindex, value))

    def reset(self):
        """Reset the faults when the axes stand, and wait until the axes follow again."""
        end = time.monotonic() + SOON
        self.command(0.0, 0.5)
        while not (reply := self.client.call('adu/reset_faults', Trigger, Trigger.Request())).success:
            assert time.monotonic() < end, reply.message
            self.command(0.0, 0.3)
        self.until_state('enabled')


@pytest.fixture(scope='module')
def bench(start_node, connect):
    made = Bench(start_node, connect)
    yield made
    made.client.close()


def test_the_axes_follow_a_rate(bench):
    bench.until_drives('operation enabled')
    before, after = bench.command(0.2, 1.5)
    assert after - before > 0.1
    bench.command(0.0, 0.3)


@pytest.mark.thorough
def test_a_fault_of_a_drive_is_named_and_reset_on_request(bench):
    bench.rehearse(1, 1, 0x8311)
    bench.until_state('enabled: azimuth motor lost')
    bench.client.until(lambda: bench.values['adu']['azimuth motor 2 error'] == '0x8311 excess torque')
    before, after = bench.command(0.2, 1.0)
    assert after - before > 0.05
    bench.reset()
    bench.rehearse(2, 1, 0x2310)
    bench.until_state('fault: elevation overcurrent')
    bench.reset()


@pytest.mark.thorough
def test_a_drive_that_drops_off_the_bus_is_a_lost_motor_and_returns(bench):
    bench.rehearse(3, 2, 1500)
    bench.until_state('enabled: elevation motor lost')
    bench.client.until(lambda: bench.values['adu']['elevation motor 2 drive'] == 'switch on disabled', SOON,
                       lambda: bench.values['adu'])
    bench.reset()
    bench.until_drives('operation enabled')


@pytest.mark.excused_by('missed_steps')
@pytest.mark.thorough
def test_a_killed_node_stops_the_drives_and_a_new_node_goes_on(bench):
    bench.command(0.3, 1.0)
    bench.node.process.send_signal(signal.SIGKILL)
    bench.until_drives('fault')
    assert {bench.values['drives'][f'{label} drive'] for label in LABELS} == {'fault'}
    # A node that starts clears the error that its absence made.
    heard = len(bench.client.heard['adu/state'])
    bench.node = bench.start()
    bench.client.until(lambda: 'enabled' in [text.data for text in bench.client.heard['adu/state'][heard:]], SOON)
    before, after = bench.command(0.2, 1.0)
    assert after - before > 0.05


@pytest.mark.thorough
def test_a_short_frame_is_named_and_dropped(bench):
    bench.send(0x181, b'abc')
    bench.command(0.0, 0.2)
    bench.node.process.send_signal(signal.SIGTERM)
    result = bench.node.finish(SOON)
    assert 'azimuth motor 1: frame 0x181 has 3 bytes: must have 8' in result.stderr
    assert result.returncode == 0
    # The node has disabled the drives, and has left the bus.
    bench.until_drives('switch on disabled')


@pytest.mark.thorough
@pytest.mark.parametrize('argument, text', [
    ('drives.azimuth.node_2:=9', r'azimuth motor 2 \(node 9\): object 1000:0: no answer within 0\.3 s'),
    ('elevation.thermal.rated_torque:=300.0', r'elevation motor 1 \(node 3\): object 6076: rated torque 30000'),
    ('bus.port:=1', r'azimuth motor 1 \(node 1\): no socketcand bus can0 at 127\.0\.0\.1:1: '
                    r'.*Connection refused')], ids=['node', 'torque', 'port'])
def test_a_bus_that_does_not_fit_is_named(bench, start_node, argument, text):
    alone = start_node('drive', *bench.arguments, '-p', 'bus.connect_time:=2.0', '-p', argument)
    result = alone.finish(SOON)
    assert result.returncode == 1
    assert re.search(text, result.stderr), result.stderr


@pytest.mark.thorough
def test_the_drives_had_stopped_within_the_time_of_the_heartbeat(bench):
    """After all other tests of the bench: its drives end, and have logged what they did without their node."""
    bench.drives.process.send_signal(signal.SIGTERM)
    said = bench.drives.finish(SOON).stderr
    missed = [float(text) for text in re.findall(r'no heartbeat of node 127 for ([0-9.]+) s', said)]
    off = [float(text) for text in re.findall(r'the motor is off ([0-9.]+) s after the last heartbeat', said)]
    assert len(missed) >= 4 and len(off) >= 4, said
    assert min(missed) >= HEARTBEAT and max(missed[:4]) < HEARTBEAT + BUSY
    assert max(off[:4]) < HEARTBEAT + STOP + BUSY


@pytest.mark.excused_by('missed_steps')
@pytest.mark.thorough
def test_a_bus_that_vanishes_and_returns(bench, start_node):
    """After the last test of the first drives: their program is killed under a running node, and started again."""
    def drives():
        return start_node('drives', *bench.arguments, domain_id=bench.domain)
    vanishing = drives()
    bench.node = bench.start()
    bench.until_state('enabled')
    vanishing.process.send_signal(signal.SIGKILL)
    bench.until_state('fault: ' + ', '.join(f'{label} lost' for label in LABELS))
    bench.drives = drives()
    bench.client.until(lambda: [bench.values['adu'].get(f'{label} drive') for label in LABELS] == [
        'switch on disabled'] * len(LABELS), SOON, lambda: bench.values['adu'])
    bench.reset()
    before, after = bench.command(0.2, 1.0)
    assert after - before > 0.05


@pytest.mark.thorough
def test_a_device_of_another_profile_is_named(start_node):
    port = free_port()
    arguments = ('-p', f'bus.port:={port}', '-p', 'bus.connect_time:=5.0')
    drives = start_node('drives', *arguments, '-p', 'drives.profile:=401')
    result = start_node('drive', *arguments, domain_id=drives.domain_id).finish(SOON)
    assert result.returncode == 1
    assert 'object 1000: device profile 401: must be 402' in result.stderr


@pytest.mark.thorough
def test_a_pass_is_tracked_with_simulated_drives(start_run, patient):
    run = start_run('leo_pass', '--pacing', 'realtime', '--drives', 'simulated', '--duration', '6', *patient,
                    '--param', 'adu.period=0.01', '--param', 'scenario.priority=10')
    result = run.finish()
    assert result.returncode in (0, 3), result.stderr    # 3: a busy machine, which lost steps
    assert 'metric' in result.stdout
    rows = {row['metric']: row['value'] for row in json.loads(run.json.read_text())['rows']}
    assert rows['pointing_max_deg'] < 0.2
    recording = load(run.bag)
    assert verify(recording).complete
    log = processes.log_folder(run.bag)
    answer = float(re.search(r'\[([0-9.]+)\] \[adu\]: drives 1, 2, 3, 4 answer', (log / 'adu.log').read_text())[1])
    [start] = set(re.findall(r'graph\.start: ([0-9]+)', (log / 'parameters.yaml').read_text()))
    # Time 0 follows the answer of the drives, by whole seconds from a time that was known before.
    assert START_LEAD_TIME_S - 0.1 < int(start) * 1e-9 - answer < START_LEAD_TIME_S + 1.1
    truth, angles = recording.table('adu/truth'), recording.table('joint_states')
    assert len(truth['t']) > 0.5 * len(angles['t'])


def test_the_control_unit_knows_the_delay_of_the_bus():
    changes = ['scenario.drives=simulated', 'adu.period=0.01']
    assert scenario.load('leo_pass', changes, pacing='realtime').given('acu')['command_delay'] == 0.01
    changes.append('acu.command_delay=0.02')
    assert scenario.load('leo_pass', changes, pacing='realtime').given('acu')['command_delay'] == 0.02


@pytest.mark.thorough
def test_lockstep_has_no_drives():
    done = subprocess.run([*PEDESTAL, 'run', 'leo_pass', '--drives', 'simulated', '--pacing', 'lockstep'],
                          capture_output=True, text=True, timeout=60.0)
    assert done.returncode == 2
    assert 'graph.pacing = lockstep: must be realtime for servo drives' in done.stderr


@pytest.mark.parametrize('change, message', [
    ('bus.interface=socketcan', 'bus.interface = socketcan: must be socketcand'),
    ('bus.host=192.168.1.9', 'bus.host = 192.168.1.9: must be 127.0.0.1')])
def test_simulated_drives_have_a_bus_of_this_machine(change, message):
    with pytest.raises(ScenarioError, match=f'{message} with drives = simulated'):
        scenario.load('leo_pass', ['scenario.drives=simulated', f'adu.{change}'], pacing='realtime')


@pytest.mark.thorough
def test_pedestal_simulate_drives_serves_a_bus(start_process):
    port = free_port()
    process = start_process([*PEDESTAL, 'simulate', 'drives', '--port', port])
    end = time.monotonic() + SOON
    while True:
        with contextlib.suppress(OSError):
            network = canopen.Network(can.Bus(interface='socketcand', channel='can0', host='127.0.0.1', port=port))
            break
        assert time.monotonic() < end and process.poll() is None
        time.sleep(0.2)
    network.connect()
    objects = network.add_node(canopen.RemoteNode(2, canopen.ObjectDictionary())).sdo
    assert struct.unpack('<I', objects.upload(0x1000, 0))[0] & 0xFFFF == 402
    network.disconnect()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=SOON)
    assert process.returncode in (0, 130)
    assert f'on socketcand can0 at 127.0.0.1:{port}' in said


@pytest.mark.thorough
def test_a_drive_of_ones_own_in_realtime(start_run):
    """A busy machine holds it up for a while; the control unit keeps its mode, and tracks when the drive goes on."""
    motors = Amplifiers((0.1, 0.4))
    motors.start()
    run = start_run('uav_flyby', '--pacing', 'realtime', '--duration', '20', '--param', 'adu.period=0.02', '--drive',
                    f'{RATE_DRIVE} {motors.port} --truth')
    done = run.finish()
    assert done.returncode == 0 and 'first lock at' in done.stdout, done
    recording = load(run.bag)
    assert verify(recording).finished and 'adu/motor_states' not in recording.topics
    assert recording.table('joint_states')['t'][0] >= 0.0 and recording.table('joint_states')['t'][-1] < 20.1
