"""A run of a scenario: its nodes as processes, watched to the end and ended in order.

In lockstep a node that dies or falls silent ends the run with its name; in realtime it is started again (supervisor).
"""
import dataclasses
import pathlib
import time

from pedestal_bringup.bags import configuration
from pedestal_bringup.run import parameter_file
from pedestal_bringup.run.processes import Graph, log_folder
from pedestal_bringup.run.program import program_messages
from pedestal_common import nodes
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


def read_tracks(scenario):
    """The program tracks {topic: message} of a scenario, its files of target and ship read before anything is started.
    Raises ValueError, OSError for a file that is not what it should be."""
    if 'ship_motion' in scenario.nodes:
        motion.constants(scenario.node_parameters('ship_motion').ship)
    return program_messages(scenario)


def run(scenario, bag, progress):
    """Run a scenario to its end, or until Ctrl-C, and return its Outcome.

    progress: a context with a function of the time of the run [s], which is called as it goes on. Raises RunError when
    it cannot go on. The recording up to then stays readable.
    """
    tracks = read_tracks(scenario)
    with Graph(scenario, bag) as graph, progress as advance:
        # With rclpy, after which no node can be a copy of this process (child).
        from pedestal_bringup.run import watch
        return watch.run(graph, tracks, advance)
