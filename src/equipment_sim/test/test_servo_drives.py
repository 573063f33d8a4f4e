"""Four servo drives with their simulated mechanics, in simulated time: control, phases, faults, limits."""
import math
import time

import can
import canopen
import numpy as np
import pytest

from drive_law.drive_state import PHASE_ENGAGING_BRAKES
from equipment_sim.drives import law
from equipment_sim.drives.can_drive import CanDrive
from pedestal_hardware import cia402, errors, pdo, servo_drives
from pedestal_hardware.cia402 import State

ENABLED = [cia402.State.OPERATION_ENABLED] * pdo.DRIVE_COUNT


def states(rig):
    return rig.unit.parts['drives']['state'].tolist()


def speeds(rig):
    return [rig.drives.parts['state'][axis]['omega'] for axis in ('azimuth', 'elevation')]


def request(rig, name):
    return rig.unit.request(f'adu/{name}')


@pytest.fixture
def running(rig):
    """A Rig whose axes follow commands."""
    made = rig(initial_elevation=0.5)
    made.run(0.4)
    assert (made.state, states(made)) == ('enabled', ENABLED)
    return made


def test_drives_are_enabled_and_hold_the_axes(running):
    before = running.truth
    running.run(2.0)
    assert np.abs(running.truth - before).max() < 2e-5
    # The unbalance of the elevation, 40 Nm cos E, is held by the integral of this node.
    torque = running.unit.outputs[0]['joint_states']['effort'][1]
    assert torque == pytest.approx(40.0 * math.cos(0.5), abs=6.0)


def test_the_bias_stays(running):
    running.run(5.0, (0.01, 0.005))
    motors = running.unit.outputs[0]['adu/motor_states']['effort']
    for axis in (0, 1):
        assert 0.5 * (motors[2 * axis] - motors[2 * axis + 1]) == pytest.approx(12.0, abs=1.0)


DIVISIONS = {'velocity': {}, 'drive': {'control': 'drive'},
             'torque': {'control': 'torque', 'period': 1e-3, 'bus.bitrate': 2_000_000}}


@pytest.mark.parametrize('control', DIVISIONS)
def test_axes_follow_a_sine(rig, control):
    """The command is the rate of a sine, and a position loop of 12/s at the encoder angle, as an ACU gives it."""
    running = rig(initial_elevation=0.5, **DIVISIONS[control])
    running.run(0.6)
    assert (running.state, states(running)) == ('enabled', ENABLED)
    amplitude, f, errors_seen = math.radians(0.5), 0.05, []
    middle, begin = running.truth, running.now
    for _ in range(round(25.0 / running.p.period)):
        t = (running.now - begin) * 1e-9
        at = amplitude * math.sin(2.0 * math.pi * f * t)
        rate = amplitude * 2.0 * math.pi * f * math.cos(2.0 * math.pi * f * t)
        angle = np.array(running.unit.outputs[0]['joint_states']['position'])
        error = middle + at - angle
        running.step(tuple(rate + 12.0 * error))
        if t > 5.0:
            errors_seen.append(middle + at - running.truth)
    rms = np.degrees(np.std(errors_seen, axis=0)) * 1e3
    assert (rms < 1.0).all(), f'{rms} mdeg'
    motors = running.unit.outputs[0]['adu/motor_states']['effort']
    for axis in (0, 1):
        assert 0.5 * (motors[2 * axis] - motors[2 * axis + 1]) == pytest.approx(12.0, abs=1.5)


def check_stop_and_reset(made, command, reset_s):
    """An emergency stop ends at standstill in spite of a command [rad/s]; a reset enables within a time [s]."""
    made.run(1.0, command)
    assert made.state == 'emergency stop'
    assert np.abs(speeds(made)).max() < 1e-6
    assert request(made, 'reset_faults').granted
    made.run(reset_s)
    assert made.state == 'enabled'


@pytest.mark.parametrize('control', ['drive', 'torque'])
def test_stops_and_lost_motors_of_each_control(rig, control):
    made = rig(initial_elevation=0.5, **DIVISIONS[control])
    made.run(0.6)
    made.run(0.5, (0.3, 0.2))
    assert request(made, 'emergency_stop').granted
    check_stop_and_reset(made, (0.3, 0.2), 0.6)
    law.raise_fault(made.drives.parts['drive'][1], 0x8311)
    made.run(0.5)
    assert made.state == 'enabled: azimuth motor lost'
    before = made.truth
    made.run(1.0, (0.1, 0.0))
    assert made.truth[0] - before[0] == pytest.approx(0.1, abs=2e-3)
    made.run(0.5)
    law.raise_fault(made.drives.parts['drive'][2], 0x8311)
    made.run(1.0)
    # With the control `drive`, motor 2 follows motor 1 and cannot continue without it.
    assert made.state == ('enabled: azimuth and elevation motor lost' if control == 'torque' else
                          'fault: azimuth motor 2 lost, elevation motor 1 lost, elevation motor 2 lost')
    assert request(made, 'reset_faults').granted
    made.run(1.2)
    assert (made.state, states(made)) == ('enabled', ENABLED)


@pytest.mark.parametrize('control', ['drive', 'torque'])
@pytest.mark.parametrize('seconds', [0.008, 0.1])
def test_missing_reports_of_each_control(rig, control, seconds):
    made = rig(initial_elevation=0.5, **DIVISIONS[control])
    made.run(0.6)
    made.run(0.8, (0.2, 0.2))
    made.mute = {0, 1, 2, 3}
    made.run(seconds, (0.2, 0.2))
    held = made.unit.parts['drives']['held'].any()
    assert held == (control == 'torque' and seconds > servo_drives.MAX_BLIND_S)
    assert max(speeds(made)) < 0.22
    made.mute = set()
    made.run(0.8, (0.2, 0.2))
    assert made.state == 'enabled'
    assert speeds(made) == pytest.approx([0.2, 0.2], abs=0.01)


def test_a_stale_command_stops_the_axes(running):
    running.run(1.0, (0.2, 0.1))
    assert np.abs(speeds(running)).min() > 0.09
    running.run(0.4, None)
    assert np.abs(speeds(running)).max() < 1e-3
    assert 'no new acu/rate_command' in running.unit.diagnose().message


@pytest.mark.parametrize('rate', [math.nan, math.inf, 1e9])
def test_an_invalid_command_stops_the_axes(running, rate):
    running.run(0.5, (0.2, 0.1))
    running.run(0.4, (rate, 0.1))
    assert np.abs(speeds(running)).max() < 1e-3
    assert 'acu/rate_command holds NaN or infinity' in running.unit.diagnose().message


def test_disable_closes_the_brakes_and_enable_opens_them(running):
    assert request(running, 'disable').granted
    running.run(1.0)
    assert running.state == 'disabled'
    assert states(running) == [cia402.State.SWITCH_ON_DISABLED] * 4
    assert not running.drives.parts['drive']['power'].any()
    assert request(running, 'enable').granted
    running.run(0.5)
    assert (running.state, states(running)) == ('enabled', ENABLED)


def test_an_emergency_stop_is_a_quick_stop_of_the_drives(running):
    running.run(0.5, (0.5, 0.2))
    assert request(running, 'emergency_stop').granted
    running.run(0.015, (0.5, 0.2))
    assert states(running) == [cia402.State.QUICK_STOP_ACTIVE] * 4
    check_stop_and_reset(running, (0.5, 0.2), 0.5)


def test_the_brakes_close_under_torque_after_an_emergency_stop(running):
    running.run(0.5, (0.0, 0.2))
    assert request(running, 'emergency_stop').granted
    while running.state != 'emergency stop' or running.unit.parts['state']['phase'] != PHASE_ENGAGING_BRAKES:
        running.step()
        assert running.now < 3e9
    before, free_periods = running.truth[1], 0
    for _ in range(round(0.5 / running.p.period)):
        running.step()
        powered = running.drives.parts['drive']['power'][2:].any()
        free_periods += not powered and not running.drives.parts['state']['elevation']['braked']
    assert free_periods == 0
    assert states(running) == [cia402.State.SWITCH_ON_DISABLED] * 4
    # The unbalanced axis would fall by 0.3 mrad more in the time in which the brakes close.
    assert running.truth[1] - before == pytest.approx(0.0, abs=2.5e-4)


FAULTS = {0x8311: 'motor 1 lost', 0xFF12: 'motor 1 lost', 0x2310: 'overcurrent', 0x4310: 'overtemperature',
          0x2350: 'overtemperature', 0x7305: 'encoder disagreement', 0x8611: 'following error'}


@pytest.mark.parametrize('code', FAULTS, ids=hex)
def test_an_error_of_a_drive_is_a_fault_of_its_axis(running, code):
    law.raise_fault(running.drives.parts['drive'][2], code)
    running.run(1.5)
    lost = FAULTS[code].startswith('motor')
    assert running.state == ('enabled: elevation motor lost' if lost else f'fault: elevation {FAULTS[code]}')
    assert dict(running.unit.diagnose().values)['elevation motor 1 error'] == errors.name(code)
    if lost:
        assert states(running)[3] == cia402.State.OPERATION_ENABLED
        before = running.truth
        running.run(1.0, (0.0, 0.05))
        assert running.truth[1] - before[1] == pytest.approx(0.05, abs=2e-3)
        running.run(0.3)
    assert request(running, 'reset_faults').granted
    running.run(1.0)
    assert (running.state, states(running)) == ('enabled', ENABLED)


def test_a_fault_after_a_reset_stays(running):
    law.raise_fault(running.drives.parts['drive'][0], 0x8311)
    running.run(0.5)
    assert request(running, 'reset_faults').granted
    running.run(0.6)
    assert running.state == 'enabled'
    law.raise_fault(running.drives.parts['drive'][2], 0x2310)
    running.run(0.5)
    assert running.state == 'fault: elevation overcurrent'


def test_no_fault_is_reset_without_a_request(running):
    law.raise_fault(running.drives.parts['drive'][0], 0x8311)
    running.run(3.0)
    assert states(running)[0] == cia402.State.FAULT


def test_a_drive_that_falls_silent_is_a_lost_motor_and_returns(running):
    running.absent.add(1)
    running.run(0.6, (0.1, 0.0))
    assert running.state == 'enabled: azimuth motor lost'
    before = running.truth
    running.run(1.0, (0.1, 0.0))
    assert running.truth[0] - before[0] == pytest.approx(0.1, abs=2e-3)
    running.absent.clear()
    running.drives.power_up(1)
    running.commission(1)
    running.run(0.5)
    assert request(running, 'reset_faults').granted
    running.run(1.0)
    assert (running.state, states(running)) == ('enabled', ENABLED)


def test_reports_that_come_now_and_then_are_no_disagreement(running):
    for k in range(120):
        running.absent = {k % 4} if k % 12 < 8 else set()
        running.step((0.5, 0.3))
    assert running.state == 'enabled'
    assert np.abs(speeds(running)).min() > 0.25


def test_a_new_node_takes_over_axes_that_have_moved(running):
    running.run(1.0, (0.6, 0.2))
    before = running.truth
    running.take_over()
    running.absent = {0, 2}
    running.run(0.05)
    running.absent = set()
    running.run(1.0)
    assert (running.state, states(running)) == ('enabled', ENABLED)
    assert running.unit.outputs[0]['joint_states']['position'] == pytest.approx(running.truth, abs=1e-5)
    assert np.abs(running.truth - before).max() < 0.1


def test_without_the_drive_of_the_load_encoder_the_other_motor_gives_the_angle(running):
    running.absent.add(0)
    running.run(0.6)
    running.run(1.0, (0.1, 0.0))
    assert running.state == 'enabled: azimuth motor lost'
    angle = running.unit.outputs[0]['joint_states']['position'][0]
    assert angle == pytest.approx(running.truth[0], abs=2.0 * running.p.azimuth.gear_train.lash)


def test_both_drives_of_an_axis_silent_remove_the_torque(running):
    running.absent |= {2, 3}
    running.run(0.6)
    assert running.state == 'fault: elevation motor 1 lost, elevation motor 2 lost'
    assert [d for d in running.unit.parts['drives']['controlword'] if d] == []


def test_a_limit_switch_stops_motion_beyond_it_only(running):
    running.run(0.3, (0.2, 0.0))
    report = running.drives.measure

    def at_the_switch():
        made = report()
        made['inputs'][0] = servo_drives.INPUT_POSITIVE_LIMIT
        return made
    running.drives.measure = at_the_switch
    running.run(1.0, (0.2, 0.0))
    assert running.state == 'fault: azimuth final limit'
    assert request(running, 'reset_faults').granted
    running.run(0.8)
    running.run(0.5, (-0.1, 0.0))
    assert running.state == 'enabled' and speeds(running)[0] < -0.09


@pytest.mark.parametrize('reversed_1', [False, True])
def test_limit_switches_have_the_directions_of_the_drive(rig, reversed_1):
    made = rig(**{'drives.azimuth.reversed_1': reversed_1})
    made.run(0.4)
    made.run(0.3, (0.2, 0.0))
    assert made.state == 'enabled' and speeds(made)[0] > 0.19
    report, switch = made.drives.measure, [servo_drives.INPUT_POSITIVE_LIMIT, servo_drives.INPUT_NEGATIVE_LIMIT]

    def at_the_switch():
        found = report()
        found['inputs'][0] = switch[pressed]
        return found
    made.drives.measure = at_the_switch
    pressed = 0 if reversed_1 else 1
    made.run(0.1, (0.2, 0.0))
    assert made.state == 'enabled'
    pressed = 1 - pressed
    made.run(0.1, (0.2, 0.0))
    assert made.state == 'fault: azimuth final limit'


@pytest.mark.parametrize('absent', [{0}, {1}, {0, 1}, {0, 1, 2, 3}])
def test_an_axis_keeps_its_motion_while_a_few_reports_are_missing(running, absent):
    running.run(0.8, (0.2, 0.2))
    running.absent = absent
    slowest = math.inf
    for k in range(20):
        if k == 3:
            running.absent = set()
        running.step((0.2, 0.2))
        slowest = min(slowest, *speeds(running))
    assert running.state == 'enabled'
    assert slowest > 0.19


@pytest.mark.parametrize('rate', [0.3, -0.3])
def test_an_axis_without_reports_stops_before_the_end_of_its_travel(rig, rate):
    made = rig(initial_elevation=1.45 if rate > 0.0 else 0.2)
    made.run(0.4)
    limits = made.p.elevation.limits
    to_end = (lambda: limits.upper - made.truth[1]) if rate > 0.0 else (lambda: made.truth[1] - limits.lower)
    while to_end() > 0.02 or made.now < 1e9:
        made.step((0.0, rate))
        assert made.now < 5e9
    # The commanded rate of this place, kept for the whole gap, would lead beyond the end.
    assert abs(speeds(made)[1]) * 0.19 > 1.5 * to_end()
    made.mute = {2, 3}
    made.run(0.19, (0.0, rate))
    assert to_end() > -4e-3
    made.mute = set()
    made.run(1.0, (0.0, rate))
    assert made.state == 'enabled'
    assert to_end() == pytest.approx(0.0, abs=2e-3)


def test_the_node_rests_when_the_drives_are_off(running):
    running.run(0.2, (0.1, 0.1))
    assert request(running, 'disable').granted
    for _ in range(400):
        running.step((0.0, 0.0))
        if running.unit.rests:
            break
    assert running.unit.rests
    assert states(running) == [cia402.State.SWITCH_ON_DISABLED] * 4


def test_the_node_rests_with_a_dead_bus(running):
    assert request(running, 'disable').granted
    running.absent = {0, 1, 2, 3}
    running.run(0.1)
    assert not running.unit.rests
    running.run(0.4)
    assert running.unit.rests


def test_an_open_interlock_is_an_emergency_stop_that_no_reset_ends(running):
    report = running.drives.measure

    def interlocked():
        made = report()
        made['inputs'][2] = servo_drives.INPUT_INTERLOCK
        return made
    running.drives.measure = interlocked
    running.run(1.0)
    assert running.state == 'emergency stop'
    reply = request(running, 'reset_faults')
    assert (reply.granted, 'interlock' in reply.text) == (False, True)


def test_an_axis_does_not_pass_the_end_of_travel(running):
    running.run(2.5, (0.0, 1.5))
    assert running.truth[1] == pytest.approx(running.p.elevation.limits.upper, abs=2e-3)


@pytest.mark.parametrize('fault, text', [
    ('motor_loss axis=azimuth motor=2', 'enabled: azimuth motor lost'),
    ('encoder_jump axis=azimuth size=0.02', 'fault: azimuth encoder disagreement'),
    ('encoder_stuck axis=azimuth', 'fault: azimuth encoder disagreement'),
    ('brake_stuck axis=azimuth state=on', 'enabled'),
    ('lost_tooth axis=azimuth motor=1', 'enabled'),
    ('gust axis=azimuth torque=2000', 'enabled')])
def test_injected_faults_of_the_plant(running, fault, text):
    from pedestal_common.wire.commands import Command
    verb, *arguments = fault.split()
    reply = running.drives.command(Command(verb, arguments=dict(argument.split('=') for argument in arguments)))
    assert reply.granted, reply.text
    from adu_drive import injected
    injected.apply_due_faults(running.drives.parts, running.now)
    running.run(1.5, (0.15, 0.0))
    assert running.state == text
    if verb == 'brake_stuck':
        assert abs(running.unit.outputs[0]['joint_states']['effort'][0]) > 1000.0


@pytest.mark.parametrize('verb', ['pin_stuck', 'drop', 'delay', 'freeze', 'bias', 'nan', 'noise'])
def test_faults_that_no_drive_has_are_refused(running, verb):
    from pedestal_common.wire.commands import Command
    reply = running.drives.command(Command(verb))
    assert not reply.granted
    assert f'{verb}: simulated drives have the faults motor_loss, encoder_jump' in reply.text


def test_every_fault_of_the_drive_unit_is_injected_or_refused():
    from equipment_sim.drives.unit import PLANT_FAULTS
    from pedestal_common.graph.nodes import DRIVE_NODE
    from pedestal_common.injection.table import INJECTED_FAULTS
    refused = {'pin_stuck', 'drop', 'delay', 'freeze', 'bias', 'nan', 'noise'}
    assert {fault.name for fault in INJECTED_FAULTS[DRIVE_NODE]} == {*PLANT_FAULTS} | refused


def test_a_gust_is_compensated(running):
    running.drives.parts['state']['azimuth']['gust'] = 800.0
    before = running.truth
    running.run(3.0)
    assert abs(running.truth[0] - before[0]) < 2e-3
    assert running.state == 'enabled'


@pytest.mark.parametrize('values, text', [
    ({'period': 1e-3}, 'period = 0.001 s: must be at least'),
    ({'bus.bitrate': 125000}, 'must be at least'),
    ({'drives.azimuth.node_1': 2}, 'must be four different nodes'),
    ({'control': 'torque'}, 'period = 0.005 s: must be at most 0.001 s with control = torque'),
    ({'control': 'torque', 'period': 1e-3}, 'period = 0.001 s: must be at least 0.0019 s'),
    ({'bus.interface': 'socketcan', 'bus.bitrate': 2_000_000}, 'bus.bitrate = 2000000: must be at most 1000000'),
    ({'control': 'drive', 'azimuth.speed_loop.disturbance_observer': 20.0}, 'must be 0 with control = drive'),
    ({'elevation.speed_loop.proportional': 100.0}, 'speed_loop.proportional = 100: must be at most 65.535'),
    ({'stow_pins': True}, 'servo drives do not move stow pins'),
    ({'azimuth.speed_loop.structure': 'independent'}, 'must be mean for servo drives')])
def test_parameters_that_do_not_fit(rig, values, text):
    with pytest.raises(ValueError, match=text):
        rig(**values)


@pytest.mark.parametrize('reaction, state', [
    (0, State.OPERATION_ENABLED), (1, State.FAULT_REACTION_ACTIVE), (2, State.SWITCH_ON_DISABLED),
    (3, State.QUICK_STOP_ACTIVE)])
def test_a_simulated_drive_reacts_to_a_lost_connection_by_6007(rig, reaction, state):
    unit = rig().drives
    with can.Bus(interface='virtual', channel='lost connection') as bus:
        drive = CanDrive(canopen.Network(bus), 1, 0, unit)
        drive.record['state'], drive.record['power'] = State.OPERATION_ENABLED, 1
        drive.local.sdo[0x6007].raw = reaction
        drive._supervise(127, 0.01)
        drive._note_heartbeat(0, b'', 0.0)
        time.sleep(0.02)
        drive.watch()
    assert drive.record['state'] == state
