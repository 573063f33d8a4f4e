"""make a recorded run again and compare; exit code 1 when a message differs"""
import pathlib

from pedestal.verbs import arguments
from pedestal_analysis import console


def add_arguments(parser):
    """Recording and bag of the new run."""
    parser.add_argument('recording', type=pathlib.Path)
    arguments.add_new_bag(parser)


def main(options):
    """Make the run and print the comparison; exit code 1 where a message differs."""
    from pedestal_analysis.reprocess import rerun
    from pedestal_bringup.graph import graph
    from pedestal_bringup.scenario.program import Plan
    from pedestal_recording import bag
    recording = bag.read(options.recording)
    chosen = rerun.configured(recording)
    path = graph.new_bag(options.bag, chosen.name)
    if graph.run(Plan(chosen), path, console.progress_of_run(chosen.header.duration)).stopped:
        raise KeyboardInterrupt
    result = rerun.result(recording, bag.read(path))
    print('\n'.join(result.lines()))
    return 0 if result.equal else 1
