"""tune a filter, the feed-forward, or the loops of your own plant"""
import argparse
import pathlib

from pedestal.verbs import arguments
from pedestal_analysis import console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add recording or scenario, subject of the tuning, axes and seeds."""
    parser.add_argument('source', metavar='BAG|SCENARIO', help='recording, to tune by the innovations; or scenario, '
                        'to tune by the pointing error')
    parser.add_argument('--filter', metavar='KIND', help='kind of the filter to tune')
    parser.add_argument('--feedforward', action='store_true', help='compute the gains of the feed-forward from the '
                        'rate loop of the drive')
    parser.add_argument('--loops', action='store_true', help='tune speed and position loop, shaper and bias for the '
                        'plant of a scenario, and measure the margins on it')
    parser.add_argument('--speed-bandwidth', type=float, metavar='HZ', help='crossover of the speed loop [Hz], for '
                        '--loops; default: 28, or 8 times --position-bandwidth')
    parser.add_argument('--position-bandwidth', type=float, metavar='HZ', help='crossover of the position loop [Hz], '
                        'for --loops; default: an eighth of --speed-bandwidth')
    parser.add_argument('--phase-margin', type=float, default=45.0, metavar='DEG', help='smallest phase margin '
                        '[deg], for --loops; 20 to 80; default: 45')
    parser.add_argument('--gain-margin', type=float, default=6.0, metavar='DB', help='smallest gain margin [dB], '
                        'for --loops; 3 to 20; default: 6')
    parser.add_argument('--axis', choices=('azimuth', 'elevation', 'both'), default='both', help='axis to tune; '
                        'default: both')
    parser.add_argument('--seed', type=int, metavar='N', help='first seed; default: value of the scenario')
    parser.add_argument('--runs', type=int, metavar='N', help='number of seeds for the tuning; the next seed '
                        'tests the result; default: 2')
    arguments.add_duration(parser)
    arguments.add_param(parser)
    parser.add_argument('--output', type=pathlib.Path, metavar='FILE', help='output parameter file; default: '
                        'NAME-KIND.yaml or NAME-loops.yaml')


def main(options: argparse.Namespace) -> int:
    """Tune, write the parameter file and print the comparison. Return exit code 0."""
    from pedestal_analysis.tuning import loops, tune
    with console.progress_of_share() as progress:
        lines = loops.main(options, progress) if options.loops else tune.main(options, options.command, progress)
    print('\n'.join(lines))
    return 0
