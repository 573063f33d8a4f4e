"""measure slopes and cross-talk of the tracking receiver by offsets about a beacon

The control unit moves the beam off a beacon in steps, on both axes and round a circle of 0.2 beamwidths, as the
scenario receiver_phasing does. The verb reads --bag, the recording of such a run. With --scenario it runs the scenario
in memory instead.

A 2 x 2 matrix is fitted to errors and offsets: slopes on its diagonal, cross-talk off the diagonal. The inverse is
verified on the circle: error below 5 %, cross-talk below -20 dB. Exchanged channels, reversed signs, 180 deg and
turned axes are named. Exit code 0: verified; 4: not verified.

With --iq, the file of the I/Q samples of the same run, the verb measures the complex calibration matrix of
monopulse_receiver_node instead: gain and phase of each element. A wrong phase is named too. With --scenario, the file
is that of `pedestal simulate receiver --output FILE` with the same scenario and parameters.

--output writes a parameter file for `pedestal run SCENARIO --params-file FILE`.
"""
import argparse
import pathlib

from pedestal import console
from pedestal.verbs import arguments


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add recording or scenario, changed parameters, and output files."""
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument('--bag', type=pathlib.Path, metavar='BAG', help='recording of a run with offsets about a '
                        'beacon')
    source.add_argument('--scenario', metavar='SCENARIO', help='scenario (name or .yaml file) to run in memory, for '
                        'example receiver_phasing')
    parser.add_argument('--iq', type=pathlib.Path, metavar='FILE', help='.sigmf-meta file of the I/Q samples of this '
                        'run (tracking_receiver.source.record), for the complex calibration matrix')
    arguments.add_param(parser, 'tracking_receiver.antenna.cross_coupling=0.3')
    arguments.add_params_file(parser)
    arguments.add_result_files(parser, 'new parameter file with the matrix', 'new HTML page with errors and circle')


def main(options: argparse.Namespace) -> int:
    """Calibrate, write the files and print the result. Return exit code 0, or EXIT_FAILED_RUN if not verified."""
    arguments.check_result_files(options)
    if options.iq is not None:
        from pedestal_workbench.calibration.receiver import iq_phasing
        arguments.check_recording(options)
        printed, content, verified = iq_phasing.main(options, arguments.changes(options))
    else:
        from pedestal_workbench.calibration.receiver import phasing
        printed, content, verified = phasing.main(*arguments.recording(options), options)
    print('\n'.join(printed))
    console.write_json(options.json, content)
    return 0 if verified else console.EXIT_FAILED_RUN
