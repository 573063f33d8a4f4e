"""`pedestal new`: make a scenario of your own antenna from the numbers of its data sheet.

Values that a data sheet does not state are scaled from the default antenna of this software. This antenna has a mirror
of 3 m, the motors of Ma 2023 and a load of 210 kg m2. SCALED_FIELDS (data_sheet) and RULES state the laws; the command
prints them with their values. The others:

    motor       flux: from the voltage at rated speed. Resistance and inductance: from their shares of the voltage at
                rated torque.
    receiver    C/N0 of the scenario for the area of the mirror. The power of the satellite and the noise of the
                receiver stay the same.
    wind        the diameter of the mirror (scenario.dish)
    structure   the lowest frequency of the data sheet, or the average of antennas of this diameter (data_sheet)
    loops       the design of tuning/loops.py. `pedestal tune --loops` then measures the loops.

If an axis cannot reach the rate of the data sheet, the scenario has RATE_SHARE of the rate that the axis reaches.
"""
import dataclasses
import functools
import math
import shlex
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping

import numpy as np

from acu_tracker.servo import travel
from drive_law.axis_params import PLANT_PERIOD_S, AxisParameters, MotorParameters, mesh_inertia
from drive_law.params import AduParameters, WindFieldParameters
from pedestal_bringup.scenario import files, scenario
from pedestal_bringup.scenario.header import PROGRAM_ERRORS
from pedestal_bringup.scenario.program import Plan
from pedestal_bringup.scenario.sections import parameters_of
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph.topics import AXES
from pedestal_common.parameters import ParameterError, as_dict, build, flatten, is_absent, option_of
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

DRAG_PEAK, WIND_M_S = 0.12, 15.0  # largest torque coefficient of a dish (adu_drive.plant.wind); printed wind [m/s]
MAX_INERTIA_RATIO = 50.0
"""Ratio of the inertia of the load to that of both motors, at the load, above which a line warns [-]. A dish of 0.6 m
starts at a ratio of 38, and trips as overspeed at 125."""
RATE_SHARE = 0.9  # share of the rate that an axis reaches, which replaces an unreachable rate of the data sheet [-]


class Rule(typing.NamedTuple):
    """Rule by which values of an axis follow from those of the default antenna."""
    label: str
    keys: tuple[str, ...]       # of an axis; the first one is printed
    text: str
    share: Callable[[float, float, float], float]   # from the ratios of load inertia, diameter and motor torque
    for_loops: bool             # True if the loops depend on the values most


def _of_motors(*keys: str) -> tuple[str, ...]:
    return tuple(f'motor_{number}.{key}' for key in keys for number in (1, 2))


RULES = (
    Rule('stiffness of a gear mesh', ('gear_train.stiffness', 'gear_train.damping', 'load.viscous'),
         'inertia: the gears resonate at an equal frequency', lambda inertia, _d, _torque: inertia, True),
    Rule('friction', ('friction.coulomb', 'friction.breakaway', 'friction.stiffness', 'friction.damping'),
         'weight on the bearing times its radius: inertia / diameter', lambda inertia, d, _torque: inertia / d, True),
    Rule('unbalance', ('load.unbalance',), 'weight times arm: inertia / diameter',
         lambda inertia, d, _torque: inertia / d, False),
    Rule('inertia of a motor', _of_motors('inertia'), 'motor torque^(5/3)',
         lambda _inertia, _d, torque: torque**(5.0 / 3.0), True),
    Rule('friction of a motor', _of_motors('friction', 'viscous', 'brake'), 'motor torque',
         lambda _inertia, _d, torque: torque, False))


def motor(sheet: DataSheet, known: Mapping[str, float]) -> dict[str, float]:
    """Return {key: value} of the electrical part of a motor. known: {key: value} of the default motor."""
    pairs, voltage = known['pole_pairs'], known['voltage']
    electrical = pairs * sheet.motor_speed * math.pi / 30.0
    flux = BACK_EMF_SHARE * voltage / electrical
    current = sheet.motor_torque / (1.5 * pairs * flux)
    return {'flux_linkage': flux, 'resistance': RESISTANCE_VOLTAGE_SHARE * voltage / current,
            'inductance': INDUCTANCE_VOLTAGE_SHARE * voltage / (electrical * current),
            'torque_limit': 3.0 * sheet.motor_torque}


def axis(sheet: DataSheet, name: str) -> dict[str, float]:
    """Return {key: value} of an axis of the drive, without the gains of its loops; name: the axis."""
    known = as_dict(getattr(AduParameters(), name))
    inertia, ratio, rate = (getattr(sheet, f'{what}_{name}') for what in ('inertia', 'ratio', 'rate'))
    ratios = (inertia / known['load.inertia'], sheet.mirror / data_sheet.KNOWN_MIRROR_M,
              sheet.motor_torque / known['thermal.rated_torque'])
    values = {'load.inertia': inertia, 'gear_train.reducer_ratio': ratio / known['gear_train.pinion_ratio'],
              'gear_train.lash': 1e-3 * sheet.lash, 'limits.rate': math.radians(rate),
              'encoder.load_bits': sheet.encoder_bits, 'faults.overspeed': 1.22 * math.radians(rate),
              'thermal.rated_torque': sheet.motor_torque}
    for number in (1, 2):
        own = {key.partition('.')[2]: value for key, value in known.items() if key.startswith(f'motor_{number}.')}
        values |= {f'motor_{number}.{key}': value for key, value in motor(sheet, own).items()}
    constant = 1.5 * known['motor_1.pole_pairs'] * values['motor_1.flux_linkage']
    values['faults.overcurrent'] = 1.3 * values['motor_1.torque_limit'] / constant
    values |= {key: known[key] * rule.share(*ratios) for rule in RULES for key in rule.keys}
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
    return sheet.cn0 or float(f'{known + 20.0 * math.log10(sheet.mirror / data_sheet.KNOWN_MIRROR_M):.4g}')


@functools.cache
def _receiver(name: str) -> TrackingReceiverParameters:
    return scenario.load(name).node_parameters('tracking_receiver')


def _scaled(given: DataSheet, sheet: DataSheet) -> list[str]:
    """Return a line for each value that the data sheet `given` lacks and `sheet` has, with its rule."""
    meta = {name: field.metadata for name, field in flatten(DataSheet)}
    given = given.with_torque()
    lacking = {name: given.scaled(name) for name in data_sheet.SCALED_FIELDS if is_absent(getattr(given, name))}
    rows = [(law.for_loops, option_of(name), f'{getattr(sheet, name):.4g} {meta[name]["unit"]}'.rstrip(),
             law.text + _limited(getattr(sheet, name), value)) for name, (value, law) in lacking.items()]
    axes, fields = [axis(sheet, name) for name in AXES], dict(flatten(AxisParameters))
    rows += [(rule.for_loops, rule.label, ', '.join(f'{values[rule.keys[0]]:.4g}' for values in axes)
              + f' {fields[rule.keys[0]].metadata["unit"]}', rule.text) for rule in RULES]
    wind = DRAG_PEAK * 0.5 * WindFieldParameters().density * WIND_M_S**2 * 0.25 * math.pi * sheet.mirror**3
    holds = ', '.join(f'{2.0 * sheet.motor_torque * getattr(sheet, f"ratio_{name}"):.3g}' for name in AXES)
    rows.append((False, f'wind of {WIND_M_S:g} m/s', f'{wind:.3g} Nm', f'diameter^3; the motors hold {holds} Nm'))
    widths = [max(map(len, column)) for column in list(zip(*rows))[1:3]]
    return [f'scaled from the antenna of {data_sheet.KNOWN_MIRROR_M:g} m by the rule behind each value (azimuth, '
            'elevation); * matters most for the loops:',
            *(f'{"*" if starred else " "} {label:{widths[0]}}  {value:{widths[1]}}  {law}'
              for starred, label, value, law in rows)]


def _limited(value: float, scaled: float) -> str:
    bound = 'at least' if value > scaled else 'at most'
    return '' if value == scaled else f'; {bound} {value:g} in place of {scaled:g}'


def _rates(plan: Plan, found: Mapping[str, Mapping[str, Json]]) -> str:
    """Return a line that compares the largest rates of the target with those of the shapers."""
    from pedestal_workbench.tuning import loops
    times, angles = next(iter(plan.tables.values()))
    rates = np.abs(np.degrees(np.diff(angles, axis=0))) / np.diff(times)[:, np.newaxis]
    there = np.degrees([found['acu'][f'{name}.shaper.rate'] for name in AXES])
    wanted = rates.max(axis=0)
    needs = f'the target of this run needs up to {wanted[0]:.3g} deg/s in azimuth and {wanted[1]:.3g} in elevation'
    if plan.scenario.header.ship:
        needs += ', without the motion of the ship'
    if (wanted <= there).all():
        return f'{needs}; the antenna has {there[0]:.3g} and {there[1]:.3g} deg/s'
    short = float(np.diff(times)[(rates > there).any(axis=1)].sum())
    options = ', '.join(f'--rate-{name} {1.1 * rate / loops.SHAPER_RATE_SHARE:.3g}'
                        for name, rate, own in zip(AXES, wanted, there) if rate > own)
    return (f'{needs}: more than the {there[0]:.3g} and {there[1]:.3g} deg/s of the antenna for {short:.3g} s, in '
            f'which the beam falls behind; {options} would follow')


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
    for name in AXES if sheet.lash else ():
        values = axis(sheet, name)
        load, motors = values['load.inertia'], 2.0 * values['motor_1.inertia']
        ratio = load / (motors * getattr(sheet, f'ratio_{name}')**2)
        if ratio > MAX_INERTIA_RATIO:
            lines.append(f'{name}: the inertia of the load is {ratio:.3g} times that of its motors: above '
                         f'{MAX_INERTIA_RATIO:g} they race through the lash and may trip the drive; '
                         f'--ratio-{name} {math.sqrt(load / (motors * MAX_INERTIA_RATIO)):.3g} avoids this')
    return lines


def sections(sheet: DataSheet, title: str,
             station: Mapping[str, float] | None = None) -> dict[str, dict[str, Json]]:
    """Return {node: {key: value}} of the scenario. station: {parameter of the receiver: value}, None for that of the
    scenario of the data sheet. Raises ValueError."""
    from pedestal_workbench.tuning import loops
    sheet = sheet.completed()
    _, content = files.text(sheet.like)
    found = files.by_node(parameter_file.parse(content))
    found['scenario']['title'] = title
    # A narrower beam needs a smaller error, equal in beamwidths.
    for key in PROGRAM_ERRORS.keys() & set(found['scenario']):
        found['scenario'][key] *= min(1.0, sheet.theta / 0.0175)
    found['tracking_receiver'] |= {'antenna.beamwidth': sheet.theta, 'receiver.cn0_dbhz': cn0(sheet)}
    found['scenario'] |= {'dish.diameter': sheet.mirror, 'dish.frequency': sheet.frequency}
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
    whole = sheet.completed()
    remarks = _scaled(sheet, whole)
    if not is_absent(sheet.motor_power):
        remarks.append(f'--motor-power {sheet.motor_power:g} kW at {whole.motor_speed:g} rpm: '
                       f'{whole.motor_torque:g} Nm')
    sheet, changed = attainable(whole)
    remarks += [*changed, *_assumed(sheet)]
    if station is None:
        remarks.append(f'no --station: the antenna stands at {_receiver(sheet.like).target.station.text}')
    title = f'{sheet.mirror:g} m antenna, beam {math.degrees(sheet.theta):.3g} deg, on the mission of {sheet.like}'
    found = sections(sheet, title, station)
    tune = shlex.join(('pedestal', 'tune', f'{name}.yaml', '--loops'))
    run = Variant(f'{name}.yaml', files=(f'{name}-loops.yaml',)).command()
    parsed = scenario.parse(name, text(found, []))
    remarks += [_rates(Plan(parsed), found), *parsed.notes]
    content = text(found, [*parameter_file.origin(command), 'Replace scaled and assumed values by known values.',
                           f'Next: {tune}, then {run}', *remarks])
    return content, remarks
