"""Verb `calibrate` and its steps, which calibrate an antenna from measurements."""
import argparse
import pathlib
import typing

from pedestal import console
from pedestal.verbs import arguments
from pedestal.verbs.arguments import Verb

if typing.TYPE_CHECKING:
    from pedestal_workbench.calibration.calibration import Calibration

UNUSED_WITH = {'offsets': ('scenario', 'points', 'collected'), 'bag': ('scenario',),
               'plan': ('terms', 'form', 'antenna', 'date', 'report', 'points', 'collected', 'json')}
"""{source of the step `pointing`: options that have no effect with it}."""


def _finish(options: argparse.Namespace, found: 'Calibration') -> int:
    """Print a calibration and write its files. Return exit code 0, or EXIT_FAILED_RUN if it is not verified."""
    from pedestal_workbench.calibration.calibration import ResultFiles
    written = found.write(arguments.typed(ResultFiles, options))
    print('\n'.join([*found.lines(), *written]))
    console.write_json(options.json, found.content())
    return 0 if found.verified else console.EXIT_FAILED_RUN


def _add_pointing(parser: argparse.ArgumentParser) -> None:
    """The file of --offsets has the columns az_deg, el_deg (direction wanted on the sky), cross_elevation_deg and
    elevation_deg (offset that had to be added to the command), and possibly sigma_deg. The formats of katpoint's
    reduction scripts and of TPOINT are read too; the content of the file decides. --bag takes the offsets from
    recordings of satellite passes: boresight in autotrack less the program track.

    The terms have the numbers and signs of the VLBI Field System and of katpoint. They are added to the wanted
    direction. A term whose sigma exceeds its value is dropped. The leave-one-out rms is the criterion for a choice of
    terms.

    --output writes a parameter file for `pedestal run SCENARIO --params-file FILE`.
    """
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
    parser.add_argument('--keep-all', action='store_true', help='all terms in the model; default: a term whose sigma '
                        'exceeds its value is dropped')
    parser.add_argument('--form', choices=('linear', 'exact'), help='form of the model: first order in the terms, as '
                        'in katpoint, or the exact law of the control unit; default: linear, unless the exact form '
                        'predicts left-out offsets better by 5 %%')
    parser.add_argument('--date', metavar='DATE', help='date of the measurement for the parameter file, for example '
                        '2026-11-26; default: the last date in the file of --offsets')
    parser.add_argument('--antenna', metavar='NAME', help='name of the antenna for the parameter file')
    arguments.add_result_files(parser, 'new parameter file with the model; with --plan: new CSV file of the '
                               'directions', 'new HTML page with the residuals')


def _pointing(options: argparse.Namespace) -> int:
    from pedestal_workbench.calibration import plan, pointing
    source = next(name for name in UNUSED_WITH if getattr(options, name) is not None)
    arguments.refuse_given(options, UNUSED_WITH[source], f'has no effect with --{source}')
    arguments.check_result_files(options, 'collected')
    if options.plan is not None:
        print('\n'.join(plan.main(options.plan, options.scenario, options.output)))
        return 0
    return _finish(options, pointing.calibrated(
        arguments.typed(pointing.PointingOptions, options, bag=options.bag or [])))


def _add_receiver(parser: argparse.ArgumentParser) -> None:
    """The control unit moves the beam off a beacon in steps, on both axes and round a circle of 0.2 beamwidths, as the
    scenario receiver_phasing does. The verb reads --bag, the recording of such a run. With --scenario it runs the
    scenario in memory instead.

    A 2 x 2 matrix is fitted to errors and offsets: slopes on its diagonal, cross-talk off the diagonal. The inverse is
    verified on the circle: error below 5 %, cross-talk below -20 dB. Exchanged channels, reversed signs, 180 deg and
    turned axes are named. Exit code 0: verified; 4: not verified.

    With --iq, the file of the I/Q samples of the same run, the verb measures the complex calibration matrix of
    monopulse_receiver_node instead: gain and phase of each element. A wrong phase is named too. With --scenario, the
    file is that of `pedestal simulate receiver --output FILE` with the same scenario and parameters.

    --output writes a parameter file for `pedestal run SCENARIO --params-file FILE`.
    """
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument('--bag', type=pathlib.Path, metavar='BAG', help='recording of a run with offsets about a '
                        'beacon')
    source.add_argument('--scenario', metavar='SCENARIO', help='scenario (name or .yaml file) to run in memory, for '
                        'example receiver_phasing')
    parser.add_argument('--iq', type=pathlib.Path, metavar='FILE', help='.sigmf-meta file of the I/Q samples of the '
                        'run of --bag or --scenario (tracking_receiver.source.record), for the complex calibration '
                        'matrix')
    arguments.add_param(parser, 'tracking_receiver.antenna.cross_coupling=0.3')
    arguments.add_params_file(parser)
    arguments.add_result_files(parser, 'new parameter file with the matrix', 'new HTML page with errors and circle')


def _receiver(options: argparse.Namespace) -> int:
    arguments.check_result_files(options)
    if options.iq is not None:
        from pedestal_workbench.calibration.receiver import iq_phasing
        arguments.check_recording(options)
        return _finish(options, iq_phasing.calibrated(arguments.typed(iq_phasing.IqPhasingOptions, options),
                                                      arguments.variant(options).overrides()))
    from pedestal_workbench.calibration.receiver import phasing
    return _finish(options, phasing.calibrated(*arguments.recording(options)))


def _add_drive(parser: argparse.ArgumentParser) -> None:
    """--plan writes a parameter file with the motions, for the limits of --scenario. They stay inside half the rate of
    the shaper, its acceleration, and 90 % of the travel. Record them twice, with and without bias torque, and give
    both recordings by --bag. With --scenario alone the verb makes both runs in memory.

    The estimates are corrected by a twin: the simulated drive with these values, which receives the recorded commands.
    The torque of the twin must agree with the recording within 10 %. Exit code 0: verified; 4: not verified.

    --output writes a parameter file for the control unit and for the simulated drive, if the result is verified. An
    axis keeps its nominal values if the twin fits the recording at least as well with them.
    """
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


def _drive(options: argparse.Namespace) -> int:
    from pedestal_workbench.calibration.drive import identified
    if options.bag:
        arguments.refuse_given(options, ('plan',), 'has no effect with --bag')
    if options.plan:
        arguments.refuse_given(options, ('output', 'report', 'json'), 'has no effect with --plan')
    arguments.check_result_files(options, 'plan')
    arguments.check_recording(options)
    variant = arguments.variant(options)
    if options.plan:
        print('\n'.join(identified.write_plan(variant.load(), options.scenario, options.plan)))
        return 0
    return _finish(options, identified.calibrated(options.bag or (), options.scenario, variant.overrides()))


def _add_sensitivity(parser: argparse.ArgumentParser) -> None:
    """The file of --levels has the columns cross_elevation_deg, elevation_deg and level_db: offset of the beam from
    the source, and total power. The first column may be az_deg, an offset in azimuth, which needs --elevation.

    --bag takes the levels from a recording in which the commands `offset` of the control unit moved the beam about the
    source.

    A Gaussian beam, convolved with the disk of the source, is fitted to the power. --flux and --frequency give G/T by
    the Y factor, corrected for the size of the source (ITU-R S.733).

    --output writes a parameter file for `pedestal run SCENARIO --params-file FILE`.
    """
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument('--levels', type=pathlib.Path, metavar='FILE', help='CSV file of offsets and levels')
    source.add_argument('--bag', type=pathlib.Path, metavar='BAG', help='recording of a scan by commands `offset`')
    for name, metavar, text in (
            ('flux', 'SFU', 'flux density of the source in solar flux units, 1 to 1e6; needs --frequency'),
            ('frequency', 'GHZ', 'frequency of the receiver, 0.1 to 300 GHz'),
            ('diameter', 'DEG', 'diameter of the source, 0 to 5 deg; default: 0.53, the sun, with --flux, else 0'),
            ('bandwidth', 'HZ', 'noise bandwidth of the receiver in a recording; default: value in the recording'),
            ('attenuation', 'DB', 'attenuation by the atmosphere towards the source, 0 to 20 dB; default: 0'),
            ('elevation', 'DEG', 'elevation of the source for offsets in azimuth, 0 to 89 deg')):
        parser.add_argument(f'--{name}', type=float, metavar=metavar, help=text)
    arguments.add_result_files(parser, 'new parameter file with beamwidth and squint', 'new HTML page with the cuts')


def _sensitivity(options: argparse.Namespace) -> int:
    from pedestal_workbench.calibration.sensitivity import sensitivity
    arguments.check_result_files(options)
    for name, other in (('attenuation', 'flux'), ('bandwidth', 'bag'), ('elevation', 'levels')):
        if getattr(options, other) is None:
            arguments.refuse_given(options, (name,), f'has no effect without --{other}')
    return _finish(options, sensitivity.calibrated(options.levels or options.bag, options.bag is not None,
                                                   arguments.typed(sensitivity.SensitivityOptions, options)))


STEPS = {
    'pointing': ('fit the pointing model to measured offsets, or plan the directions to measure',
                 Verb(_add_pointing, _pointing)),
    'receiver': ('measure slopes and cross-talk of the tracking receiver by offsets about a beacon',
                 Verb(_add_receiver, _receiver)),
    'drive': ('identify friction, inertia, lash, bias, encoder and structure of both axes from safe motions',
              Verb(_add_drive, _drive)),
    'sensitivity': ('measure beamwidth, squint and G/T from levels at offsets about the sun or another source',
                    Verb(_add_sensitivity, _sensitivity)),
}


def _add_calibrate(parser: argparse.ArgumentParser) -> None:
    """The step `pointing` fits the pointing model of the control unit to measured offsets. The step `receiver`
    measures slopes and cross-talk of the tracking receiver. The step `drive` identifies friction, inertia, lash and
    structure. The step `sensitivity` measures beamwidth, squint and G/T.
    """
    arguments.add_steps(parser, 'step', STEPS)


VERBS = {'calibrate': Verb(_add_calibrate)}
