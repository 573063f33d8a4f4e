"""send the program track of a scenario to a running ACU"""
import datetime

from pedestal.verbs import arguments

START_FROM_FILE = 'file'
"""--start at the UTC of the target."""


def add_arguments(parser):
    """Scenario, duration, parameters."""
    parser.add_argument('scenario')
    parser.add_argument('--duration', type=float, metavar='S', help='of the run it is for')
    parser.add_argument('--start', metavar='UTC', help='when its time is 0, as 2026-11-22T12:00:00, now, '
                        'or file: when its file or its TLE says; default: when the graph began, which the ACU is '
                        'asked for')
    arguments.add_param(parser)
    arguments.add_namespace(parser)


def _start(plan, text):
    """Return the time [ns of UTC] of --start for a program.Plan, None if it is not given. Raises ValueError."""
    if text is None:
        return None
    if text == START_FROM_FILE:
        return plan.begins()
    from pedestal_common.geometry import orbit
    utc = datetime.timezone.utc
    moment = datetime.datetime.now(utc) if text == 'now' else orbit.instant('--start', text).replace(tzinfo=utc)
    return round(moment.timestamp() * 1e6) * 1000


def main(options):
    """Send the program track; exit code of watch.send_program."""
    from pedestal_bringup.graph import watch
    from pedestal_bringup.scenario import scenario
    from pedestal_bringup.scenario.program import Plan
    plan = Plan(scenario.load(options.scenario, options.param, duration=options.duration))
    return watch.send_program(plan, _start(plan, options.start), arguments.ros_arguments(options))
