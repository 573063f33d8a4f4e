"""operate a running antenna by hand on this terminal

Shows angles, errors, mode and reason, receiver and alarms; keys ask for modes, arrows jog while they are held. Needs
a terminal; q ends it, the antenna goes on.
"""
import sys

from pedestal.verbs import arguments


def add_arguments(parser):
    """Who asks."""
    arguments.add_remote(parser)


def main(options):
    """Run the console; exit code 0."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise ValueError('operate needs a terminal; `pedestal mode` and `pedestal status` do without')
    from pedestal_operator import console
    with arguments.remote(options) as spun:
        spun.wait_for_node(options.timeout)
        console.operate(spun)
    return 0
