"""`pedestal calibrate drive`: properties of both axes from safe motions, for the control unit and the simulated plant.

The result is a table with nominal and identified values, rows for --json, a page, and a ROS 2 parameter file with
acu.AXIS.feedforward.* and adu.AXIS.*. The twin with these values must reproduce the torques of the recording.
"""
import dataclasses
import math
import pathlib
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from adu_drive.params import AduParameters
from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import files
from pedestal_bringup.scenario import scenario as scenarios
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph.topics import AXES
from pedestal_common.parameters import as_dict, build, defaults
from pedestal_common.quantities import Json, Pairs, Row
from pedestal_common.text_files import parameter_file
from pedestal_recording import bag as bags
from pedestal_recording import recording as recordings
from pedestal_results import intervals
from pedestal_results.intervals import estimated, row
from pedestal_workbench.calibration import output_files
from pedestal_workbench.calibration.drive import estimates, identified_page, motion_data, motions, twin
from pedestal_workbench.calibration.drive.estimates import Estimates
from pedestal_workbench.calibration.drive.twin import Errors

CASE_NAME, TORQUE_TARGET = 'drive', '< 10'  # case of the rows, and target of the torque error of the twin [%]
VALUE_DIGITS, ERROR_DIGITS = 6, 3
"""Significant digits in a parameter file, and decimal digits of torque errors that are compared."""
DIRECT_NAMES = 'bias', 'eccentricity_sin', 'eccentricity_cos'  # estimates that the sum of the torques does not show
QUANTITIES = {
    'inertia': ('kg m2', 'inertia of the load'), 'dish_inertia': ('kg m2', 'part of it that swings on the structure'),
    'frequency': ('Hz', 'first mode of the structure on a locked base'), 'damping': ('', 'damping ratio of this mode'),
    'coulomb': ('Nm', 'sliding friction'), 'breakaway': ('Nm', 'static friction'),
    'stribeck_rate': ('rad/s', 'rate at which the static part has fallen to 1 / e'),
    'viscous': ('Nms/rad', 'viscous friction'), 'unbalance': ('Nm', 'torque of gravity at angle 0'),
    'offset': ('Nm', 'torque that does not depend on the motion, such as wind'),
    'lash': ('rad', 'total lash of one mesh on the load axis'), 'stiffness': ('Nm/rad', 'stiffness of one mesh'),
    'bias': ('Nm', 'bias torque per motor'), 'eccentricity_sin': ('rad', 'load encoder, sine of the angle'),
    'eccentricity_cos': ('rad', 'load encoder, cosine of the angle')}
"""{estimate: (unit, meaning)}, in the order of the table."""


@dataclasses.dataclass(frozen=True)
class Identified:
    """Result of a calibration of the drive. The dictionaries have the names of the axes as keys, except `changes`."""
    source: str                         # names of the recordings
    recordings: Sequence[twin.DriveRecording]
    first: dict[str, Estimates]         # before the correction by the twin
    found: dict[str, Estimates]         # in the order of QUANTITIES
    maps: dict[str, Pairs]              # error of the load encoder [rad] over the angle [rad], empty without a turn
    changes: dict[str, float]           # {parameter of adu: identified value, or nominal value of a name in `kept`}
    kept: dict[str, set[str]]           # parameters that keep their nominal values
    before: Errors                      # of the nominal twin
    identified: Errors                  # of the twin with all identified values
    after: Errors                       # of the twin with `changes`


def calibrate(recordings: Sequence[twin.DriveRecording], source: str) -> Identified:
    """Return the result of a calibration; source: names of the recordings. Raises ValueError."""
    found, maps = {}, {}
    first, corrected = twin.estimated(recordings)
    for name in AXES:
        axis = getattr(recordings[0].drive, name)
        own = dict(corrected[name])
        of_bias = max((estimates.bias(recording.motions[name], axis.bias.hold) for recording in recordings),
                      key=lambda found: found['torque'][0] if found else -math.inf)
        if of_bias:
            own['bias'] = of_bias['torque']
        maps[name] = np.zeros((0, 2))
        for recording in recordings:
            of_encoder, table = estimates.encoder(recording.motions[name], axis.gear_train.pinion_ratio)
            if of_encoder:
                own, maps[name] = {**own, **of_encoder}, table
                break
        found[name] = {key: own[key] for key in QUANTITIES if key in own}
    values = {name: {key: value for key, (value, *_) in own.items()} for name, own in found.items()}
    identified = {name: _rounded(value) for name, value in twin.parameters(recordings, values).items()}
    changes, kept, before, error = _chosen(recordings, found, identified)
    return Identified(source, recordings, first, found, maps, changes, kept, before, error,
                      twin.torque_errors(recordings, changes))


def _chosen(recordings: Sequence[twin.DriveRecording], found: Mapping[str, Estimates],
            identified: Mapping[str, float]) -> tuple[dict[str, float], dict[str, set[str]], Errors, Errors]:
    """Return (changes, kept, before, identified) of an Identified; identified: {parameter: value} of adu.

    An axis keeps its nominal values if the twin fits the recording at least as well with them. The torque does not
    show bias and encoder, so such an axis keeps them only if their intervals hold the nominal values.
    """
    nominal, names = as_dict(recordings[0].drive), {}
    for axis, own in found.items():
        direct = {f'{axis}.{twin.PARAMETER_NAMES[key]}': own[key] for key in DIRECT_NAMES if key in own}
        shown = {name for name, (_, low, high) in direct.items() if not low <= nominal[name] <= high}
        names[axis] = {name for name in identified if name.startswith(f'{axis}.')} - shown

    def values(kept: Collection[str]) -> dict[str, float]:
        return {name: nominal[name] if name in kept else value for name, value in identified.items()}

    before, after = (twin.torque_errors(recordings, values(kept)) for kept in (set().union(*names.values()), ()))
    kept = {axis: own if round(before[axis], ERROR_DIGITS) <= round(after[axis], ERROR_DIGITS) else set()
            for axis, own in names.items()}
    return values(set().union(*kept.values())), kept, before, after


def _rounded(value: float) -> float:
    return float(f'{value:.{VALUE_DIGITS}g}')


def rows(result: Identified) -> list[Row]:
    """Return the rows for --json."""
    listed = []
    for name, found in result.found.items():
        listed += [estimated(CASE_NAME, f'{name}_{key}', estimate, QUANTITIES[key][0], estimates.PART_COUNT)
                   for key, estimate in found.items()]
        listed += [row(CASE_NAME, f'{name}_torque_error_before_percent', 100.0 * result.before[name], '%'),
                   row(CASE_NAME, f'{name}_torque_error_identified_percent', 100.0 * result.identified[name], '%'),
                   row(CASE_NAME, f'{name}_torque_error_percent', 100.0 * result.after[name], '%',
                       target=TORQUE_TARGET)]
    return listed


def passed(result: Identified) -> bool:
    """Return True if the twin reproduces the recorded torques."""
    return not any(intervals.missed(item) for item in rows(result))


def lines(result: Identified) -> list[str]:
    """Return the lines of the table, with the torque errors and remarks."""
    drive, listed = as_dict(result.recordings[0].drive), []
    for name, found in result.found.items():
        listed += [f'{name:17} {"nominal":>11} {"identified":>11}  {"95 % interval":26} {"unit":8} meaning']
        for key, (value, low, high) in found.items():
            parameter = twin.PARAMETER_NAMES.get(key)
            nominal = f'{drive[f"{name}.{parameter}"]:.5g}' if parameter else ''
            interval = f'{low:.5g} to {high:.5g}' if math.isfinite(low) else ''
            listed.append(f'  {key:16}{nominal:>11} {value:11.5g}  {interval:26} {QUANTITIES[key][0]:8} '
                          f'{QUANTITIES[key][1]}')
        chosen = f', {100.0 * result.after[name]:.1f} % with the chosen values' if result.kept[name] else ''
        listed += [f'  torque of the twin is off by {100.0 * result.before[name]:.1f} % rms with nominal values, '
                   f'{100.0 * result.identified[name]:.1f} % with identified values{chosen} '
                   f'(must be {TORQUE_TARGET} %)',
                   *(f'  {sentence}' for sentence in remarks(result, name)), '']
    listed.append('verified: the twin reproduces the recorded torques' if passed(result) else
                  'NOT VERIFIED: the twin does not reproduce the recorded torques; the drive has a property that its '
                  'model lacks, or wrong data of the motors, the gear ratio or the control loops')
    return listed


def remarks(result: Identified, name: str) -> list[str]:
    """Return sentences on the kept values of an axis, and on its properties that the motions do not show."""
    found, kept = result.found[name], result.kept[name]
    missing = []
    if kept:
        missing.append('nominal values kept: the twin fits the recording at least as well with them')
    if 'lash' not in found:
        off = any(getattr(recording.drive, name).bias.schedule == 'off' for recording in result.recordings)
        missing.append('lash: not shown, because no motor changes the sign of a firm torque'
                       + ('' if off else f'; add a run with adu.{name}.bias.schedule=off'))
    if 'frequency' not in found:
        missing.append('structure: no mode between 2 and 30 Hz shows in the torque, or a rigid twin shows it too')
    if 'stribeck_rate' not in found:
        missing.append('static friction: not shown, because it is too small or no motion is slow enough')
    if 'eccentricity_sin' not in found:
        missing.append('encoder: not shown, because the axis made no turn of 300 deg both ways')
    return missing


def acu_parameters(result: Identified) -> dict[str, float]:
    """Return the parameters {name: value} of acu: inertia of load and motors, friction of the load.

    The friction of the motors rises over a wider range of rates than the feed-forward knows. With it, the following
    error of a slow pass doubled, so the integral of the speed loop takes it.
    """
    values, extra = {}, twin.extra_inertia(result.recordings)
    for name in result.found:
        axis = getattr(result.recordings[0].drive, name)
        ratio, motors = axis.gear_train.ratio, (axis.motor_1, axis.motor_2)
        if f'{name}.load.inertia' in result.changes:
            values[f'{name}.feedforward.inertia'] = _rounded(result.changes[f'{name}.load.inertia'] + extra[name]
                                                             + ratio**2 * sum(motor.inertia for motor in motors))
        values[f'{name}.feedforward.friction'] = result.changes[f'{name}.friction.coulomb']
    return values


def content(result: Identified) -> dict[str, Json]:
    """Return the content of the --json file."""
    return {'name': 'calibrate drive', 'rows': rows(result), 'source': result.source, 'verified': passed(result),
            'remarks': {name: remarks(result, name) for name in result.found},
            'encoder_map_deg': {name: np.degrees(table).tolist() for name, table in result.maps.items()},
            'kept': {name: sorted(kept) for name, kept in result.kept.items()},
            'parameters': {'acu': acu_parameters(result), 'adu': result.changes}}


def plan_parameters(chosen: Scenario) -> tuple[motions.Plan, dict[str, dict[str, Json]]]:
    """Return (plan, {node: {parameter: value}}) that let a scenario make the motions."""
    plan = motions.plan(chosen.node_parameters('acu'))
    start = dict(zip(AXES, plan.start))
    return plan, {'scenario': {'duration': plan.duration, 'program.source': 'none'},
                  'acu': {'initial_mode': 'preset', 'commands': plan.commands,
                          **{f'{name}.preset': angle for name, angle in start.items()}},
                  'adu': {f'initial_{name}': angle for name, angle in start.items()}}


def write_plan(chosen: Scenario, given: str, path: pathlib.Path) -> list[str]:
    """Write the motions for the antenna of a scenario to a new parameter file. Return lines for the user.

    given: name or path of the scenario, as the user gave it.
    """
    run = Variant(given, files=(path,)).command()
    plan, sections = plan_parameters(chosen)
    stated = [f'motions of {motions.time_text(plan.duration)} for the antenna of {chosen.name}, within', *plan.limits]
    parameter_file.write_new(path, sections, stated)
    return [*stated, f'written: {path}', 'Record the motions twice:',
            f'    {run} --bag drive_1',
            f'    {run} --param adu.azimuth.bias.schedule=off --param adu.elevation.bias.schedule=off --bag drive_2']


def in_memory(name: str, overrides: Sequence[str]) -> list[twin.DriveRecording]:
    """Return two runs of a scenario in memory, the second without bias torque.

    name: of the scenario; overrides: changed parameters 'node.key=value', the true values of the simulated drive.
    The nominal values are those of the scenario itself.
    """
    chosen = scenarios.load(name, overrides)
    nominal = scenarios.load(name).node_parameters('adu')
    _, plan = plan_parameters(chosen)
    motion = [files.override(f'{node}.{key}', value) for node, values in plan.items()
              for key, value in values.items()]
    without_bias = [f'adu.{axis}.bias.schedule=off' for axis in AXES]
    found = []
    for more in ([], without_bias):
        run = scenarios.load(name, [*overrides, *motion, *more], duration=plan['scenario']['duration'])
        drive = twin.changed(nominal, {f'{axis}.bias.schedule': 'off' for axis in AXES} if more else {})
        found.append(twin.read(memory_recording.record(run), drive))
    return found


def of_bags(paths: Iterable[pathlib.Path]) -> list[twin.DriveRecording]:
    """Return what a calibration takes from recordings. Raises ValueError for recordings of different drives."""
    found, first = [], None
    for path in paths:
        bag = bags.read(path, '')
        given = recordings.parameters(bag, 'adu')
        known = {key: given[key] for key in defaults(AduParameters) if key in given}
        if not known:
            raise ValueError(f'--bag {path}: the recording does not state the parameters of the drive, adu')
        drive = build(AduParameters, known)
        axes = {key: value for key, value in as_dict(drive).items() if key.partition('.')[0] in AXES
                and '.bias.' not in key}
        first = first or axes
        changed = [key for key in axes if axes[key] != first[key]]
        if changed:
            raise ValueError(f'--bag {path}: adu.{changed[0]} = {axes[changed[0]]} differs from the first recording, '
                             f'{first[changed[0]]}; only the bias may differ')
        try:
            found.append(twin.read(bag, drive))
        except motion_data.MotionError as error:
            raise ValueError(f'--bag {path}: {error}') from None
    return found


def main(bags: Sequence[pathlib.Path], scenario_name: str, changes: Sequence[str],
         files: output_files.ResultFiles) -> tuple[list[str], dict[str, Json], bool]:
    """Calibrate recordings, or without them a scenario; write the files and return (lines, content, verified).

    changes: texts 'node.key=value' of --params-file and --param. Raises ValueError.
    """
    source = ', '.join(str(path) for path in bags) or scenario_name
    try:
        recordings = of_bags(bags) if bags else in_memory(scenario_name, changes)
        result = calibrate(recordings, source)
    except motion_data.MotionError as error:
        raise ValueError(f'{source}: {error}') from None
    printed = [f'drive of {source}, {len(recordings)} recordings', '', *lines(result)]
    printed += output_files.write(files, printed, {'acu': acu_parameters(result), 'adu': result.changes},
                                  lambda: identified_page.page(result, lines(result), files.command),
                                  verified=passed(result))
    return printed, content(result), passed(result)
