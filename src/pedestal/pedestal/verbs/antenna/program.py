"""send the program track of a scenario to a running ACU"""
import argparse
import datetime

from pedestal.verbs import arguments

START_FROM_FILE = 'file'
"""Value of --start for the start time in the file of the target."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add scenario, duration, start and parameters."""
    arguments.add_scenario(parser)
    arguments.add_duration(parser, 'the program track')
    parser.add_argument('--start', type=_utc, metavar='UTC', help='UTC at the beginning of the track: for example '
                        '2026-11-22T12:00:00, now, or file (start time in the file or TLE of the target); '
                        'default: start of the running graph')
    arguments.add_param(parser)
    arguments.add_namespace(parser)


def _utc(text: str) -> int | str:
    """Return a UTC in ISO 8601, or `now`, as a number [ns]; `file` unchanged."""
    if text == START_FROM_FILE:
        return text
    if text == 'now':
        moment = datetime.datetime.now(datetime.timezone.utc)
    else:
        moment = datetime.datetime.fromisoformat(text.removesuffix('Z'))
        if moment.tzinfo is None:
            moment = moment.replace(tzinfo=datetime.timezone.utc)
    return round(moment.timestamp() * 1e6) * 1000


def main(options: argparse.Namespace) -> int:
    """Send the program track. Return the exit code of watch.send_program."""
    from pedestal_bringup.graph import watch
    from pedestal_bringup.scenario import scenario
    from pedestal_bringup.scenario.program import Plan
    plan = Plan(scenario.load(options.scenario, options.param, duration=options.duration))
    start = plan.begins() if options.start == START_FROM_FILE else options.start
    return watch.send_program(plan, start, arguments.ros_arguments(options))
