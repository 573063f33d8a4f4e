"""measure this machine: the lockstep ring, the compiled core, bags"""
import importlib

from pedestal_analysis import console
from pedestal_studies import bench


def add_arguments(parser):
    """What to measure, --json."""
    parser.add_argument('what', nargs='?', choices=tuple(bench.BENCH_MODULES), help='default: all')
    console.add_json(parser)


def main(options):
    """Run one or all benches and write the rows."""
    content = {'name': 'bench', 'rows': []}
    for what in (options.what,) if options.what else bench.BENCH_MODULES:
        content['rows'] += importlib.import_module(f'{bench.__name__}.{bench.BENCH_MODULES[what]}').run()
    console.write_json(options.json, content)
    return 0
