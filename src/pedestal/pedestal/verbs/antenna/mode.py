"""set the mode of a running antenna control unit (ACU)

Publishes the command on acu/command and waits for the reply. Exit code 0: the ACU accepted the command. Exit code 1:
the ACU refused it; the reason is printed.

    pedestal mode preset --az 30 --el 45
    pedestal mode preset 30 45           go to the same angles, given without --az and --el
    pedestal mode preset point=zenith    go to the stored preset zenith (parameter acu.points)
    pedestal mode rate --az 0.5          turn at 0.5 deg/s for half a second
    pedestal mode rate --az 0.5 --hold 8 turn at 0.5 deg/s for 8 s; Ctrl-C ends the motion at once
    pedestal mode tle --tle iss.tle      follow the satellite of a file
    pedestal mode stow
"""
import argparse
import math

from pedestal.verbs import arguments
from pedestal.verbs.antenna import ask

MAX_HOLD_S = 600.0  # largest time for which mode rate is repeated [s]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add mode, angles and the options of a client."""
    parser.add_argument('mode', help='name of the mode, for example stop; for an unknown name the reply lists '
                        'all names')
    parser.add_argument('--az', type=float, metavar='DEG', help='azimuth [deg]; in mode rate: azimuth rate [deg/s]')
    parser.add_argument('--el',
                        type=float, metavar='DEG', help='elevation [deg]; in mode rate: elevation rate [deg/s]')
    parser.add_argument('given', nargs='*', metavar='NAME=VALUE', help='other arguments of the mode (radians, SI '
                        'units; see docs/operating.md, Commands); or two numbers, as --az and --el')
    parser.add_argument('--hold', type=float, metavar='S', help='time for which mode rate is repeated before the axes '
                        'stop [s]; default: the command is sent once and lasts 0.5 s')
    arguments.add_elements(parser)
    arguments.add_remote(parser)


def main(options: argparse.Namespace) -> int:
    """Send the command. Return the exit code."""
    angles = {'azimuth': options.az, 'elevation': options.el}
    numbers = [text for text in options.given if is_number(text)]
    given = ask.with_elements(options, (text for text in options.given if text not in numbers))
    if len(numbers) not in (0, 2):
        raise ValueError(f'{" ".join(numbers)}: must be azimuth and elevation [deg], for example '
                         f'`pedestal mode {options.mode} 30 45`; one axis: --az 30 or --el 45')
    for (name, degrees), text in zip(angles.items(), numbers):
        if degrees is not None:
            raise ValueError(f'{text} and --{name[:2]} {degrees:g}: {name} is given twice')
        angles[name] = float(text)
    for name, degrees in angles.items():
        if degrees is not None and name in given:
            raise ValueError(f'{name} {degrees:g} deg and {name}={given[name]}: {name} is given twice')
        if degrees is not None:
            given[name] = math.radians(degrees)
    if options.hold is not None and not (options.mode == 'rate' and 0.0 < options.hold <= MAX_HOLD_S):
        raise ValueError(f'--hold {options.hold:g}: must be in 0 to {MAX_HOLD_S:g} s, with mode rate only')
    return ask.send_command(options, options.mode, given, hold=options.hold)


def is_number(text: str) -> bool:
    """Return True if a text is a decimal number."""
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
