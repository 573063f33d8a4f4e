"""How a run starts: the time at which it begins and what its nodes are told; and what comes of it."""
import dataclasses
import time

from pedestal_bringup.graph.processes import log_folder
from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.text_files import parameter_file
from pedestal_recording import configuration

START_LEAD_TIME_S = 5.0
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


def begins(scenario):
    """graph.start of a run whose nodes start now [ns UTC]; 0 in lockstep, where time is that of the steps."""
    return time.time_ns() + round(START_LEAD_TIME_S * NS_PER_SECOND) if scenario.header.pacing == 'realtime' else 0


def parameters_of_all(scenario, bag, start):
    """The scenario as a ROS 2 parameter file, every node told of the graph it is in. start: graph.start [ns UTC]."""
    names = ','.join(dict.fromkeys(map(nodes.plain, scenario.nodes)))
    shared = {'graph.pacing': scenario.header.pacing, 'graph.nodes': names, 'graph.beams': scenario.header.graph_beams,
              'graph.deadline': scenario.header.deadline, 'graph.start': start,
              'graph.priority': scenario.header.priority}
    sections = {node: {**scenario.given(node), **shared} for node in scenario.nodes if node != 'operator'}
    sections['recorder'].update(bag=str(bag), **configuration.recorder_parameters(scenario))
    if start and not scenario.header.beam:
        sections[nodes.DRIVE_NODE].setdefault('state_file', str(log_folder(bag) / f'{nodes.DRIVE_NODE}.state'))
    return parameter_file.text(sections)
