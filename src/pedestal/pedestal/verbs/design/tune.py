"""tune a filter, the feed-forward, or the loops of your own plant

Give exactly one of --filter, --feedforward and --loops. --filter needs a recording or a scenario; --feedforward and
--loops need a scenario.
"""
import argparse
import pathlib

from pedestal import console
from pedestal.verbs import arguments


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add recording or scenario, subject of the tuning, axes and seeds."""
    parser.add_argument('source', metavar='BAG|SCENARIO', help='input of the tuning. With a recording, the filter is '
                        'tuned for the largest likelihood of the innovations; with a scenario, for the smallest true '
                        'pointing error')
    parser.add_argument('--filter', metavar='KIND', help='kind of the filter to tune, for example imm (all kinds: '
                        '`pedestal parameters acu`, filter.kind); excludes --feedforward and --loops')
    parser.add_argument('--feedforward', action='store_true', help='compute the gains of the feed-forward from the '
                        'rate loop of the drive; needs a scenario; excludes --filter and --loops')
    parser.add_argument('--loops', action='store_true', help='tune speed and position loop, shaper and bias for the '
                        'plant of a scenario, and measure the margins on it; excludes --filter and --feedforward')
    parser.add_argument('--speed-bandwidth', type=float, metavar='HZ', help='crossover of the speed loop [Hz], for '
                        '--loops; default: 8 times --position-bandwidth if this option is given, else 28')
    parser.add_argument('--position-bandwidth', type=float, metavar='HZ', help='crossover of the position loop [Hz], '
                        'for --loops; default: an eighth of --speed-bandwidth')
    parser.add_argument('--phase-margin', type=float, metavar='DEG', help='smallest phase margin '
                        '[deg], for --loops; 20 to 80; default: 45')
    parser.add_argument('--gain-margin', type=float, metavar='DB', help='smallest gain margin [dB], '
                        'for --loops; 3 to 20; default: 6')
    parser.add_argument('--axis', choices=('azimuth', 'elevation', 'both'), default='both', help='axis to tune; '
                        'default: both')
    parser.add_argument('--seed', type=int, metavar='N', help='first seed; default: value of the scenario')
    parser.add_argument('--runs', type=int, metavar='N', help='number of runs with different seeds for the '
                        'tuning; one more run, with the next seed, checks the result; default: 2')
    arguments.add_duration(parser)
    arguments.add_param(parser)
    parser.add_argument('--output', type=pathlib.Path, metavar='FILE', help='output parameter file; default: '
                        'SCENARIO-KIND.yaml, SCENARIO-feedforward.yaml or SCENARIO-loops.yaml')


def main(options: argparse.Namespace) -> int:
    """Tune, write the parameter file and print the comparison. Return exit code 0."""
    from pedestal_workbench.tuning import loops, tune
    with console.progress_of_share() as progress:
        lines = loops.main(options, progress) if options.loops else tune.main(options, options.command, progress)
    print('\n'.join(lines))
    return 0
