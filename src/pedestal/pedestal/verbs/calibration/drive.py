"""identify friction, inertia, lash, bias, encoder and structure of both axes from safe motions

--plan writes a parameter file with the motions, for the limits of --scenario. They stay inside half the rate of the
shaper, its acceleration, and 90 % of the travel. Record them twice, with and without bias torque, and give both
recordings by --bag. With --scenario alone the verb makes both runs in memory.

The estimates are corrected by a twin: the simulated drive with these values, which receives the recorded commands. The
torque of the twin must agree with the recording within 10 %. Exit code 0: verified; 4: not verified.

--output writes a parameter file for the control unit and for the simulated drive, if the result is verified. An axis
keeps its nominal values if the twin fits the recording at least as well with them.
"""
import argparse
import pathlib

from pedestal import console
from pedestal.verbs import arguments

UNUSED_OPTIONS = {'bag': ('plan',), 'plan': ('output', 'report', 'json')}
"""{option: options that have no effect with it}."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add recordings or scenario, plan, changed parameters, and output files."""
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument('--bag', type=pathlib.Path, metavar='BAG', action='append', help='recording of the motions of '
                        '--plan; may be repeated, for runs with and without bias torque')
    source.add_argument('--scenario', metavar='SCENARIO', help='scenario (name or .yaml file) whose antenna is '
                        'planned for or run in memory')
    parser.add_argument('--plan', type=pathlib.Path, metavar='FILE', help='new parameter file with the motions, for '
                        '`pedestal run SCENARIO --params-file FILE`')
    arguments.add_param(parser, 'adu.azimuth.load.inertia=273')
    arguments.add_params_file(parser)
    arguments.add_result_files(parser, 'new parameter file with the identified values', 'new HTML page with friction, '
                               'torques and encoder errors')


def main(options: argparse.Namespace) -> int:
    """Plan or identify, write the files and print the result. Return exit code 0, or EXIT_FAILED_RUN."""
    from pedestal_workbench.calibration.drive import identified
    for name, unused in UNUSED_OPTIONS.items():
        if getattr(options, name):
            arguments.refuse_unused(options, unused, name)
    arguments.check_result_files(options, 'plan')
    arguments.check_recording(options)
    changes = arguments.changes(options)
    if options.plan:
        from pedestal_bringup.scenario import scenario
        chosen = scenario.load(options.scenario, changes)
        print('\n'.join(identified.write_plan(chosen, options.scenario, options.plan)))
        return 0
    printed, content, verified = identified.main(options, changes)
    print('\n'.join(printed))
    console.write_json(options.json, content)
    return 0 if verified else console.EXIT_FAILED_RUN
