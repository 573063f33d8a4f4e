"""A run of a scenario: its nodes as processes, watched to the end and ended in order.

In lockstep a node that dies or falls silent ends the run with its name; in realtime it is started again (supervisor).
"""
import contextlib
import dataclasses
import pathlib
import socket
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor

from pedestal_bringup.bags import configuration
from pedestal_bringup.run import lockstep, parameter_file, supervisor
from pedestal_bringup.run.operator_node import Operator, another_graph
from pedestal_bringup.run.processes import Graph, log_folder
from pedestal_bringup.run.program import program_messages
from pedestal_common import messages, middleware, nodes
from pedestal_common.steps import SECOND
from ship_motion_sim import motion

START_TIME = 5.0
"""Seconds from the start of the nodes of a realtime run to the beginning of its time: a warm start takes two of them.
Who comes later has lost steps, no more."""


@dataclasses.dataclass
class Outcome:
    """What a run says of itself: the last JSON line of the drive and of the recorder, {} of one that left none; how
    often a node was started again; the steps that the drive lost beside; whether the user stopped it."""
    drive: dict
    recorder: dict
    restarts: int = 0
    losses: int = 0
    stopped: bool = False


def _free_bag(scenario):
    """bags/runs/SCENARIO-N with the first N that is free."""
    number = 1
    while True:
        bag = pathlib.Path('bags') / 'runs' / f'{scenario}-{number}'
        if not bag.exists():
            return bag
        number += 1


def new_bag(given, scenario):
    """Where to record: as given, else bags/runs/SCENARIO-N. Raises ValueError where there is one already."""
    bag = pathlib.Path(given) if given else _free_bag(scenario)
    if bag.exists():
        raise ValueError(f'bag {bag} exists already; a recording is never overwritten')
    return bag


def begins(scenario):
    """graph.start of a run whose nodes start now [ns UTC]; 0 in lockstep, where time is that of the steps."""
    return time.time_ns() + round(START_TIME * SECOND) if scenario.header.pacing == 'realtime' else 0


def parameters_of_all(scenario, bag, start):
    """The scenario as a ROS 2 parameter file, every node told of the graph it is in. start: graph.start [ns UTC]."""
    names = ','.join(dict.fromkeys(map(nodes.plain, scenario.nodes)))
    shared = {'graph.pacing': scenario.header.pacing, 'graph.nodes': names, 'graph.beams': scenario.header.graph_beams,
              'graph.deadline': scenario.header.deadline, 'graph.start': start,
              'graph.priority': scenario.header.priority}
    sections = {node: {**scenario.given(node), **shared} for node in scenario.nodes if node != 'operator'}
    sections['recorder'].update(bag=str(bag), **configuration.recorder_parameters(scenario))
    if start and not scenario.header.beam:
        sections[nodes.DRIVE].setdefault('state_file', str(log_folder(bag) / f'{nodes.DRIVE}.state'))
    return parameter_file.text(sections)


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


def read_tracks(scenario):
    """The program tracks {topic: message} of a scenario, its files of target and ship read before anything is started.
    Raises ValueError, OSError for a file that is not what it should be."""
    if 'ship_motion' in scenario.nodes:
        motion.constants(scenario.node_parameters('ship_motion').ship)
    return program_messages(scenario)


def run(scenario, bag, progress):
    """Run a scenario to its end, or until Ctrl-C, and return its Outcome.

    progress(time of the run [s]) is called as it goes on. Raises RunError when it cannot go on. The recording up to
    then stays readable.
    """
    realtime = scenario.header.pacing == 'realtime'
    tracks = read_tracks(scenario)
    graph = Graph(scenario, bag)
    middleware.initialise([])
    try:
        operator = Operator(scenario.header.graph_beams, scenario.nodes)
        try:
            with sole_run(operator.context.get_domain_id()):
                operator.refuse_company()
                return (_in_realtime if realtime else _in_lockstep)(graph, operator, tracks, progress)
        finally:
            operator.destroy_node()
    finally:
        rclpy.try_shutdown()


def _in_lockstep(graph, operator, tracks, progress):
    graph.write(parameters_of_all(graph.scenario, graph.bag, 0))
    with graph:
        try:
            lockstep.watch(graph, operator, tracks, progress)
        except KeyboardInterrupt:
            graph.stop()
            return Outcome(graph.result(nodes.DRIVE), graph.result('recorder'), stopped=True)
        return Outcome(graph.outcome(nodes.DRIVE), graph.outcome('recorder'))


def _in_realtime(graph, operator, tracks, progress):
    supervisor.prepare(graph.scenario)
    start = begins(graph.scenario)
    graph.write(parameters_of_all(graph.scenario, graph.bag, start))
    for track in tracks.values():
        messages.put_stamp(track.header.stamp, start)
    with graph:
        supervised = supervisor.Supervisor(graph, operator, start)
        try:
            supervised.watch(tracks, progress)
            stopped = False
        except KeyboardInterrupt:
            stopped = True
        graph.stop()
        recorder = graph.result('recorder') if stopped else graph.outcome('recorder')
        return Outcome(graph.result(nodes.DRIVE), recorder, supervised.restarts.count, supervised.losses.count,
                       stopped)


def send_program(scenario, start=None, ros_arguments=()) -> int:
    """Send a scenario's program track to a running ACU and keep it latched until Ctrl-C.

    start: when its time is 0 [ns UTC]; None: when the graph's is, which the ACU is asked for. ros_arguments: for the
    node that sends it, in the namespace of the graph.
    """
    middleware.initialise(ros_arguments)
    try:
        operator = Operator(scenario.header.graph_beams)
        executor = SingleThreadedExecutor()
        executor.add_node(operator)
        tracks = program_messages(scenario)
        if start is None:
            acu = nodes.members(('acu',), scenario.header.graph_beams)[0]
            print(f'asks {acu} on ROS_DOMAIN_ID {operator.context.get_domain_id()} when its time began', flush=True)
            start = operator.graph_start(acu, executor)
        for track in tracks.values():
            messages.put_stamp(track.header.stamp, start)
        operator.send(tracks)
        print(f'{", ".join(tracks) or "nothing to be"} sent; kept for who comes later until Ctrl-C', flush=True)
        while True:
            executor.spin_once(timeout_sec=0.2)
    except KeyboardInterrupt:
        return 0
    finally:
        rclpy.try_shutdown()
