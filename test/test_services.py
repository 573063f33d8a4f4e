"""The ACU's modes by service, and what it says to bad input: one node alone under a client that plays the rest."""
import math
import signal
import time

import numpy as np
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters

from pedestal_bringup.scenario.program import program_message
from pedestal_common.node import middleware
from pedestal_common.wire import messages

PERIOD = 5_000_000
JOINTS, ERROR = 'joint_states', 'tracking_receiver/angle_error'


class Plant:
    """Encoders at rest whose last bit flickers, or they would be frozen, and a receiver that sees the target in the
    beam; each step waits for the ACU's command."""

    def __init__(self, client):
        self.client = client
        self.stamp = 0
        client.write(JOINTS, ERROR, 'acu/program_track')
        for name in ('acu/rate_command', 'acu/mode', 'diagnostics'):
            client.read(name)

    def step(self, count=1, position=(0.1, 0.5), error=(0.0, 0.0, 60.0), jump=0, velocity=(0.0, 0.0)):
        """Publish count steps, each after the answer to the one before: of a backlog a node takes the newest."""
        self.stamp += jump
        for _ in range(count):
            self.stamp += PERIOD
            joints = messages.template('joint_states')
            messages.put_stamp(joints.header.stamp, self.stamp)
            joints.position[:] = position[0], position[1] + 1e-6 * (self.stamp // PERIOD % 2)
            joints.velocity[:] = velocity
            self.client.publish(JOINTS, joints)
            measured = messages.Vector3Stamped(header=messages.header('beam'), vector=messages.vector3(*error))
            messages.put_stamp(measured.header.stamp, self.stamp)
            self.client.publish(ERROR, measured)
            self.answered()

    def answered(self):
        commands = self.client.heard['acu/rate_command']
        self.client.until(lambda: commands and messages.nanoseconds(commands[-1].header.stamp) >= self.stamp)

    @property
    def mode(self):
        """The latched mode as heard last."""
        return self.client.heard['acu/mode'][-1].data

    def enters(self, mode):
        self.step()
        self.client.until(lambda: self.mode == mode)

    def program(self, rows, start=0.0):
        """A program track of (time, azimuth, elevation) rows."""
        table = np.array(rows, float).reshape(-1, 3)
        message = program_message(table[:, 0], table[:, 1:])
        messages.put_stamp(message.header.stamp, round(start * 1e9))
        return message


@pytest.fixture(scope='module')
def plant(start_node, connect):
    node = start_node('acu', '-p', 'graph.silence:=60.0')
    yield Plant(connect(node.domain_id))
    node.process.send_signal(signal.SIGINT)
    result = node.finish(15.0)
    assert result.returncode == 0 and 'Traceback' not in result.stderr


def test_no_mode_before_the_encoders_speak(plant):
    for mode in ('stow', 'preset', 'program', 'autotrack'):
        assert plant.client.trigger(f'acu/{mode}') == (False, 'refused: encoder invalid; mode is standby')


def test_refused_with_the_reason(plant):
    plant.step(error=(math.nan, math.nan, 10.0))
    assert plant.client.trigger('acu/program') == (False, 'refused: no program track; mode is standby')
    assert plant.client.trigger('acu/autotrack') == (False, 'refused: receiver not locked; mode is standby')


@pytest.mark.parametrize('mode', ['stow', 'preset', 'standby'])
def test_accepted_after_read_back(plant, mode):
    plant.step()
    assert plant.client.trigger(f'acu/{mode}') == (True, f'mode is {mode}')
    plant.enters(mode)


def test_program_and_autotrack(plant):
    now = plant.stamp * 1e-9
    plant.client.publish('acu/program_track', plant.program([(0.0, 0.1, 0.5), (100.0, 0.1, 0.5)], now))
    plant.client.until(lambda: plant.step() or plant.client.trigger('acu/program')[0])
    plant.enters('program')
    plant.step(150)
    assert plant.client.trigger('acu/autotrack') == (True, 'mode is autotrack')
    plant.enters('autotrack')
    assert plant.client.trigger('acu/standby') == (True, 'mode is standby')
    plant.enters('standby')


def test_a_program_that_is_over_is_refused(plant):
    now = plant.stamp * 1e-9
    plant.client.publish('acu/program_track', plant.program([(0.0, 0.1, 0.5), (0.1, 0.1, 0.5)], now))
    plant.step(60)
    assert plant.client.trigger('acu/program') == (False, 'refused: after program track; mode is standby')


@pytest.mark.parametrize('change, text', [
    (lambda m: m.points[1].positions.__setitem__(0, math.nan), 'program track row 1: '),
    (lambda m: m.points[1].positions.__setitem__(1, math.inf), 'program track row 1: '),
    (lambda m: setattr(m.points[1], 'time_from_start', messages.Duration(sec=0, nanosec=0)), 'must be after 0 s'),
    (lambda m: setattr(m, 'joint_names', ['azimuth', 'polarisation']), "joint_names ['azimuth', 'polarisation']"),
    (lambda m: setattr(m.points[1], 'positions', np.zeros(1)), 'row 1: 1 positions'),
    (lambda m: setattr(m, 'points', []), 'program track has 0 rows'),
], ids=['NaN', 'inf', 'unordered', 'names', 'short row', 'empty'])
def test_a_bad_program_track_is_named(plant, change, text):
    message = plant.program([(0.0, 0.1, 0.5), (1.0, 0.2, 0.5)])
    change(message)
    plant.client.publish('acu/program_track', message)
    status = plant.client.diagnosed('acu/program_track refused: ')
    assert text in status.message and '\n' not in status.message
    assert plant.client.trigger('acu/reset_faults') == (True, 'cleared')


def test_one_row_is_a_preset(plant):
    plant.client.publish('acu/program_track', plant.program([(0.0, math.nan, 0.7)]))
    plant.step()
    assert plant.client.diagnosed('invalid input: preset').level == 2
    plant.client.publish('acu/program_track', plant.program([(0.0, 0.3, 0.7)]))
    plant.step()
    assert plant.client.trigger('acu/preset')[0]
    plant.step(3)
    command = plant.client.heard['acu/rate_command'][-1]
    assert (command.velocity > 0.0).all(), 'it moves from (0.1, 0.5) to (0.3, 0.7)'
    assert plant.client.trigger('acu/standby')[0]
    plant.client.publish('acu/program_track', plant.program([(0.0, 0.3, 3.0)]))
    plant.step()
    assert plant.client.trigger('acu/preset') == (
        False, 'refused: outside limits, elevation 171.89 deg: must be -2.00 to 92.00 deg; mode is standby')


def test_a_writer_that_does_not_latch_is_heard(plant):
    """As `ros2 topic pub` writes; what was there before is outside the limits."""
    client, kind = plant.client, middleware.message_class('trajectory_msgs/msg/JointTrajectory')
    writer = client.node.create_publisher(kind, 'acu/program_track', 10)
    client.until(writer.get_subscription_count)
    time.sleep(0.3)  # the reader's side of the discovery
    writer.publish(messages.serialize(plant.program([(0.0, 0.3, 0.7)])))
    client.until(lambda: plant.step() or client.trigger('acu/preset')[0])
    plant.step(3)
    assert (client.heard['acu/rate_command'][-1].velocity > 0.0).all(), 'it moves from (0.1, 0.5) to (0.3, 0.7)'
    assert client.trigger('acu/standby')[0]
    client.node.destroy_publisher(writer)


@pytest.mark.parametrize('bad', [
    {'encoder': {'position': (math.nan, 0.5)}, 'error': {'error': (0.0, math.nan, 60.0)}},
    {'encoder': {'position': (0.1, math.inf)}, 'error': {'error': (math.inf, 0.0, 60.0)}},
    {'step_gap': {'jump': 3_000_000_000}, 'error': {'error': (0.0, 0.0, math.nan)}},
], ids=['NaN', 'inf', 'stamp jump and C/N0 NaN'])
def test_a_bad_message_among_good_ones_is_named(plant, bad):
    heard = plant.client.heard['diagnostics']
    first = len(heard)
    for changes in bad.values():
        plant.step(3)
        plant.step(1, **changes)
    plant.step(3)

    def named():
        said = [status for array in heard[first:] for status in array.status
                if status.message.startswith('invalid input: ')]
        assert all(status.level == 2 for status in said)
        return {name for status in said for name in status.message.partition(': ')[2].split()}
    plant.client.until(lambda: set(bad) <= named())
    assert np.isfinite(plant.client.heard['acu/rate_command'][-1].velocity).all()


def test_an_invalid_encoder_ends_a_mode(plant):
    plant.step()
    assert plant.client.trigger('acu/stow')[0]
    plant.enters('stow')
    plant.step(position=(math.nan, 0.5))
    plant.client.until(lambda: plant.mode == 'standby')
    assert (plant.client.heard['acu/rate_command'][-1].velocity == 0.0).all()


def put(plant, name, value):
    """The answer to `ros2 param set /acu name value`."""
    typed = (ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=value) if isinstance(value, str) else
             ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=value) if isinstance(value, int) else
             ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value))
    request = SetParameters.Request(parameters=[Parameter(name=name, value=typed)])
    return plant.client.call('acu/set_parameters', SetParameters, request).results[0]


def test_controllers_while_it_tracks(plant):
    """The antenna obeys and follows 0.05 rad/s; every change of the azimuth's controller leaves the command alone."""
    plant.step()
    start = plant.stamp * 1e-9
    plant.client.publish('acu/program_track', plant.program([(0.0, 0.1, 0.5), (40.0, 2.1, 0.5)], start))
    plant.client.until(lambda: plant.step(error=(math.nan, math.nan, 10.0)) or plant.client.trigger('acu/program')[0])
    azimuth, rates = 0.1, []

    def track(steps):
        nonlocal azimuth
        for _ in range(steps):
            plant.step(position=(azimuth, 0.5), error=(math.nan, math.nan, 10.0), velocity=(sum(rates[-1:]), 0.0))
            rates.append(plant.client.heard['acu/rate_command'][-1].velocity[0])
            azimuth += PERIOD * 1e-9 * rates[-1]

    track(200)
    for controller in ('pid', 'adrc', 'feedforward', 'adrc', 'pid', 'feedforward'):
        before = len(rates)
        assert put(plant, 'azimuth.controller', controller).successful
        track(200)
        assert abs(rates[before] - rates[before - 1]) < 1e-4, controller
        assert rates[-1] == pytest.approx(0.05, abs=2e-3)
        lag = 0.1 + 0.05 * (plant.stamp * 1e-9 - start) - (azimuth - PERIOD * 1e-9 * rates[-1])
        assert abs(lag) < 0.05 / 20.0
    assert put(plant, 'azimuth.feedforward.bandwidth', 20).successful
    result = put(plant, 'azimuth.controller', 'lqr')
    assert not result.successful and 'must be one of pid, feedforward, adrc' in result.reason
    result = put(plant, 'azimuth.controller', 'beam')
    assert not result.successful and result.reason == (
        "azimuth.controller = 'beam': must be one of pid, feedforward, adrc: the drive has motors")
    assert plant.client.trigger('acu/standby')[0]


def test_filters_while_it_tracks(plant):
    """The antenna obeys and follows a target by its errors alone; every change of the filter leaves the command alone,
    and what cannot be a filter is refused."""
    azimuth, first, rates = 0.3, plant.stamp * 1e-9, []

    def track(steps):
        nonlocal azimuth
        for _ in range(steps):
            error = (0.3 + 0.02 * (plant.stamp * 1e-9 - first) - azimuth) * math.cos(0.5)
            plant.step(position=(azimuth, 0.5), error=(error, 0.0, 60.0), velocity=(sum(rates[-1:]), 0.0))
            rates.append(plant.client.heard['acu/rate_command'][-1].velocity[0])
            azimuth += PERIOD * 1e-9 * rates[-1]

    track(150)
    assert plant.client.trigger('acu/autotrack')[0]
    track(300)
    for kind in ('imm', 'alpha_beta', 'singer', 'imm_ukf', 'current_statistical'):
        before = len(rates)
        assert put(plant, 'azimuth.filter.kind', kind).successful
        track(100)
        assert plant.mode == 'autotrack' and abs(rates[before] - rates[before - 1]) < 1e-4, kind
        assert rates[-1] == pytest.approx(0.02, abs=1e-3)
    result = put(plant, 'azimuth.filter.imm.models', 'cv constant')
    assert not result.successful
    assert "azimuth.filter.imm.models = 'cv constant': must be two or more of cv, ca" in result.reason
    values = {value.key: value.value for value in plant.client.diagnosed('').values}
    assert int(values['errors gated']) >= 0
    assert plant.client.trigger('acu/standby')[0]


def test_a_drive_that_does_not_follow(plant):
    plant.client.write('adu/state')
    plant.client.publish('adu/state', messages.String(data='emergency stop'))
    plant.client.until(lambda: plant.step() or plant.client.trigger('acu/stow') == (
        False, 'refused: drive not ready; mode is standby'))
    values = {value.key: value.value for value in plant.client.diagnosed('').values}
    assert values['drive'] == 'emergency stop'
    plant.client.publish('adu/state', messages.String(data='enabled'))
    plant.client.until(lambda: plant.step() or plant.client.trigger('acu/stow')[0])
    plant.enters('stow')
    plant.client.publish('adu/state', messages.String(data='fault: azimuth overspeed'))
    plant.client.until(lambda: plant.step() or plant.mode == 'standby')
    assert plant.client.heard['acu/rate_command'][-1].velocity == pytest.approx(0.0, abs=1e-9)
    plant.client.publish('adu/state', messages.String(data='enabled'))
    plant.client.until(lambda: plant.step() or plant.client.trigger('acu/stow')[0])
    assert plant.client.trigger('acu/standby')[0]


def test_parameters_while_it_runs(plant):
    def moved_by():
        """The rate commanded soon after preset is asked for, 0.4 rad away in azimuth, of an antenna that obeys."""
        plant.client.publish('acu/program_track', plant.program([(0.0, 0.6, 0.5)]))
        plant.step()
        assert plant.client.trigger('acu/preset')[0]
        azimuth, rate = 0.1, 0.0
        for _ in range(20):
            plant.step(position=(azimuth, 0.5), velocity=(rate, 0.0))
            rate = plant.client.heard['acu/rate_command'][-1].velocity[0]
            azimuth += PERIOD * 1e-9 * rate
        assert plant.client.trigger('acu/standby')[0]
        plant.step(20)
        return rate

    before = moved_by()
    assert put(plant, 'azimuth.shaper.rate', 0.01).successful
    assert put(plant, 'azimuth.feedforward.bandwidth', 0.0).successful
    assert moved_by() < 0.1 * before
    for name, value, text in (('azimuth.shaper.rate', 1e9, 'azimuth.shaper.rate'),
                              ('azimuth.feedforward.bandwidth', math.nan, 'azimuth.feedforward.bandwidth'),
                              ('azimuth.limits.rate', 1e-3, 'shaper.rate'),
                              ('period', 0.01, 'period')):
        result = put(plant, name, value)
        assert not result.successful and text in result.reason, (name, result.reason)


def test_stamps_that_go_back_are_named(plant):
    plant.step()
    joints = messages.template('joint_states')
    plant.client.publish(JOINTS, joints)
    status = plant.client.diagnosed('joint_states: 1 dropped: stale: ')
    assert status.level == 1


def test_the_lost_steps_in_the_diagnostics_of_the_drive_are_an_alarm(plant):
    """Only the drive counts the commands that came too late. Its step number counts from midnight."""
    client = plant.client
    client.write('diagnostics')
    client.read('acu/alarms')
    for i in range(12):
        values = {'step': 8_000_000 + 200 * i, 'lost_steps': 20 * i}
        client.publish('diagnostics', messages.DiagnosticArray(header=messages.header(''), status=[
            messages.DiagnosticStatus(level=0, name='adu', message='enabled', hardware_id='pedestal', values=[
                messages.KeyValue(key=key, value=str(value)) for key, value in values.items()])]))
        plant.step()

    def listed():
        return [status for status in client.heard['acu/alarms'][-1].status if status.name == 'steps lost']
    client.until(lambda: client.heard['acu/alarms'] and listed())
    values = {pair.key: pair.value for pair in listed()[0].values}
    assert values['detail'] == '100 of the last 1000 steps were lost, 10%' and 'scenario.priority' in values['action']
