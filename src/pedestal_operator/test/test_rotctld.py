"""The rotctld protocol: what a line asks for, how it is answered; against Hamlib's server where it is installed."""
import io
import shutil
import socket
import subprocess
import time

import pytest

from pedestal_operator.rotator import line_server, rotctld
from pedestal_operator.rotator.rotctld import (
    RESULT_INVALID,
    RESULT_NOT_AVAILABLE,
    RESULT_NOT_IMPLEMENTED,
    RESULT_OK,
    Limits,
    answer,
    read,
)


@pytest.mark.parametrize(('line', 'name', 'values', 'separator'), (
    ('p', 'get_pos', (), ''), ('\\get_pos\r', 'get_pos', (), ''),
    ('  P  123.45   30.5 ', 'set_pos', (123.45, 30.5), ''),
    ('P -10,5 +91', 'set_pos', (-10.5, 91.0), ''), ('\\set_pos 1 2', 'set_pos', (1.0, 2.0), ''),
    ('+P 1 2', 'set_pos', (1.0, 2.0), '\n'), (';p', 'get_pos', (), ';'), ('S', 'stop', (), ''), ('K', 'park', (), ''),
    ('M 2 100', 'move', (2, 100), ''), ('M cw -1', 'move', (16, -1), ''), ('_', 'get_info', (), ''),
    ('\\dump_state', 'dump_state', (), ''), ('q', 'quit', (), ''), ('R 1', 'reset', (1.0,), ''),
    ('P 171.41234567890123 35.4', 'set_pos', (171.41234567890123, 35.4), '')))
def test_a_line_is_read(line, name, values, separator):
    request = read(line)
    assert (request.name, request.values, request.separator, request.error) == (name, values, separator, RESULT_OK)


@pytest.mark.parametrize(('line', 'error'), (
    ('P', RESULT_INVALID), ('P 10', RESULT_INVALID), ('P 1 2 3', RESULT_INVALID), ('P nan 10', RESULT_INVALID),
    ('P 10 inf', RESULT_INVALID),
    ('P 1e400 0', RESULT_INVALID), ('P 0x10 0', RESULT_INVALID), ('P ' + '9' * 100 + ' 0', RESULT_INVALID),
    ('P a b', RESULT_INVALID),
    ('M 3 50', RESULT_INVALID), ('M 2 0', RESULT_INVALID), ('M 2 101', RESULT_INVALID),
    ('M sideways 5', RESULT_INVALID), ('S now', RESULT_INVALID),
    ('Z', RESULT_NOT_IMPLEMENTED), ('dance', RESULT_NOT_IMPLEMENTED), ('\\p', RESULT_NOT_IMPLEMENTED),
    ('w abc', RESULT_NOT_AVAILABLE),
    ('\\get_level SPEED', RESULT_NOT_AVAILABLE), ('get_pos', RESULT_NOT_IMPLEMENTED)))
def test_what_cannot_be_done_is_refused(line, error):
    request = read(line)
    assert request.error == error and answer(request, request.error) == f'RPRT {error}\n'.encode()


def test_nothing_is_answered_to_what_asks_nothing():
    assert [read(line) for line in ('', '  ', '\r', '# a comment', '+')] == [None] * 5


def test_a_question_mark_is_answered_by_the_commands():
    listed = answer(read('?'), RESULT_OK, rotctld.COMMAND_LIST_LINES).decode().splitlines()
    assert listed[:2] == ['p: get_pos', 'P: set_pos'] and '\\dump_state' in listed
    assert len(listed) == len(rotctld.COMMANDS)
    assert read('?p').separator == '?'


def test_answers_are_the_references_to_the_byte():
    at = rotctld.position(1.0, 2.0)
    assert answer(read('p'), RESULT_OK, at) == b'1.00\n2.00\n'
    assert answer(read('+p'), RESULT_OK, at) == b'get_pos:\nAzimuth: 1.00\nElevation: 2.00\nRPRT 0\n'
    assert answer(read(';p'), RESULT_OK, at) == b'get_pos:;Azimuth: 1.00;Elevation: 2.00;RPRT 0\n'
    assert answer(read('+P 1 2'), RESULT_OK) == b'set_pos: 1 2\nRPRT 0\n'
    assert answer(read('+S'), RESULT_OK) == b'stop:\nRPRT 0\n'
    assert answer(read('P 1 2'), RESULT_OK) == b'RPRT 0\n'
    assert answer(read('+P 1 2'), RESULT_INVALID) == b'set_pos: 1 2\nRPRT -1\n'
    assert answer(read('\\dump_state'), RESULT_OK, rotctld.state(Limits((-270.0, 270.0), (-2.0, 92.0)), False)) == (
        b'1\n2\nmin_az=-270.000000\nmax_az=270.000000\nmin_el=-2.000000\nmax_el=92.000000\nsouth_zero=0\n'
        b'rot_type=AzEl\ndone\n')


@pytest.mark.parametrize(('azimuth', 'told'), ((-10.0, '350.00'), (359.999, '0.00'), (725.0, '5.00'), (0.0, '0.00')))
def test_the_azimuth_is_told_from_0_to_360(azimuth, told):
    assert rotctld.position(azimuth, 5.0)[0] == ('Azimuth', told)


@pytest.mark.parametrize(('azimuth', 'near', 'expected'), (
    (350.0, 5.0, -10.0), (10.0, 355.0, 370.0), (180.0, 1.0, 180.0), (180.0, -1.0, -180.0), (100.0, -200.0, -260.0)))
def test_the_nearest_turn_inside_the_travel_is_taken(azimuth, near, expected):
    assert rotctld.turn(azimuth, near, (-270.0, 450.0)) == pytest.approx(expected)
    assert rotctld.turn(200.0, 0.0, (-90.0, 90.0)) is None


def test_a_pass_through_north_never_unwinds():
    at = 0.0
    for step in range(80):
        at, before = rotctld.turn((340.0 + 0.5 * step) % 360.0, at, (-270.0, 270.0)), at
        assert step == 0 or abs(at - before) < 1.0


def test_lines_are_cut_and_long_ones_kept_out_of_memory():
    program = sender()
    assert taken(program, b'p\nP 1 2\nS') == ['p', 'P 1 2'] and taken(program, b'\n') == ['S']
    assert taken(program, b'x' * 10_000) == [None]
    for _ in range(100):
        assert taken(program, b'x' * 10_000) == []
    assert taken(program, b'x\np\n') == ['p']


@pytest.fixture(autouse=True)
def pause(monkeypatch):
    """Every pause of a program is long enough to end a line."""
    monkeypatch.setattr(line_server, 'LINE_END_TIMEOUT_S', -1.0)


def sender():
    """A program, without its stream."""
    return line_server.Client(io.BytesIO(), 'rotctld', rotctld.MAX_LINE_BYTES)


def taken(program, data=b''):
    """The lines that end with these bytes."""
    if data:
        program.take(data)
    else:
        program.end_line(rotctld.is_complete)
    lines = list(program.lines)
    program.lines.clear()
    return lines


@pytest.mark.parametrize('command', ('p', 'P  10.00   20.00', '+p', '\\dump_state', 'S', 'P 10,5 20,5'))
def test_a_complete_command_of_a_program_without_line_ends_is_a_line(command):
    """gpredict for Windows sends no line ends."""
    program = sender()
    for _ in range(2):
        assert taken(program, command.encode()) == [] and taken(program) == [command] and taken(program) == []


@pytest.mark.parametrize('text', ('P', 'P 10', 'P 10 x', '\\dump', 'xyz', '', '#p'))
def test_half_a_command_is_no_line(text):
    program = sender()
    assert taken(program, text.encode()) == [] and taken(program) == []


def test_a_program_with_line_ends_is_never_cut():
    program = sender()
    assert taken(program, b'p\nP 12 3') == ['p'] and taken(program) == []
    assert taken(program, b'0\n') == ['P 12 30']


def test_status_words():
    limits = Limits((-180.0, 360.0), (0.0, 90.0))
    assert rotctld.flags((0.0, 0.0), (10.0, 10.0), limits) == ''
    assert rotctld.flags((1.0, -1.0), (10.0, 10.0), limits) == (
        'MOVING MOVING_AZ MOVING_RIGHT MOVING_EL MOVING_DOWN')
    assert rotctld.flags((0.0, 0.0), (-180.0, 90.0), limits) == 'LIMIT_LEFT LIMIT_UP'


ALIKE = ('P 10 20', '+P 11 21', 'S', '+S', ';S', '\\stop', 'K', 'R 1', 'M 2 50', '\\set_pos 12 22', 'P a b', 'M 3 50',
         'P 13,5 20')


@pytest.mark.skipif(shutil.which('rotctld') is None, reason='rotctld is not installed (libhamlib-utils)')
def test_the_same_lines_are_answered_as_by_the_reference():
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        port = probe.getsockname()[1]
    server = subprocess.Popen(['rotctld', '-m', '1', '-T', '127.0.0.1', '-t', str(port)], stderr=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 20.0
        while True:
            try:
                connection = socket.create_connection(('127.0.0.1', port), 5.0)
                break
            except OSError:
                assert time.monotonic() < deadline
                time.sleep(0.05)
        with connection:
            connection.settimeout(5.0)
            for line in ALIKE:
                connection.sendall(line.encode() + b'\n')
                said = b''
                while b'RPRT' not in said or not said.endswith(b'\n'):
                    said += connection.recv(4096)
                request = read(line)
                assert answer(request, request.error) == said, line
    finally:
        server.kill()
        server.wait()
