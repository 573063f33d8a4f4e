"""python test/recompute_live.py BAG NODE: feed the recorded inputs of a node to the process of the node, in lockstep
over ROS, and compare its outputs with the recorded ones. Exit code 1 if they are not identical.

The program starts the process of the node, and takes the place of all other nodes of the graph. It proves that the
process of a node and its unit, which `pedestal recompute` uses, are equal, services included.
"""
import functools
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Collection, Iterable

import numpy as np
import rclpy
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.utilities import try_shutdown
from std_srvs.srv import Trigger

from pedestal_bringup.graph.operator_node import Operator
from pedestal_bringup.graph.processes import command_line
from pedestal_common import parameters
from pedestal_common.graph import domain, nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node import middleware
from pedestal_common.node.unit import Unit
from pedestal_common.quantities import Ints, Seconds
from pedestal_common.text_files import parameter_file
from pedestal_common.wire import commands, messages, records
from pedestal_workbench.again import difference, recompute
from pedestal_workbench.again.difference import Output
from pedestal_workbench.again.feed import FedRecording

NODE_START_TIMEOUT_S = 300.0
"""Time allowed for the start of the node [s]. The node may have to compile its laws first."""
ANSWER_TIMEOUT_S = 20.0  # time allowed for the answer of the node to a step [s]
STOP_TIMEOUT_S = 10.0  # grace period between SIGINT and SIGKILL [s]
NODE_DISCOVERY_TIME_S = 0.5
"""Wait after the Feeder has discovered the node, so that the node can discover the Feeder too [s]."""


class Feeder(Operator):
    """ROS node in place of the graph around a node: it publishes the inputs of the node, and keeps its outputs.

    node      name of the node
    inputs    topics that the Feeder publishes
    written   output topics of the node
    """

    def __init__(self, node: str, inputs: Iterable[str], written: Iterable[str]) -> None:
        super().__init__()
        self.node = node
        self.input_publishers = {name: self._publisher(self.links[name]) for name in inputs}
        self.answers: dict[str, list[bytes]] = {name: [] for name in written}   # received so far, by output topic
        self.readers: list[Node] = []   # the other ROS nodes that `stand_in` made
        row = nodes.row(node)
        self.replies: list[bytes] = []  # of the node to commands
        if row.obeys:
            self.command_publisher = self._publisher(self.links[row.obeys])
            self.create_subscription(middleware.message_class(self.links[row.replies].type), row.replies,
                                     self.replies.append, middleware.qos(self.links[row.replies].rate), raw=True)

    def stand_in(self, names: Collection[str]) -> None:
        """Make a ROS node for each of these names, as a subscriber of the outputs of the node.

        Because a node in lockstep waits until all nodes in its parameter graph.nodes have subscribed, each needs such
        a stand-in. The stand-in of the recorder keeps the outputs in `answers`; the others drop them.
        """
        for reader in names:
            if reader not in (self.node, self.name):
                self.readers.append(rclpy.create_node(reader))
                for link in self.links.values():
                    if self.node in link.writers and reader in nodes.readers(link, names):
                        kept = reader == 'recorder' and link.name in self.answers
                        self.readers[-1].create_subscription(
                            middleware.message_class(link.type), link.name,
                            self.answers[link.name].append if kept else lambda data: None, middleware.qos(link.rate),
                            raw=True)

    def _publisher(self, link: nodes.Link) -> Publisher:
        return self.create_publisher(middleware.message_class(link.type), link.name, middleware.qos(link.rate))

    def announce_now(self, name: str, data: bytes) -> None:
        """Publish a message for which no step waits, and wait for its acknowledgement, else raise RuntimeError."""
        publisher = self.input_publishers[name]
        publisher.publish(data)
        if not publisher.wait_for_all_acked(Duration(seconds=ANSWER_TIMEOUT_S)):
            raise RuntimeError(f'{self.node} did not acknowledge {name} within {ANSWER_TIMEOUT_S:g} s')


class Live:
    """The process of the node together with the Feeder. log: of the process; services: of the node."""

    def __init__(self, feeder: Feeder, process: subprocess.Popen[bytes], log: pathlib.Path,
                 services: Collection[str]) -> None:
        self.feeder, self.process, self.log, self.services = feeder, process, log, services
        self.executor = SingleThreadedExecutor()
        for node in (feeder, *feeder.readers):
            self.executor.add_node(node)

    def until(self, condition: Callable[[], object], limit: Seconds, missing: Callable[[], str]) -> None:
        """Spin the ROS nodes of the Feeder until condition() is true.

        limit: longest wait; missing: function that returns the name of the missing message, for the error.
        Raises RuntimeError if the node dies, or after the limit.
        """
        deadline = time.monotonic() + limit
        while not condition():
            if self.process.poll() not in (None, 0):     # 0: it ended as planned, and its last messages may follow
                raise RuntimeError(f'{self.feeder.node} exited with code {self.process.returncode}: '
                                   f'{" ".join(self.log.read_text(errors="replace").split())}')
            if time.monotonic() > deadline:
                raise RuntimeError(f'{self.feeder.node}: no {missing()} within {limit:g} s')
            self.executor.spin_once(timeout_sec=0.1)

    def send_command(self, command: commands.Command) -> None:
        """Send a command by its service or by the command topic, and wait for the reply. Raises RuntimeError."""
        if command.verb not in self.services:
            before = len(self.feeder.replies)
            self.feeder.command_publisher.publish(messages.serialize(commands.message(command)))
            self.until(lambda: len(self.feeder.replies) > before, ANSWER_TIMEOUT_S, lambda: f'reply to {command}')
            return
        service = command.verb
        client = self.feeder.create_client(Trigger, service)
        self.until(client.service_is_ready, ANSWER_TIMEOUT_S, lambda: f'service {service}')
        future = client.call_async(Trigger.Request())
        self.until(future.done, ANSWER_TIMEOUT_S, lambda: f'reply of service {service}')
        self.feeder.destroy_client(client)


def outputs(recording: FedRecording, done: recompute.Recomputed,
            params: parameters.Parameters) -> dict[str, Output]:
    """Return {topic: Output} of the process of a node that is fed with the inputs of the recomputation `done`.

    done: its outputs give the number of messages due at each step; params: parameters of the node.
    Raises RuntimeError if messages are missing. Steps of a recording in realtime may lack inputs.
    """
    assert recording.lockstep
    with domain.of_run(), tempfile.TemporaryDirectory() as folder:
        middleware.initialise([])
        try:
            return _run(recording, done, params, pathlib.Path(folder))
        finally:
            try_shutdown()


def _graph(recording: FedRecording, unit: Unit) -> tuple[str, ...]:
    """Return the parameter graph.nodes of the process: the node, the recorder, and the optional nodes that feed it.
    Because the recorder subscribes to every output, the process publishes each of them."""
    optional = [node.name for node in nodes.NODES if (node.optional or node.name == 'operator')
                and any(topic in unit.NODE.reads and recording.has(topic) for topic in node.writes)]
    return (unit.NODE.name, 'recorder', *optional)


def _run(recording: FedRecording, done: recompute.Recomputed, params: parameters.Parameters,
         folder: pathlib.Path) -> dict[str, Output]:
    file, log = folder / 'parameters.yaml', folder / 'log'
    names = _graph(recording, done.unit)
    values = {**parameters.as_dict(params), 'graph.pacing': 'lockstep', 'graph.nodes': ','.join(names),
              'graph.beams': recording.bag.beams}
    file.write_text(parameter_file.text({done.node: values}))
    inputs = [name for name in done.unit.reads if recording.feeds(name) and name not in done.unit.NODE.writes]
    feeder = Feeder(done.node, inputs, done.outputs)
    with open(log, 'wb') as output:
        feeder.check_domain_free()
        feeder.stand_in(names)
        process = subprocess.Popen(command_line(done.node, done.unit.NODE.executable, file),
                                   stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                                   env={**os.environ, 'ROS_LOG_DIR': str(folder)})
        try:
            live = Live(feeder, process, log, done.unit.REQUESTS)
            live.until(lambda: all(each.get_subscription_count() for each in feeder.input_publishers.values())
                       and feeder.count_publishers('diagnostics'), NODE_START_TIMEOUT_S,
                       lambda: 'subscriber of its inputs')
            # Because DDS discovers each direction separately, the node may not know the feeder yet.
            time.sleep(NODE_DISCOVERY_TIME_S)
            steps = _feed(recording, done, live)
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
    return {name: _output(name, data, done, steps[name]) for name, data in feeder.answers.items()}


def _feed(recording: FedRecording, done: recompute.Recomputed, live: Live) -> dict[str, list[int]]:
    """Feed all steps to the process. Return {output topic: [step at which each message came]}."""
    feed, feeder = done.feed, live.feeder
    due = {name: _due(done, name) for name in done.outputs}
    steps: dict[str, list[int]] = {name: [] for name in done.outputs}

    def answered(step: int) -> bool:
        for name, answers in feeder.answers.items():
            steps[name] += [step] * (len(answers) - len(steps[name]))
        return all(len(feeder.answers[name]) >= count[step] for name, count in due.items())

    def missing(step: int) -> str:
        names = [name for name, count in due.items() if len(feeder.answers[name]) < count[step]]
        return f'{", ".join(names)} for step {feed.stamps[step] / NS_PER_SECOND:.6f} s'

    for step, _, came in feed.stretches(range(len(feed.stamps))):
        for name, row in came:
            feeder.announce_now(name, recording.data(name)[row])
        for command, _ in done.requests.get(step, ()):
            live.send_command(command)
        for name, rows in feed.rows.items():
            if rows[step] >= 0 and name in feeder.input_publishers:
                feeder.input_publishers[name].publish(recording.data(name)[rows[step]])
        live.until(functools.partial(answered, step), NODE_START_TIMEOUT_S if step == 0 else ANSWER_TIMEOUT_S,
                   functools.partial(missing, step))
    return steps


def _due(done: recompute.Recomputed, name: str) -> Ints:
    """Return the number of messages of an output topic that are due up to each step, this step included."""
    if records.is_text(name):
        return np.searchsorted(done.outputs[name].stamps, done.feed.stamps, side='right')
    return np.cumsum(done.steps[name]['stamp'] != records.NO_STAMP)


def _output(name: str, data: list[bytes], done: recompute.Recomputed, steps: list[int]) -> Output:
    """Return the Output of a topic from its CDR bytes and the step at which each message came."""
    log = done.feed.stamps[np.array(steps[:len(data)], np.int64)]
    return difference.recorded([bytes(message) for message in data[:len(log)]], log, name)


def main(bag: str, node: str) -> int:
    """Print the comparison of a node in a bag. Return the exit code, 1 for a difference."""
    recording = FedRecording(bag)
    params = recompute.parameters_of(recording, node)
    done = recompute.recompute(recording, node, params)
    exact = difference.Tolerance(0.0, 0.0)
    compared = recompute.compare(recording, outputs(recording, done, params), done.unit, exact)
    print(*difference.lines(compared), sep='\n')
    return 0 if compared and all(topic.identical for topic in compared) else 1


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))
