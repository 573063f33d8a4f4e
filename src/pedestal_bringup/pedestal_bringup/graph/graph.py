"""Run of a scenario from its files to its end. `watch` starts and watches its nodes."""
import pathlib

from pedestal_bringup.graph.processes import Graph
from pedestal_bringup.graph.start import START_LEAD_TIME_S


def _free_bag(scenario):
    """Return bags/runs/SCENARIO-N with the first N that is free."""
    number = 1
    while True:
        bag = pathlib.Path('bags') / 'runs' / f'{scenario}-{number}'
        if not bag.exists():
            return bag
        number += 1


def new_bag(given, scenario):
    """Return the folder of the recording: as given, else bags/runs/SCENARIO-N. Raises ValueError where it exists
    already."""
    bag = pathlib.Path(given) if given else _free_bag(scenario)
    if bag.exists():
        raise ValueError(f'bag {bag} exists already; a recording is never overwritten')
    return bag


def read_files(plan):
    """Read the files of ship and target of a program.Plan before any node is started.

    Return (lines on the run, program tracks). Raises ValueError, OSError for an invalid file.
    """
    return plan.announced(), plan.tracks


def run(plan, bag, progress, servers=None):
    """Run the scenario of a program.Plan to its end, or until Ctrl-C, and return its Outcome.

    servers: {name: processes.ServerProcess} beside the nodes.
    progress: a context with a function of the time of the run [s], which is called during the run. Raises RunError
    when the run cannot continue. The recording up to then stays readable.
    """
    _, tracks = read_files(plan)
    with Graph(plan.scenario, bag, servers) as graph:
        graph.start_servers()
        if servers:
            print(f'the servers are usable as soon as the antenna runs, in {START_LEAD_TIME_S:g} s at the soonest',
                  flush=True)
        # This import loads rclpy. It must wait until the nodes have been forked from this process (child).
        from pedestal_bringup.graph import watch
        with progress as advance:
            return watch.run(graph, tracks, advance)
