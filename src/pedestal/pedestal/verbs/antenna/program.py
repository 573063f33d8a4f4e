"""send a table of times and angles (program track) of a scenario to a running ACU"""
import argparse
import datetime
import typing

from pedestal.verbs import arguments

if typing.TYPE_CHECKING:
    from pedestal_bringup.scenario.program import Plan

START_FROM_FILE = 'file'  # value of --start for the start time in the file of the target


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add scenario, duration, start and parameters."""
    arguments.add_scenario(parser)
    arguments.add_duration(parser, 'the program track')
    parser.add_argument('--start', metavar='UTC', help="time of the first row, one of: a UTC such as "
                        "2026-11-22T12:00:00; `now`; `file`: the start time given in the target's track file or TLE; "
                        "default: start of the running graph")
    arguments.add_param(parser)
    arguments.add_namespace(parser)


def _start(plan: 'Plan', text: str | None) -> int | None:
    """Return the time [ns of UTC] of --start for a program.Plan, None if it is not given. Raises ValueError."""
    if text is None:
        return None
    if text == START_FROM_FILE:
        return plan.begins()
    from pedestal_common.geometry import orbit
    utc = datetime.timezone.utc
    moment = datetime.datetime.now(utc) if text == 'now' else orbit.instant('--start', text).replace(tzinfo=utc)
    return round(moment.timestamp() * 1e6) * 1000


def main(options: argparse.Namespace) -> int:
    """Send the program track. Return the exit code of watch.send_program."""
    from pedestal_bringup.graph import watch
    from pedestal_bringup.scenario import scenario
    from pedestal_bringup.scenario.program import Plan
    plan = Plan(scenario.load(options.scenario, options.param, duration=options.duration))
    return watch.send_program(plan, _start(plan, options.start), arguments.ros_arguments(options))
