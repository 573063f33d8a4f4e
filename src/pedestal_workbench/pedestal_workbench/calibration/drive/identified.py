"""`pedestal calibrate drive`: properties of both axes from safe motions, for the control unit and the simulated plant.

The twin with these values must reproduce the torques of the recording.
"""
import dataclasses
import math
import pathlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from drive_law.params import AduParameters
from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import files
from pedestal_bringup.scenario import scenario as scenarios
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph.topics import AXES
from pedestal_common.parameters import as_dict, build, defaults
from pedestal_common.quantities import Json, Pairs, Row
from pedestal_common.text_files import parameter_file
from pedestal_common.text_files.text_table import Cell, TextTable
from pedestal_recording import bag as bags
from pedestal_recording import recording as recordings
from pedestal_results import intervals
from pedestal_results.intervals import estimated, row
from pedestal_results.report import figures
from pedestal_results.report.figures import FILTERED_COLOUR, RAW_COLOUR, TRUTH_COLOUR, Spec, new_panels, thin
from pedestal_workbench.calibration.calibration import Calibration, named
from pedestal_workbench.calibration.drive import estimates, motions, twin
from pedestal_workbench.calibration.drive.estimates import Estimates
from pedestal_workbench.calibration.drive.twin import Errors

TORQUE_TARGET = '< 10'  # target of the torque error of the twin [%]
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
class Identified(Calibration):
    """Calibration of a drive. The dictionaries have the names of the axes as keys, except `changes`."""
    STEP = 'drive'

    recordings: Sequence[twin.DriveRecording]
    first: dict[str, Estimates]         # before the correction by the twin
    found: dict[str, Estimates]         # in the order of QUANTITIES
    maps: dict[str, Pairs]              # error of the load encoder [rad] over the angle [rad], empty without a turn
    changes: dict[str, float]           # {parameter of adu: identified value, or nominal value of a name in `kept`}
    kept: dict[str, set[str]]           # parameters that keep their nominal values
    before: Errors                      # of the nominal twin
    identified: Errors                  # of the twin with all identified values
    after: Errors                       # of the twin with `changes`

    @property
    def verified(self) -> bool:
        """True if the twin reproduces the recorded torques."""
        return not any(map(intervals.missed, self.rows()))

    def rows(self) -> list[Row]:
        """Return the estimates and the torque errors of the twin."""
        listed = []
        for name, found in self.found.items():
            listed += [estimated(self.STEP, f'{name}_{key}', estimate, QUANTITIES[key][0], estimates.PART_COUNT)
                       for key, estimate in found.items()]
            listed += [row(self.STEP, f'{name}_torque_error_before_percent', 100.0 * self.before[name], '%'),
                       row(self.STEP, f'{name}_torque_error_identified_percent', 100.0 * self.identified[name], '%'),
                       row(self.STEP, f'{name}_torque_error_percent', 100.0 * self.after[name], '%',
                           target=TORQUE_TARGET)]
        return listed

    def details(self) -> dict[str, Json]:
        """Return remarks, maps of the encoders and parameters of the --json file."""
        return {'verified': self.verified, 'remarks': {name: self.remarks(name) for name in self.found},
                'encoder_map_deg': {name: np.degrees(table).tolist() for name, table in self.maps.items()},
                'kept': {name: sorted(kept) for name, kept in self.kept.items()}, 'parameters': self.parameters()}

    def lines(self) -> list[str]:
        """Return the table of each axis, with the torque errors and remarks."""
        drive = as_dict(self.recordings[0].drive)
        listed = [f'drive of {self.source}, {len(self.recordings)} recordings', '']
        for name, found in self.found.items():
            cells: list[Sequence[Cell]] = []
            for key, (value, low, high) in found.items():
                parameter = twin.PARAMETER_NAMES.get(key)
                nominal = f'{drive[f"{name}.{parameter}"]:.5g}' if parameter else ''
                interval = f'{low:.5g} to {high:.5g}' if math.isfinite(low) else ''
                cells.append((f'  {key}', nominal, value, interval, *QUANTITIES[key]))
            listed += TextTable(((name, '<17'), ('nominal', '>11'), ('identified', '>11.5g'),
                                 ('95 % interval', '<26'), ('unit', '<8'), 'meaning'), cells).lines()
            chosen = f', {100.0 * self.after[name]:.1f} % with the chosen values' if self.kept[name] else ''
            listed += [f'  torque of the twin is off by {100.0 * self.before[name]:.1f} % rms with nominal values, '
                       f'{100.0 * self.identified[name]:.1f} % with identified values{chosen} '
                       f'(must be {TORQUE_TARGET} %)',
                       *(f'  {sentence}' for sentence in self.remarks(name)), '']
        listed.append('verified: the twin reproduces the recorded torques' if self.verified else
                      'NOT VERIFIED: the twin does not reproduce the recorded torques; the drive has a property that '
                      'its model lacks, or wrong data of the motors, the gear ratio or the control loops')
        return listed

    def remarks(self, name: str) -> list[str]:
        """Return sentences on the kept values of an axis, and on its properties that the motions do not show."""
        found, missing = self.found[name], []
        if self.kept[name]:
            missing.append('nominal values kept: the twin fits the recording at least as well with them')
        if 'lash' not in found:
            off = any(getattr(recording.drive, name).bias.schedule == 'off' for recording in self.recordings)
            missing.append('lash: not shown, because no motor changes the sign of a firm torque'
                           + ('' if off else f'; add a run with adu.{name}.bias.schedule=off'))
        elif 'stiffness' not in found:
            missing.append('stiffness: not shown, because the torques of the motions twist the gears too little')
        if 'frequency' not in found:
            contact = any(getattr(recording.drive, name).bias.schedule != 'off' for recording in self.recordings)
            missing.append('structure: no mode between 2 and 30 Hz shows in the torque, or a rigid twin shows it too'
                           + ('' if contact else twin.NO_CONTACT))
        if 'stribeck_rate' not in found:
            missing.append('static friction: not shown, because it is too small or no motion is slow enough')
        if 'eccentricity_sin' not in found:
            missing.append('encoder: not shown, because the axis made no turn of 300 deg both ways')
        return missing

    def parameters(self) -> dict[str, dict[str, Json]]:
        """Return the changes of the simulated drive, and inertia, friction and structure for the control unit.

        The inertia is that of load and motors, the friction that of the load. The friction of the motors rises over a
        wider range of rates than the feed-forward knows. With it, the following error of a slow pass doubled, so the
        integral of the speed loop takes it.
        """
        values, extra = {}, twin.extra_inertia(self.recordings)
        for name in self.found:
            axis = getattr(self.recordings[0].drive, name)
            ratio, motors = axis.gear_train.ratio, (axis.motor_1, axis.motor_2)
            if f'{name}.load.inertia' in self.changes:
                values[f'{name}.feedforward.inertia'] = _rounded(
                    self.changes[f'{name}.load.inertia'] + extra[name]
                    + ratio**2 * sum(motor.inertia for motor in motors))
            values[f'{name}.feedforward.friction'] = self.changes[f'{name}.friction.coulomb']
        values |= {key: value for key, value in self.changes.items() if '.structure.' in key}
        return {'acu': values, 'adu': self.changes}

    def friction_plot(self) -> Figure:
        """Draw the torque at constant rates over the rate, and the fitted friction."""
        figure, panels = new_panels(1, 2, height=2.8, x=[f'{name} rate [rad/s]' for name in self.found],
                                    y='torque on the load [Nm]')
        for axes, (name, found) in zip(panels.flat, self.found.items()):
            recording, first = self.recordings[0], self.first[name]
            motion = recording.motions[name]
            pieces = twin.constant_rates(motion, motion.load_torque(getattr(recording.drive, name)), first)
            known = {key: found[key][0] for key in ('coulomb', 'breakaway', 'stribeck_rate', 'viscous')
                     if key in found}
            known = {'breakaway': known['coulomb'], 'stribeck_rate': 1.0, **known}
            gravity = first['unbalance'][0] * np.cos(pieces[:, 2]) if 'unbalance' in first else 0.0
            torque = pieces[:, 1] - (first['offset'][0] + gravity)
            axes.semilogx(np.abs(pieces[:, 0]), np.sign(pieces[:, 0]) * torque, '.', color=RAW_COLOUR)
            low, high = np.quantile(np.abs(pieces[:, 0]), (0.0, 1.0))
            rates = np.geomspace(low, high, 100)
            axes.semilogx(rates, estimates.friction_torque(rates, **known), color=FILTERED_COLOUR)
            axes.margins(0.05)
        return figure

    def torque_plot(self) -> Figure:
        """Draw the torque of the motors in the recording and in the twin, of both axes."""
        figure, panels = new_panels(len(self.found), y=[f'{name}\nmotor torque [Nm]' for name in self.found])
        twins = twin.replayed(self.recordings[0], self.changes)
        for axes, (name, true) in zip(panels.flat, self.recordings[0].motions.items()):
            for motion, colour, label in ((true, TRUTH_COLOUR, 'recording'), (twins[name], FILTERED_COLOUR, 'twin')):
                axes.plot(*thin(motion.t, motion.motor_torque.sum(1)), color=colour, label=label)
        return figures.outside_legend(figure, panels[0, 0])

    def encoder_plot(self) -> Figure:
        """Draw the error of the load encoders over the angle; the axes without a turn stay empty."""
        figure, panels = new_panels(1, 2, height=2.6, x=[f'{name} [deg]' for name in self.maps],
                                    y='load encoder less motors [mdeg]')
        for axes, table in zip(panels.flat, self.maps.values()):
            axes.plot(np.degrees(table[:, 0]), 1e3 * np.degrees(table[:, 1]), '.-', color=FILTERED_COLOUR)
            axes.margins(0.05)
        return figure

    FIGURES: ClassVar = (
        Spec('friction', 'Friction', 'Points: torque on the load at constant rates, in the direction of the motion, '
             'less the torques of inertia, gravity and wind. Line: identified friction. At the slowest rates some '
             'points lie below the line, because the bristles of the friction still bend there.', (), friction_plot),
        Spec('torques', 'Torques', 'Sum of the torques of both motors of an axis. Orange: recording. Blue: twin with '
             'the values of the parameter file, which receives the same commands.', (), torque_plot),
        Spec('encoder', 'Error of the load encoders', 'Load encoder less the mean of the motor encoders, mean of both '
             'directions. The first second of a turn is left out. Empty without a turn.', (), encoder_plot))


def calibrate(recordings: Sequence[twin.DriveRecording], source: str) -> Identified:
    """Return the calibration by recordings; source: their names. Raises ValueError."""
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


def plan_parameters(chosen: Scenario) -> tuple[motions.MotionPlan, dict[str, dict[str, Json]]]:
    """Return (plan, {node: {parameter: value}}) that let a scenario make the motions."""
    plan = motions.plan(chosen.node_parameters('acu'))
    start = dict(zip(AXES, plan.start))
    return plan, {'scenario': {'duration': plan.duration, 'program.source': 'none'},
                  'acu': {'initial_mode': 'preset', 'commands': plan.commands,
                          **{f'{name}.preset': angle for name, angle in start.items()}},
                  'adu': {f'initial_{name}': angle for name, angle in start.items()}}


def write_plan(chosen: Scenario, given: str, path: pathlib.Path) -> list[str]:
    """Write the motions for the antenna of a scenario to a new parameter file. Return lines for the user. given: name
    or path of the scenario, as the user gave it."""
    run = Variant(given, files=(path,)).command()
    plan, sections = plan_parameters(chosen)
    stated = [f'motions of {motions.time_text(plan.duration)} for the antenna of {chosen.name}, within', *plan.limits]
    parameter_file.write_new(path, sections, stated)
    return [*stated, f'written: {path}', 'Record the motions twice:',
            f'    {run} --bag drive_1',
            f'    {run} --param adu.azimuth.bias.schedule=off --param adu.elevation.bias.schedule=off --bag drive_2']


def _in_memory(name: str, overrides: Sequence[str]) -> list[twin.DriveRecording]:
    """Return two runs of a scenario in memory, the second without bias torque. overrides: changed parameters
    'node.key=value', the true values of the simulated drive. The nominal values are those of the scenario itself."""
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


def _of_bags(paths: Iterable[pathlib.Path]) -> list[twin.DriveRecording]:
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
        with named(f'--bag {path}'):
            found.append(twin.read(bag, drive))
    return found


def calibrated(paths: Sequence[pathlib.Path], scenario_name: str, changes: Sequence[str]) -> Identified:
    """Return the calibration by recordings, or without them by a scenario. Raises ValueError. changes: texts
    'node.key=value' of --params-file and --param."""
    source = ', '.join(str(path) for path in paths) or scenario_name
    with named(source):
        return calibrate(_of_bags(paths) if paths else _in_memory(scenario_name, changes), source)
