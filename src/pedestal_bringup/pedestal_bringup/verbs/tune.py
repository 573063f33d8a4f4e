"""find the parameters of a filter or of the feed-forward"""
import pathlib

from pedestal_bringup import console
from pedestal_bringup.verbs import arguments


def add_arguments(parser):
    """Recording or scenario, what to tune, on which axes and seeds."""
    parser.add_argument('source', metavar='BAG|SCENARIO', help='a recording: innovations; a scenario: pointing error')
    parser.add_argument('--filter', metavar='KIND', help='the kind of filter to tune')
    parser.add_argument('--feedforward', action='store_true', help="the gains that follow from the drive's rate loop")
    parser.add_argument('--axis', choices=('azimuth', 'elevation', 'both'), default='both', help='default: both')
    parser.add_argument('--seed', type=int, metavar='N', help='first seed; default: what the scenario says')
    parser.add_argument('--runs', type=int, metavar='N', help='seeds to tune on, the next one judges; default: 2')
    parser.add_argument('--duration', type=float, metavar='S', help='of a run')
    arguments.add_param(parser)
    parser.add_argument('--output', type=pathlib.Path, metavar='FILE', help='default: NAME-KIND.yaml')


def main(options):
    """Tune, write the parameter file and print the comparison."""
    from pedestal_bringup.trials import tune
    with console.progress_of_share() as progress:
        lines = tune.main(options, options.command, progress)
    print('\n'.join(lines))
    return 0
