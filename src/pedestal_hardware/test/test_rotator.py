"""Rotators: the bytes of the protocols, the law of the set-points, and the parameters."""
import contextlib
import math
import socket
import threading
import time

import numpy as np
import pytest

from pedestal_common.parameters import ParameterError, build
from pedestal_hardware.rotator import protocols, set_point
from pedestal_hardware.rotator.line import Line, Measurement, SetPoint
from pedestal_hardware.rotator.protocols import Accepted, Position, Refusal
from pedestal_hardware.rotator.unit import Rotator
from pedestal_hardware.rotator_params import RotatorParameters


@pytest.mark.parametrize('name, azimuth, elevation, sent', [
    ('rotctld', 123.456, 30.5, b'P 123.46 30.50\n'),
    ('gs232', 12.4, 6.5, b'W012 006\r'),
    ('easycomm', 10.04, -2.0, b'AZ10.0 EL-2.0\n'),
    # the manual of Rot2Prog: H = 10 (360 + angle) as ASCII, PH = 0x0A, K = 0x2F
    ('rot2prog', 123.5, 77.0, b'W4835\n4370\n/ '),
    ('rot1prog', 123.4, 0.0, b'W4830\0\0\0\0\0\0/ '),
])
def test_a_set_point_in_bytes(name, azimuth, elevation, sent):
    assert protocols.PROTOCOLS[name]().set_point(azimuth, elevation, (10, 10)) == sent


def test_a_set_point_of_a_rotator_of_the_azimuth_alone():
    sent = [protocols.PROTOCOLS[name](azimuth_only=True).set_point(123.0, 45.0, None) for name in (
        'rotctld', 'gs232', 'gs232_azimuth', 'easycomm')]
    assert sent == [b'P 123.00 0.00\n', b'W123 000\r', b'M123\r', b'AZ123.0\n']


ANSWERS = [
    ('rotctld', b'12.50\n-1.25\n', [Position(12.5, -1.25)]),
    ('rotctld', b'RPRT 0\n', [Accepted()]),
    ('rotctld', b'12.50\nRPRT -6\n3.00\n4.00\n', [Refusal('rotctld error -6'), Position(3.0, 4.0)]),
    ('gs232', b'AZ=012  EL=006\r\n', [Position(12.0, 6.0)]),
    ('gs232', b'+0123+0045\r\n', [Position(123.0, 45.0)]),
    ('easycomm', b'AZ10.0 EL20.0\n', [Position(10.0, 20.0)]),
    ('easycomm', b'AZ10.0\nEL-0.5\n', [Position(10.0, -0.5)]),
    ('rot2prog', bytes([0x57, 3, 7, 2, 5, 2, 3, 9, 4, 0, 2, 0x20]), [Position(12.5, 34.0, (2, 2))]),
    ('rot1prog', bytes([0x57, 3, 7, 2, 0x20]), [Position(12.0, 0.0)]),
    ('gs232', b'AZ=020  EL=-05\r\n', [Position(20.0, -5.0)]), ('gs232', b'+0020-0005\r\n', [Position(20.0, -5.0)]),
    ('gs232', b'AZ=0000EL=000\r', [Position(0.0, 0.0)]),      # Hamlib issue 251
    ('gs232', b'\r\nAZ=400.5  EL=030.0\r\n?>', [Position(400.5, 30.0), Refusal("answer '?>'", True)]),
    ('easycomm', b'AZ10,5 EL-0,5\n', [Position(10.5, -0.5)]),
    ('easycomm', b'+10.5\n-0.5\n', [Position(10.5, -0.5)]),
    ('easycomm', b'AZ+010.5,EL+20.0\n', [Position(10.5, 20.0)]),
    ('easycomm', b'AZ=10.5, EL=-20,5\n', [Position(10.5, -20.5)]),
    ('gs232', b'AZ=+020  EL=-05\r\n', [Position(20.0, -5.0)]),
    ('easycomm', b'AZ180.0 EL45.0 UP145500000 FM DN435000000 USB\n', [Position(180.0, 45.0)]),
    ('easycomm', b'az180.0 el45.0\n', [Position(180.0, 45.0)]),
    ('gs232', b'az=180 el=045\r\n', [Position(180.0, 45.0)]),
    ('gs232', b'AZ=180\r\nEL=-05\r\n', [Position(180.0, -5.0)]), ('gs232', b'+0180\r+0045\r', [Position(180.0, 45.0)]),
    ('rotctld', b'12,50\n-1,25\n', [Position(12.5, -1.25)]),
    ('easycomm', b'AZ EL\r\nAZ10.0 EL20.0\r\n', [Position(10.0, 20.0)]),
]


@pytest.mark.parametrize('name, sent, expected', ANSWERS)
def test_answers_arrive_whole_or_byte_by_byte(name, sent, expected):
    whole, cut = protocols.PROTOCOLS[name](), protocols.PROTOCOLS[name]()
    for found in (whole.answers(sent), [answer for byte in sent for answer in cut.answers(bytes([byte]))]):
        assert [type(answer) for answer in found] == [type(answer) for answer in expected]
        for answer, wanted in zip(found, expected):
            assert answer[:2] == pytest.approx(wanted[:2]) and answer[2:] == wanted[2:] if isinstance(
                answer, Position) else answer == wanted


@pytest.mark.parametrize('name, sent', [
    ('rotctld', b'nan\n10.0\n'), ('rotctld', b'1e9\n10.0\n'), ('rotctld', b'hello\nworld\n'),
    ('gs232', b'AZ=1  EL=006\r\n'), ('gs232', b'AZ=12  EL=006\r\n'),
    ('easycomm', b'10 20\n'), ('rot2prog', b'W' + bytes(10) + b' '), ('easycomm', b'AZ1.2.3 EL4\n'),
    ('easycomm', b'ALlow battery\n'),
    ('rot2prog', b'W' + bytes(9) + b'\x0a!'), ('gs232', bytes(600)), ('rotctld', b'9' * 600),
])
def test_bytes_that_are_no_answer_are_refused_and_the_next_answer_counts(name, sent):
    protocol = protocols.PROTOCOLS[name]()
    refusals = protocol.answers(sent + b'\n')
    assert refusals and all(isinstance(answer, Refusal) and answer.reason for answer in refusals)
    good, expected = next((answer, wanted) for of, answer, wanted in ANSWERS if of == name)
    assert [type(answer) for answer in protocol.answers(good)][-1] is Position and expected


@pytest.mark.parametrize('line', [b'AZ=012\r\n', b'+0012\r\n'])
def test_an_azimuth_without_elevation_is_named_with_its_parameter_at_the_second_request(line):
    """The elevation may have a line of its own. Half an answer to one request is none to the next one."""
    protocol = protocols.PROTOCOLS['gs232']()
    found = []
    for _ in range(3):
        protocol.sent(protocol.ask)
        found.append(protocol.answers(line))
    assert found == [[], *2 * [[Refusal(protocols.NO_ELEVATION)]]]


@pytest.mark.parametrize('echoes', [True, False])
def test_an_echoed_set_point_is_no_position_and_a_position_at_the_set_point_is_no_echo(echoes):
    protocol = protocols.PROTOCOLS['easycomm']()
    echo, answer = b'AZ EL \n' if echoes else b'', b'AZ10.0 EL20.0\n'
    protocol.sent(protocol.ask)
    assert len(protocol.answers(echo + answer)) == 1
    protocol.sent(protocol.set_point(10.0, 20.0, None))
    protocol.sent(protocol.ask)
    assert protocol.answers((answer if echoes else b'') + echo + answer) == [Position(10.0, 20.0)]


class Rotctld(threading.Thread):
    """A server of rotctld's lines that answers the second line of its third position too late, and refuses a stop."""

    def __init__(self):
        super().__init__(daemon=True)
        self.server = socket.create_server(('127.0.0.1', 0))
        self.port, self.positions, self.stops = self.server.getsockname()[1], 0, 0

    def run(self):
        while True:
            connection, _ = self.server.accept()
            with connection, connection.makefile('rwb', buffering=0) as lines, contextlib.suppress(OSError):
                for line in lines:
                    self.answer(line, lines)

    def answer(self, line, lines):
        if line == b'p\n':
            self.positions += 1
            lines.write(b'10.0\n')
            time.sleep(0.5 if self.positions == 3 else 0.0)
            lines.write(b'45.0\n')
        else:
            self.stops += line == b'S\n'
            lines.write(b'RPRT -6\n' if self.stops == 1 else b'RPRT 0\n')


def wait_until(condition):
    deadline = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_a_late_answer_exchanges_no_axes_and_a_refused_stop_is_sent_again():
    server = Rotctld()
    server.start()
    connection = Line(f'socket://127.0.0.1:{server.port}', protocols.PROTOCOLS['rotctld'], 0.02, 0.2)
    connection.start()
    seen = set()
    wait_until(lambda: server.positions > 8 and seen.add(connection.newest and connection.newest[:2]) is None
               and connection.counts['positions'] > 8)
    wait_until(lambda: seen.add(connection.newest[:2]) is None and connection.counts['positions'] > 20)
    assert seen <= {None, (10.0, 45.0)} and connection.counts['missing_answers'] == 1
    connection.send('stop')
    wait_until(lambda: server.stops == 2 and not connection.refusal)
    connection.close()


@pytest.mark.parametrize('text', [b'W logged: Wind 3 m/s\r\n', b'WWWW', b''])
def test_text_between_the_frames_of_a_rot2prog_loses_no_frame(text):
    protocol = protocols.PROTOCOLS['rot2prog']()
    frame = bytes([0x57, 3, 7, 2, 5, 2, 3, 9, 4, 0, 2, 0x20])
    found = [answer for answer in protocol.answers(text + frame + text + frame + bytes(12))
             if isinstance(answer, Position)]
    assert [answer[:2] for answer in found] == [pytest.approx((12.5, 34.0))] * 2


class Device:
    """The unit of a rotator with a measurement in each step."""

    def __init__(self, **parameters):
        self.unit = Rotator(build(RotatorParameters, parameters), ('clock', 'acu/reference', 'acu/mode'))
        self.unit.prepare()
        self.k, self.period = 0, self.unit.parameters.period

    def step(self, azimuth=None, elevation=0.0, measured=(0.0, 0.0), rate=0.0, mode='program'):
        """Make a step with a reference [deg], without one where azimuth is None. Return the decision."""
        stamp = round(self.k * self.period * 1e9)
        self.unit.take_text('acu/mode', mode)
        reference = self.unit.inputs['acu/reference']
        reference['stamp'] = np.iinfo(np.int64).min if azimuth is None else stamp
        reference['position'] = np.radians((math.nan if azimuth is None else azimuth, elevation))
        reference['velocity'] = np.radians((rate, 0.0))
        if measured is not None:
            self.unit.measure(Measurement(*measured, self.k * self.period), self.k * self.period)
        else:
            self.unit.measure(None, self.k * self.period)
        self.unit.step(np.array([stamp]), self.unit.inputs, self.unit.outputs)
        self.k += 1
        return self.unit.decision


def test_a_set_point_is_sent_when_the_target_leaves_the_dead_band():
    device = Device(dead_band=0.5)
    assert device.step(10.0, 20.0)[:2] == pytest.approx((10.0, 20.0))
    assert device.step(10.4, 20.0) is None
    assert device.step(10.6, 20.0)[:2] == pytest.approx((10.6, 20.0))
    assert [device.step(10.6, 20.0) for _ in range(20)] == [None] * 20


def test_a_ramp_stays_within_the_dead_band_and_half_a_step():
    """0.5 deg/s in steps of 1 deg: the set-point in force is never further away than the stated accuracy."""
    device = Device(protocol='gs232', dead_band=0.3)
    worst, sent = 0.0, None
    for k in range(200):
        target = 20.0 + 0.5 * k * device.period
        sent = device.step(target) or sent
        worst = max(worst, abs(sent[0] - target))
    assert sent[0] == round(sent[0]) and worst <= device.unit.accuracy_deg + 0.5 * device.period


def test_a_target_between_two_steps_of_the_device_is_sent_once():
    device = Device(protocol='gs232', dead_band=0.1)
    assert device.step(30.4)[:2] == (pytest.approx(30.0), 0.0)
    assert [device.step(30.4) for _ in range(20)] == [None] * 20


@pytest.mark.parametrize('mode', ['stop', 'standby', 'a mode of a later version'])
def test_a_mode_without_motion_stops_the_device_and_moves_it_never_again(mode):
    """The reference of the control unit is still the target of the mode before."""
    device = Device()
    device.step(100.0, 30.0, mode='preset')
    assert [device.step(100.0, 30.0, mode=mode) for _ in range(10)] == ['stop'] + [None] * 9
    for name in ('adu/disable', 'adu/enable'):
        device.unit.request(name)
        assert [device.step(100.0, 30.0, mode=mode) for _ in range(3)] == [None] * 3
    assert device.step(100.0, 30.0, mode='rate') is None and 'preset first' in device.unit.diagnose().message
    assert device.step(1.0, 1.0, mode='rate')[:2] == pytest.approx((1.0, 1.0))


def test_a_target_outside_the_travel_waits_at_the_end():
    device = Device()
    assert device.step(400.0, -5.0)[:2] == pytest.approx((360.0, 0.0))
    assert 'outside the travel' in device.unit.diagnose().message


@pytest.mark.parametrize('azimuth', [math.nan, math.inf, 1e9])
def test_an_invalid_reference_is_ignored_and_reported(azimuth):
    device = Device()
    device.step(10.0)
    assert device.step(azimuth) is None
    assert device.unit.diagnose().level == 2 and 'NaN' in device.unit.diagnose().message


def test_a_stale_reference_and_a_disabled_drive_stop_the_device_once():
    device = Device(command_timeout=5)
    device.step(10.0)
    decisions = [device.step() for _ in range(10)]
    assert decisions.count('stop') == 1 and set(decisions) == {None, 'stop'}
    assert device.step(10.0)[:2] == pytest.approx((10.0, 0.0))        # the same target is sent again after the stop
    device.unit.request('adu/disable')
    assert [device.step(11.0), device.step(12.0)] == ['stop', None]


def test_a_silent_device_is_a_fault_without_angles_and_returns():
    device = Device(silence=1.5, answer_timeout=1.0)
    device.step(10.0)
    for _ in range(10):
        decision = device.step(10.0, measured=None)
    joints = device.unit.outputs['joint_states']
    assert device.unit.condition == 'fault: rotator silent' and decision is None
    assert joints['stamp'][0] == np.iinfo(np.int64).min
    assert device.step(10.0, measured=(3.0, 4.0))[:2] == pytest.approx((10.0, 0.0))
    assert device.unit.condition == 'enabled'
    assert np.degrees(joints['position'][0]) == pytest.approx((3.0, 4.0))


def test_a_rotator_that_does_not_move_is_reported():
    device = Device()
    for _ in range(40):
        device.step(50.0, measured=(3.0, 4.0))
    diagnosis = device.unit.diagnose()
    assert diagnosis.level == 1 and 'the rotator has not moved for' in diagnosis.message
    assert '47.0 deg away from its set-point' in diagnosis.message
    for k in range(40):
        device.step(50.0, measured=(4.0 + k, 4.0))
        assert device.unit.diagnose().level == 0


def test_a_refusal_without_an_answer_belongs_to_the_set_point():
    """A GS-232 does not answer W, and `?>` to a W that it refuses."""
    server, lines = socket.create_server(('127.0.0.1', 0)), []

    def serve():
        connection, _ = server.accept()
        with connection, connection.makefile('rwb', buffering=0) as stream, contextlib.suppress(OSError):
            for part in iter(lambda: stream.read(1), b''):
                lines.append(part)
                if part == b'\r':
                    word = b''.join(lines)
                    lines.clear()
                    stream.write(b'?>\r\n' if word.startswith(b'W') else b'+0010+0045\r\n')
    threading.Thread(target=serve, daemon=True).start()
    connection = Line(f'socket://127.0.0.1:{server.getsockname()[1]}', protocols.PROTOCOLS['gs232'], 0.02, 0.5)
    connection.start()
    wait_until(lambda: connection.newest is not None)
    connection.send(SetPoint(120.0, 30.0, None))
    wait_until(lambda: connection.counts['refusals'] == 1)
    positions = connection.counts['positions']
    wait_until(lambda: connection.counts['positions'] > positions + 3)
    assert 'request refused' in connection.fault
    connection.close()


def test_a_target_that_is_too_fast_is_reported():
    device = Device(rate=1.0)
    device.step(10.0, rate=2.0)
    assert 'moves at 2.00 deg/s, the rotator at 1 deg/s' in device.unit.diagnose().message


@pytest.mark.parametrize('given, message', [
    ({'protocol': 'gs232', 'resolution': 0.5}, 'resolution = 0.5 deg: must be 0, or at least 1 deg'),
    ({'azimuth.low': 20.0, 'azimuth.high': 10.0}, 'high = 10 deg: must be above low = 20 deg'),
    ({'silence': 0.5}, 'silence = 0.5 s: must be above answer_timeout = 1 s'),
    ({'protocol': 'gs232', 'azimuth.low': -180.0}, 'must be at least 0 deg'),
    ({'protocol': 'spid'}, 'must be one of'),
    ({'duration': 0.5}, 'duration = 0.5 s: must be a multiple of the period 0.2 s'),
    ({'url': 'ttyUSB0'}, "url = 'ttyUSB0': must be"), ({'url': 'tcp://127.0.0.1:4533'}, 'tcp: must be'),
    ({'url': 'udp://127.0.0.1:4533'}, 'must be socket://HOST:PORT, or the path of a serial device'),
])
def test_parameters_that_do_not_go_together(given, message):
    with pytest.raises(ParameterError, match=message):
        build(RotatorParameters, given)


@pytest.mark.parametrize('beams, lockstep, message', [(0, False, 'must be 1'), (1, True, 'must be realtime')])
def test_the_graph_of_a_rotator(beams, lockstep, message):
    with pytest.raises(ParameterError, match=message):
        RotatorParameters().check_graph(beams, lockstep)


def test_the_constants_of_the_law_are_those_of_the_parameters():
    constants = Rotator(RotatorParameters(), ('clock', 'acu/reference', 'acu/mode')).parts['constants']
    assert constants.dtype == set_point.Constants.dtype
    assert np.degrees(constants['dead_band']) == pytest.approx(0.1)
