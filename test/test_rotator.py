"""The control unit with rotators in place of the drive: Hamlib's rotctld, and simulated ones on pseudo terminals."""
import math
import pathlib
import shutil
import signal
import subprocess
import time

import numpy as np
import pytest
from shared import NODE, PEDESTAL, free_port

from pedestal_common.wire import commands, messages

PARAMETERS = pathlib.Path(__file__).parents[1] / 'docs' / 'how-to' / 'rotator.yaml'
BEAMWIDTH_DEG = 10.0
STEP_TRACK = (f'tracker.receiver.beamwidth:={math.radians(BEAMWIDTH_DEG)}', 'steptrack.cycle:=8.0',
              'steptrack.dwell:=0.8', 'steptrack.step:=0.1')
ROTCTLD = shutil.which('rotctld')


class Device:
    """A rotator: its process, and how the node reaches it."""

    def __init__(self, process, url):
        self.process, self.url = process, url


@pytest.fixture
def device(request):
    """A rotator of a protocol, with its habits behind the name: 'rot2prog pulses=2'."""
    if request.param == 'rotctld':
        if ROTCTLD is None:
            pytest.skip('rotctld is not installed (libhamlib-utils)')
        port = free_port()
        process = subprocess.Popen([ROTCTLD, '-m', '1', '-T', '127.0.0.1', '-t', str(port)])
        yield request.param, Device(process, f'socket://127.0.0.1:{port}')
    else:
        protocol, *habits = request.param.split()
        process = subprocess.Popen([*PEDESTAL, 'simulate', 'rotator', '--protocol', protocol,
                                    *(word for habit in habits for word in ('--habit', habit))],
                                   stdout=subprocess.PIPE, text=True)
        yield protocol, Device(process, process.stdout.readline().strip())
    process.send_signal(signal.SIGCONT)
    process.terminate()
    process.wait(10.0)


@pytest.fixture
def station(device, start_process, connect, reserve_domain):
    """(Client, Device, smallest step [deg]) of a graph of control unit and rotator."""
    domain, (protocol, rotator) = reserve_domain(), device
    def start(module, changes):
        start_process([*NODE, module, '--ros-args', '--params-file', PARAMETERS,
                       *(part for change in changes for part in ('-p', change))], ROS_DOMAIN_ID=str(domain))

    # The control unit is there first, and reports a silent drive until the rotator is there.
    start('acu_node', STEP_TRACK)
    client = connect(domain, f'client_{domain}')
    for name in ('acu/mode', 'acu/command_result', 'acu/alarms', 'diagnostics'):
        client.read(name)
    client.diagnosed('no joint_states', 60.0)
    start('rotator_node', (f'protocol:={protocol}', f'url:={rotator.url}'))
    for name in ('adu/state', 'joint_states'):
        client.read(name)
    client.write('acu/command', 'acu/program_track')
    client.until(lambda: client.heard['adu/state'] and client.heard['adu/state'][-1].data == 'enabled'
                 and client.heard['joint_states'] and client.heard['acu/mode'])
    client.diagnosed('standby', 60.0)      # the control unit has made a step, so it has the angles
    return client, rotator, {'gs232': 1.0}.get(protocol, 0.1)


@pytest.mark.parametrize('simulated', (False, True))
def test_a_control_unit_names_at_its_start_what_the_file_does_not_state(start_process, reserve_domain, simulated):
    process = start_process([*NODE, 'acu_node', '--ros-args', '--params-file', PARAMETERS, '-p',
                             f'graph.simulated:={str(simulated).lower()}'], ROS_DOMAIN_ID=str(reserve_domain()))
    said = ''
    while 'ready, waits for' not in said and (line := process.stderr.readline()):
        said += line
    for text in ('acu.prediction.station.*: not given; set them to the position of the antenna; ',
                 'acu.tracker.receiver.beamwidth = 0.0175 rad: the default; set it to that of'):
        assert (text in said) != simulated, said
    assert 'ready, waits for' in said and 'acu.azimuth.limits' not in said      # the file states the travel


@pytest.mark.thorough
def test_a_control_unit_of_a_real_drive_names_the_models_that_its_structure_does_not_allow(start_process,
                                                                                            reserve_domain):
    structure = ('azimuth.structure.inertia_share:=0.5', 'azimuth.structure.frequency:=8.0')
    process = start_process([*NODE, 'acu_node', '--ros-args',
                             *(part for text in ('graph.nodes:=acu,adu', *structure) for part in ('-p', text))],
                            ROS_DOMAIN_ID=str(reserve_domain()))
    said = ''
    while 'ready, waits for' not in said and (line := process.stderr.readline()):
        said += line
    assert ('the filter uses 3 of its 8 models ca in azimuth (structure of 8 Hz); a faster model would swing the '
            'structure' in said), said
    assert 'acu.azimuth.structure' not in said and 'acu.elevation.structure.*: the defaults; set them to' in said


def ask(client, verb, **arguments):
    """Command the control unit, and wait until it grants the command."""
    assert (reply := asked(client, verb, **arguments)).granted, reply


def asked(client, verb, **arguments):
    """Return the Reply of the control unit to a command."""
    number = str(len(client.heard['acu/command_result']) + 1)
    client.publish('acu/command', commands.message(commands.Command(verb, 'client', number, arguments)))
    reply = client.until(lambda: client.heard['acu/command_result'][int(number) - 1:])[-1]
    return commands.of_reply(reply)[1]


def distance(client, azimuth, elevation):
    """Return the larger distance of an axis from an angle [deg]."""
    return float(np.max(np.abs(np.degrees(client.heard['joint_states'][-1].position) - (azimuth, elevation))))


@pytest.mark.parametrize('device', ('gs232', *(pytest.param(device, marks=pytest.mark.thorough) for device in (
    'rotctld', 'easycomm', 'rot2prog', 'rot2prog pulses=2', 'gs232 elevation=-5', 'gs232 prompt=true'))),
    indirect=True)
def test_a_rotator_goes_where_a_preset_says(station):
    """The mode stays, and no alarm takes the motion of a rotator for uncommanded motion. The last three are the cases
    N4_2, N4_5 and N4_6."""
    client, _, step = station
    ask(client, 'preset', azimuth=math.radians(20.0), elevation=math.radians(12.0))
    client.until(lambda: distance(client, 20.0, 12.0) <= step, told=lambda: str(client.heard['joint_states'][-1]))
    client.diagnosed('follows within')
    raised = {status.name for array in client.heard['acu/alarms'][-1:] for status in array.status}
    assert raised <= {'drive silent'}       # from the start, not acknowledged
    assert client.heard['acu/mode'][-1].data == 'preset'
    assert client.heard['adu/state'][-1].data == 'enabled'
    for mode in ('sun', 'tle'):     # the file of the how-to states no position
        reply = asked(client, mode)
        assert not reply.granted and reply.text.startswith(
            'refused: position of the antenna not given, set `prediction.station.latitude_deg`, ')


@pytest.mark.thorough
@pytest.mark.parametrize('device', ('easycomm turned=true azimuth=90 elevation=40',), indirect=True)
def test_a_rotator_that_runs_away_is_stopped_alarmed_and_reset(station):
    client, _, _ = station
    ask(client, 'preset', azimuth=math.radians(80.0), elevation=math.radians(40.0))
    client.until(lambda: client.heard['adu/state'][-1].data == 'fault: azimuth runs away')
    client.until(lambda: 'drive fault' in {status.name for status in client.heard['acu/alarms'][-1].status})
    client.diagnosed('azimuth went away from 90')
    client.until(lambda: client.heard['acu/mode'][-1].data == 'standby')
    assert 90.0 < math.degrees(client.heard['joint_states'][-1].position[0]) < 102.0
    client.spin(2.0)
    ask(client, 'reset')
    client.until(lambda: client.heard['adu/state'][-1].data == 'enabled')


@pytest.mark.thorough
@pytest.mark.parametrize('device', ('easycomm',), indirect=True)
def test_a_program_track_within_what_the_rotator_can_do(station):
    """1 deg/s in azimuth: the axis stays within the stated accuracy and one period of motion."""
    client, _, _ = station
    begin = messages.nanoseconds(client.heard['joint_states'][-1].header.stamp) + 10_000_000_000
    points = [(begin + round(k * 1e9), math.radians(30.0 + k), math.radians(30.0)) for k in range(-20, 60)]
    client.publish('acu/program_track', program_track(points))
    ask(client, 'program')
    client.until(lambda: messages.nanoseconds(client.heard['joint_states'][-1].header.stamp) > begin + 5_000_000_000)
    first = len(client.heard['joint_states'])
    client.spin(8.0)
    errors = []
    for joints in client.heard['joint_states'][first:]:
        t = (messages.nanoseconds(joints.header.stamp) - begin) * 1e-9
        errors.append(math.degrees(joints.position[0]) - (30.0 + t))
    assert len(errors) > 20 and max(map(abs, errors)) < 0.5, errors
    assert client.heard['acu/mode'][-1].data == 'program'


@pytest.mark.thorough
@pytest.mark.parametrize('device', ('easycomm',), indirect=True)
def test_step_track_finds_the_peak_of_a_level(station):
    """With a beam of 10 deg, whose steps of 1 deg are ten steps of the rotator. The noise is learnt off target."""
    client, _, _ = station
    target, noise = np.array((24.0, 20.0)), np.random.default_rng(1)
    client.write('tracking_receiver/angle_error')

    def off():
        angles = np.degrees(client.heard['joint_states'][-1].position)
        return (angles - target) * (math.cos(math.radians(target[1])), 1.0) / BEAMWIDTH_DEG

    def send(joints):
        error = messages.template('tracking_receiver/angle_error')
        error.header.stamp, error.vector.x, error.vector.y = joints.header.stamp, math.nan, math.nan
        error.vector.z = max(50.0 - 12.0 * float(off() @ off()), 20.0) + 0.02 * noise.standard_normal()
        client.publish('tracking_receiver/angle_error', error)

    ask(client, 'preset', azimuth=math.radians(60.0), elevation=math.radians(20.0))
    client.until(lambda: distance(client, 60.0, 20.0) < 0.1)
    client.read('joint_states', send)
    client.spin(4.0)
    ask(client, 'preset', azimuth=math.radians(21.0), elevation=math.radians(20.0))
    client.until(lambda: distance(client, 21.0, 20.0) < 0.1)
    client.spin(2.0)
    ask(client, 'steptrack')
    client.until(lambda: np.hypot(*off()) < 0.06, told=lambda: f'{off()} beamwidths off')
    assert client.heard['acu/mode'][-1].data == 'steptrack'


def program_track(points):
    """Return a program track of points (stamp [ns], azimuth, elevation [rad])."""
    rows = []
    for stamp, *angles in points:
        row = messages.trajectory_point(2)
        row.positions[:] = angles
        row.time_from_start = messages.Duration(*divmod(stamp - points[0][0], 1_000_000_000))
        rows.append(row)
    track = messages.program_track(rows)
    messages.put_stamp(track.header.stamp, points[0][0])
    return track


@pytest.mark.thorough
@pytest.mark.parametrize('device', ('rotctld',), indirect=True)
@pytest.mark.excused_by(None)
def test_a_rotator_that_vanishes_is_named_and_returns(station):
    """A silent device publishes no angles. The control unit holds its mode for the time of a short silence."""
    client, rotator, step = station
    ask(client, 'preset', azimuth=math.radians(20.0), elevation=math.radians(12.0))
    rotator.process.send_signal(signal.SIGSTOP)
    client.diagnosed('no position for 1 s')
    client.until(lambda: client.heard['adu/state'][-1].data == 'fault: rotator silent')
    count = len(client.heard['joint_states'])
    client.spin(1.0)
    assert len(client.heard['joint_states']) == count
    rotator.process.send_signal(signal.SIGCONT)
    client.until(lambda: client.heard['adu/state'][-1].data == 'enabled')
    since = time.monotonic()
    client.until(lambda: client.heard['acu/mode'][-1].data == 'preset' or time.monotonic() - since > 5.0)
    if client.heard['acu/mode'][-1].data != 'preset':
        ask(client, 'preset', azimuth=math.radians(20.0), elevation=math.radians(12.0))
    client.until(lambda: distance(client, 20.0, 12.0) <= step)
    rotator.process.kill()
    client.until(lambda: client.heard['adu/state'][-1].data == 'fault: rotator silent')
