"""measure this machine: the lockstep ring, the compiled core, bags"""
from pedestal_bringup import console


def add_arguments(parser):
    """What to measure, --json."""
    parser.add_argument('what', nargs='?', choices=('graph', 'core', 'bag'), help='default: all')
    console.add_json(parser)


def main(options):
    """Run one or all benches and write the rows."""
    from pedestal_bringup.bench import bench
    content = {'name': 'bench', 'rows': []}
    for what in (options.what,) if options.what else bench.BENCHES:
        content['rows'] += bench.BENCHES[what]()
    console.write_json(options.json, content)
    return 0
