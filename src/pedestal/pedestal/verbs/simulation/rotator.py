"""a rotator with its own position loop on a pseudo terminal, whose path is printed, until Ctrl-C

rotator_node, or another program, opens this path as a serial line.
"""
import argparse
import math

MAX_RATE_DEG_S, MAX_DELAY_S = 360.0, 10.0
PROTOCOLS = 'gs232', 'easycomm', 'rot2prog'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add protocol, rate and delay."""
    parser.add_argument('--protocol', choices=PROTOCOLS, default='gs232', help='protocol on the line; default: gs232')
    parser.add_argument('--rate', type=float, default=6.0, metavar='RATE', help='rate of both axes, at most '
                        f'{MAX_RATE_DEG_S:g}; default: 6 deg/s')
    parser.add_argument('--delay', type=float, default=0.05, metavar='DELAY', help='time until an answer, 0 to '
                        f'{MAX_DELAY_S:g}; default: 0.05 s')


def main(options: argparse.Namespace) -> int:
    """Serve the rotator until Ctrl-C, and return the exit code. Raises ValueError."""
    from equipment_sim import rotator as simulator
    if not 0.0 < options.rate <= MAX_RATE_DEG_S:
        raise ValueError(f'--rate {options.rate:g}: must be above 0 and at most {MAX_RATE_DEG_S:g} deg/s')
    if not (math.isfinite(options.delay) and 0.0 <= options.delay <= MAX_DELAY_S):
        raise ValueError(f'--delay {options.delay:g}: must be 0 to {MAX_DELAY_S:g} s')
    simulator.serve(options.protocol, options.rate, options.delay)
    return 0
