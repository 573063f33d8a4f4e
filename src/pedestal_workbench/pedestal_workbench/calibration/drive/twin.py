"""Twin of a drive: the simulated drive with estimated parameters, driven by the recorded commands.

Between two reports the torque follows the staircase of the rate commands, so an inertia from the reported torque is
too small by some tens of percent. The twin has the same loops and the same staircase. Each estimate is therefore
corrected by its ratio, or its difference, to the same estimate from the twin, until both agree (indirect inference:
Gourieroux, Monfort and Renault, J. Applied Econometrics 8 (1993) S85).
"""
import dataclasses
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from adu_drive.plant import gimbal
from drive_law.params import AduParameters
from pedestal_common.graph.topics import AXES
from pedestal_common.parameters import as_dict, build
from pedestal_common.quantities import Estimate, Floats, Json, KilogramMeters2, Pair, Pairs, Radians, Vectors3
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_workbench.calibration.calibration import CalibrationError
from pedestal_workbench.calibration.drive import estimates, mode, motion_data
from pedestal_workbench.calibration.drive.estimates import Estimates
from pedestal_workbench.calibration.drive.motion_data import Motion
from pedestal_workbench.tuning import identification

PARAMETER_NAMES = {
    'inertia': 'load.inertia', 'viscous': 'load.viscous', 'unbalance': 'load.unbalance',
    'coulomb': 'friction.coulomb', 'breakaway': 'friction.breakaway', 'stribeck_rate': 'friction.stribeck_rate',
    'lash': 'gear_train.lash', 'stiffness': 'gear_train.stiffness', 'bias': 'bias.torque',
    'frequency': 'structure.frequency', 'damping': 'structure.damping',
    'eccentricity_sin': 'encoder.error.eccentricity_sin', 'eccentricity_cos': 'encoder.error.eccentricity_cos'}
"""{estimate: parameter of an axis of adu}."""
SCALED_NAMES = ('viscous', 'coulomb', 'breakaway', 'stribeck_rate', 'lash', 'stiffness', 'frequency', 'damping')
ADDED_NAMES = ('inertia', 'dish_inertia', 'unbalance')
"""Estimates that the twin corrects by a ratio, and by a difference."""
NO_CONTACT = '; the teeth rattle without bias torque: add the recording with it, without bias.schedule=off'
MESH_NAMES = 'lash', 'stiffness'  # estimates of a mesh
ROUND_COUNT, MAX_RATIO = 4, 1.6  # number of corrections, and largest ratio of a correction [-]
PASS_COUNT = 2  # number of passes of the estimates of friction and inertia
MAX_SHARE = 0.85  # largest share of the dish in the inertia of the load [-]
RIGID = {f'{name}.structure.inertia_share': 0.0 for name in AXES}
"""Parameters of adu of a drive without a flexible structure."""
Errors: TypeAlias = dict[str, float]  # {axis: error of the torques of a twin [-]}


@dataclasses.dataclass(frozen=True)
class DriveRecording:
    """What a calibration of the drive takes from a recording."""
    drive: AduParameters
    motions: dict[str, Motion]  # {axis: its motion}
    rate: Pairs                 # rate commands of azimuth and elevation [rad/s]
    torque: Pairs               # torque feed-forward [Nm]
    start: Pair                 # encoder angles at the first step [rad]


def read(bag: Recording, drive: AduParameters) -> DriveRecording:
    """Return the data of a recording of one beam. Raises CalibrationError."""
    if 'ship/imu/data' in bag.topics:
        raise CalibrationError('the recording is of a ship, whose motion moves the axes too')
    states = bag.table('adu/state')['data'] if 'adu/state' in bag.topics else ()
    wrong = [text for text in states if text != 'enabled']
    if wrong:
        raise CalibrationError(f'the drive was not enabled all the time; it reported {wrong[0]!r}')
    motions = {name: motion_data.read(bag, name, getattr(drive, name)) for name in AXES}
    joints = bag.table('joint_states')
    columns = [f'{name}.{kind}' for kind in ('velocity', 'effort') for name in AXES]
    # Before the first command of the control unit the drive holds its angles.
    commands = np.nan_to_num(recordings.at(bag, joints['t'], 'acu/rate_command', columns))
    start = np.array([joints[f'{name}.position'][0] for name in AXES])
    return DriveRecording(drive, motions, commands[:, :2].copy(), commands[:, 2:].copy(), start)


def replayed(recording: DriveRecording, changes: Mapping[str, float]) -> dict[str, Motion]:
    """Return {axis: motion} of the twin of a recording; changes: {parameter: value} of adu."""
    drive = changed(recording.drive, changes)
    zero = np.array([getattr(drive, name).encoder.error.zero for name in AXES])
    at = dict(zip(('initial_azimuth', 'initial_elevation'), (recording.start - zero).tolist()))
    position, motors = identification.respond(dataclasses.replace(drive, **at), recording.rate, recording.torque)
    t = recording.motions['azimuth'].t
    return {name: motion_data.smoothed(t, position[:, i], motors[:, i], getattr(drive, name).gear_train.ratio)
            for i, name in enumerate(AXES)}


def changed(drive: AduParameters, changes: Mapping[str, Json]) -> AduParameters:
    """Return the parameters of a drive with changes {parameter: value}."""
    return build(type(drive), {**as_dict(drive), **changes})


def load_inertia_change(drive: AduParameters, elevation: Radians) -> KilogramMeters2:
    """Return the inertia about azimuth at an elevation less the parameter azimuth.load.inertia."""
    if drive.elevating.about_beam <= 0.0:
        return 0.0
    bodies = gimbal.constants(drive)[0]
    s, k = np.sin(elevation), np.cos(elevation)
    about = np.array((-s, 0.0, -k))
    return float(about @ bodies['I'] @ about + bodies['J_yoke'] - drive.azimuth.load.inertia)


def constant_rates(motion: Motion, load: Floats, found: Estimates) -> Vectors3:
    """Return estimates.plateaus without the torques that accelerate base and dish; load: torque on the load [Nm]."""
    return estimates.plateaus(motion, load - mode.inertia_torque(motion, found))


def estimate(recordings: Sequence[DriveRecording], motions: Sequence[Motion], name: str,
             flexible: bool = True) -> Estimates:
    """Return the estimates of an axis from the recorded or replayed motion of each recording. Raises ValueError."""
    axes = [getattr(recording.drive, name) for recording in recordings]
    gravity = name == 'elevation'
    loads = [motion.load_torque(axis) for motion, axis in zip(motions, axes)]
    # Teeth that rattle without bias torque hide the mode.
    in_contact = [(motion, load) for motion, load, axis in zip(motions, loads, axes) if axis.bias.schedule != 'off']
    found: Estimates = {}
    for _ in range(PASS_COUNT):
        # At a constant rate a dish may swing for seconds, so the friction needs the inertias and the inertias need it.
        pieces = np.concatenate([constant_rates(motion, load, found) for motion, load in zip(motions, loads)])
        try:
            found = dict(estimates.friction(pieces, gravity))
        except ValueError as error:
            raise ValueError(f'{name}: {error}' + ('' if in_contact else NO_CONTACT)) from None
        found |= mode.identify(in_contact or list(zip(motions, loads)), found, gravity, flexible)
    found |= estimates.lash([(motion, motion.mesh_torque(axis)) for motion, axis in zip(motions, axes)],
                            axes[0].gear_train.ratio)
    return found


def estimated(recordings: Sequence[DriveRecording]) -> tuple[dict[str, Estimates], dict[str, Estimates]]:
    """Return {axis: first estimates} and {axis: corrected estimates}. Raises ValueError."""
    true = {name: [recording.motions[name] for recording in recordings] for name in AXES}
    first = {name: estimate(recordings, true[name], name) for name in AXES}
    extra = extra_inertia(recordings)
    flexible = {name for name in AXES if 'frequency' in first[name]}
    if flexible:
        # The staircase of the torque may look like a mode. The twin has the same staircase without a structure.
        motions = [replayed(recording, RIGID) for recording in recordings]
        for name in sorted(flexible):
            again = estimate(recordings, [of_axes[name] for of_axes in motions], name)
            if 'frequency' in again:
                flexible.remove(name)
                first[name] = estimate(recordings, true[name], name, flexible=False)
    values = {name: {key: value for key, (value, *_) in found.items()} for name, found in first.items()}
    for name, found in values.items():
        # The estimate of the inertia is too small by the same amount in the twin, whatever its inertia is. Teeth that
        # rattle show too little lash and stiffness. A twin with these would rattle in another way.
        axis = getattr(recordings[0].drive, name)
        found['inertia'] = axis.load.inertia + extra[name]
        found |= {key: getattr(axis.gear_train, key) for key in MESH_NAMES if key in found}
    for _ in range(ROUND_COUNT):
        changes = parameters(recordings, values)
        motions = [replayed(recording, changes) for recording in recordings]
        for name in AXES:
            again = estimate(recordings, [of_axes[name] for of_axes in motions], name, name in flexible)
            for key in set(again) & set(first[name]):
                if key in ADDED_NAMES:
                    values[name][key] += first[name][key][0] - again[key][0]
                elif key == 'offset':       # the twin has none, so its estimate is the error of the method
                    values[name][key] = first[name][key][0] - again[key][0]
                elif key in SCALED_NAMES and again[key][0] != 0.0:
                    ratio = first[name][key][0] / again[key][0]
                    values[name][key] *= min(max(ratio, 1.0 / MAX_RATIO), MAX_RATIO)
    corrected = {name: {key: _moved(values[name][key], *found, key in MESH_NAMES)
                        for key, found in first[name].items()} for name in AXES}
    return first, corrected


def extra_inertia(recordings: Sequence[DriveRecording]) -> dict[str, KilogramMeters2]:
    """Return {axis: inertia} that the elevating part adds to load.inertia at the elevation of the motions."""
    elevation = float(np.median(recordings[0].motions['elevation'].theta))
    return {'azimuth': load_inertia_change(recordings[0].drive, elevation), 'elevation': 0.0}


def _moved(value: float, first: float, low: float, high: float, rattling: bool) -> Estimate:
    """Return the estimate `value` with the width of the interval of a first estimate, scaled if the value is larger.
    Teeth that rattle make the correction of a mesh uncertain, so its interval also covers the first estimate."""
    scale, more = max(1.0, abs(value / first)) if first else 1.0, abs(value - first) if rattling else 0.0
    return value, value + scale * (low - first) - more, value + scale * (high - first) + more


def parameters(recordings: Sequence[DriveRecording], values: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Return the parameters {name: value} of adu for the estimates {axis: {name: value}} from recordings."""
    drive, extra = recordings[0].drive, extra_inertia(recordings)
    found: dict[str, float] = {}
    for name, known in values.items():
        nominal = getattr(drive, name)
        known = {**known, 'inertia': known['inertia'] - extra[name]} if 'inertia' in known else known
        own = {PARAMETER_NAMES[key]: float(value) for key, value in known.items() if key in PARAMETER_NAMES}
        own['structure.inertia_share'] = (min(max(known['dish_inertia'] / known['inertia'], 0.0), MAX_SHARE)
                                          if 'dish_inertia' in known else 0.0)
        coulomb = own.get('friction.coulomb', nominal.friction.coulomb)
        own['friction.breakaway'] = max(own.get('friction.breakaway', coulomb), coulomb)
        own['load.viscous'] = max(own.get('load.viscous', nominal.load.viscous), 0.0)
        found |= {f'{name}.{key}': value for key, value in own.items()}
    return found


def torque_errors(recordings: Sequence[DriveRecording], changes: Mapping[str, float]) -> Errors:
    """Return the rms difference of the torques of recording and twin, over the rms torque of the moving steps."""
    squares: dict[str, list[list[float]]] = {name: [] for name in AXES}
    for recording in recordings:
        twins = replayed(recording, changes)
        for name, true in recording.motions.items():
            moving = np.abs(true.v) > motion_data.MOVING_RATE_RAD_S
            torques = (twins[name].motor_torque - true.motor_torque).sum(1), true.motor_torque.sum(1)
            squares[name].append([np.sum(torque[moving]**2) for torque in torques])
    return {name: float(np.sqrt(np.divide(*np.sum(rows, axis=0)))) for name, rows in squares.items()}
