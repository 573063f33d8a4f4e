"""Watch of a run by the process `pedestal run`, which takes part in the graph as the node `operator`.

In lockstep a node that dies or is silent ends the run (module lockstep). In realtime such a node is started again
(module supervisor). Simulated equipment and its node start before the other nodes, because time 0, a parameter of
every node, follows the answer of the equipment.
"""
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

from rclpy.executors import SingleThreadedExecutor
from rclpy.utilities import try_shutdown

from pedestal_bringup.graph import lockstep, own_programs, supervisor
from pedestal_bringup.graph.operator_node import Operator
from pedestal_bringup.graph.processes import Graph, exit_description
from pedestal_bringup.graph.start import LATEST_START_S, START_LEAD_TIME_S, Outcome, begins, parameters_of_all
from pedestal_bringup.scenario.program import Plan
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node import middleware
from pedestal_common.quantities import Message, Nanoseconds, Seconds
from pedestal_common.wire import messages
from pedestal_hardware.start import starts

Changes: TypeAlias = Mapping[str, Mapping[str, object]]     # {node: {parameter: value}}


def run(graph: Graph, tracks: Mapping[str, Message], progress: Callable[[Seconds], object]) -> Outcome:
    """Let the held nodes of a graph begin, watch them to their end or until Ctrl-C, and return the Outcome.

    tracks: {topic: program track}; progress: function of the time of the run. Raises RuntimeError, and GraphError if
    another graph runs on the domain.
    """
    middleware.initialise([])
    try:
        operator = Operator(graph.scenario.header.graph_beams, graph.scenario.nodes)
        try:
            operator.check_domain_free()
            own = ''
            if graph.scenario.own:
                graph.begin(parameters_of_all(graph.scenario, graph.bag, 0), graph.scenario.own)
                own = own_programs.begin(graph, operator)
            realtime = graph.scenario.header.pacing == 'realtime'
            return (_in_realtime if realtime else _in_lockstep)(graph, operator, tracks, progress, own)
        except KeyboardInterrupt:
            return Outcome({}, {}, stopped=True)
        finally:
            operator.destroy_node()
    finally:
        try_shutdown()


def _in_lockstep(graph: Graph, operator: Operator, tracks: Mapping[str, Message],
                 progress: Callable[[Seconds], object], own: str) -> Outcome:
    graph.begin(parameters_of_all(graph.scenario, graph.bag, 0, own=own))
    try:
        lockstep.watch(graph, operator, tracks, progress)
    except KeyboardInterrupt:
        graph.stop()
        return Outcome(graph.result(nodes.DRIVE_NODE), graph.result('recorder'), stopped=True)
    # A drive of the user prints no result.
    drive = graph.result if nodes.DRIVE_NODE in graph.scenario.own else graph.outcome
    return Outcome(drive(nodes.DRIVE_NODE), graph.outcome('recorder'))


def _in_realtime(graph: Graph, operator: Operator, tracks: Mapping[str, Message],
                 progress: Callable[[Seconds], object], own: str) -> Outcome:
    supervisor.prepare(graph.scenario)
    start, changes = begins(graph.scenario), _addresses(graph.scenario)
    if graph.scenario.header.simulated_parts:
        start = _equipment_begun(graph, operator, changes, own)
    for track in tracks.values():
        messages.put_stamp(track.header.stamp, start)
    graph.begin(parameters_of_all(graph.scenario, graph.bag, start, changes, own))
    supervised = supervisor.Supervisor(graph, operator, start)
    try:
        supervised.watch(tracks, progress)
        stopped = False
    except KeyboardInterrupt:
        stopped = True
    graph.stop()
    recorder = graph.result('recorder') if stopped else graph.outcome('recorder')
    return Outcome(graph.result(nodes.DRIVE_NODE), recorder, supervised.restarts.count, supervised.losses.count,
                   stopped)


def _free_port(kind: int) -> int:
    with socket.socket(socket.AF_INET, kind) as free:
        free.bind(('127.0.0.1', 0))
        return free.getsockname()[1]


def _addresses(scenario: Scenario) -> Changes:
    """Return the free ports between simulated equipment and its nodes, where a scenario gives no port."""
    found: dict[str, Mapping[str, object]] = {}
    for part in scenario.header.simulated_parts:
        node = nodes.SIMULATED_PARTS[part]
        if part == nodes.SIMULATED_DRIVES.name:
            changes: dict[str, object] = {'bus.port': _free_port(socket.SOCK_STREAM)}
        elif scenario.node_parameters(node).source.kind == 'vita49':
            changes = {'source.address': f'udp://127.0.0.1:{_free_port(socket.SOCK_DGRAM)}'}
        else:
            changes = {'source.address': f'tcp://127.0.0.1:{_free_port(socket.SOCK_STREAM)}'}
        given = scenario.given(node)
        found[node] = found[part] = {name: value for name, value in changes.items() if name not in given}
    return found


ANSWER_PARAMETERS = {
    nodes.SIMULATED_DRIVES.name: {'bus.connect_time': LATEST_START_S, 'drives.start_after': START_LEAD_TIME_S},
    nodes.SIMULATED_IQ.name: {'source.start_after': START_LEAD_TIME_S}}
"""{simulated equipment: parameters with which its node chooses time 0 at the answer of the equipment}."""


def _equipment_begun(graph: Graph, operator: Operator, changes: Changes, own: str) -> Nanoseconds:
    """Let simulated equipment and its node begin, and return graph.start, which its node chooses at the answer of the
    equipment. If several are simulated, time 0 follows the answer of the drives. Raises RuntimeError."""
    part = graph.scenario.header.simulated_parts[0]
    chooser = nodes.SIMULATED_PARTS[part]
    provisional = time.time_ns() + round((LATEST_START_S + START_LEAD_TIME_S) * NS_PER_SECOND)
    waiting = {node: {**values, **(ANSWER_PARAMETERS[part] if node in (chooser, part) else {})}
               for node, values in changes.items()}
    graph.begin(parameters_of_all(graph.scenario, graph.bag, provisional, waiting, own), (chooser, part))
    executor = SingleThreadedExecutor()
    executor.add_node(operator)
    # A drive node ends by itself after LATEST_START_S, with an error that names the drives.
    chosen = chosen_start(graph, operator, lambda seconds: middleware.turn(executor, seconds), part,
                          LATEST_START_S + START_LEAD_TIME_S)
    executor.remove_node(operator)
    return chosen


def chosen_start(graph: Graph, operator: Operator, spin: Callable[[Seconds], object], part: str,
                 limit: Seconds) -> Nanoseconds:
    """Wait until the node of simulated equipment chooses time 0, and return it. spin(seconds) lets the operator
    take diagnostics. Raises RuntimeError that names the node and what it awaits."""
    chooser, heard = nodes.SIMULATED_PARTS[part], ['no diagnostics']
    chosen: list[Nanoseconds] = []

    def note(status: Message, _now: Seconds) -> None:
        if status.name == chooser:
            heard[:] = [status.message]
            chosen.extend(starts([status], chooser))
    operator.on_diagnostics = note
    end = time.monotonic() + limit
    while not chosen:
        spin(0.1)
        for node, code in graph.ended().items():
            if node in (chooser, part):
                raise RuntimeError(graph.exit_report(node, exit_description(code)))
        if not chosen and time.monotonic() > end:
            raise RuntimeError(graph.exit_report(chooser, f'has no answer of {part} after {limit:g} s: {heard[0]}'))
    return chosen[0]


def send_program(plan: Plan, start: Nanoseconds | None = None, ros_arguments: Sequence[str] = ()) -> int:
    """Send the program track of a plan to a running ACU and keep it latched until Ctrl-C. start: time 0 of the track,
    UTC; None: the graph.start of the ACU."""
    beams = plan.scenario.header.graph_beams
    middleware.initialise(ros_arguments)
    try:
        operator = Operator(beams)
        executor = SingleThreadedExecutor()
        executor.add_node(operator)
        tracks = plan.tracks
        if start is None:
            acu = nodes.members(('acu',), beams)[0]
            print(f'requests graph.start of {acu} on ROS_DOMAIN_ID {operator.context.get_domain_id()}', flush=True)
            start = operator.graph_start(acu, executor)
        for track in tracks.values():
            messages.put_stamp(track.header.stamp, start)
        operator.send(tracks)
        print(f'{", ".join(tracks) or "no program track"} sent; latched for late joiners until Ctrl-C', flush=True)
        while True:
            middleware.turn(executor, 0.2)
    except KeyboardInterrupt:
        return 0
    finally:
        try_shutdown()
