"""Programs of the user in the place of nodes of a run, such as a receiver: `pedestal run --receiver FILE.py`.

They start first. ROS then states which topics each of them reads and publishes, and the other nodes begin with this
row of the table of nodes (parameter graph.own). So the run waits for no message that a program does not publish.
"""
import itertools
import json
import os
import pathlib
import shlex
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from pedestal_common.graph import nodes, topics
from pedestal_common.node import run

if TYPE_CHECKING:
    from rclpy.topic_endpoint_info import TopicEndpointInfo

    from pedestal_bringup.graph.operator_node import Operator
    from pedestal_bringup.graph.processes import Graph
    from pedestal_bringup.scenario.scenario import Scenario

START_TIMEOUT_S = 60.0  # longest time from the start of a program until it publishes its topics [s]
SETTLING_TIME_S = 0.5  # time for which the topics of a program must stay the same before they count as all [s]
POLL_PERIOD_S = 0.1  # time between two looks at the topics of the programs [s]

ALL_TOPICS = frozenset(itertools.chain.from_iterable(
    node.writes for node in (*nodes.NODES, *nodes.HARDWARE_ROWS)))  # that a node of the graph publishes


def command(program: str, node: str, file: pathlib.Path) -> list[str]:
    """Return the command that starts a program of the user under the name of a node, with a parameter file. Raises
    ValueError for a missing program."""
    first, *arguments = shlex.split(program)
    return [*_executable(first), *arguments, '--ros-args', '-r', f'__node:={node}', '--params-file', str(file)]


def _executable(first: str) -> list[str]:
    if first.endswith('.py'):
        if not pathlib.Path(first).is_file():
            raise ValueError(f'{first}: no such file')
        return [sys.executable, '-u', first]
    package, _, name = first.partition('/')
    if name in nodes.EXECUTABLES and nodes.EXECUTABLES[name].package == package:
        return run.command(name)
    for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        path = pathlib.Path(prefix, 'lib', package, name)
        if prefix and path.is_file() and os.access(path, os.X_OK):
            return [str(path)]
    raise ValueError(f'{first}: no such executable in AMENT_PREFIX_PATH; source the setup.bash of its workspace, or '
                     'name a FILE.py')


def needed(scenario: 'Scenario', node: str) -> dict[str, list[str]]:
    """Return {topic: nodes that wait for it} of the topics that a program in the place of a node must publish."""
    ours = [name for name in scenario.nodes if name not in scenario.own]
    found = {}
    for link in nodes.links_of(scenario.nodes, scenario.header.graph_beams).values():
        readers = [name for name in nodes.readers(link, ours) if name != 'recorder' or link.name == 'clock']
        if node in link.writers and link.rate == 'step' and not link.flag and readers:
            found[link.name] = readers
    return found


def begin(graph: 'Graph', operator: 'Operator') -> str:
    """Wait until the programs of the user, which have begun, publish what the run needs. Return graph.own. Raises
    RuntimeError that names the program and the missing or unsuitable topic."""
    found: dict[str, tuple[list[str], list[str]]] = {}
    settled = started = time.monotonic()
    while True:
        before, found = found, {node: _topics(operator, node) for node in graph.scenario.own}
        for node, code in graph.ended().items():
            if node in graph.scenario.own:
                reason = f'({graph.scenario.own[node]}) ended with exit code {code}'
                raise RuntimeError(graph.exit_report(node, reason))
        lacks = [text for node, (_, writes) in found.items() for text in _lacks(graph.scenario, node, writes)]
        now = time.monotonic()
        settled = settled if found == before and not lacks else now
        if now - settled > SETTLING_TIME_S:
            break
        if now - started > START_TIMEOUT_S:
            raise RuntimeError(f'{lacks[0]} after {START_TIMEOUT_S:g} s' if lacks else 'topics come and go')
        time.sleep(POLL_PERIOD_S)
    for node, (reads, writes) in found.items():
        for text in _unsuitable(operator, node, graph.scenario):
            raise RuntimeError(f'{node} ({graph.scenario.own[node]}): {text}')
        print(f'{node}: {graph.scenario.own[node]}, reads {", ".join(reads) or "no topic"}, publishes '
              f'{", ".join(writes)}', flush=True)
    return json.dumps(found)


def _topics(operator: 'Operator', node: str) -> tuple[list[str], list[str]]:
    """Return the topics of the graph that a node reads, and those that it publishes."""
    from rclpy.node import NodeNameNonExistentError
    try:
        read, written = (ask(node, '/') for ask in (operator.get_subscriber_names_and_types_by_node,
                                                    operator.get_publisher_names_and_types_by_node))
    except NodeNameNonExistentError:
        return [], []
    names = ({name.removeprefix('/') for name, _ in some} - {'diagnostics'} for some in (read, written))
    reads, writes = (sorted(some & set(topics.TOPIC_BY_NAME)) for some in names)
    return reads, writes


def _lacks(scenario: 'Scenario', node: str, writes: list[str]) -> Iterator[str]:
    for topic, readers in needed(scenario, node).items():
        if topic not in writes:
            yield (f'{node} ({scenario.own[node]}) publishes no {topic}, which {" and ".join(readers)} must receive; '
                   f'it publishes {", ".join(writes) or "no topic of the graph"}')


def _unsuitable(operator: 'Operator', node: str, scenario: 'Scenario') -> Iterator[str]:
    """Yield a text for each topic of a node with a wrong owner, type, or quality of service."""
    from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

    from pedestal_common.node import middleware, shell
    lockstep = scenario.header.pacing == 'lockstep'
    places = {topic for row in (*nodes.NODES, *nodes.HARDWARE_ROWS) if row.name == node for topic in row.writes}

    def of_node(infos: 'list[TopicEndpointInfo]') -> 'list[TopicEndpointInfo]':
        return [info for info in infos if shell.node_of(info) == node]
    reads, writes = _topics(operator, node)
    for name in (*writes, *reads):
        topic = topics.TOPIC_BY_NAME[name]
        if name in writes and name in ALL_TOPICS - places and topic.rate != 'once':
            yield f'publishes {name}, which belongs to another node'
        published, read = (of_node(ask(f'/{name}')) for ask in (operator.get_publishers_info_by_topic,
                                                                 operator.get_subscriptions_info_by_topic))
        ours = [middleware.qos(topic.rate, 'lockstep' if lockstep else role) for role in ('recorded', 'written')]
        for info, (given, asked) in [*((info, (info.qos_profile, ours[0])) for info in published),
                                     *((info, (ours[1], info.qos_profile)) for info in read)]:
            if info.topic_type != topic.type:
                yield f'{name} has the type {info.topic_type}: must be {topic.type}'
            unreliable = (given.reliability, asked.reliability) == (ReliabilityPolicy.BEST_EFFORT,
                                                                 ReliabilityPolicy.RELIABLE)
            if unreliable or (given.durability, asked.durability) == (DurabilityPolicy.VOLATILE,
                                                                   DurabilityPolicy.TRANSIENT_LOCAL):
                yield (f'{name} has the quality of service {info.qos_profile.reliability.name}, '
                       f'{info.qos_profile.durability.name}: must be {ours[0].reliability.name}, '
                       f'{ours[0].durability.name}')
