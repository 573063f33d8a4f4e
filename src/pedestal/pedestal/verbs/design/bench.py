"""measure the speed of this machine: nodes in lockstep, compiled control laws, recordings"""
import argparse
import importlib

from pedestal_analysis import console
from pedestal_common.quantities import Json
from pedestal_studies import bench


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: the benchmark to run, and the file for its rows."""
    parser.add_argument('what', nargs='?', choices=tuple(bench.BENCH_MODULES), help='benchmark to run; default: all')
    console.add_json(parser)


def main(options: argparse.Namespace) -> int:
    """Run one benchmark or all, and write the rows. Return exit code 0."""
    content: dict[str, Json] = {'name': 'bench', 'rows': []}
    for what in (options.what,) if options.what else bench.BENCH_MODULES:
        content['rows'] += importlib.import_module(f'{bench.__name__}.{bench.BENCH_MODULES[what]}').run()
    console.write_json(options.json, content)
    return 0
