"""operate a running antenna by hand on this terminal

Shows angles, errors, mode and its reason, receiver and alarms. The screen lists the key of each mode. An arrow key
jogs the antenna while it is held down. Needs a terminal. q ends the program; the antenna continues.
"""
import argparse
import sys

from pedestal.verbs import arguments


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of a client."""
    arguments.add_remote(parser)


def main(options: argparse.Namespace) -> int:
    """Run the console. Return exit code 0. Raises ValueError without a terminal."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise ValueError('operate needs a terminal; `pedestal mode` and `pedestal status` need none')
    from pedestal_operator import console
    with arguments.remote(options) as connection:
        connection.wait_for_node(options.timeout)
        console.operate(connection)
    return 0
