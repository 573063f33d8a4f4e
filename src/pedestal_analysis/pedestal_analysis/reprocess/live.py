"""`pedestal recompute --live`: feed the recorded inputs of a node to the process of the node, in lockstep over ROS.

The module starts the process of the node, and takes the place of all other nodes of the graph.
"""
import collections
import os
import pathlib
import signal
import subprocess
import tempfile
import time

import numpy as np
import rclpy
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger

from pedestal_analysis.reprocess import difference, recompute
from pedestal_bringup.graph.operator_node import Operator
from pedestal_bringup.graph.processes import RunError, command_line
from pedestal_common import parameters
from pedestal_common.graph import domain, nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node import middleware
from pedestal_common.text_files import parameter_file
from pedestal_common.wire import commands, messages, records

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
    answers   {output topic: [CDR bytes]} received so far
    replies   [CDR bytes] of the replies of the node to commands
    readers   the other ROS nodes that `stand_in` made
    """

    def __init__(self, node, inputs, written):
        super().__init__()
        self.node = node
        self.publishers_of = {name: self._publisher(self.links[name]) for name in inputs}
        self.answers = {name: [] for name in written}
        self.readers = []
        row = nodes.row(node)
        self.replies = []
        if row.obeys:
            self.command_publisher = self._publisher(self.links[row.obeys])
            self.create_subscription(middleware.message_class(self.links[row.replies].type), row.replies,
                                     self.replies.append, middleware.qos(self.links[row.replies].rate), raw=True)

    def stand_in(self, names):
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

    def _publisher(self, link):
        return self.create_publisher(middleware.message_class(link.type), link.name, middleware.qos(link.rate))

    def announce_now(self, name, data):
        """Publish a message for which no step waits, and wait for its acknowledgement. Raises RunError without it."""
        publisher = self.publishers_of[name]
        publisher.publish(data)
        if not publisher.wait_for_all_acked(Duration(seconds=ANSWER_TIMEOUT_S)):
            raise RunError(f'{self.node} did not acknowledge {name} within {ANSWER_TIMEOUT_S:g} s')


class Live:
    """The process of the node together with the Feeder.

    feeder     Feeder
    process    subprocess.Popen of the node
    log        path of the log of the process
    services   names of the services of the node
    """

    def __init__(self, feeder, process, log, services):
        self.feeder, self.process, self.log, self.services = feeder, process, log, services
        self.executor = SingleThreadedExecutor()
        for node in (feeder, *feeder.readers):
            self.executor.add_node(node)

    def until(self, condition, limit, missing):
        """Spin the ROS nodes of the Feeder until condition() is true.

        limit: longest wait [s]; missing: function that returns the name of the missing message, for the error.
        Raises RunError if the node dies, or after the limit.
        """
        deadline = time.monotonic() + limit
        while not condition():
            if self.process.poll() not in (None, 0):     # 0: it ended as planned, and its last messages may follow
                raise RunError(f'{self.feeder.node} exited with code {self.process.returncode}: '
                               f'{" ".join(self.log.read_text(errors="replace").split())}')
            if time.monotonic() > deadline:
                raise RunError(f'{self.feeder.node}: no {missing()} within {limit:g} s')
            self.executor.spin_once(timeout_sec=0.1)

    def send_command(self, command):
        """Send a commands.Command by its service or by the command topic, and wait for the reply. Raises RunError."""
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


def outputs(recording, done, params):
    """Return {topic: Output} of the process of a node that is fed with the inputs of a recompute.Recomputed.

    done: the Recomputed, whose outputs give the number of messages due at each step; params: parameters of the node.
    Raises RunError if messages are missing, RecomputeError for a recording in realtime.
    """
    if not recording.lockstep:
        raise recompute.RecomputeError('--live feeds in lockstep, and steps of a realtime recording may lack inputs; '
                                       'recompute it without --live')
    with domain.of_run(), tempfile.TemporaryDirectory() as folder:
        middleware.initialise([])
        try:
            return _run(recording, done, params, pathlib.Path(folder))
        finally:
            rclpy.try_shutdown()


def _graph(recording, unit):
    """Return the parameter graph.nodes of the process: the node, the recorder, and the optional nodes that feed it.

    Because the recorder subscribes to every output, the process publishes each of them.
    """
    optional = [node.name for node in nodes.NODES if (node.optional or node.name == 'operator')
                and any(topic in unit.NODE.reads and recording.has(topic) for topic in node.writes)]
    return (unit.NODE.name, 'recorder', *optional)


def _run(recording, done, params, folder):
    """Start the process of the node with its files in a folder, feed it, end it, and return its {topic: Output}."""
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
        process = subprocess.Popen(command_line(done.node, done.unit.NODE.module, file),
                                   stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                                   env={**os.environ, 'ROS_LOG_DIR': str(folder)})
        try:
            live = Live(feeder, process, log, done.unit.REQUESTS)
            live.until(lambda: all(publisher.get_subscription_count() for publisher in feeder.publishers_of.values())
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


def _feed(recording, done, live):
    """Feed all steps to the process. Return {output topic: [step at which each message came]}."""
    feed, feeder = done.feed, live.feeder
    events = collections.defaultdict(list)
    for step, name, row in feed.events:
        events[step].append((name, row))
    due = {name: _due(done, name) for name in done.outputs}
    steps = {name: [] for name in done.outputs}

    def answered(step):
        for name, answers in feeder.answers.items():
            steps[name] += [step] * (len(answers) - len(steps[name]))
        return all(len(feeder.answers[name]) >= count[step] for name, count in due.items())

    def missing(step):
        names = [name for name, count in due.items() if len(feeder.answers[name]) < count[step]]
        return f'{", ".join(names)} for step {feed.stamps[step] / NS_PER_SECOND:.6f} s'

    for step in range(len(feed.stamps)):
        for name, row in events[step]:
            feeder.announce_now(name, recording.data(name)[row])
        for command, _ in done.requests.get(step, ()):
            live.send_command(command)
        for name, rows in feed.rows.items():
            if rows[step] >= 0 and name in feeder.publishers_of:
                feeder.publishers_of[name].publish(recording.data(name)[rows[step]])
        live.until(lambda step=step: answered(step), NODE_START_TIMEOUT_S if step == 0 else ANSWER_TIMEOUT_S,
                   lambda step=step: missing(step))
    return steps


def _due(done, name):
    """Return the number (n,) of messages of an output topic that are due up to each step, this step included."""
    if records.is_text(name):
        return np.searchsorted(done.outputs[name].stamps, done.feed.stamps, side='right')
    return np.cumsum(done.steps[name]['stamp'] != records.NO_STAMP)


def _output(name, data, done, steps):
    """Return the Output of a topic from its CDR bytes and the step at which each message came."""
    log = done.feed.stamps[np.array(steps[:len(data)], np.int64)]
    return difference.recorded([bytes(message) for message in data[:len(log)]], log, name)
