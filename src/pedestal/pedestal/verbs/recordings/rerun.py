"""repeat a recorded run and compare the two recordings

Exit code 0 if all messages are equal, also if metadata or the layout of the file differ. Exit code 1 if any message
differs.
"""
import argparse
import pathlib

from pedestal import console
from pedestal.verbs import arguments


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add recording and bag of the new run."""
    parser.add_argument('recording', type=pathlib.Path, help='recording of the first run: a folder or an .mcap file')
    arguments.add_new_bag(parser)


def main(options: argparse.Namespace) -> int:
    """Repeat the run and print the comparison. Return the exit code, 1 if a message differs."""
    from pedestal_bringup.graph import graph
    from pedestal_bringup.scenario.program import Plan
    from pedestal_recording import bag
    from pedestal_workbench.again import rerun
    recording = bag.read(options.recording)
    chosen = rerun.scenario_of_recording(recording)
    path = graph.new_bag(options.bag, chosen.name)
    if graph.run(Plan(chosen), path, console.progress_of_run(chosen.header.duration)).stopped:
        raise KeyboardInterrupt
    result = rerun.result(recording, bag.read(path))
    print('\n'.join(result.lines()))
    return 0 if result.equal else 1
