"""Start and outcome of a run of the graph: its time 0, the parameters of its nodes, and the data that it leaves."""
import dataclasses
import pathlib
import time
from collections.abc import Mapping

from pedestal_bringup.graph.processes import log_folder
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.quantities import Json, Nanoseconds
from pedestal_common.text_files import parameter_file
from pedestal_recording import configuration

START_LEAD_TIME_S = 5.0
"""Time from the start of the processes of a realtime run to time 0 of the run [s]. A start with compiled laws takes
2 s. A node that is ready only after time 0 loses steps, but does no other harm."""

DRIVES_LEAD_TIME_S = 5.0
"""Additional time of servo drives that the launch file starts [s]. `pedestal run` waits for their answer instead."""

LATEST_START_S = 600.0
"""Longest time in which servo drives or a receiver must answer [s]. Before their answer, time 0 is this far ahead."""


@dataclasses.dataclass
class Outcome:
    """Outcome of a run."""
    drive: dict[str, Json]      # result of the drive: the last JSON line of its log; {} without one
    recorder: dict[str, Json]   # result of the recorder, likewise
    restarts: int = 0           # number of restarts of nodes
    losses: int = 0             # number of steps that the drive lost, without those lost because of restarts
    stopped: bool = False       # True if the user stopped the run


def begins(scenario: Scenario) -> Nanoseconds:
    """Return graph.start of a run whose nodes start now: the UTC at which its time is 0. In lockstep return 0."""
    if scenario.header.pacing != 'realtime':
        return 0
    lead = START_LEAD_TIME_S + (DRIVES_LEAD_TIME_S if scenario.header.servo else 0.0)
    return time.time_ns() + round(lead * NS_PER_SECOND)


def parameters_of_all(scenario: Scenario, bag: pathlib.Path, start: Nanoseconds,
                      changes: Mapping[str, Mapping[str, object]] | None = None, own: str = '') -> str:
    """Return the text of the ROS 2 parameter file of a run: the values of a scenario for each node, and the parameters
    `graph.` that all share.

    changes: {node: {name: value}} that the scenario does not contain; own: graph.own. A program of the user gets only
    the parameters `graph.`, a drive also its period, and in lockstep the duration.
    """
    names = ','.join(dict.fromkeys(map(nodes.plain, scenario.nodes)))
    shared = {'graph.pacing': scenario.header.pacing, 'graph.nodes': names, 'graph.beams': scenario.header.graph_beams,
              'graph.deadline': scenario.header.deadline, 'graph.start': start,
              'graph.priority': scenario.header.priority, 'graph.scenario': scenario.name, 'graph.simulated': True}
    shared |= {'graph.own': own} if own else {}
    # The operator runs in this process and reads no parameter file.
    sections = {node: {**({} if node in scenario.own else scenario.given(node)), **shared}
                for node in scenario.nodes if node != 'operator'}
    if nodes.DRIVE_NODE in scenario.own:
        lasts = {'duration': scenario.header.duration} if scenario.header.pacing == 'lockstep' else {}
        sections[nodes.DRIVE_NODE].update(period=scenario.node_parameters(nodes.DRIVE_NODE).period, **lasts)
    for node, values in (changes or {}).items():
        sections[node].update(values)
    sections['recorder'].update(bag=str(bag), **configuration.recorder_parameters(scenario))
    # In realtime a drive that is started again continues at its last angles; an array has no angles to keep.
    if start and not scenario.header.beam and nodes.DRIVE_NODE not in scenario.own:
        sections[nodes.DRIVE_NODE].setdefault('state_file', str(log_folder(bag) / f'{nodes.DRIVE_NODE}.state'))
    return parameter_file.text(sections)
