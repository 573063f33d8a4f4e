"""fit the pointing model to measured offsets, or plan the directions to measure

The file of --offsets has the columns az_deg, el_deg (direction wanted on the sky), cross_elevation_deg and
elevation_deg (offset that had to be added to the command), and possibly sigma_deg. The formats of katpoint's
reduction scripts and of TPOINT are read too; the content of the file decides. --bag takes the offsets from recordings
of satellite passes: boresight in autotrack less the program track.

The terms have the numbers and signs of the VLBI Field System and of katpoint. They are added to the wanted direction.
A term whose sigma exceeds its value is dropped. The leave-one-out rms is the criterion for a choice of terms.

--output writes a parameter file for `pedestal run SCENARIO --params-file FILE`.
"""
import argparse
import pathlib

from pedestal import console
from pedestal.verbs import arguments

UNUSED_OPTIONS = {'offsets': ('scenario', 'points', 'collected'), 'bag': ('scenario',),
                  'plan': ('terms', 'form', 'antenna', 'date', 'report', 'points', 'collected', 'json')}
"""{option of the source: options that have no effect with it}."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add file of the offsets, terms, date, output files, and the plan."""
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument('--offsets', type=pathlib.Path, metavar='FILE', help='file of measured offsets: CSV, katpoint '
                        'or TPOINT')
    source.add_argument('--bag', type=pathlib.Path, metavar='BAG', action='append', help='recording of a pass: the '
                        'offsets are the boresight in autotrack less the program track; may be repeated')
    source.add_argument('--plan', type=int, metavar='N', help='number of directions to plan: a CSV table of encoder '
                        'angles, spread over the sky and both turns of the wrap; 10 to 500')
    parser.add_argument('--points', type=int, metavar='N', help='number of offsets from each recording of --bag; '
                        'default: 10')
    parser.add_argument('--collected', type=pathlib.Path, metavar='FILE', help='new CSV file of the offsets that were '
                        'read, in the form of --offsets')
    parser.add_argument('--scenario', metavar='SCENARIO', help='scenario (name or .yaml file) whose travel limits the '
                        'directions of --plan; default: azimuth -270 to 270 deg')
    parser.add_argument('--terms', metavar='P1,P3,...', help='terms to fit; default: P1,P3,P4,P5,P6,P7,P8')
    parser.add_argument('--keep-all', action='store_true', help='no drop of terms whose sigma exceeds their value')
    parser.add_argument('--form', choices=('linear', 'exact'), help='form of the model: first order in the terms, as '
                        'in katpoint, or the exact law of the control unit; default: linear, unless the exact form '
                        'predicts left-out offsets better by 5 %%')
    parser.add_argument('--date', metavar='DATE', help='date of the measurement for the parameter file, for example '
                        '2026-11-26; default: the last date in the file of --offsets')
    parser.add_argument('--antenna', metavar='NAME', help='name of the antenna for the parameter file')
    arguments.add_result_files(parser, 'new parameter file with the model; with --plan: new CSV file of the '
                               'directions', 'new HTML page with the residuals')


def main(options: argparse.Namespace) -> int:
    """Fit or plan, write the files and print the result. Return exit code 0."""
    from pedestal_workbench.calibration import plan, pointing
    source = next(name for name in UNUSED_OPTIONS if getattr(options, name) is not None)
    arguments.refuse_unused(options, UNUSED_OPTIONS[source], source)
    arguments.check_result_files(options, 'collected')
    if options.plan is not None:
        print('\n'.join(plan.main(options)))
        return 0
    printed, content = pointing.main(options)
    print('\n'.join(printed))
    console.write_json(options.json, content)
    return 0
