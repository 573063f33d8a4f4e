"""Arguments that several verbs take."""
import os
import pathlib


def add_param(parser, example='acu.azimuth.feedforward.bandwidth=20'):
    """--param NODE.KEY=VALUE, any number of times."""
    parser.add_argument('--param', action='append', default=[], metavar='NODE.KEY=VALUE',
                        help=f'change a parameter, for example {example}; may be repeated')


def add_beam(parser):
    """--beam NAME of a recording of several beams."""
    parser.add_argument('--beam', default='', metavar='NAME', help='of a recording of several, for example beam_2; '
                        'default: the first')


def add_vector(parser):
    """--vector FORMAT of a verb that draws."""
    parser.add_argument('--vector', choices=('pdf', 'svg'), help='write each figure in this format too, for print')


def add_new_bag(parser):
    """--bag DIR, where a run is recorded."""
    parser.add_argument('--bag', type=pathlib.Path, metavar='DIR', help='of the new run; default: '
                        'bags/runs/SCENARIO-N')


def add_namespace(parser):
    """--namespace NAME of a graph that was launched in one."""
    parser.add_argument('--namespace', default='', metavar='NAME', help='in which the graph was launched, for example '
                        'ship_1')


def ros_arguments(options):
    """The arguments of ROS 2 for a node in the namespace of add_namespace. Raises ValueError."""
    from rclpy.exceptions import InvalidNamespaceException
    from rclpy.validate_namespace import validate_namespace
    if not options.namespace:
        return []
    name = f'/{options.namespace.strip("/")}'
    try:
        validate_namespace(name)
    except InvalidNamespaceException:
        raise ValueError(f'--namespace {options.namespace}: must be letters, digits and _, as ship_1') from None
    return ['--ros-args', '-r', f'__ns:={name}']


def add_remote(parser, commands=True):
    """Beam of a running graph, time to wait, and the name of the operator for a verb that sends commands."""
    add_namespace(parser)
    parser.set_defaults(who=None)
    if commands:
        parser.add_argument('--who', metavar='NAME', help='by which name to ask; default: login@host')
    parser.add_argument('--beam', default='', metavar='NAME', help='of an array of several, for example beam_2')
    parser.add_argument('--timeout', type=float, default=5.0, metavar='S', help='to wait for the graph and for its '
                        'reply; default: 5')


def remote(options, node='acu'):
    """A remote_node.Spun of the node `terminal`, by the options of add_remote."""
    from pedestal_common.graph import nodes
    from pedestal_operator.remote_node import Remote, RemoteSession, user
    if options.beam and options.beam + '/' not in nodes.prefixes(nodes.MAX_BEAMS):
        raise ValueError(f'--beam {options.beam}: must be beam_1 to beam_{nodes.MAX_BEAMS}')
    return RemoteSession(lambda: Remote(f'terminal_{os.getpid()}', options.who or user(), node, options.beam),
                         ros_arguments(options))


def add_workers(parser):
    """--workers N or --scheduler ADDRESS of many runs."""
    workers = parser.add_mutually_exclusive_group()
    workers.add_argument('--workers', type=int, metavar='N', help='processes for the runs; default: one per core')
    workers.add_argument('--scheduler', metavar='ADDRESS', help="Dask cluster for the runs, for example "
                         "tcp://host:8786; needs pip install 'pedestal_analysis[cluster]' here and the pedestal "
                         "packages there")


def add_params_file(parser):
    """--params-file FILE."""
    parser.add_argument('--params-file', type=pathlib.Path, metavar='FILE',
                        help='ROS 2 parameter file whose values replace those of the scenario, for example one of '
                        '`pedestal tune`')
