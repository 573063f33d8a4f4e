"""Fixtures of the tests that start processes: ROS domains of their own, processes that cannot outlive their test, runs
of `pedestal`, single nodes, and a client that talks to them."""
import collections
import contextlib
import dataclasses
import fcntl
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

import domains
import limited
import not_judged
import numpy as np
import pytest
from shared import NODE, PEDESTAL, begins_with, free_port

MOST_DOMAINS = 25
"""Domains that a test session holds: several sit side by side, and others want some too."""

START = 180.0
"""Seconds within which nodes have started, also on a loaded machine."""


WATCH = not_judged.Watch()


def pytest_configure(config):
    """The plugin of not_judged.py, and its mark."""
    config.pluginmanager.register(WATCH)
    config.addinivalue_line('markers', 'excused_by(count): what may excuse the test, see test/not_judged.py')


@pytest.fixture(scope='session')
def reserve_domain():
    """reserve(lasting=False) -> a ROS_DOMAIN_ID that no other test session of this machine holds (domains.py). When
    this session has MOST_DOMAINS of them, or all are taken, the one that it was given first is given again, except
    lasting ones, whose graph lives as long as the session: Fast DDS remembers a killed process for 20 s."""
    candidates = iter(domains.candidates())
    locks = []
    given = collections.deque()

    def reserve(lasting=False):
        for candidate in candidates if len(given) < MOST_DOMAINS else ():
            lock = domains.hold(candidate)
            if lock is None:
                continue
            locks.append(lock)
            if not lasting:
                given.append(candidate)
            return candidate
        if not given:
            pytest.fail('every ROS_DOMAIN_ID is taken')
        given.rotate(-1)
        return given[-1]

    yield reserve
    for lock in locks:
        lock.close()


@pytest.fixture(scope='session')
def domain_id(reserve_domain):
    return reserve_domain(lasting=True)


def _environment(domain_id, folder):
    return {**os.environ, 'ROS_DOMAIN_ID': str(domain_id), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_LOG_DIR': str(folder / 'ros_log'), 'PYTHONUNBUFFERED': '1'}


@pytest.fixture
def environment(domain_id, tmp_path):
    """Environment of a node or of `pedestal`: the session's domain, loopback only, logs in the test's folder."""
    return _environment(domain_id, tmp_path)


@pytest.fixture
def start_process(environment, tmp_path):
    """start(command, **changes of the environment, None: not set) -> Popen with text pipes, the head of its own
    process group; what still runs when the test ends is killed with its children."""
    started = []

    def start(command, **changes):
        wanted = {name: value for name, value in {**environment, **changes}.items() if value is not None}
        process = _popen(command, tmp_path, wanted)
        started.append(process)
        return process

    yield start
    for process in started:
        limited.kill_tree(process)


@pytest.fixture
def run_process(start_process):
    """run(command, timeout [s], **changes of the environment) -> CompletedProcess; fails the test, with what the
    process said, when it takes longer."""
    def run(command, timeout, **changes):
        return _finished(start_process(command, **changes), timeout)

    return run


def _popen(command, folder, environment):
    return subprocess.Popen([str(part) for part in command], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)


def _finished(process, timeout):
    try:
        output, errors = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        limited.kill_tree(process)
        try:
            output, errors = process.communicate(timeout=limited.DEATH_TIME_S)
        except subprocess.TimeoutExpired as held:       # by a process that had left the tree before
            output, errors = held.stdout, held.stderr
        pytest.fail(f'{" ".join(map(str, process.args))} ran longer than {timeout:g} s\n{output}\n{errors}')
    return subprocess.CompletedProcess(process.args, process.returncode, output, errors)


def _complaints(errors):
    return ''.join(line for line in errors.splitlines(keepends=True) if not line.startswith('[INFO]'))


@pytest.fixture(scope='session')
def complaints():
    """complaints(stderr of a node) -> it without what is mere information."""
    return _complaints


@dataclasses.dataclass
class Run:
    """A `pedestal run` as a process."""
    process: subprocess.Popen
    bag: pathlib.Path
    domain_id: int

    def __post_init__(self):
        self.log = self.bag.with_name(self.bag.name + '.log')
        self.json = self.bag.with_name(self.bag.name + '.json')

    def pids(self):
        """{executable without _node: pid} of the nodes that run."""
        found = {}
        for process in pathlib.Path('/proc').glob('[0-9]*'):
            try:
                arguments = (process / 'cmdline').read_text().split('\0')
            except OSError:
                continue
            if str(self.log / 'parameters.yaml') in arguments:
                found[arguments[3].removesuffix('_node')] = int(process.name)
        return found

    def signal(self, node, number):
        os.kill(self.pids()[node], number)

    def recorded(self, size=100_000):
        """Whether this many bytes are in the bag: its first chunk, so the drive is well under way."""
        assert self.process.poll() is None, self.finish()
        return sum(file.stat().st_size for file in self.bag.glob('*.mcap')) > size

    def finish(self, timeout=180.0):
        return _finished(self.process, timeout)

    def interrupt(self):
        """Ctrl-C, where it has not ended yet; the CompletedProcess."""
        self.process.send_signal(signal.SIGINT)
        return self.finish()

    def kill(self):
        limited.kill_tree(self.process)
        limited.kill(*self.pids().values())


@pytest.fixture(scope='module')
def start_run(reserve_domain, tmp_path_factory):
    """start(scenario, *arguments, domain_id=None, bag=None, prefix=()) -> Run in a domain and a folder of its own."""
    started = []

    def start(scenario, *arguments, domain_id=None, bag=None, prefix=()):
        started.append(_run(scenario, arguments, domain_id or reserve_domain(), tmp_path_factory.mktemp('run'), bag,
                            prefix))
        return started[-1]

    yield start
    for run in started:
        run.kill()


def _run(scenario, arguments, domain, folder, bag=None, prefix=()):
    run = Run(None, bag or folder / 'bag', domain)
    command = [*prefix, *PEDESTAL, 'run', scenario, '--bag', run.bag, '--json', run.json, *arguments]
    run.process = _popen(command, folder, _environment(domain, folder))
    WATCH.add(lambda: run.process.poll() is None, not_judged.recorded(run.bag, run.process))
    return run


@pytest.fixture(scope='session')
def patient():
    """Arguments of a realtime run in which no time of the product's own ends while a busy machine holds a node up or
    starts it again, and whose position loops stay stable with joint states as late as that; axes may be as far beyond
    their commands as one that is obeyed for too long takes them. It takes a quarter of the steps, so that it leaves
    more of a core to others."""
    return tuple(word for change in ('acu.resume_time=60', 'acu.step_gap=0.2', 'acu.attitude_timeout=10',
                                     'acu.unasked_rate=1', 'acu.azimuth.feedforward.bandwidth=4',
                                     'acu.elevation.feedforward.bandwidth=4', 'adu.command_timeout=60',
                                     'adu.period=0.02') for word in ('--param', change))


RECORDED = {'leo_pass': 5.0, 'ship_pass': 3.0}
"""{scenario: s} of the runs of `recorded`."""


@pytest.fixture(scope='session')
def recorded(reserve_domain, tmp_path_factory):
    """recorded(scenario) -> (Run, what it printed) of a finished lockstep run of RECORDED seconds that comes to
    autotrack, to be read only: one for the files of all workers, made by the first that asks."""
    mine = tmp_path_factory.getbasetemp()
    everyones = mine.parent if 'PYTEST_XDIST_WORKER' in os.environ else mine

    def make(scenario):
        folder = everyones / f'recorded-{scenario}'
        folder.mkdir(exist_ok=True)
        said = folder / 'said'
        with open(folder / 'lock', 'w') as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not said.exists():
                run = _run(scenario, ('--pacing', 'lockstep', '--duration', RECORDED[scenario], '--param',
                                      'acu.tracker.lock_count=20'), reserve_domain(), folder)
                try:
                    result = run.finish()
                finally:
                    run.kill()
                assert result.returncode == 0, result.stderr
                said.write_text(result.stdout)
        return Run(None, folder / 'bag', None), said.read_text()
    return make


EXECUTABLES = {'drives': 'simulated_drives_node', 'monopulse': 'monopulse_receiver_node', 'page': 'operator_page'}
"""{node of the tests: its executable} of those whose executable is not NODE_node."""


@dataclasses.dataclass
class NodeProcess:
    process: subprocess.Popen
    domain_id: int

    def finish(self, timeout=START):
        """CompletedProcess; of stderr what is no mere information."""
        done = _finished(self.process, timeout)
        done.stderr = _complaints(done.stderr)
        return done


@pytest.fixture(scope='module')
def start_node(reserve_domain, tmp_path_factory):
    """start(node, *ROS arguments, domain_id=None) -> NodeProcess, alone in a domain of its own, or in that domain."""
    started = []

    def start(node, *arguments, domain_id=None):
        folder, domain = tmp_path_factory.mktemp(node), domain_id or reserve_domain()
        command = [*NODE, EXECUTABLES.get(node, f'{node}_node'), '--ros-args', *arguments]
        started.append(NodeProcess(_popen(command, folder, _environment(domain, folder)), domain))
        return started[-1]

    yield start
    for node in started:
        limited.kill_tree(node.process)


class Client:
    """Talks to nodes through rclpy: publishes and hears the messages of messages.py, calls services."""

    def __init__(self, domain_id, name):
        import rclpy

        from pedestal_common.node import middleware
        self.context = rclpy.Context()
        rclpy.init(args=[], context=self.context, domain_id=domain_id)
        self.node = rclpy.create_node(name, context=self.context)
        with contextlib.redirect_stderr(sys.__stderr__):    # faulthandler wants a file, which capsys has none of
            self.executor = middleware.make_executor(self.context)
        self.executor.add_node(self.node)
        self.is_open, self.counts = True, None
        self.heard = {}
        self.publishers = {}

    def write(self, *names):
        """Make publishers of these topics and wait until someone reads each."""
        from pedestal_common.graph import topics
        from pedestal_common.node import middleware
        for name in names:
            topic = topics.TOPIC_BY_NAME[name]
            self.publishers[name] = self.node.create_publisher(middleware.message_class(topic.type), name,
                                                               middleware.qos(topic.rate))
        self.until(lambda: all(publisher.get_subscription_count() for publisher in self.publishers.values()))
        time.sleep(0.3)  # the readers' side of the discovery

    def read(self, name, take=None):
        """Hear a topic: messages go to self.heard[name] and to take; waits until someone writes it."""
        from pedestal_common.graph import topics
        from pedestal_common.node import middleware
        from pedestal_common.wire import messages
        topic = topics.TOPIC_BY_NAME[name]
        heard = self.heard[name] = []
        if name == 'diagnostics' and self.counts is None:
            self.counts = []

        def on_bytes(data):
            heard.append(messages.deserialize(data, topic.type))
            if name == 'diagnostics':
                self.counts += not_judged.counts_of(heard[-1])
            if take is not None:
                take(heard[-1])
        self.node.create_subscription(middleware.message_class(topic.type), name, on_bytes,
                                      middleware.qos(topic.rate), raw=True)
        self.until(lambda: self.node.count_publishers(name))
        if topic.rate == 'reply':
            time.sleep(0.3)  # the writer's side of the discovery

    def publish(self, name, message):
        from pedestal_common.wire import messages
        self.publishers[name].publish(messages.serialize(message))

    def spin(self, seconds):
        """Hear for so long [s] whatever comes."""
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0.0:
            self.executor.spin_once(timeout_sec=left)

    def until(self, condition, timeout=START, told=lambda: ''):
        """Spin until condition() is true and return what it gave; fails the test after timeout [s], with told()."""
        deadline = time.monotonic() + timeout
        while not (value := condition()):
            assert time.monotonic() < deadline, f'nothing within {timeout:g} s; {told()}'
            self.executor.spin_once(timeout_sec=0.05)
        return value

    def call(self, name, service_type, request):
        client = self.node.create_client(service_type, name)
        try:
            self.until(client.service_is_ready)
            asked = []

            def done():
                # A server drops a response that a busy machine has not yet found the reader of: so ask once more.
                if not asked or time.monotonic() > asked[-1][0] + 20.0:
                    asked.append((time.monotonic(), client.call_async(request)))
                return next((future for _, future in asked if future.done()), None)
            return self.until(done).result()
        finally:
            self.node.destroy_client(client)

    def trigger(self, name):
        """(success, message) of a std_srvs/Trigger."""
        from std_srvs.srv import Trigger
        response = self.call(name, Trigger, Trigger.Request())
        return response.success, response.message

    def diagnosed(self, text, timeout=30.0):
        """Wait for a diagnostic that comes from now on and whose message holds the text; its DiagnosticStatus."""
        heard = self.heard['diagnostics']
        first = len(heard)

        def found():
            return [status for array in heard[first:] for status in array.status if text in status.message]
        return self.until(found, timeout, lambda: f'no diagnostic says {text!r}; said: {self.said(first)}')[0]

    def counted(self, until):
        """The counts of lost steps in the diagnostics that it reads, up to a time [ns] while it is open."""
        end = time.monotonic() + not_judged.LAST_COUNT_TIME_S
        while self.counts is not None and self.is_open and time.monotonic() < end and not (
                self.counts and self.counts[-1][0] > until):
            self.executor.spin_once(timeout_sec=0.05)
        return self.counts or []

    def said(self, first):
        """The messages of the diagnostics from the first-th on."""
        return [status.message for array in self.heard['diagnostics'][first:] for status in array.status]

    def close(self):
        self.is_open = False
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@contextlib.contextmanager
def _clients():
    """Give what opens clients, and close them."""
    clients = []
    before = dict(os.environ)
    from pedestal_common.graph import domain
    domain.set_defaults()

    def open_client(domain_id, name='client'):
        client = Client(domain_id, name)
        clients.append(client)
        WATCH.add(lambda: client.is_open, client.counted)
        return client

    try:
        yield open_client
    finally:
        for client in clients:
            client.close()
        os.environ.clear()
        os.environ.update(before)


@pytest.fixture(scope='module')
def connect():
    """connect(domain_id, name='client') -> Client; by its name it can stand for a node of the graph."""
    with _clients() as open_client:
        yield open_client


@dataclasses.dataclass
class Station:
    """An antenna in realtime with a server for every other program. client: of its graph, and hears its mode and
    joint states; ports: {server: number}; said: what was printed when it started."""
    run: Run
    client: Client
    ports: dict
    said: str

    def recorded(self, topic):
        """The messages of a topic in the file so far, once that holds what was said until now."""
        from pedestal_common.graph import topics
        from pedestal_common.wire import messages
        from pedestal_recording import bag as bags
        heard, copy = self.client.heard['joint_states'], self.run.bag.with_name('copy')
        heard.clear()
        self.client.until(lambda: heard)
        now = messages.nanoseconds(heard[0].header.stamp)

        def so_far():
            shutil.copytree(self.run.bag, copy, dirs_exist_ok=True)
            bag = bags.load(copy)
            times = [log_time for _, log_time, _, _ in bag.raw('joint_states')]
            return bag if times and times[-1] > now else None
        raw = self.client.until(so_far).raw(topic)
        return [messages.deserialize(data, topics.TOPIC_BY_NAME[topic].type) for *_, data in raw]

    def asked(self):
        """The commands that were replied to, as they are recorded."""
        from pedestal_common.wire import commands
        return [commands.of_reply(reply)[0] for reply in self.recorded('acu/command_result')]

    def end(self):
        """Ctrl-C; the servers have nothing to complain of."""
        self.run.interrupt()
        for name in ('foxglove', 'frames'):
            complaints = _complaints((self.run.log / f'{name}.log').read_text())
            assert [line for line in complaints.splitlines() if not line.startswith(f'{name}: ')] == []


@pytest.fixture(scope='session')
def station(reserve_domain, tmp_path_factory, patient):
    """The Station of the files of conftest.STATION, which come in that order. It moves softly: where a busy machine
    loses steps, a hard start looks like an encoder that jumps."""
    ports = {server: free_port() for server in ('rotctld', 'page', 'foxglove')}
    soft = (f'acu.{axis}.shaper.{limit}' for axis in ('azimuth', 'elevation')
            for limit in ('rate=0.6', 'acceleration=2', 'jerk=100'))
    changes = ('acu.initial_mode=standby', 'acu.tracker.handover=false', *soft)
    run = _run('uav_flyby', ('--duration', '900', '--pacing', 'realtime', '--frames', *patient,
                             *(word for server, port in ports.items() for word in (f'--{server}', port)),
                             *(word for change in changes for word in ('--param', change))),
               reserve_domain(lasting=True), tmp_path_factory.mktemp('station'))
    try:
        with _clients() as connect:
            said = begins_with(run.process, 7)
            client = connect(run.domain_id)
            for name in ('acu/mode', 'joint_states'):
                client.read(name)
            client.until(lambda: client.heard['joint_states'] and client.heard['acu/mode'])
            made = Station(run, client, ports, said)
            yield made
            if run.process.poll() is None:
                made.end()
    finally:
        run.kill()


@pytest.fixture
def one_line():
    """one_line(errors) -> the single line a refused command prints; fails the test on a traceback or more lines."""
    def check(errors):
        assert 'Traceback' not in errors, errors
        lines = _complaints(errors).strip().splitlines()
        assert len(lines) == 1, errors
        return lines[0]
    return check


@pytest.fixture(scope='session')
def differences():
    """A function (Run of the closed loop, Bag) -> {topic column: largest difference} of every message of every topic,
    which the bag holds up to its last complete step."""
    def of(run, bag):
        unequal = {}
        for topic in run.topics:
            ours, theirs = run.table(topic), bag.table(topic)
            count = len(theirs['t'])
            if not (len(ours['t']) - 1 <= count <= len(ours['t'])
                    and np.array_equal(np.round(ours['t'][:count] * 1e9), np.round(theirs['t'] * 1e9))):
                unequal[f'{topic} t'] = len(ours['t']) - count
                continue
            for column in ours:
                a, b = ours[column][:count], theirs[column]
                if column == 'data':
                    if list(a) != list(b):
                        unequal[topic] = b
                elif column != 't' and not np.array_equal(a, b, equal_nan=True):
                    unequal[f'{topic} {column}'] = float(np.nanmax(np.abs(a - b)))
        assert set(run.topics) >= {'joint_states', 'acu/mode', 'acu/rate_command'}
        return unequal
    return of
