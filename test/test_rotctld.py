"""Hamlib's rotctl, gpredict's exact bytes and clients that misbehave, on a running realtime graph."""
import contextlib
import importlib.util
import itertools
import math
import os
import pathlib
import pty
import shutil
import signal
import socket
import subprocess
import time

import pytest
from shared import NODE, begins_with, free_port

from pedestal_common.wire import commands

ROTCTL = shutil.which('rotctl')
_SPEC = importlib.util.spec_from_file_location('rotator_gpredict',
                                               pathlib.Path(__file__).parents[1] / 'docs' / 'rotator' / 'gpredict.py')
gpredict = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(gpredict)


@pytest.fixture(scope='module')
def antenna(station):
    """(Run, Client of its graph, port of its rotctld)."""
    client, port = station.client, station.ports['rotctld']
    with connected(port) as probe:
        client.until(lambda: b'no control unit' not in ask(probe, '_') and b'-' not in ask(probe, 'p'), 60.0)
    return station.run, client, port


def connected(port):
    deadline = time.monotonic() + 180.0
    while True:
        try:
            connection = socket.create_connection(('127.0.0.1', port), 5.0)
            connection.settimeout(10.0)
            return connection
        except OSError:
            assert time.monotonic() < deadline
            time.sleep(0.1)


def ask(connection, line):
    """One recv, as gpredict and SatDump do."""
    connection.sendall(line.encode() + b'\n')
    return connection.recv(4096)


def granted(connection, line):
    """Ask for a set-point, again while a busy machine keeps the control unit from replying in time; RPRT 0."""
    said = next(filter(lambda said: said != b'RPRT -5\n', (ask(connection, line) for _ in range(20))), b'RPRT -5\n')
    return said == b'RPRT 0\n'


@pytest.mark.skipif(ROTCTL is None, reason='rotctl is not installed (libhamlib-utils)')
@pytest.mark.every_case     # the recording of the last test contains each of these commands
@pytest.mark.parametrize(('command', 'code', 'said'), (
    (('P', '20', '40'), 0, ''), (('p',), 0, None), (('P', '20', '200'), 2, 'Invalid parameter'), (('S',), 0, ''),
    (('M', 'CW', '50'), 0, ''), (('S',), 0, ''), (('K',), 0, ''), (('R', '1'), 0, ''), (('_',), 0, 'pedestal')))
def test_hamlibs_client_is_served(antenna, command, code, said):
    """Asked again where a busy machine keeps the control unit from replying in time."""
    _, _, port = antenna
    for _ in range(5):
        done = subprocess.run([ROTCTL, '-m', '2', '-r', f'127.0.0.1:{port}', *command], capture_output=True, text=True,
                              timeout=60.0)
        if (done.returncode == 0) == (code == 0):
            break
    assert (done.returncode == 0) == (code == 0), (done.stdout, done.stderr)
    if said is None:
        assert len([float(line) for line in done.stdout.split()]) == 2
    else:
        assert said in done.stdout + done.stderr


def test_a_program_without_line_ends_is_answered(antenna):
    """gpredict for Windows."""
    _, client, port = antenna
    with connected(port) as windows:
        for command, lines in ((b'p', 2), (b'P  30.00   45.00', 1), (b'p', 2), (b'S', 1)):
            windows.sendall(command)
            assert windows.recv(4096).count(b'\n') == lines


@pytest.mark.thorough
def test_without_an_antenna_no_answer_is_a_position(start_process, complaints):
    """One line in the log for each kind of refusal of a program, however often it happens and connects."""
    nodes = {name: start_process([*NODE, f'{name}_node', '--ros-args', '-p',
                                  'port:=0']) for name in ('rotctld', 'easycomm')}
    ports = {name: int(begins_with(node, 1).removeprefix(f'{name}: 127.0.0.1:')) for name, node in nodes.items()}
    with connected(ports['rotctld']) as probe:
        for line in (*('p', '\\get_pos', 's', '1', '\\dump_state', 'P 10 20') * 3,):
            assert ask(probe, line) == b'RPRT -6\n', line
        assert ask(probe, '+p') == b'get_pos:\nRPRT -6\n'
        assert ask(probe, '_') == b'pedestal, no control unit\n'
        assert ask(probe, '?').startswith(b'p: get_pos\nP: set_pos\n')
    if ROTCTL:
        for command in (['p'], ['P', '10', '20'], ['S']):
            assert subprocess.run([ROTCTL, '-m', '2', '-r', f'127.0.0.1:{ports["rotctld"]}', *command],
                                  capture_output=True, timeout=60.0).returncode == 2
    with connected(ports['easycomm']) as probe:
        for line in ('AZ EL', 'AZ', 'AZ10 EL20', 'EL20', 'AZ EL'):
            probe.sendall(line.encode() + b'\n')
            assert ask(probe, 'GS') == b'GS8\n', line
    for name, kinds in (('rotctld', 5), ('easycomm', 2)):
        nodes[name].send_signal(signal.SIGTERM)
        _, errors = nodes[name].communicate(timeout=60.0)
        said = complaints(errors).splitlines()
        assert nodes[name].returncode == 0 and len(said) == kinds and all('refused' in line for line in said), errors


def test_a_set_point_moves_the_antenna_from_standby(antenna):
    _, client, port = antenna
    with connected(port) as gpredict:
        assert granted(gpredict, 'P 30.00 45.00')
        client.until(lambda: client.heard['acu/mode'][-1].data == 'preset', 20.0)
        deadline = time.monotonic() + 30.0
        while (told := ask(gpredict, 'p')) != b'30.00\n45.00\n':
            assert time.monotonic() < deadline, told
            client.spin(0.05)
        assert ask(gpredict, 'P nan 10') == b'RPRT -1\n' and ask(gpredict, 'P 30 120') == b'RPRT -1\n'
        assert ask(gpredict, 'Z') == b'RPRT -4\n' and ask(gpredict, 'P 10') == b'RPRT -1\n'
        client.until(lambda: ask(gpredict, '+p') == b'get_pos:\nAzimuth: 30.00\nElevation: 45.00\nRPRT 0\n', 30.0)
        gpredict.sendall(b'q\n')
        assert gpredict.recv(10) == b''


@pytest.mark.thorough
def test_a_pass_through_north_in_set_points_is_met_without_unwinding(antenna):
    """One each 0.8 s, azimuth 0 to 360, 1 deg/s through north; test_set_points says how evenly."""
    _, client, port = antenna
    with connected(port) as gpredict:
        assert granted(gpredict, 'P 353.00 45.00')
        client.until(lambda: abs(client.heard['joint_states'][-1].position[0] + math.radians(7.0)) < 1e-3, 60.0)
        client.heard['joint_states'].clear()
        for step in range(16):
            assert granted(gpredict, f'P {(353.0 + 0.8 * step) % 360.0:.2f} 45.00')
            ending = time.monotonic() + 0.8
            while time.monotonic() < ending:
                client.spin(0.02)
    angles = [state.position[0] for state in client.heard['joint_states']]
    assert 0.15 < max(angles) - min(angles) < 0.3                           # 12 deg and no turn the other way


@pytest.mark.thorough
@pytest.mark.skipif(bool(gpredict.MISSING), reason=f'not installed: {", ".join(gpredict.MISSING)}')
def test_gpredict_itself_points_at_a_satellite_that_passes(antenna, tmp_path):
    """Debian's, on a screen of its own; against sgp4."""
    _, client, port = antenna
    with connected(port) as probe, contextlib.closing(gpredict.Gpredict(tmp_path, port)) as program:
        def away():
            azimuth, elevation = map(float, ask(probe, 'p').split())
            expected = gpredict.angles(program.satellite, gpredict.now())
            return max(abs((azimuth - expected[0] + 180.0) % 360.0 - 180.0), abs(elevation - expected[1]))
        client.until(lambda: away() < 0.5, 60.0)
        elevation = float(ask(probe, 'p').split()[1])
        client.until(lambda: float(ask(probe, 'p').split()[1]) > elevation + 0.5, 60.0)
        client.until(lambda: away() < 0.5, 60.0)
        assert client.heard['acu/mode'][-1].data == 'preset'


def test_one_client_is_in_control_and_the_others_are_told_so(antenna):
    _, _, port = antenna
    with connected(port) as first, connected(port) as second:
        assert granted(first, 'P 10 40')
        assert ask(second, 'P 50 40') == b'RPRT -14\n' and b'\n' in ask(second, 'p')
        assert ask(second, 'S') == b'RPRT 0\n'                              # to stop is everybody's
        first.sendall(b'q\n')
        first.recv(10)
        time.sleep(0.5)
        assert granted(second, 'P 12 40')


def test_a_program_takes_no_pass_before_an_operator_has_allowed_it(antenna):
    _, client, port = antenna
    if 'acu/command' not in client.publishers:
        client.write('acu/command')

    def hand(verb):
        client.publish('acu/command', commands.message(commands.Command(verb, 'hand', f'{verb} {time.monotonic()}')))
        client.spin(0.5)

    def in_pass():
        hand('program')
        return client.heard['acu/mode'][-1].data in ('program', 'autotrack')
    with connected(port) as gpredict:
        client.until(in_pass, 60.0)
        mode = client.heard['acu/mode'][-1].data
        for _ in range(3):
            assert ask(gpredict, 'P 12 40') == b'RPRT -9\n'
        assert client.heard['acu/mode'][-1].data == mode and ask(gpredict, 'K') == b'RPRT -9\n'
        hand('allow')
        client.until(lambda: ask(gpredict, 'P 12 40') == b'RPRT 0\n', 60.0)
        client.until(lambda: client.heard['acu/mode'][-1].data == 'preset', 60.0)
        assert ask(gpredict, 'S') == b'RPRT 0\n'


@pytest.fixture(params=('rotctld', 'easycomm'))
def server(request, antenna, start_process):
    """(name of a server, its port, its number as a model of rotctl)."""
    run, client, port = antenna
    if request.param == 'rotctld':
        yield request.param, port, '2'
        return
    port = free_port()
    command = [*NODE, 'easycomm_node', '--ros-args', '-p', f'port:={port}']
    node = start_process(command, ROS_DOMAIN_ID=str(run.domain_id))
    with connected(port) as probe:
        client.until(lambda: ask(probe, 'AZ GS').startswith(b'AZ'), 60.0)
    yield request.param, port, '202'
    node.send_signal(signal.SIGINT)
    assert node.wait(30.0) == 0


@pytest.mark.thorough
@pytest.mark.skipif(ROTCTL is None, reason='rotctl is not installed (libhamlib-utils)')
def test_a_program_that_connects_for_each_set_point_is_one_program(antenna, server):
    """rotctl, a process for each set-point. A busy machine may spoil the pace of some of them."""
    _, client, _ = antenna
    kind, port, model = server
    if 'acu/command_result' not in client.heard:
        client.read('acu/command_result')
    heard = client.heard['acu/command_result']
    heard.clear()

    def presets():
        """(name of the client, {argument: number}) of the set-points that were granted."""
        return [(command.who, {name: float(text) for name, text in command.arguments.items()})
                for command, reply in map(commands.of_reply, heard)
                if command.verb == 'preset' and command.who.startswith(kind) and reply.granted]

    def shot(azimuth):
        """Send a set-point, and hear of it until the next is due, a second later."""
        due = time.monotonic() + 1.0
        subprocess.run([ROTCTL, '-m', model, '-r', f'127.0.0.1:{port}', 'P', str(azimuth), '40'], timeout=60.0,
                       capture_output=True)
        client.spin(max(due - time.monotonic(), 0.2))
    azimuths = itertools.count()
    client.until(lambda: shot(next(azimuths)) or len({who for who, arguments in presets()
                                                      if arguments['azimuth_rate'] > 0.0}) > 1, 60.0)
    if kind == 'easycomm':                                                  # an angle that a line leaves out
        far = next(azimuths) + 60
        shot(far)
        with connected(port) as half:
            half.sendall(b'EL41.0\n')
            client.until(lambda: presets()[-1][1]['elevation'] == pytest.approx(math.radians(41.0)), 60.0)
        assert presets()[-1][1]['azimuth'] == pytest.approx(math.radians(far), abs=0.02)
    with socket.create_connection(('127.0.0.1', port), 5.0, ('127.0.0.2', 0)) as other:
        other.settimeout(10.0)

        def is_refused():
            shot(next(azimuths))
            if kind == 'rotctld':
                return ask(other, 'P 50 40') == b'RPRT -14\n'
            other.sendall(b'AZ50 EL40\n')
            return ask(other, 'GS') == b'GS8\n'
        client.until(is_refused, 60.0)
        # A stop ends the motion, and with it the control that later tests need.
        if kind == 'rotctld':
            assert ask(other, 'S') == b'RPRT 0\n' and granted(other, 'P 50 40')
        else:
            other.sendall(b'SA SE\n')
            client.until(lambda: ask(other, 'GS') == b'GS1\n', 60.0)


@pytest.mark.thorough
def test_clients_that_misbehave_disturb_nobody(antenna):
    _, _, port = antenna
    mute = [connected(port) for _ in range(3)]
    for connection in mute:                                                 # Look4Sat never reads
        connection.sendall(b'p\n' * 20_000)
    endless = connected(port)
    endless.sendall(b'x' * 1_000_000)
    half = connected(port)
    half.sendall(b'P 1')
    with connected(port) as good:
        for _ in range(5):
            assert ask(good, 'p').count(b'\n') == 2
    endless.sendall(b'\np\n')
    assert endless.recv(100).startswith(b'RPRT -1\n')
    half.sendall(b'0 20\n')
    for connection in (*mute, endless, half):
        connection.close()
    with connected(port) as good:
        assert ask(good, 'p').count(b'\n') == 2


@pytest.mark.skipif(ROTCTL is None, reason='rotctl is not installed (libhamlib-utils)')
def test_easycomm_over_tcp_and_a_serial_device(antenna, start_process):
    """Hamlib's models 201, 202 and 204, and a pair of pseudo terminals in the place of a serial line."""
    run, client, _ = antenna
    port, (end, device) = free_port(), pty.openpty()
    node = start_process([*NODE, 'easycomm_node', '--ros-args', '-p', f'port:={port}',
                          '-p', f'device:={os.ttyname(device)}'], ROS_DOMAIN_ID=str(run.domain_id))
    connected(port).close()
    os.set_blocking(end, False)
    client.until(lambda: _serial(end, b'AZ EL \n').startswith(b'AZ'), 60.0)
    # The elevation stays as it is. A line is sent again, because another client may still be in control at first.
    client.until(lambda: _serial(end, b'AZ21.0\n') == b'' and _serial(end, b'AZ \n') == b'AZ21.0\n', 60.0)
    assert float(_serial(end, b'EL \n')[2:]) > 5.0
    assert _serial(end, b'AZ21.0 EL37.0\n') == b''
    client.until(lambda: _serial(end, b'AZ EL \n') == b'AZ21.0 EL37.0\n', 60.0)
    client.until(lambda: _serial(end, b'GS\n') == b'GS1\n', 60.0)
    client.until(lambda: client.heard['acu/mode'][-1].data == 'preset', 60.0)
    for line in (b'AZ25.0 EL3x\n', b'AZ25.0EL39.0\n', b'AZ 25.0 EL 39.0\n', b'AZ25.0 EL200\n', b'AZ25,0 ELnan\n'):
        assert _serial(end, line) == b'' and _serial(end, b'GS\n') == b'GS8\n', line  # never half of a line
        assert _serial(end, b'AZ EL \n') == b'AZ21.0 EL37.0\n', line
    assert _serial(end, b'AZ21,5 EL37,5\n') == b''
    client.until(lambda: _serial(end, b'AZ EL \n') == b'AZ21.5 EL37.5\n', 60.0)
    assert _serial(end, b'AZ21.0 EL37.0\n') == b'' and _serial(end, b'GS\n') in (b'GS1\n', b'GS2\n')
    client.until(lambda: _serial(end, b'AZ EL \n') == b'AZ21.0 EL37.0\n', 60.0)
    _serial(end, b'EL39.0\n')                                               # the azimuth stays as it was asked for
    client.until(lambda: _serial(end, b'AZ EL \n') == b'AZ21.0 EL39.0\n', 60.0)
    for model, words in (('201', 'P'), ('202', 'PpS'), ('204', 'PpS')):        # 201 only points, in Hamlib
        for command in (('P', '15', '42') if word == 'P' else (word,) for word in words):
            done = subprocess.run([ROTCTL, '-m', model, '-r', f'127.0.0.1:{port}', *command], capture_output=True,
                                  text=True, timeout=60.0)
            assert done.returncode == 0, (model, command, done.stderr)
    node.send_signal(signal.SIGINT)
    assert node.wait(30.0) == 0
    os.close(end)
    os.close(device)


def _serial(end, line):
    """Write a line, read what has come in 0.3 s."""
    os.write(end, line)
    time.sleep(0.3)
    with contextlib.suppress(BlockingIOError):
        return os.read(end, 1000)
    return b''


@pytest.mark.thorough
def test_a_server_that_is_killed_serves_again_and_releases_the_control_of_its_clients(antenna):
    _, client, port = antenna
    with connected(port) as first:
        assert granted(first, 'P 20 40')
        [pid] = [int(process.name) for process in pathlib.Path('/proc').glob('[0-9]*')
                 if {f'port:={port}', 'rotctld_node'} <= set(_arguments(process))]
        os.kill(pid, signal.SIGKILL)
        assert first.recv(10) == b''
    def accepts(line):
        """A connection that the killed server's socket still accepted is reset."""
        with contextlib.suppress(ConnectionResetError), connected(port) as second:
            return ask(second, line) == b'RPRT 0\n'
        return False
    client.until(lambda: accepts('P 25 45'), 60.0)
    client.until(lambda: accepts('S'), 60.0)


def _arguments(process):
    try:
        return (process / 'cmdline').read_text().split('\0')
    except OSError:
        return []


def test_the_recording_says_who_moved_the_antenna(station):
    told = station.asked()
    assert told and {command.who.split()[0] for command in told} <= {'rotctld', 'easycomm', 'hand'}
    assert {'take', 'preset', 'stop', 'stow', 'rate', 'release'} <= {command.verb for command in told}
