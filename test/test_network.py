"""What a node opens to the network, and a graph on two hosts: network namespaces, each with its own /dev/shm."""
import os
import pathlib
import signal
import subprocess
import time

import limited
import numpy as np
import pytest
from shared import PEDESTAL

from pedestal_bringup.graph import processes, supervisor
from pedestal_bringup.graph.start import begins, parameters_of_all
from pedestal_bringup.scenario import scenario
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_recording import bag as bags

pytestmark = pytest.mark.thorough


def sockets(pid):
    """{(protocol, local IPv4 address)} of the internet sockets of a process."""
    inodes = {link.readlink().name for link in pathlib.Path(f'/proc/{pid}/fd').iterdir() if link.is_symlink()}
    found = set()
    for protocol in ('udp', 'udp6', 'tcp', 'tcp6', 'raw'):
        for line in pathlib.Path(f'/proc/{pid}/net/{protocol}').read_text().splitlines()[1:]:
            columns = line.split()
            if f'socket:[{columns[9]}]' in inodes:
                address = bytes.fromhex(columns[1].partition(':')[0])[::-1]
                found.add((protocol, '.'.join(map(str, address))))
    return found


@pytest.mark.parametrize('node', ['adu', 'recorder'])
def test_a_node_listens_to_its_own_machine_only(start_node, connect, node):
    alone = start_node(node)
    client = connect(alone.domain_id)
    client.until(lambda: node in client.node.get_node_names())
    assert sockets(alone.process.pid) == {('udp', '127.0.0.1')}
    alone.process.send_signal(signal.SIGINT)
    assert alone.finish(15.0).returncode == 0


class Hosts:
    """Two hosts on one switch: network namespaces, each with its own /dev/shm, whose cables can be pulled."""
    NAMES = 'near', 'far'

    def __init__(self):
        self._prefix = f'pedestal-{os.getpid()}-'
        self._started = []
        try:
            self._ip('netns', 'add', self._of('switch'))
            self._in('switch', 'link', 'add', 'bridge', 'type', 'bridge')
            self._in('switch', 'link', 'set', 'bridge', 'up')
            for number, name in enumerate(self.NAMES, 1):
                self._ip('netns', 'add', self._of(name))
                self._in(name, 'link', 'add', 'eth0', 'type', 'veth', 'peer', 'name', name, 'netns',
                         self._of('switch'))
                self._in('switch', 'link', 'set', name, 'master', 'bridge', 'up')
                self._in(name, 'address', 'add', f'10.77.0.{number}/24', 'dev', 'eth0')
                for device in ('lo', 'eth0'):
                    self._in(name, 'link', 'set', device, 'up')
        except (OSError, subprocess.CalledProcessError) as error:
            self.close()
            pytest.skip(f'this machine makes no network namespaces: {getattr(error, "stderr", error)}')

    def _of(self, name):
        return self._prefix + name

    @staticmethod
    def _ip(*arguments):
        subprocess.run(['ip', *arguments], check=True, capture_output=True, text=True, timeout=30)

    def _in(self, name, *arguments):
        self._ip('-netns', self._of(name), *arguments)

    def start(self, name, command, log, **environment):
        """A process on a host, its output in a file."""
        inherited = {name: value for name, value in os.environ.items() if name != 'FASTRTPS_DEFAULT_PROFILES_FILE'}
        shell = 'mount -t tmpfs tmpfs /dev/shm && exec "$@"'
        with open(log, 'wb') as output:
            process = subprocess.Popen(
                ['ip', 'netns', 'exec', self._of(name), 'unshare', '--mount', 'sh', '-c', shell, 'sh', *command],
                env={**inherited, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', **environment}, stdout=output,
                stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, start_new_session=True)
        self._started.append(process)
        return process

    def cut(self, seconds):
        """Pull the cable of the far host for a while; when that was [ns UTC], begin and end."""
        self._in('switch', 'link', 'set', 'far', 'down')
        begun = time.time_ns()
        time.sleep(seconds)
        self._in('switch', 'link', 'set', 'far', 'up')
        return begun, time.time_ns()

    def close(self):
        for process in self._started:
            limited.kill_tree(process)
        for name in (*self.NAMES, 'switch'):
            subprocess.run(['ip', 'netns', 'delete', self._of(name)], capture_output=True, timeout=30)


@pytest.fixture(scope='module')
def hosts():
    hosts = Hosts()
    yield hosts
    hosts.close()


CUTS = (0.05, 1.0, 10.0)
"""Seconds."""

TIMEOUT = 60
"""Periods until a command is stale: a busy machine may hold the control unit up for longer than the 10 of the
default."""

FOLLOWED = 5.0
"""Seconds from one cut to the next, in which the target is found again."""


@pytest.fixture(scope='module')
def cut(hosts, tmp_path_factory, reserve_domain):
    """(Bag of a pass recorded on the near host while the control unit ran on the far one, [(begin, end)] of the CUTS
    [s of the run])."""
    folder, domain = tmp_path_factory.mktemp('hosts'), {'ROS_DOMAIN_ID': str(reserve_domain())}
    chosen = scenario.load('leo_pass', pacing='realtime',
                           overrides=['acu.resume_time=15', f'adu.command_timeout={TIMEOUT}'])
    supervisor.prepare(chosen)
    begin, bag, file = begins(chosen), folder / 'bag', folder / 'parameters.yaml'
    file.write_text(parameters_of_all(chosen, bag, begin))
    (folder / 'bag.log').mkdir()
    started = [hosts.start('far' if node == 'acu' else 'near',
                           processes.command_line(node, chosen.row(node).executable, file), folder / f'{node}.log',
                           **domain)
               for node in chosen.nodes if node != 'operator']

    def said():
        return '\n'.join(log.read_text() for log in folder.glob('[a-z]*.log') if log.is_file())

    def wait_until(condition):
        deadline = time.monotonic() + 120.0
        while not condition():
            assert time.monotonic() < deadline and not any(process.poll() for process in started), said()
            time.sleep(0.1)
    wait_until(lambda: 'runs' in (folder / 'acu.log').read_text())
    hosts.start('far', [*PEDESTAL, 'program', 'leo_pass'], folder / 'program.log', **domain)
    wait_until(lambda: 'sent' in (folder / 'program.log').read_text())
    time.sleep(FOLLOWED)
    times = []
    for seconds in CUTS:
        times.append([(moment - begin) / NS_PER_SECOND for moment in hosts.cut(seconds)])
        time.sleep(FOLLOWED)
    for process in started:
        process.terminate()
    assert [process.wait(30.0) for process in started] == [0] * len(started), said()
    return bags.read(bag), times


def test_a_cut_stops_the_axes_until_it_is_over(cut):
    bag, times = cut
    joints, modes = bag.table('joint_states'), bag.table('acu/mode')
    rate = np.hypot(joints['azimuth.velocity'], joints['elevation.velocity'])

    def fastest(begin, end):
        return rate[(joints['t'] > begin) & (joints['t'] < end)].max(initial=0.0)
    for begin, end in times:
        stopped = begin + TIMEOUT * 0.005 + 0.3
        assert fastest(begin - FOLLOWED, begin) > 2e-3
        assert fastest(stopped, end) < 1e-3
        assert fastest(end, end + FOLLOWED) > 2e-3
        assert modes['data'][np.searchsorted(modes['t'], end + FOLLOWED) - 1] in ('program', 'autotrack')
