"""Arguments that several verbs take."""
import pathlib


def add_param(parser, example='acu.azimuth.feedforward.bandwidth=20'):
    """--param NODE.KEY=VALUE, any number of times."""
    parser.add_argument('--param', action='append', default=[], metavar='NODE.KEY=VALUE',
                        help=f'change a parameter, for example {example}; may be repeated')


def add_beam(parser):
    """--beam NAME of a recording of several beams."""
    parser.add_argument('--beam', default='', metavar='NAME', help='of a recording of several, for example beam_2; '
                        'default: the first')


def add_new_bag(parser):
    """--bag DIR, where a run is recorded."""
    parser.add_argument('--bag', type=pathlib.Path, metavar='DIR', help='of the new run; default: '
                        'bags/runs/SCENARIO-N')


def new_bag(given, scenario):
    """Where to record: as given, else bags/runs/SCENARIO-N. Raises ValueError where there is one already."""
    from pedestal_bringup.run import graph
    bag = given or graph.free_bag(scenario)
    if bag.exists():
        raise ValueError(f'--bag {bag} exists already; a recording is never overwritten')
    return bag
