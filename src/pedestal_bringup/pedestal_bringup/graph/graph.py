"""Run of a scenario as a graph of nodes, from its files to its end, for `pedestal run`.

The class processes.Graph makes a process for each node and holds it. The module `watch` then lets the held nodes
begin, and watches them.
"""
import pathlib
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from pedestal_bringup.graph.processes import Graph, ServerProcess
from pedestal_bringup.graph.start import START_LEAD_TIME_S, Outcome
from pedestal_common.graph import domain
from pedestal_common.quantities import Message, Seconds

if TYPE_CHECKING:
    from pedestal_bringup.scenario.program import Plan


def _free_bag(scenario: str) -> pathlib.Path:
    """Return the path bags/runs/SCENARIO-N with the smallest N for which nothing exists there.

    scenario: name of the scenario.
    """
    number = 1
    while True:
        bag = pathlib.Path('bags') / 'runs' / f'{scenario}-{number}'
        if not bag.exists():
            return bag
        number += 1


def new_bag(given: str, scenario: str) -> pathlib.Path:
    """Return the folder for the recording: `given`, or bags/runs/SCENARIO-N if `given` is empty. scenario: name of the
    scenario. Raises ValueError if the folder exists already."""
    bag = pathlib.Path(given) if given else _free_bag(scenario)
    if bag.exists():
        raise ValueError(f'bag {bag} exists already; a recording is never overwritten')
    return bag


def read_files(plan: 'Plan') -> tuple[list[str], dict[str, Message]]:
    """Read the files of ship and target of a plan before any node is started.

    Return (lines of text that announce the run to the user, {topic: program track}). Raises ValueError, OSError for an
    invalid file.
    """
    return plan.announced(), plan.tracks


def run(plan: 'Plan', bag: pathlib.Path, progress: AbstractContextManager[Callable[[Seconds], object]],
        servers: Mapping[str, ServerProcess] | None = None) -> Outcome:
    """Run the scenario of a plan to its end, or until Ctrl-C, and return its Outcome.

    bag: folder for the recording. progress: its function is called during the run with the time of the run. servers:
    {name: process} beside the nodes. Raises RuntimeError if the run cannot continue. The recording up to that moment
    stays readable. Raises GraphError if the domain of the user has another graph, see domain.of_run.
    """
    _, tracks = read_files(plan)
    with domain.of_run(), Graph(plan.scenario, bag, servers) as graph:
        graph.start_servers()
        if servers:
            print(f'the servers are usable as soon as the antenna runs, in {START_LEAD_TIME_S:g} s at the soonest',
                  flush=True)
        # This import loads rclpy, which starts threads. Because a copy of this process would lack these threads, Graph
        # has made the processes of the nodes before the import (see the module child).
        from pedestal_bringup.graph import watch
        with progress as advance:
            return watch.run(graph, tracks, advance)
