"""Starts the nodes of a scenario as processes, watches over them, and ends them in order."""
import contextlib
import ctypes
import dataclasses
import json
import os
import pathlib
import signal
import socket
import subprocess
import sys
import time

import rclpy
import yaml
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from pedestal_bringup.bags import configuration
from pedestal_bringup.run.program import program_messages
from pedestal_common import messages, middleware, nodes, parameters
from pedestal_common.shell import Shell
from pedestal_common.steps import SECOND

LOG_LINES = 8
STOP_TIME = 20.0
DISCOVERY_TIME = 0.5
"""Seconds a run looks for another graph on its domain before it starts its own."""

REALTIME_SILENCE = 5.0
"""Seconds without diagnostics (they come every second) after which a node of a realtime run counts as silent."""

ANSWER_TIME = 2.0
"""Seconds a node has to answer a parameter service before it counts as stuck."""


ENDING = (nodes.DRIVE, 'recorder')
"""Nodes that end by themselves when the run is over."""


class RunError(RuntimeError):
    """A run ended before its time; the message names the node, the reason and its last log lines."""


@dataclasses.dataclass
class Outcome:
    """What a finished run says of itself: the last JSON line of the drive and of the recorder."""
    drive: dict
    recorder: dict


class Operator(Shell):
    """Sends the program tracks to a graph of `beams` (nodes.links) and listens to the diagnostics of the others."""

    def __init__(self, beams=0):
        super().__init__('operator', parameters.Parameters)
        self.links = nodes.links(beams)
        self.time = 0.0
        self.heard = {}
        self._writers = {}
        self.message_reader('diagnostics', self._take)

    def send(self, tracks):
        """The program tracks {topic: message}, latched."""
        self._open(tracks)
        for topic, message in tracks.items():
            self._writers[topic](messages.serialize(message))

    def send_to(self, names, tracks):
        """The same once all of the nodes that read them are there, or a short run may end before its recorder has
        them; whether they are sent."""
        self._open(tracks)
        if any(self._missing(publisher, nodes.readers(link, names))
               for link, publisher in self.publishers_by_link.items()):
            return False
        self.send(tracks)
        return True

    def _open(self, names):
        for name in names:
            if name not in self._writers:
                self._writers[name] = self.writer(name)

    def refuse_company(self):
        """Raise RunError when the nodes of another graph are on this domain: they would hear this one."""
        deadline = time.monotonic() + DISCOVERY_TIME
        while time.monotonic() < deadline:
            names = self.get_node_names()
            if names.count(self.name) > 1 or any(node.name in names for node in nodes.NODES if node.module):
                raise another_graph(self.context.get_domain_id())
            time.sleep(0.02)

    def _take(self, array):
        self.time = max(self.time, messages.nanoseconds(array.header.stamp) * 1e-9)
        for status in array.status:
            self.heard[status.name] = time.monotonic()

    def silent(self, limit):
        """The node that has said nothing for longer than limit [s] and longest of all; None while all speak."""
        last = min(self.heard, key=self.heard.get, default=None)
        return last if last is not None and time.monotonic() - self.heard[last] > limit else None

    def stuck(self, names, executor):
        """Those of the nodes whose process does not even answer a parameter service."""
        clients = {node: self.create_client(GetParameters, f'{node}/get_parameters') for node in names}
        answers = {}
        deadline = time.monotonic() + ANSWER_TIME
        while time.monotonic() < deadline and not (len(answers) == len(clients) and all(
                answer.done() for answer in answers.values())):
            for node, client in clients.items():
                if node not in answers and client.service_is_ready():
                    answers[node] = client.call_async(GetParameters.Request())
            executor.spin_once(timeout_sec=0.02)
        return [node for node in names if node not in answers or not answers[node].done()]


def free_bag(scenario):
    """bags/runs/SCENARIO-N with the first N that is free."""
    number = 1
    while True:
        bag = pathlib.Path('bags') / 'runs' / f'{scenario}-{number}'
        if not bag.exists():
            return bag
        number += 1


def parameter_file(scenario, pacing, bag, start=0):
    """The scenario as a ROS 2 parameter file, every node told of the graph it is in; start: see GraphParameters."""
    names = ','.join(dict.fromkeys(map(nodes.plain, scenario.nodes)))
    told = {'graph.pacing': pacing, 'graph.nodes': names, 'graph.beams': scenario.header.graph_beams,
            'graph.deadline': scenario.header.deadline}
    if start:
        told['graph.start'] = start
    sections = {node: {**scenario.given(node), **told} for node in scenario.nodes if node != 'operator'}
    sections['recorder'].update(bag=str(bag), **configuration.recorder_parameters(scenario))
    return yaml.safe_dump({node: {'ros__parameters': values} for node, values in sections.items()})


def command_line(node, module, file):
    """What starts the module of a node, 'beam_2/acu' in the namespace of its beam, with a parameter file."""
    beam = nodes.beam_of(node)
    return [sys.executable, '-m', module, '--ros-args', *(['-r', f'__ns:=/{beam}'] if beam else []),
            '--params-file', str(file)]


def _end_with_parent():
    """In the child: SIGTERM when the supervisor dies, however it dies (prctl PR_SET_PDEATHSIG)."""
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)


@contextlib.contextmanager
def uninterrupted():
    """A second Ctrl-C does not cut the clean stop short."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def sole_run(domain_id):
    """Hold a ROS domain for one run on this machine: an abstract socket, gone with its process however that ends.

    Raises RunError when another run holds it; discovery alone is too slow to tell on a busy machine.
    """
    with socket.socket(socket.AF_UNIX) as holder:
        try:
            holder.bind(f'\0pedestal-domain-{domain_id}')
        except OSError:
            raise another_graph(domain_id) from None
        yield


def another_graph(domain_id):
    return RunError(f'another graph runs on ROS_DOMAIN_ID {domain_id}; set a free one')


class Graph:
    """The processes of one run and their logs, beside the bag. Use as a context: leaving it stops whatever still runs.

    Raises RunError when there is no writing beside the bag.
    """

    def __init__(self, scenario, bag):
        self.scenario = scenario
        self.bag = pathlib.Path(bag)
        self.log = self.bag.with_name(self.bag.name + '.log')
        self.file = self.log / 'parameters.yaml'
        self.processes = {}
        self.start = time.time_ns() // SECOND * SECOND + 12 * SECOND if scenario.header.pacing == 'realtime' else 0
        try:
            self.log.mkdir(parents=True, exist_ok=True)
            self.file.write_text(parameter_file(scenario, scenario.header.pacing, self.bag, self.start))
        except OSError as error:
            raise RunError(f'cannot record to {self.bag}: {error.filename}: {error.strerror}') from None

    def __enter__(self):
        for node in self.scenario.nodes:
            if node != 'operator':
                with open(self._log_of(node), 'wb') as output:
                    self.processes[node] = subprocess.Popen(
                        command_line(node, self.scenario.row(node).module, self.file),
                        stdout=output, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
                        env={**os.environ, 'ROS_LOG_DIR': str(self.log)}, start_new_session=True,
                        preexec_fn=_end_with_parent)
        return self

    def __exit__(self, *_):
        with uninterrupted():
            self.stop()

    def stop(self):
        """Ask the nodes that still run to end, the recorder after all others; whether each ends with exit code 0."""
        others = [process for node, process in self.processes.items() if node != 'recorder']
        recorder = [process for node, process in self.processes.items() if node == 'recorder']
        return not any(self._stop(others) + self._stop(recorder))

    @staticmethod
    def _stop(processes):
        """Their exit codes; who does not listen is killed."""
        for process in processes:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
                process.send_signal(signal.SIGCONT)
        deadline = time.monotonic() + STOP_TIME
        for process in processes:
            try:
                process.wait(max(deadline - time.monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                process.kill()
        return [process.wait() for process in processes]

    def _log_of(self, node):
        return self.log / f'{node.replace("/", ".")}.log'

    def last_lines(self, node):
        """The end of a node's log, its result left out."""
        lines = self._log_of(node).read_text(errors='replace').strip().splitlines()
        return [line for line in lines if not line.startswith('{')][-LOG_LINES:]

    def result(self, node):
        """The last JSON object in a node's log: its result, or why it ended (shell.main); {} where there is none."""
        for line in reversed(self._log_of(node).read_text(errors='replace').splitlines()):
            if line.startswith('{'):
                with contextlib.suppress(ValueError):
                    return json.loads(line)
        return {}

    def outcome(self, node):
        """The result of a node that has ended well. Raises RunError where it left none."""
        result = self.result(node)
        if not result:
            raise RunError(f'{node} ended without its result; its log is {self._log_of(node)}')
        return result

    def ended(self):
        """{node: exit code} of the processes that have ended."""
        return {node: process.returncode for node, process in self.processes.items() if process.poll() is not None}

    def failure(self, stuck, unheard=None):
        """The error of a run in which a node has ended before its time, or `unheard` says nothing any more.

        stuck(names) -> those that do not answer. A node may accuse one that itself waits for the node that is stuck.
        """
        time.sleep(0.5)
        early = {node: code for node, code in self.ended().items() if code != 0 or node not in ENDING}
        lines = {node: self.last_lines(node) for node in self.processes}
        accused = {name for node in early for name in self.result(node).get('silent', ())}
        killed = [node for node, code in early.items() if code < 0]
        silent = [node for node in self.processes if node in accused and node not in early] or [
            node for node in (unheard,) if node is not None and node not in early]
        if silent and not killed:
            mute = stuck([node for node in self.processes if node not in early])
            # Who waits for the recorder to take what he sent answers nobody either; the recorder waits for no one.
            silent = [node for node in mute if node == 'recorder'] or [
                node for node in silent if node in mute] or mute or silent
        culprit = (killed or silent or list(early))[0]
        if culprit in killed:
            reason = f'died by signal {signal.Signals(-early[culprit]).name}'
        elif culprit in silent:
            reason = 'has fallen silent'
        else:
            reason = f'ended before the run did, with exit code {early[culprit]}'
        log = '\n'.join(f'  | {line}' for line in lines[culprit]) or '  | (it logged nothing)'
        others = ''.join(f'\n  {node}: {lines[node][-1]}' for node in early if node != culprit and lines[node])
        return RunError(f'{culprit} {reason}; its last log lines ({self._log_of(culprit)}):\n{log}{others}')


def run(scenario, bag, progress):
    """Run a scenario to its end and return its Outcome.

    progress(drive time [s]) is called as the run goes on. Raises RunError when a node fails, KeyboardInterrupt after
    a clean stop. The recording up to then stays readable.
    """
    tracks = program_messages(scenario)
    graph = Graph(scenario, bag)
    middleware.set_defaults()
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        operator = Operator(scenario.header.graph_beams)
        try:
            with sole_run(operator.context.get_domain_id()):
                operator.refuse_company()
                return _run(graph, operator, tracks, progress)
        finally:
            operator.destroy_node()
    finally:
        rclpy.try_shutdown()


def _run(graph, operator, tracks, progress):
    """Start the nodes, watch them to the end of the run, stop them in order."""
    header = graph.scenario.header
    patience = min(header.deadline, REALTIME_SILENCE) if header.pacing == 'realtime' else 2.0 * header.deadline
    with graph:
        sent = False
        executor = SingleThreadedExecutor()
        executor.add_node(operator)

        def stuck(names):
            return operator.stuck(names, executor)

        while graph.ended().get(nodes.DRIVE) != 0:
            executor.spin_once(timeout_sec=0.1 if sent else 0.02)
            sent = sent or operator.send_to(graph.scenario.nodes, tracks)
            progress(max(operator.time - graph.start / SECOND, 0.0))
            if any(code != 0 or node not in ENDING for node, code in graph.ended().items()):
                raise graph.failure(stuck, operator.silent(header.deadline))
            mute = operator.silent(patience)
            if mute:
                raise graph.failure(stuck, mute)
        progress(header.duration)
        if not graph.stop():
            raise graph.failure(stuck)
        return Outcome(graph.outcome(nodes.DRIVE), graph.outcome('recorder'))


def send_program(scenario) -> int:
    """Send a scenario's program track to a running ACU and keep it latched until Ctrl-C."""
    middleware.set_defaults()
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        operator = Operator(scenario.header.graph_beams)
        operator.send(program_messages(scenario))
        executor = SingleThreadedExecutor()
        executor.add_node(operator)
        while True:
            executor.spin_once(timeout_sec=0.2)
    except KeyboardInterrupt:
        return 0
    finally:
        rclpy.try_shutdown()
