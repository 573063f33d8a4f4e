"""Servers beside a run: ports in use, announcements, ends and restarts."""
import os
import socket
import sys
import time
import types

import pytest

from pedestal_bringup.graph import launch_arguments, operator_servers, processes, supervisor
from pedestal_bringup.scenario import scenario

PORT_SERVERS = [name for name, server in operator_servers.SERVERS.items() if server.port]
REALTIME = types.SimpleNamespace(pacing='realtime')

SERVER = """import time
print('[INFO] no announcement')
print('rotctld: 127.0.0.1:4533', flush=True)
time.sleep(0.2)
print('rotctld, again', flush=True)
time.sleep(60.0)
"""


@pytest.fixture
def taken():
    """Port of another program."""
    with socket.create_server(('127.0.0.1', 0)) as server:
        yield server.getsockname()[1]


@pytest.mark.parametrize('name', PORT_SERVERS)
def test_a_port_in_use_is_refused(name, taken):
    with pytest.raises(ValueError, match=f'^--{name}: port {taken} of 127.0.0.1 is in use: --{name} PORT selects '
                                         'another port$'):
        operator_servers.check({name: taken}, REALTIME)
    given = {**{argument.name: argument.default for argument in launch_arguments.ARGUMENTS}, 'pacing': 'realtime',
             name: str(taken)}
    with pytest.raises(ValueError, match=f'^{name}:=: port {taken} of 127.0.0.1 is in use: {name}:=PORT selects'):
        launch_arguments.servers(given, launch_arguments.load_scenario(given))


def test_two_servers_at_the_same_port_are_refused(taken):
    free = taken + 1 if taken < 65535 else taken - 1
    with pytest.raises(ValueError, match=f'--easycomm: port {free} of 127.0.0.1 is in use'):
        operator_servers.check({'rotctld': free, 'easycomm': free}, REALTIME)


@pytest.fixture
def graph_of(tmp_path, monkeypatch):
    """graph_of(source of a server, lines=1) -> Graph with this server, not entered."""
    def make(source, lines=1):
        (tmp_path / 'a_server.py').write_text(source)
        monkeypatch.setenv('PYTHONPATH', str(tmp_path), prepend=os.pathsep)
        return processes.Graph(scenario.load('uav_flyby', pacing='realtime'), tmp_path / 'bag', {
            'rotctld': processes.ServerProcess([sys.executable, '-m', 'a_server'], lines)})
    return make


def test_a_server_is_announced_when_it_serves(graph_of, capfd):
    with graph_of(SERVER, 2) as graph:
        graph.start_servers()
        assert capfd.readouterr().out == 'rotctld: 127.0.0.1:4533\nrotctld, again\n'
        assert (graph.log / 'rotctld.log').stat().st_mode & 0o077 == 0


def test_a_server_that_cannot_serve_ends_the_run(graph_of):
    with graph_of("""print('{"error": "port 1 is in use", "silent": []}'); raise SystemExit(1)""") as graph:
        with pytest.raises(RuntimeError, match='^--rotctld: port 1 is in use$'):
            graph.start_servers()


def test_a_server_that_dies_is_started_again_until_it_has_died_too_often(graph_of, capfd):
    """The nodes and the run go on."""
    with graph_of(SERVER, 2) as graph:
        graph.start_servers()
        supervised = supervisor.Supervisor(graph, types.SimpleNamespace(), time.time_ns())
        attempts = graph.scenario.header.restart.attempts
        capfd.readouterr()
        for number in range(1, attempts + 1):
            graph.kill('rotctld')
            supervised.check_processes(100.0)
            output = capfd.readouterr()
            assert output.err == (f'pedestal: rotctld died by signal SIGKILL: starting it again, {number} of '
                                  f'{attempts} within 60 s\n')
            supervised.check_processes(159.0)
            while not output.out:
                time.sleep(0.05)
                supervised.check_processes(159.0)
                output = capfd.readouterr()
            assert output.out == 'rotctld: 127.0.0.1:4533\nrotctld, again\n'
        graph.kill('rotctld')
        for _ in range(2):
            supervised.check_processes(159.0)
        assert capfd.readouterr().err == (f'pedestal: rotctld died by signal SIGKILL, after {attempts} starts within '
                                          '60 s: it stays off\n')
        assert supervised.restarts.count == 0
