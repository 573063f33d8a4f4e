"""Start of a run: the time at which it begins, the parameters of its nodes, and its outcome."""
import dataclasses
import time

from pedestal_bringup.graph.processes import log_folder
from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.text_files import parameter_file
from pedestal_recording import configuration

START_LEAD_TIME_S = 5.0
"""Time from the start of the nodes of a realtime run to the beginning of its time [s]. A warm start takes 2 s; a later
node only loses steps."""


@dataclasses.dataclass
class Outcome:
    """Outcome of a run.

    drive     last JSON line of the drive, {} without one; recorder: that of the recorder
    restarts  number of restarts of nodes
    losses    number of steps that the drive lost apart from restarts
    stopped   True if the user stopped the run
    """
    drive: dict
    recorder: dict
    restarts: int = 0
    losses: int = 0
    stopped: bool = False


def begins(scenario):
    """Return graph.start of a run whose nodes start now [ns UTC]; 0 in lockstep, where time is that of the steps."""
    return time.time_ns() + round(START_LEAD_TIME_S * NS_PER_SECOND) if scenario.header.pacing == 'realtime' else 0


def parameters_of_all(scenario, bag, start):
    """Return the scenario as a ROS 2 parameter file, in which every node has the parameters of its graph. start:
    graph.start [ns UTC]."""
    names = ','.join(dict.fromkeys(map(nodes.plain, scenario.nodes)))
    shared = {'graph.pacing': scenario.header.pacing, 'graph.nodes': names, 'graph.beams': scenario.header.graph_beams,
              'graph.deadline': scenario.header.deadline, 'graph.start': start,
              'graph.priority': scenario.header.priority}
    # The operator runs in this process and reads no parameter file.
    sections = {node: {**scenario.given(node), **shared} for node in scenario.nodes if node != 'operator'}
    sections['recorder'].update(bag=str(bag), **configuration.recorder_parameters(scenario))
    # In realtime a drive that is started again continues at its last angles; an array has no angles to keep.
    if start and not scenario.header.beam:
        sections[nodes.DRIVE_NODE].setdefault('state_file', str(log_folder(bag) / f'{nodes.DRIVE_NODE}.state'))
    return parameter_file.text(sections)
