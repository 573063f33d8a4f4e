"""measure this machine: the lockstep ring, the compiled core, bags"""
from pedestal_bringup import console


def add_arguments(parser):
    parser.add_argument('what', nargs='?', choices=('graph', 'core', 'bag'), help='default: all')
    console.add_json(parser)


def main(options):
    from pedestal_bringup.bench import bench
    content = {'name': 'bench', 'rows': []}
    for what in (options.what,) if options.what else bench.BENCHES:
        content['rows'] += bench.BENCHES[what]()
    console.write_json(options.json, content)
    return 0
