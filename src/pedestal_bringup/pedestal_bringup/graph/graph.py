"""Run of a scenario from its files to its end. `watch` starts and watches its nodes."""
import pathlib

from pedestal_bringup.graph.processes import Graph
from ship_motion_sim.sea import motion


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
    """Read the files of target and ship of a program.Plan before any node is started. Raises ValueError, OSError for
    an invalid file."""
    scenario = plan.scenario
    if 'ship_motion' in scenario.nodes:
        motion.constants(scenario.node_parameters('ship_motion').ship)
    return plan.tracks


def run(plan, bag, progress):
    """Run the scenario of a program.Plan to its end, or until Ctrl-C, and return its Outcome.

    progress: a context with a function of the time of the run [s], which is called during the run. Raises RunError
    when the run cannot continue. The recording up to then stays readable.
    """
    tracks = read_files(plan)
    with Graph(plan.scenario, bag) as graph, progress as advance:
        # Imported late, because it imports rclpy, after which no node can be a copy of this process (child).
        from pedestal_bringup.graph import watch
        return watch.run(graph, tracks, advance)
