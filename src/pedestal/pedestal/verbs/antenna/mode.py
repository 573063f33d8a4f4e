"""command a mode of a running ACU

Publishes the command on acu/command and waits for the reply. Exit code 0: the ACU accepted the command. Exit code 1:
the ACU refused it; the reason is printed.

    pedestal mode preset --az 30 --el 45
    pedestal mode preset point=zenith
    pedestal mode rate --az 0.5          turn at 0.5 deg/s for half a second; repeat the command to continue
    pedestal mode stow
"""
import argparse
import math

from pedestal.verbs import arguments
from pedestal.verbs.antenna import ask


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add mode, angles and the options of a client."""
    parser.add_argument('mode', help='name of the mode, for example stop; an unknown name is refused with a '
                        'list of all')
    parser.add_argument('--az', type=float, metavar='DEG', help='azimuth [deg]; for mode rate its rate [deg/s]')
    parser.add_argument('--el', type=float, metavar='DEG', help='elevation [deg]; for mode rate its rate [deg/s]')
    parser.add_argument('given', nargs='*', metavar='NAME=VALUE', help='other arguments of the mode, in SI units')
    arguments.add_remote(parser)


def main(options: argparse.Namespace) -> int:
    """Send the command. Return the exit code."""
    given = ask.pairs(options.given)
    for name, degrees in (('azimuth', options.az), ('elevation', options.el)):
        if degrees is not None:
            given[name] = math.radians(degrees)
    return ask.send_command(options, options.mode, given)
