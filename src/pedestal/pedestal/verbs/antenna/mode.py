"""ask a running ACU for a mode

Asks by acu/command and waits for the reply: exit code 0 where it was granted, 1 where it was refused, with the reason.

    pedestal mode preset --az 30 --el 45
    pedestal mode preset point=zenith
    pedestal mode rate --az 0.5          (deg/s; for half a second, ask again and again)
    pedestal mode stow
"""
import math

from pedestal.verbs import arguments
from pedestal.verbs.antenna import ask


def add_arguments(parser):
    """Mode, angles, who asks."""
    parser.add_argument('mode', help='for example stop; one that there is not is refused with the list of all')
    parser.add_argument('--az', type=float, metavar='DEG', help='azimuth; of `rate` [deg/s]')
    parser.add_argument('--el', type=float, metavar='DEG', help='elevation; of `rate` [deg/s]')
    parser.add_argument('given', nargs='*', metavar='NAME=VALUE', help='other arguments, in SI units')
    arguments.add_remote(parser)


def main(options):
    """Ask for the mode; the exit code."""
    given = ask.pairs(options.given)
    for name, degrees in (('azimuth', options.az), ('elevation', options.el)):
        if degrees is not None and name in given:
            raise ValueError(f'--{name[:2]} {degrees:g}: {name} is given twice')
        if degrees is not None:
            given[name] = math.radians(degrees)
    return ask.send_command(options, options.mode, given)
