"""set the mode of a running antenna control unit (ACU)

Publishes the command on acu/command and waits for the reply. Exit code 0: the ACU accepted the command. Exit code 1:
the ACU refused it; the reason is printed.

    pedestal mode preset --az 30 --el 45
    pedestal mode preset point=zenith    go to the stored preset zenith (parameter acu.points)
    pedestal mode rate --az 0.5          turn at 0.5 deg/s for half a second; repeat the command to continue
    pedestal mode tle --tle iss.tle      follow the satellite of a file
    pedestal mode stow
"""
import argparse
import math

from pedestal.verbs import arguments
from pedestal.verbs.antenna import ask


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add mode, angles and the options of a client."""
    parser.add_argument('mode', help='name of the mode, for example stop; for an unknown name the reply lists '
                        'all names')
    parser.add_argument('--az', type=float, metavar='DEG', help='azimuth [deg]; in mode rate: azimuth rate [deg/s]')
    parser.add_argument('--el',
                        type=float, metavar='DEG', help='elevation [deg]; in mode rate: elevation rate [deg/s]')
    parser.add_argument('given',
                        nargs='*', metavar='NAME=VALUE', help='other arguments of the mode (radians, SI units); '
                        'see docs/operating.md, Commands')
    arguments.add_elements(parser)
    arguments.add_remote(parser)


def main(options: argparse.Namespace) -> int:
    """Send the command. Return the exit code."""
    given = ask.with_elements(options)
    for name, degrees in (('azimuth', options.az), ('elevation', options.el)):
        if degrees is not None and name in given:
            raise ValueError(f'--{name[:2]} {degrees:g}: {name} is given twice')
        if degrees is not None:
            given[name] = math.radians(degrees)
    return ask.send_command(options, options.mode, given)
