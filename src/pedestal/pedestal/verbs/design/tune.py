"""find the parameters of a filter, of the feed-forward, or of the loops of your own plant"""
import pathlib

from pedestal.verbs import arguments
from pedestal_analysis import console


def add_arguments(parser):
    """Recording or scenario, what to tune, on which axes and seeds."""
    parser.add_argument('source', metavar='BAG|SCENARIO', help='a recording: innovations; a scenario: pointing error')
    parser.add_argument('--filter', metavar='KIND', help='the kind of filter to tune')
    parser.add_argument('--feedforward', action='store_true', help="the gains that follow from the drive's rate loop")
    parser.add_argument('--loops', action='store_true', help='speed and position loop, shaper and bias for the plant '
                        'of a scenario, with the margins that are measured on it')
    parser.add_argument('--speed-bandwidth', type=float, metavar='HZ', help='--loops: crossover; default: 28 Hz, or 8 '
                        'times that of the position loop')
    parser.add_argument('--position-bandwidth', type=float, metavar='HZ', help='--loops: crossover; default: an '
                        'eighth of the speed loop')
    parser.add_argument('--phase-margin', type=float, metavar='DEG', help='--loops: default: 45')
    parser.add_argument('--gain-margin', type=float, metavar='DB', help='--loops: default: 6')
    parser.add_argument('--axis', choices=('azimuth', 'elevation', 'both'), default='both', help='default: both')
    parser.add_argument('--seed', type=int, metavar='N', help='first seed; default: what the scenario says')
    parser.add_argument('--runs', type=int, metavar='N', help='seeds to tune on, the next one judges; default: 2')
    parser.add_argument('--duration', type=float, metavar='S', help='of a run')
    arguments.add_param(parser)
    parser.add_argument('--output', type=pathlib.Path, metavar='FILE', help='default: NAME-KIND.yaml, NAME-loops.yaml')


def main(options):
    """Tune, write the parameter file and print the comparison."""
    from pedestal_analysis.tuning import loops, tune
    with console.progress_of_share() as progress:
        lines = loops.main(options, progress) if options.loops else tune.main(options, options.command, progress)
    print('\n'.join(lines))
    return 0
