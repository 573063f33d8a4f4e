"""send the program track of a scenario to a running ACU"""
import datetime

from pedestal.verbs import arguments

START_FROM_FILE = 'file'
"""--start at the UTC of the target."""


def add_arguments(parser):
    """Scenario, duration, parameters."""
    parser.add_argument('scenario')
    parser.add_argument('--duration', type=float, metavar='S', help='of the run it is for')
    parser.add_argument('--start', type=_utc, metavar='UTC', help='when its time is 0, as 2026-11-22T12:00:00, now, '
                        'or file: when its file or its TLE says; default: when the graph began, which the ACU is '
                        'asked for')
    arguments.add_param(parser)
    arguments.add_namespace(parser)


def _utc(text):
    """ISO 8601 in UTC, or `now` -> ns; `file` as it is."""
    if text == START_FROM_FILE:
        return text
    if text == 'now':
        moment = datetime.datetime.now(datetime.timezone.utc)
    else:
        moment = datetime.datetime.fromisoformat(text.removesuffix('Z'))
        if moment.tzinfo is None:
            moment = moment.replace(tzinfo=datetime.timezone.utc)
    return round(moment.timestamp() * 1e6) * 1000


def main(options):
    """Send the program track; exit code of watch.send_program."""
    from pedestal_bringup.graph import watch
    from pedestal_bringup.scenario import scenario
    from pedestal_bringup.scenario.program import Plan
    plan = Plan(scenario.load(options.scenario, options.param, duration=options.duration))
    start = plan.begins() if options.start == START_FROM_FILE else options.start
    return watch.send_program(plan, start, arguments.ros_arguments(options))
