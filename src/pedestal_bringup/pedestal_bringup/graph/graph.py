"""Run of a scenario as a graph of nodes, from its files to its end, for `pedestal run`."""
import itertools
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


def new_bag(given: str, scenario: str) -> pathlib.Path:
    """Return the folder of the recording: `given`, or the first bags/runs/SCENARIO-N that does not exist. Raises
    ValueError if `given` exists."""
    if not given:
        return next(bag for number in itertools.count(1)
                    if not (bag := pathlib.Path('bags') / 'runs' / f'{scenario}-{number}').exists())
    bag = pathlib.Path(given)
    if bag.exists():
        raise ValueError(f'bag {bag} exists already; a recording is never overwritten')
    return bag


def read_files(plan: 'Plan') -> tuple[list[str], dict[str, Message]]:
    """Read the files of ship and target of a plan. Return (lines that announce the run, {topic: program track}).
    Raises ValueError, OSError for an invalid file."""
    return plan.announced(), plan.tracks


def run(plan: 'Plan', bag: pathlib.Path, progress: AbstractContextManager[Callable[[Seconds], object]],
        servers: Mapping[str, ServerProcess] | None = None) -> Outcome:
    """Run the scenario of a plan to its end, or until Ctrl-C, and return its Outcome.

    progress: its function is called with the time of the run. servers: {name: process} beside the nodes. Raises
    RuntimeError if the run cannot continue; the recording up to that moment stays readable. Raises GraphError, see
    domain.of_run.
    """
    _, tracks = read_files(plan)
    with domain.of_run(), Graph(plan.scenario, bag, servers) as graph:
        graph.start_servers()
        if servers:
            print(f'the servers answer once the antenna runs, in {START_LEAD_TIME_S:g} s at the earliest',
                  flush=True)
        # This import loads rclpy, which starts threads. Because a copy of this process would lack these threads, Graph
        # has made the processes of the nodes before the import (see the module child).
        from pedestal_bringup.graph import watch
        with progress as advance:
            return watch.run(graph, tracks, advance)
