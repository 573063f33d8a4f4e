"""A ship scenario in realtime with ins_input_node in the place of ins_node: NMEA sentences of `pedestal simulate ins`,
and the Imu of a driver with a wrong frame."""
import math
import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shared import NODE, PEDESTAL, free_port

from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.program import Plan
from pedestal_common.text_files import parameter_file
from pedestal_common.wire import commands, messages
from ship_motion_sim import motion

NODES = {'ship_motion': 'ship_motion_node', 'acu': 'acu_node',
         'tracking_receiver': 'tracking_receiver_node', 'adu': 'adu_node'}
INPUT = 'ins_input_node'


@pytest.mark.thorough
def test_a_ship_scenario_tracks_with_an_ins_that_sends_nmea(patient, start_process, connect, reserve_domain, tmp_path):
    """The control unit comes to autotrack, the attitude is that of the ship. An INS that vanishes is named, and the
    control unit tracks after its return."""
    changes = [*patient[1::2], 'ins.error_told=false', 'acu.tracker.lock_count=20', 'scenario.program.time_offset=0',
               'acu.initial_mode=standby']
    chosen, port, domain = scenario.load('ship_pass', changes, pacing='realtime'), free_port(), reserve_domain()
    for node in NODES:
        chosen.unit(node).prepare()         # compiles the laws, before the pass begins
    start = time.time_ns() + 5_000_000_000
    shared = {'graph.pacing': 'realtime', 'graph.nodes': ','.join((*NODES, 'ins')), 'graph.start': start}
    file = tmp_path / 'parameters.yaml'
    file.write_text(parameter_file.text({
        **{node: {**chosen.given(node), **shared} for node in NODES},
        'ins': {**shared, 'nmea.url': f'udp://127.0.0.1:{port}', 'stamp': 'device'}}))
    for module in (*NODES.values(), INPUT):
        start_process([*NODE, module, '--ros-args', '--params-file', file], ROS_DOMAIN_ID=str(domain))

    def simulated():
        return start_process([*PEDESTAL, 'simulate', 'ins', '--scenario', 'ship_pass', '--port', port, '--start',
                              start])
    device = simulated()
    client = connect(domain, 'ins')
    client.write('acu/program_track', 'acu/command')
    client.publish('acu/program_track', Plan(chosen).tracks['acu/program_track'])
    for name in ('acu/mode', 'acu/command_result', 'diagnostics', 'ship/imu/data', 'ins/state',
                 'tracking_receiver/angle_error'):
        client.read(name)
    client.diagnosed('receives attitudes', 60.0)
    client.diagnosed('standby (', 60.0)      # the control unit has made a step
    track(client)
    client.spin(2.0)
    first = {name: len(heard) for name, heard in client.heard.items()}
    client.spin(6.0)
    assert [mode.data for mode in client.heard['acu/mode']][-1] == 'autotrack'
    assert client.heard['ins/state'][-1].data == 'aligned'
    said = [status.message for array in client.heard['diagnostics'][first['diagnostics']:] for status in array.status]
    assert not [text for text in said if 'invalid' in text or 'dropped' in text]
    errors = [(error.vector.x, error.vector.y) for error in
              client.heard['tracking_receiver/angle_error'][first['tracking_receiver/angle_error']:]]
    pointing = math.degrees(math.sqrt(np.mean(np.square(errors))))
    attitude, rates = deviations(client.heard['ship/imu/data'][first['ship/imu/data']:], chosen, start)
    print(f'receiver error {pointing:.4f} deg rms, attitude {attitude:.4f} deg max, rates {rates:.3f} deg/s rms')
    assert pointing < 0.05 and attitude < 2e-3 and rates < 0.05
    device.kill()
    client.diagnosed('nothing published for')
    simulated()
    client.diagnosed('receives attitudes', 60.0)
    track(client)


def track(client):
    """Command the program track until the control unit tracks, as an operator does. On a busy machine an encoder may
    be late, or the receiver's errors may diverge: the control unit then refuses the command, or holds the axes."""
    for number in range(12):
        if number:
            client.trigger('acu/reset_faults')
        client.publish('acu/command', commands.message(commands.Command('program', 'client', f'{time.monotonic()}')))
        for _ in range(5):
            client.spin(1.0)
            if [mode.data for mode in client.heard['acu/mode']][-1:] == ['autotrack']:
                return
    pytest.fail(f'no autotrack: {client.heard["acu/command_result"][-3:]}, {client.heard["diagnostics"][-1:]}')


def deviations(samples, chosen, start):
    """Return (largest error of the attitude [deg], rms error of the rates [deg/s]) against the law of the ship."""
    [constants], [truth] = motion.constants(chosen.node_parameters('ship_motion').ship), np.zeros(
        1, motion.Truth.dtype)
    attitudes, rates = [], []
    assert len(samples) > 100
    for sample in samples:
        motion.truth(constants, (messages.nanoseconds(sample.header.stamp) - start) * 1e-9, truth)
        q, w = sample.orientation, sample.angular_velocity
        attitudes.append((Rotation.from_quat((q.x, q.y, q.z, q.w)) * Rotation.from_quat(truth['quaternion']).inv())
                         .magnitude())
        rates.append(np.subtract((w.x, w.y, w.z), truth['angular_velocity']))
    return math.degrees(max(attitudes)), math.degrees(math.sqrt(np.mean(np.square(rates))))


@pytest.mark.thorough
def test_the_wrong_frame_of_a_driver_ends_its_attitude_within_10_s(start_process, connect, reserve_domain):
    """A driver like NovAtel's, at 50 Hz, whose rates have the axes right, forward, up. The deck rolls."""
    domain = reserve_domain()
    start_process([*NODE, INPUT, '--ros-args', '-p', 'source:=imu', '-p', 'imu.topic:=driver/imu', '-p',
                   'imu.earth:=nwu', '-r', 'driver/imu:=ship/imu/data_raw'], ROS_DOMAIN_ID=str(domain))
    client = connect(domain, 'driver')
    for name in ('ship/imu/data', 'ins/state', 'diagnostics'):
        client.read(name)
    client.write('ship/imu/data_raw')
    message, begin = messages.template('ship/imu/data_raw'), time.monotonic()
    heard, k = client.heard['ship/imu/data'], 0
    while (t := time.monotonic() - begin) < 9.0:
        for target, names, numbers in (
                (message.orientation, 'xyzw', Rotation.from_euler('x', 8.0 * math.sin(t), degrees=True).as_quat()),
                (message.angular_velocity, 'xyz', (0.0, math.radians(8.0) * math.cos(t), 0.0))):
            for name, number in zip(names, numbers):
                setattr(target, name, float(number))
        messages.put_stamp(message.header.stamp, time.time_ns())
        client.publish('ship/imu/data_raw', message)
        k += 1
        client.spin(max(begin + 0.02 * k - time.monotonic(), 0.0))
    assert [state.data for state in client.heard['ins/state']] == ['aligning', 'aligned', 'aligning']
    assert time.time_ns() - messages.nanoseconds(heard[-1].header.stamp) > 1_000_000_000
    assert 'imu.rate_body = rfu' in client.diagnosed('wrong frame').message


@pytest.mark.parametrize('given, reason', [
    (('--rate', 0), '--rate 0 Hz: must be 0.1 to 200'), (('--port', 0), '--port 0: must be 1 to 65535'),
    (('--scenario', 'leo_pass'), 'leo_pass: has no ship'), (('--scenario', 'ship_pas'), 'ship_pass')])
def test_wrong_options_of_the_simulated_ins_are_named(given, reason, pedestal):
    code, _, errors = pedestal('simulate', 'ins', *given)
    assert code == 2 and reason in errors
