"""`pedestal recompute --live`: the recorded inputs of a node into its real process, in lockstep over DDS."""
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
from pedestal_bringup.graph.operator_node import Operator, sole_run
from pedestal_bringup.graph.processes import RunError, command_line
from pedestal_bringup.scenario import parameter_file
from pedestal_common import parameters
from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node import middleware
from pedestal_common.wire import commands, messages, records

NODE_START_TIMEOUT_S = 300.0
"""Seconds within which the node has started; it may be compiling its laws for the first time."""
ANSWER_TIMEOUT_S = 20.0
"""Seconds within which it answers a step."""
STOP_TIMEOUT_S = 10.0


class Feeder(Operator):
    """Stands for everything around the node: writes what it reads, reads what it writes.

    inputs: topics that are fed; written: topics that are kept in `answers`.
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
            self.asks = self._publisher(self.links[row.obeys])
            self.create_subscription(middleware.message_class(self.links[row.replies].type), row.replies,
                                     self.replies.append, middleware.qos(self.links[row.replies].rate), raw=True)

    def stand_in(self, names):
        """Make nodes of these names, those the process is told of, which read what it writes."""
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
        """Publish a message that no step waits for, and wait until it has arrived."""
        publisher = self.publishers_of[name]
        publisher.publish(data)
        if not publisher.wait_for_all_acked(Duration(seconds=ANSWER_TIMEOUT_S)):
            raise RunError(f'{self.node} did not take {name} within {ANSWER_TIMEOUT_S:g} s')


class Live:
    """The node's process and the feeder, spun until what is waited for has come."""

    def __init__(self, feeder, process, log, services):
        self.feeder, self.process, self.log, self.services = feeder, process, log, services
        self.executor = SingleThreadedExecutor()
        for node in (feeder, *feeder.readers):
            self.executor.add_node(node)

    def until(self, condition, limit, what):
        """Spin until condition() holds. Raises RunError where the node dies, or lacks what() after `limit` [s]."""
        deadline = time.monotonic() + limit
        while not condition():
            if self.process.poll() not in (None, 0):
                raise RunError(f'{self.feeder.node} ended with exit code {self.process.returncode}: '
                               f'{" ".join(self.log.read_text(errors="replace").split())}')
            if time.monotonic() > deadline:
                raise RunError(f'{self.feeder.node}: no {what()} within {limit:g} s')
            self.executor.spin_once(timeout_sec=0.1)

    def ask(self, command):
        """Ask for a Command, by the service of this name or by the topic, and wait for the answer."""
        if command.verb not in self.services:
            before = len(self.feeder.replies)
            self.feeder.asks.publish(messages.serialize(commands.message(command)))
            self.until(lambda: len(self.feeder.replies) > before, ANSWER_TIMEOUT_S, lambda: f'reply to {command}')
            return
        service = command.verb
        client = self.feeder.create_client(Trigger, service)
        self.until(client.service_is_ready, ANSWER_TIMEOUT_S, lambda: f'service {service}')
        future = client.call_async(Trigger.Request())
        self.until(future.done, ANSWER_TIMEOUT_S, lambda: f'answer of {service}')
        self.feeder.destroy_client(client)


def outputs(recording, done, params):
    """{topic: Output} of the process of a node fed with the inputs of a Recomputed, whose answers say how many
    messages are due at each step. Raises RunError when they do not come."""
    if not recording.lockstep:
        raise recompute.RecomputeError('--live feeds in lockstep: a realtime recording, whose steps may lack inputs, '
                                       'is recomputed without it')
    middleware.initialise([])
    try:
        with tempfile.TemporaryDirectory() as folder:
            return _run(recording, done, params, pathlib.Path(folder))
    finally:
        rclpy.try_shutdown()


def _graph(recording, unit):
    """Names of the nodes the process is told of: itself, who records it, and whoever changes what it reads."""
    optional = [node.name for node in nodes.NODES if (node.optional or node.name == 'operator')
                and any(topic in unit.NODE.reads and recording.has(topic) for topic in node.writes)]
    return (unit.NODE.name, 'recorder', *optional)


def _run(recording, done, params, folder):
    file, log = folder / 'parameters.yaml', folder / 'log'
    names = _graph(recording, done.unit)
    values = {**parameters.as_dict(params), 'graph.pacing': 'lockstep', 'graph.nodes': ','.join(names),
              'graph.beams': recording.bag.beams}
    file.write_text(parameter_file.text({done.node: values}))
    inputs = [name for name in done.unit.reads if recording.feeds(name) and name not in done.unit.NODE.writes]
    feeder = Feeder(done.node, inputs, done.outputs)
    with sole_run(feeder.context.get_domain_id()), open(log, 'wb') as output:
        feeder.check_domain_free()
        feeder.stand_in(names)
        process = subprocess.Popen(command_line(done.node, done.unit.NODE.module, file),
                                   stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                                   env={**os.environ, 'ROS_LOG_DIR': str(folder)})
        try:
            live = Live(feeder, process, log, done.unit.REQUESTS)
            live.until(lambda: all(publisher.get_subscription_count() for publisher in feeder.publishers_of.values())
                       and feeder.count_publishers('diagnostics'), NODE_START_TIMEOUT_S,
                       lambda: 'reader of its inputs')
            time.sleep(0.5)  # the other side of the discovery
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
    """Feed every step; {topic: step at which each of its messages came}."""
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
            live.ask(command)
        for name, rows in feed.rows.items():
            if rows[step] >= 0 and name in feeder.publishers_of:
                feeder.publishers_of[name].publish(recording.data(name)[rows[step]])
        live.until(lambda step=step: answered(step), NODE_START_TIMEOUT_S if step == 0 else ANSWER_TIMEOUT_S,
                   lambda step=step: missing(step))
    return steps


def _due(done, name):
    """How many messages of a topic must have come by each step (n,)."""
    if records.is_text(name):
        return np.searchsorted(done.outputs[name].stamps, done.feed.stamps, side='right')
    return np.cumsum(done.steps[name]['stamp'] != records.NO_STAMP)


def _output(name, data, done, steps):
    log = done.feed.stamps[np.array(steps[:len(data)], np.int64)]
    return difference.recorded([bytes(message) for message in data[:len(log)]], log, name)
