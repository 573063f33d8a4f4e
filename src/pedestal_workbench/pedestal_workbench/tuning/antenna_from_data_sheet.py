"""`pedestal new`: make a scenario of your own antenna from the numbers of its data sheet.

Values that a data sheet does not state are scaled from the default antenna of this software. This antenna has the
motors of Ma 2023 and a load of 210 kg m2. The scaling keeps the resonance frequencies of gears and motors:

    motor       flux: from the voltage at rated speed. Resistance and inductance: from their shares of the voltage at
                rated torque. Inertia: proportional to the rated torque to the power 5/3. Friction and brake:
                proportional to the rated torque.
    gear, load  Stiffness, damping and viscous friction: proportional to the inertia of the load. Other friction and
                unbalance: proportional to the inertia of the load to the power 2/3.
    receiver    C/N0 of the scenario for the area of the mirror. The power of the satellite and the noise of the
                receiver stay the same.
    wind        the diameter of the mirror
    structure   the lowest frequency of the data sheet, or the average of antennas of this diameter (data_sheet)
    loops       the design of tuning/loops.py. `pedestal tune --loops` then measures the loops.

If an axis cannot reach the rate of the data sheet, the scenario has RATE_SHARE of the rate that the axis reaches.
"""
import dataclasses
import functools
import math
import shlex
import typing
from collections.abc import Iterable, Iterator, Mapping

from acu_tracker.servo import travel
from drive_law.axis_params import PLANT_PERIOD_S, MotorParameters, mesh_inertia
from drive_law.params import AduParameters
from pedestal_bringup.scenario import files, scenario
from pedestal_bringup.scenario.header import PROGRAM_ERRORS
from pedestal_bringup.scenario.program import Plan
from pedestal_bringup.scenario.sections import parameters_of
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph.topics import AXES
from pedestal_common.parameters import ParameterError, as_dict, build, flatten
from pedestal_common.quantities import DecibelHertz, Json, Radians
from pedestal_common.text_files import parameter_file
from pedestal_workbench.tuning import data_sheet
from pedestal_workbench.tuning.data_sheet import DataSheet
from tracking_receiver_sim.params import TrackingReceiverParameters

if typing.TYPE_CHECKING:
    from pedestal_workbench.tuning.loops import Plant

BACK_EMF_SHARE, RESISTANCE_VOLTAGE_SHARE, INDUCTANCE_VOLTAGE_SHARE = 0.85, 0.033, 0.24
"""Shares of the phase voltage of a motor [-]: back-EMF at rated speed, voltages over resistance and inductance at
rated torque."""

KNOWN_MIRROR_M = 2.4  # diameter of the mirror for which the C/N0 of the scenarios holds [m] (AntennaParameters)
RATE_SHARE = 0.9  # share of the rate that an axis reaches, which replaces an unreachable rate of the data sheet [-]


def motor(sheet: DataSheet, known: Mapping[str, float]) -> dict[str, float]:
    """Return {key: value} of a motor, scaled from the parameters {key: value} of the default motor."""
    share, pairs, voltage = sheet.motor_torque / 30.0, known['pole_pairs'], known['voltage']
    electrical = pairs * sheet.motor_speed * math.pi / 30.0
    flux = BACK_EMF_SHARE * voltage / electrical
    current = sheet.motor_torque / (1.5 * pairs * flux)
    return {'flux_linkage': flux, 'resistance': RESISTANCE_VOLTAGE_SHARE * voltage / current,
            'inductance': INDUCTANCE_VOLTAGE_SHARE * voltage / (electrical * current),
            'torque_limit': 3.0 * sheet.motor_torque, 'inertia': known['inertia'] * share**(5.0 / 3.0),
            'friction': known['friction'] * share,
            'viscous': known['viscous'] * share, 'brake': known['brake'] * share}


def axis(sheet: DataSheet, name: str) -> dict[str, float]:
    """Return {key: value} of an axis of the drive, without the gains of its loops; name: the axis."""
    known = as_dict(getattr(AduParameters(), name))
    inertia, ratio, rate = (getattr(sheet, f'{what}_{name}') for what in ('inertia', 'ratio', 'rate'))
    share = inertia / known['load.inertia']
    values = {'load.inertia': inertia, 'gear_train.reducer_ratio': ratio / known['gear_train.pinion_ratio'],
              'gear_train.lash': 1e-3 * sheet.lash, 'limits.rate': math.radians(rate),
              'encoder.load_bits': sheet.encoder_bits, 'faults.overspeed': 1.22 * math.radians(rate),
              'thermal.rated_torque': sheet.motor_torque}
    for number in (1, 2):
        own = {key.partition('.')[2]: value for key, value in known.items() if key.startswith(f'motor_{number}.')}
        values |= {f'motor_{number}.{key}': value for key, value in motor(sheet, own).items()}
    constant = 1.5 * known['motor_1.pole_pairs'] * values['motor_1.flux_linkage']
    values['faults.overcurrent'] = 1.3 * values['motor_1.torque_limit'] / constant
    values |= {key: known[key] * share for key in ('gear_train.stiffness', 'gear_train.damping', 'load.viscous')}
    values |= {f'friction.{key}': known[f'friction.{key}'] * share**(2.0 / 3.0)
               for key in ('coulomb', 'breakaway', 'stiffness', 'damping')}
    values['load.unbalance'] = known['load.unbalance'] * share**(2.0 / 3.0)
    if sheet.mode_share:
        values |= {'structure.inertia_share': sheet.mode_share,
                   'structure.frequency': float(f'{sheet.structural_frequency:.3g}')}
    return values | _softer(name, values)


def _softer(name: str, values: Mapping[str, float]) -> dict[str, float]:
    """Return {key: value} of stiffness and damping of the gear meshes, limited for the step of the simulated plant.
    Because the stiffness is scaled with the load, it is too large for small motors under a heavy load."""
    known, h = getattr(AduParameters(), name), PLANT_PERIOD_S
    J, N = values['load.inertia'], values['gear_train.reducer_ratio'] * known.gear_train.pinion_ratio
    M = mesh_inertia(values['motor_1.inertia'], N, (1.0 - values.get('structure.inertia_share', 0.0)) * J)
    return {'gear_train.damping': min(values['gear_train.damping'], M / h),
            'gear_train.stiffness': min(values['gear_train.stiffness'], M / h**2)}


def _plant(sheet: DataSheet, name: str, values: Mapping[str, float]) -> 'Plant':
    from pedestal_workbench.tuning import loops
    known = getattr(AduParameters(), name)
    try:
        return loops.Plant(name, build(type(known), {**as_dict(known), **values}), beamwidth=sheet.theta)
    except ParameterError as error:
        raise ParameterError(f'adu.{name}: {error}') from None


def attainable(sheet: DataSheet) -> tuple[DataSheet, list[str]]:
    """Return (data sheet with rates that its axes reach, line about each changed rate). Two limits apply: the motors
    must reach the rate with their voltage, and stop the axis from it within half of its travel. Raises ValueError."""
    from pedestal_workbench.tuning import loops
    acu, remarks = scenario.load(sheet.like).node_parameters('acu'), []
    for name in AXES:
        asked, ratio = math.radians(getattr(sheet, f'rate_{name}')), getattr(sheet, f'ratio_{name}')
        values = axis(sheet, name)
        turning = min(motor.reachable_rate(ratio) for motor in _motors(name, values))
        plant = _plant(sheet, name, {**values, 'limits.rate': min(asked, RATE_SHARE * turning)})
        limits = getattr(acu, name).limits
        braking = dataclasses.replace(limits, acceleration=loops.rate_slope(plant)).deceleration
        stopping = travel.stopping_rate(0.5 * (limits.high - limits.low), braking, acu.reaction)
        stopping /= loops.SHAPER_RATE_SHARE
        if asked > min(turning, stopping):
            reached = math.degrees(min(turning, stopping))
            taken = float(f'{RATE_SHARE * reached:.3g}')
            why = (f'the motors reach {reached:.3g} deg/s at ratio {ratio:g}' if turning <= stopping else
                   f'the motors can stop the axis within half of its travel from {reached:.3g} deg/s')
            remarks.append(f'--rate-{name} {math.degrees(asked):.4g}: {why}; {taken:g} deg/s is taken')
            changes: dict[str, Json] = {f'rate_{name}': taken}
            sheet = dataclasses.replace(sheet, **changes)
    return sheet, remarks


def _motors(name: str, values: Mapping[str, float]) -> Iterator[MotorParameters]:
    known = getattr(AduParameters(), name)
    for number in (1, 2):
        own = {key.partition('.')[2]: value for key, value in values.items() if key.startswith(f'motor_{number}.')}
        default = getattr(known, f'motor_{number}')
        try:
            yield build(type(default), {**as_dict(default), **own})
        except ParameterError as error:
            raise ParameterError(f'adu.{name}: motor_{number}.{error}') from None


def cn0(sheet: DataSheet) -> DecibelHertz:
    """Return the C/N0 on the beam axis at the reference range: of the data sheet, else by the area of the mirror."""
    known = _receiver(sheet.like).receiver.cn0_dbhz
    return sheet.cn0 or float(f'{known + 20.0 * math.log10(sheet.mirror / KNOWN_MIRROR_M):.4g}')


@functools.cache
def _receiver(name: str) -> TrackingReceiverParameters:
    return scenario.load(name).node_parameters('tracking_receiver')


def _assumed(sheet: DataSheet) -> list[str]:
    lines = []
    if not sheet.cn0:
        receiver = _receiver(sheet.like).receiver
        lines.append(f'no --cn0: {cn0(sheet):.3g} dB-Hz at {1e-3 * receiver.reference_range:g} km, that of '
                     f'{sheet.like} for the area of the mirror, is taken; the receiver locks at '
                     f'{receiver.acquire_level_dbhz:g} dB-Hz')
    if sheet.mode_share and not sheet.mode:
        lines.append(f'no --mode: {sheet.structural_frequency:.3g} Hz, the average of antennas of {sheet.mirror:g} m, '
                     'is taken for the structure')
    return lines


def sections(sheet: DataSheet, title: str,
             station: Mapping[str, float] | None = None) -> dict[str, dict[str, Json]]:
    """Return {node: {key: value}} of the scenario. station: {parameter of the receiver: value}, None for that of the
    scenario of the data sheet. Raises ValueError."""
    from pedestal_workbench.tuning import loops
    _, content = files.text(sheet.like)
    found = files.by_node(parameter_file.parse(content))
    found['scenario']['title'] = title
    # A narrower beam needs a smaller error, equal in beamwidths.
    for key in PROGRAM_ERRORS.keys() & set(found['scenario']):
        found['scenario'][key] *= min(1.0, sheet.theta / 0.0175)
    found['tracking_receiver'] |= {'antenna.beamwidth': sheet.theta, 'receiver.cn0_dbhz': cn0(sheet)}
    found['adu']['wind.field.diameter'] = sheet.mirror
    w_s = 2.0 * math.pi * loops.DEFAULT_SPEED_CROSSOVER_HZ
    for name in AXES:
        values = axis(sheet, name)
        plant = _plant(sheet, name, values)
        values |= loops.drive_gains(plant, w_s)
        found['adu'] |= {f'{name}.{key}': value for key, value in values.items()}
        gains = loops.control_gains(plant, w_s, loops.position_crossover(plant, w_s))
        found['acu'] |= {f'{name}.{key}': value for key, value in gains.items()}
    rounded = {node: {key: float(f'{value:.4g}') if isinstance(value, float) else value for key, value in own.items()}
               for node, own in found.items()}
    place = station or as_dict(_receiver(sheet.like).target.station, 'target.station.')
    rounded['tracking_receiver'] = {**place, **rounded['tracking_receiver'], **place}
    if not rounded['scenario'].get('ship'):
        rounded['adu'] |= _at_the_target(sheet, rounded)
    return rounded


def _at_the_target(sheet: DataSheet, found: Mapping[str, Mapping[str, Json]]) -> dict[str, Radians]:
    """Return {key of adu: initial angle}, three beamwidths from the predicted target, so that a slow antenna reaches
    it soon. The angles of a wide beam end at the travel of the axis. found: {node: {key: value}} of the scenario."""
    chosen = scenario.parse(sheet.like, parameter_file.text(found))
    _, angles = Plan(chosen).tables['']
    travels = [getattr(chosen.node_parameters('adu'), name).limits for name in AXES]
    return {f'initial_{name}': min(max(float(f'{angle + 3.0 * sheet.theta:.4g}'), travel.lower), travel.upper)
            for name, angle, travel in zip(AXES, angles[0], travels)}


def text(found: Mapping[str, Mapping[str, Json]], head: Iterable[str]) -> str:
    """Return the text of a scenario file from {node: {key: value}}, with unit and meaning of each value in a comment.
    head: lines of comment at its beginning."""
    lines = []
    for node, values in found.items():
        fields = dict(flatten(parameters_of(node)))
        lines += [node + ':' if node == 'scenario' else f'{parameter_file.ANY_NAMESPACE}{node}:', '  ros__parameters:']
        for key, value in values.items():
            meta = fields[key].metadata
            unit = f'[{meta["unit"]}] ' if meta.get('unit') else ''
            written = files.override(key, value).replace('=', ': ', 1)
            lines.append(f'    {written:44}  # {unit}{meta["doc"]}')
    return parameter_file.comment(head) + '\n'.join(lines) + '\n'


def new(sheet: DataSheet, name: str, command: str,
        station: Mapping[str, float] | None = None) -> tuple[str, list[str]]:
    """Return (text of the scenario file, line about each changed or assumed value). command: the command line, for the
    head of the file; station: as in `sections`. Raises ValueError for values that contradict each other, which names
    the options of `pedestal new` to change."""
    try:
        return _new(sheet, name, command, station)
    except ValueError as error:
        raise data_sheet.refusal(sheet, error, lambda other: _new(other, name, command, station)) from None


def _new(sheet: DataSheet, name: str, command: str, station: Mapping[str, float] | None) -> tuple[str, list[str]]:
    sheet, remarks = attainable(sheet)
    remarks += _assumed(sheet)
    if station is None:
        remarks.append(f'no --station: the antenna stands at {_receiver(sheet.like).target.station.text}')
    title = f'{sheet.mirror:g} m antenna, beam {math.degrees(sheet.theta):.3g} deg, on the mission of {sheet.like}'
    found = sections(sheet, title, station)
    tune = shlex.join(('pedestal', 'tune', f'{name}.yaml', '--loops'))
    run = Variant(f'{name}.yaml', files=(f'{name}-loops.yaml',)).command()
    remarks += scenario.parse(name, parameter_file.text(found)).notes
    content = text(found, [*parameter_file.origin(command), 'Values that are not in the data sheet are scaled from '
                           'the antenna of the product: replace them by known values.',
                           f'Next: {tune}, then {run}', *remarks])
    return content, remarks
