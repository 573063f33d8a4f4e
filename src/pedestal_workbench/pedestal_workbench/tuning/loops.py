"""`pedestal tune --loops`: design the gains of drive and control unit for the plant of a scenario.

The plant of an axis is its motors, gears and load. Each axis is first designed as a rigid axis. The margins of its
loops are then measured on the simulated plant, with its gears, lash, friction, structure, delays and sampling
(frequency_response). A loop without the required margins is made slower until it has them. The design of a rigid axis:

    J = J_m + J_L / (2 N^2)                     inertia that one motor moves, on its shaft [kg m2]
    J_A = J_L + 2 J_m N^2                       inertia of the whole axis, at the load [kg m2]
    K_p = w_s J,  K_i = K_p w_s / 5             gains of the speed loop, per motor [Nms/rad], [Nm/rad]
    w_p = w_s / 8                               gain of the position loop (`feedforward.bandwidth`) [rad/s]
    a = 1/2 (2 T_max N - T_load) / J_A          acceleration of the shaper [rad/s2], 3/4 without lash
    j = 3/4 a w_s                               jerk of the shaper [rad/s3]
    h0 = 3.5 / w_s                              filter step of the shaper [s]
    T_b = 0.4 T_r                               bias torque of a motor [Nm]. It is full up to a motor torque of
                                                0.47 T_r, and zero from 1.5 T_r on.

    J_m, J_L    inertia of one motor, of the load; N: gear ratio from motor to load
    w_s         crossover of the speed loop [rad/s]
    T_max, T_r  torque limit and rated torque of a motor; up to half of the torque a bias keeps the teeth in contact,
                and a quarter is a reserve for a heavier load
    T_load      sum of friction, unbalance and mean wind, at the load

The feed-forward takes J_A and the friction of the load. A required crossover of the position loop takes the place of
w_s / 8.

A declared structure swings with the frequency f on locked motors. The receiver sees this swing as a motion of the
target, and the shaper must not excite it. docs/develop/decisions.md states the design for f and its reasons. The
control unit gets f, and limits the models of its filter by it (acu_tracker.structure). Of both
designs the smaller value counts, of h0 the larger. The margins are then measured with the structure in the plant, and
again in all PLANT_CORNERS, within the ranges of these parameters. The smallest margins count.
"""
import dataclasses
import math
import pathlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from drive_law.axis_params import SPEED_LOOP_PERIOD_S, AxisParameters
from pedestal_bringup.scenario.variant import Variant
from pedestal_common import parameters
from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import (
    Decibels,
    Degrees,
    Hertz,
    Json,
    KilogramMeters2,
    NewtonMeters,
    Radians,
    RadiansPerSecond,
    RadiansPerSecond2,
)
from pedestal_common.text_files import parameter_file
from pedestal_common.text_files.text_table import TextTable
from pedestal_recording import configuration
from pedestal_workbench.tuning import frequency_response as frequency
from pedestal_workbench.tuning.frequency_response import Margins

DEFAULT_SPEED_CROSSOVER_HZ, CROSSOVER_RATIO = 28.0, 8.0
"""Default crossover of the speed loop [Hz]; ratio of the crossovers of the speed loop and the position loop [-]."""

TORQUE_SHARE, SHAPER_RATE_SHARE = 0.75, 0.94
"""Acceleration of the shaper without lash, and its rate, as shares of those that the axis can reach [-]."""

MAX_BEND_RAD, BEND_SHARE = 0.8e-3, 0.1
"""Largest bend of a structure by the acceleration of the shaper [rad]; its largest ratio to the beamwidth [-]."""

CLOSED_TEETH_SHARE = 0.5
"""Share of the torque limit that the shaper uses with lash [-]. Above this torque (`bias.out`) no bias torque keeps
the teeth in contact. They would part at the end of an acceleration in strong wind, and their impact would trip it."""

MODE_H0, MODE_RATIO = 0.8, 3.0
"""h0 of the shaper times the frequency of the structure; smallest ratio of this frequency to the crossover of the
position loop [-]."""

PLANT_CORNERS = tuple((inertia, mode) for inertia in (0.7, 1.3) for mode in (0.8, 1.2))
"""Factors (of the load inertia, of the frequency of the structure) with which the loops must also have their margins
[-]."""

WORST_SUFFIX = ', worst'  # of the name of a loop, in the row with its smallest margins in all PLANT_CORNERS

NEAR_SHARE = 0.95  # share of a required crossover from which on a loop counts as fast enough [-]

SLOWDOWN_FACTOR, MAX_SLOWDOWNS = 0.85, 12
"""Factor of the crossover from one try to the next, slower one [-]; largest number of tried crossovers."""

STILL_AIR_PARAMETERS = {'scenario.ship': False, 'scenario.program.source': 'target', 'acu.initial_mode': 'program',
                        'adu.initially_enabled': True, 'adu.wind.azimuth': 0.0, 'adu.wind.elevation': 0.0,
                        'adu.wind.gust.kind': 'none', 'adu.wind.field.speed': 0.0}
"""Changed parameters of a scenario for the measurement of a plant: ashore, in still air, on a program track."""


@dataclasses.dataclass(frozen=True)
class LoopRequirements:
    """Required properties of the loops."""
    speed: Hertz | None = None      # crossover of the speed loop; None: derived from the other loop, or the default
    position: Hertz | None = None   # crossover of the position loop; None likewise
    phase_margin: Degrees = 45.0    # smallest phase margin
    gain_margin: Decibels = 6.0     # smallest gain margin

    def __post_init__(self) -> None:
        for name, low, high, unit in (('speed', 0.1, 500.0, 'Hz'), ('position', 0.01, 50.0, 'Hz'),
                                      ('phase_margin', 20.0, 80.0, 'deg'), ('gain_margin', 3.0, 20.0, 'dB')):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise ValueError(f'{name} = {value:g} {unit}: must be {low:g} to {high:g}')


@dataclasses.dataclass(frozen=True)
class Plant:
    """Plant of one axis for the design of its loops. Raises ValueError if the motors cannot move the axis."""
    name: str       # of the axis
    axis: AxisParameters
    wind: NewtonMeters = 0.0        # mean wind torque at the load
    beamwidth: Radians = math.inf   # half-power beamwidth of the antenna

    def __post_init__(self) -> None:
        if self.acceleration <= 0.0:
            raise ValueError(f'adu.{self.name}: the motors cannot move the axis: friction, unbalance and wind need '
                             'more torque than both torque limits')

    @property
    def motor_inertia(self) -> KilogramMeters2:
        """Inertia J_m of a motor, the mean of both."""
        return 0.5 * (self.axis.motor_1.inertia + self.axis.motor_2.inertia)

    @property
    def ratio(self) -> float:
        """Gear ratio N from motor to load [-]."""
        return self.axis.gear_train.ratio

    @property
    def inertia(self) -> KilogramMeters2:
        """Inertia J that one motor moves, on its shaft."""
        return self.motor_inertia + self.axis.load.inertia / (2.0 * self.ratio**2)

    @property
    def mode(self) -> Hertz:
        """Frequency f of the structure on locked motors, 0 if no structure is declared."""
        structure = self.axis.structure
        return structure.frequency if structure.inertia_share > 0.0 else 0.0

    @property
    def gear_inertia(self) -> KilogramMeters2:
        """Inertia J without the share of the dish, which one motor moves above the frequency of the structure."""
        on_gear = (1.0 - self.axis.structure.inertia_share) * self.axis.load.inertia
        return self.motor_inertia + on_gear / (2.0 * self.ratio**2)

    @property
    def whole_inertia(self) -> KilogramMeters2:
        """Inertia J_A of load and motors, at the load."""
        return 2.0 * self.inertia * self.ratio**2

    @property
    def acceleration(self) -> RadiansPerSecond2:
        """Acceleration of the load by both torque limits, less friction, unbalance and wind."""
        torque = (self.axis.motor_1.torque_limit + self.axis.motor_2.torque_limit) * self.ratio
        return (torque - self.axis.friction.coulomb - abs(self.axis.load.unbalance) - abs(self.wind)
                ) / self.whole_inertia


def structure(plant: Plant) -> dict[str, float]:
    """Return {key of acu.AXIS: value} of the structure, by which the control unit limits the models of its filter."""
    return parameters.as_dict(plant.axis.structure, 'structure.') if plant.mode else {}


def rate_slope(plant: Plant) -> RadiansPerSecond2:
    """Return the largest slope of the rate command (`limits.acceleration`): 1.3 times the acceleration of the shaper
    of a rigid axis without lash."""
    return 1.3 * TORQUE_SHARE * plant.acceleration


def drive_gains(plant: Plant, w_s: RadiansPerSecond) -> dict[str, float]:
    """Return {key of adu.AXIS: value} of the drive for a crossover w_s of the speed loop."""
    K_p, rated = w_s * plant.gear_inertia, plant.axis.thermal.rated_torque
    return {'speed_loop.proportional': K_p, 'speed_loop.integral': K_p * w_s / 5.0,
            'speed_loop.load_inertia': plant.axis.load.inertia, 'bias.torque': 0.4 * rated, 'bias.hold': 0.47 * rated,
            'bias.out': 1.5 * rated,
            'limits.deceleration': _allowed('limits.deceleration', 0.5 * plant.acceleration)}


def position_crossover(plant: Plant, w_s: RadiansPerSecond) -> RadiansPerSecond:
    """Return the crossover w_p of the position loop for a crossover w_s of the speed loop."""
    w_p = w_s / CROSSOVER_RATIO
    return min(w_p, 2.0 * math.pi * plant.mode / MODE_RATIO) if plant.mode else w_p


def shaper_gains(plant: Plant, w_s: RadiansPerSecond) -> dict[str, float]:
    """Return {key of acu.AXIS.shaper: value} for a crossover w_s of the speed loop."""
    share = CLOSED_TEETH_SHARE if plant.axis.gear_train.lash else TORQUE_SHARE
    a, f = share * plant.acceleration, plant.mode
    if not f:
        return {'acceleration': a, 'jerk': 0.75 * a * w_s, 'h0': 3.5 / w_s}
    bend = min(MAX_BEND_RAD, BEND_SHARE * plant.beamwidth)
    a = min(a, bend * (2.0 * math.pi * f) ** 2)
    return {'acceleration': a, 'jerk': a * min(0.75 * w_s, f), 'h0': max(3.5 / w_s, MODE_H0 / f)}


def control_gains(plant: Plant, w_s: RadiansPerSecond, w_p: RadiansPerSecond) -> dict[str, Json]:
    """Return {key of acu.AXIS: value} of the control unit; w_s, w_p: crossovers of speed and position loop."""
    shaper = {f'shaper.{key}': value for key, value in shaper_gains(plant, w_s).items()}
    return {'controller': 'feedforward', 'feedforward.bandwidth': w_p, 'feedforward.inertia': plant.whole_inertia,
            'feedforward.friction': plant.axis.friction.coulomb,
            'shaper.rate': SHAPER_RATE_SHARE * plant.axis.limits.rate, **shaper, **structure(plant),
            'adrc.rate_bandwidth': w_s * plant.gear_inertia / plant.inertia,
            'limits.rate': plant.axis.limits.rate, 'limits.acceleration': rate_slope(plant)}


_AXIS_FIELDS = dict(parameters.flatten(AxisParameters))  # {key of adu.AXIS: dataclass field}


def _allowed(key: str, value: float) -> float:
    """Return the value of a parameter of adu.AXIS that is nearest to `value` in the range of the parameter."""
    allowed = _AXIS_FIELDS[key].metadata
    return min(max(value, allowed['low']), allowed['high'])


def smallest(every: Sequence[Margins]) -> Margins:
    """Return the smallest value of each metric in several results; NaN if none has the metric."""
    return {key: (np.fmin.reduce([margins[key][0] for margins in every]), unit) for key, (_, unit) in every[0].items()}


def meets_margins(margins: Margins, required: LoopRequirements) -> bool:
    """Return True if the margins of a loop meet the requirements. A gain margin outside the measured band (NaN) meets
    its requirement. A loop whose gain is never above 1 has no phase margin (NaN), and does not meet its requirement.
    """
    phase, gain = margins['phase_margin_deg'][0], margins['gain_margin_db'][0]
    return phase >= required.phase_margin and not gain < required.gain_margin


class LoopRow(NamedTuple):
    """A row of the table of the loops."""
    loop: str
    axis: str
    wanted: Hertz       # required crossover or bandwidth
    margins: Margins


class Loops:
    """The loops of a scenario during their design: the plants {axis: Plant}, and the present gains, such as
    {'adu.azimuth.speed_loop.proportional': value}. Raises ValueError for a drive without motors."""

    def __init__(self, variant: Variant) -> None:
        chosen = variant.load()
        if chosen.header.beam:
            raise ValueError(f'scenario {chosen.name}: an electronic beam has no loops to tune')
        self.variant, self.name = variant, chosen.name
        drive = chosen.node_parameters('adu')
        known = chosen.node_parameters('tracking_receiver')
        self.plants = {name: Plant(name, getattr(drive, name), getattr(drive.wind, name), known.antenna.beamwidth)
                       for name in AXES}
        self.gains: dict[str, Json] = {}

    def set(self, node: str, name: str, gains: Mapping[str, Json]) -> None:
        """Set gains {key: value} of a node for the axis `name`, rounded to four digits."""
        self.gains |= {f'{node}.{name}.{key}': float(f'{value:.4g}') if isinstance(value, float) else value
                       for key, value in gains.items()}

    def designed(self, loop: str, name: str) -> RadiansPerSecond:
        """Return the crossover for which the gains of a loop, speed or position, were designed."""
        if loop == 'position':
            return self.gains[f'acu.{name}.feedforward.bandwidth']
        return self.gains[f'adu.{name}.speed_loop.proportional'] / self.plants[name].gear_inertia

    def _measured(self, corner: tuple[float, float] = (1.0, 1.0)) -> Variant:
        changed: dict[str, float] = {}
        for name, plant in self.plants.items():
            if plant.mode and corner != (1.0, 1.0):
                changed |= {f'adu.{name}.load.inertia': _allowed('load.inertia', corner[0] * plant.axis.load.inertia),
                            f'adu.{name}.structure.frequency': _allowed('structure.frequency', corner[1] * plant.mode)}
        return frequency.moving(self.variant).with_({**self.gains, **changed, **STILL_AIR_PARAMETERS})

    def response(self, loop: str, name: str, corner: tuple[float, float] = (1.0, 1.0)) -> frequency.Response | None:
        """Return the response of a loop (current, speed, position) of the axis `name` with the present gains, None if
        the drive trips. corner: factors of the plant, see PLANT_CORNERS. For the current loop it is the response of
        the motor with the smaller phase margin."""
        variant = self._measured(corner)
        drive = variant.load().node_parameters('adu')
        axis = getattr(drive, name)
        if loop == 'current':
            # frequency.current measures the azimuth, so this axis takes its place, with the travel of the azimuth.
            travel = drive.azimuth.limits
            limits = dataclasses.replace(axis.limits, lower=travel.lower, upper=travel.upper)
            motors = frequency.current(dataclasses.replace(drive, azimuth=dataclasses.replace(axis, limits=limits)))
            return min(motors.values(), key=lambda response: frequency.margins(response)['phase_margin_deg'][0])
        if loop == 'speed':
            sweep = frequency.FLEXIBLE_SPEED_SWEEP if self.plants[name].mode else frequency.SPEED_SWEEP
            sweep = frequency.in_contact(axis, sweep, SPEED_LOOP_PERIOD_S)
            return frequency.speed(drive, sweep, (name,))[f'speed/{name}']
        sweep = frequency.in_contact(axis, frequency.POSITION_SWEEP, drive.period)
        found = frequency.position(variant, (name,), sweep)[f'position/{name}']
        # A tripped drive returns no signal.
        return found if np.isfinite(found.open_loop).all() and found.open_loop.all() else None

    def measured(self, loop: str, name: str, corner: tuple[float, float] = (1.0, 1.0)) -> Margins | None:
        """Return the margins of `response`, None if the drive trips."""
        found = self.response(loop, name, corner)
        return frequency.margins(found) if found is not None else None

    def _with_every_plant(self, loop: str, name: str, required: LoopRequirements) -> tuple[list[Margins], str]:
        """Return (margins with the plant and, for a structure, with all PLANT_CORNERS; text on the first of them that
        miss the requirements, '' for none)."""
        every: list[Margins] = []
        for corner in ((1.0, 1.0), *(PLANT_CORNERS if self.plants[name].mode else ())):
            margins = self.measured(loop, name, corner)
            if margins is None:
                return every, 'the drive trips'
            if not meets_margins(margins, required):
                phase, gain = margins['phase_margin_deg'][0], margins['gain_margin_db'][0]
                return every, ('its gain is below 1 at each measured frequency' if math.isnan(phase) else
                               f'it has {phase:.3g} deg and {gain:.3g} dB')
            every.append(margins)
        return every, ''

    def close(self, loop: str, name: str, required: LoopRequirements, set_to: Callable[[RadiansPerSecond], None],
              fastest: RadiansPerSecond) -> tuple[RadiansPerSecond, list[tuple[str, Margins]]]:
        """Return (crossover, rows) of the fastest loop, speed or position, that meets the requirements. set_to sets
        the gains for a crossover; fastest: first tried crossover. A row is the name of the loop and its margins. For a
        structure, a second row has the smallest margins in all PLANT_CORNERS. Raises ValueError if no tried loop meets
        the requirements."""
        for w in fastest * SLOWDOWN_FACTOR**np.arange(MAX_SLOWDOWNS):
            set_to(w)
            every, missed = self._with_every_plant(loop, name, required)
            if not missed:
                worst = [(f'{loop}{WORST_SUFFIX}', smallest(every))] if len(every) > 1 else []
                return w, [(loop, every[0]), *worst]
        raise ValueError(f'{self.name}, {name}: the {loop} loop cannot be closed with {required.phase_margin:g} deg '
                         f'and {required.gain_margin:g} dB: at {w / (2.0 * math.pi):.3g} Hz {missed}')


def design(loops: Loops, axes: Sequence[str], required: LoopRequirements,
           progress: Callable[[float, str], object]) -> list[LoopRow]:
    """Design the loops of some axes, whose gains are then in `loops`, and return the rows of the table. Raises
    ValueError."""
    speed_hz = required.speed or CROSSOVER_RATIO * (required.position or DEFAULT_SPEED_CROSSOVER_HZ / CROSSOVER_RATIO)
    wanted_s = 2.0 * math.pi * speed_hz
    rows, reached = [], {}
    for name in AXES:  # both axes are designed first, because both move in a measurement
        plant = loops.plants[name]
        loops.set('adu', name, drive_gains(plant, wanted_s))
        loops.set('acu', name, control_gains(plant, wanted_s, position_crossover(plant, wanted_s)))
    for i, name in enumerate(axes):
        plant = loops.plants[name]
        progress(i / len(axes), f'{name}: current and speed loop')
        current = plant.axis.current_loop.bandwidth
        measured = loops.measured('current', name)
        assert measured is not None     # only a measurement of the position loop runs a drive that can trip
        rows.append(LoopRow('current', name, current, measured))

        def set_speed(w: RadiansPerSecond, name: str = name, plant: Plant = plant) -> None:
            loops.set('adu', name, drive_gains(plant, w))
        reached[name], closed = loops.close('speed', name, required, set_speed, wanted_s)
        rows += [LoopRow(loop, name, wanted_s / (2.0 * math.pi), margins) for loop, margins in closed]
    for i, name in enumerate(axes):
        progress((i + 0.5) / len(axes), f'{name}: position loop')
        plant, w_s = loops.plants[name], reached[name]
        w_p = (min(2.0 * math.pi * required.position, wanted_s / CROSSOVER_RATIO) if required.position
               else position_crossover(plant, w_s))

        def set_position(w: RadiansPerSecond, name: str = name, plant: Plant = plant,
                         w_s: RadiansPerSecond = w_s) -> None:
            loops.set('acu', name, control_gains(plant, w_s, w))
        _, closed = loops.close('position', name, required, set_position, w_p)
        wanted = required.position or w_p / (2.0 * math.pi)
        rows += [LoopRow(loop, name, wanted, margins) for loop, margins in closed]
    return rows


def table(rows: Iterable[LoopRow], required: LoopRequirements) -> list[str]:
    """Return the table of the loops as lines of text, with measured and required values."""
    cells = []
    for loop, name, wanted, margins in rows:
        values = {key: value for key, (value, _) in margins.items()}
        limits = required.phase_margin, required.gain_margin
        floor = [f'(>= {limit:g})' for limit in limits] if loop != 'current' else ('', '')
        cells.append((f'{name} {loop}', f'{wanted:.3g} Hz', _text(values['crossover_hz'], 'Hz'),
                      _text(values['bandwidth_hz'], 'Hz'),
                      f'{_text(values["phase_margin_deg"], "deg")} {floor[0]:>7}',
                      f'{_text(values["gain_margin_db"], "dB")} {floor[1]:>7}'))
    return TextTable((('loop', '<20'), ('required', '>9'), ('crossover', '>10'), ('bandwidth', '>10'),
                      ('phase margin', '>21'), ('gain margin', '>20')), cells).lines()


def _text(value: float, unit: str) -> str:
    return f'{value:.3g} {unit}' if math.isfinite(value) else 'none'


def remarks(loops: Loops, rows: Sequence[LoopRow]) -> list[str]:
    """Return lines on the rows of `design`: loops that are slower than required, with the reason, and loops without a
    gain margin."""
    lines = []
    for loop, name, wanted, margins in rows:
        got = margins['crossover_hz'][0]
        if loop in ('speed', 'position') and got < NEAR_SHARE * wanted:
            designed = loops.designed(loop, name) / (2.0 * math.pi)
            speed = loops.designed('speed', name) / (2.0 * math.pi)
            if designed > NEAR_SHARE * wanted:
                reason = 'the gains are those of a rigid axis; gears, delays and friction make the loop slower'
            elif loop == 'position' and designed > NEAR_SHARE * speed / CROSSOVER_RATIO:
                reason = f'a position loop has at most 1/{CROSSOVER_RATIO:g} of the crossover of the speed loop'
            else:
                reason = 'a faster loop does not hold the required margins'
            lines.append(f'{name} {loop} loop: {wanted:.3g} Hz required, {got:.3g} Hz reached: {reason}')
    return [*lines, *frequency.without_gain_margin([f'{name} {loop}' for loop, name, _, margins in rows
                                                    if math.isnan(margins['gain_margin_db'][0])])]


@dataclasses.dataclass(frozen=True)
class LoopOptions:
    """Plant whose loops are designed."""
    source: str             # scenario, name or .yaml file
    param: list[str]        # its changes, texts NODE.KEY=VALUE
    axis: str               # azimuth, elevation or both
    output: pathlib.Path | None     # parameter file; None: the default
    command: str            # whole command line, for the head of the file


def main(options: LoopOptions, required: LoopRequirements, progress: Callable[[float, str], object]) -> list[str]:
    """Design the loops, write the parameter file and return the lines to print. Raises ValueError."""
    axes = AXES if options.axis == 'both' else (options.axis,)
    loops = Loops(Variant(options.source, tuple(options.param)))
    file = options.output or pathlib.Path(f'{loops.name}-loops.yaml')
    if file.exists() or not file.parent.is_dir():
        raise ValueError(f'--output {file}: must be a new file in a directory that exists')
    rows = design(loops, axes, required, progress)
    loops.gains = {key: value for key, value in loops.gains.items() if key.split('.')[1] in axes}
    tuned = loops.variant.with_(loops.gains).load()     # raises ScenarioError for a gain outside its range
    lines = [*table(rows, required), *remarks(loops, rows), *tuned.notes]
    made = parameter_file.origin(options.command, configuration.git_revision() or 'unknown')
    sections = {node: {key.removeprefix(f'{node}.'): value for key, value in loops.gains.items()
                       if key.startswith(f'{node}.')} for node in ('adu', 'acu')}
    parameter_file.write_new(file, sections, [*made, *lines])
    return [*lines, '', *(f'{name:44} {value}' for name, value in loops.gains.items()),
            f'written: {file}  ({Variant(options.source, files=(file,)).command()})']
