"""`pedestal tune --loops`: design the gains of drive and control unit for the plant of a scenario.

Each axis is designed as a rigid axis. The margins are then measured on the simulated plant, with its gears, lash,
friction, structure, delays and sampling (frequency_response). A loop without the required margins is made slower until
it has them. Per motor on its shaft, with the inertia J_m of a motor, J_L of the load, and the ratio N:

    J = J_m + J_L / (2 N^2)                          inertia that one motor moves
    K_p = w_s J,  K_i = K_p w_s / 5                  speed loop of crossover w_s
    position loop: PI of K_p = w_s / 8               `feedforward.bandwidth`, or the requirement
    feed-forward: J_L + 2 J_m N^2, friction of the load
    shaper: a = 3/4 (2 T_max N - T_load) / (J_L + 2 J_m N^2), jerk a 3/4 w_s, h0 = 3.5 / w_s
    bias torque: 0.4 of the rated torque, held up to a torque of 0.47, zero at 1.5 of the rated torque

T_load is the sum of friction, unbalance and mean wind. A quarter of the torque is a reserve for a heavier load.

A declared structure (`adu.AXIS.structure`, inertia_share above 0) swings with the frequency f on locked motors. The
receiver sees this swing as a motion of the target, and the shaper must not pass it on:

    speed loop: J without the share of the dish, because the dish does not follow above f
    position loop: at most K_p = 2 pi f / 3
    shaper: a that bends the structure by a / (2 pi f)^2 of at most 0.8 mrad and a tenth of the beamwidth, and needs
            half of the torque, up to which the bias torque keeps the teeth closed; jerk a f, so that the acceleration
            rises within one period of the swing and leaves no swing behind; h0 = 0.8 / f

Each of these values is the smaller one of the two designs (of h0 the larger one). The margins are then measured with
the structure in the plant, also with the load inertia changed by 30 % and f by 20 %, and the smallest margins count.
"""
import dataclasses
import math
import pathlib

import numpy as np

from adu_drive.params import SPEED_LOOP_PERIOD_S
from pedestal_analysis.tuning import frequency_response as frequency
from pedestal_bringup.scenario import scenario
from pedestal_common.graph.topics import AXES
from pedestal_common.text_files import parameter_file
from pedestal_recording import configuration

DEFAULT_SPEED_CROSSOVER_HZ, CROSSOVER_RATIO = 28.0, 8.0
"""Default crossover of the speed loop [Hz], and ratio of the crossovers of speed and position loop [-]."""

TORQUE_SHARE, SHAPER_RATE_SHARE = 0.75, 0.94
"""Shares of the shaper in the acceleration and in the rate of the axis [-]."""

MAX_BEND_RAD, BEND_SHARE = 0.8e-3, 0.1
"""Largest bend of a structure under the shaper's acceleration [rad], and its largest ratio to the beamwidth [-]."""

CLOSED_TEETH_SHARE = 0.5
"""Share of the torque limit that the shaper uses on a flexible structure: `bias.out`, above which no bias torque keeps
the teeth closed [-]."""

MODE_H0, MODE_RATIO = 0.8, 3.0
"""Filter step of the shaper times the frequency of the structure, and least ratio of that frequency to the crossover
of the position loop [-]."""

PLANT_CORNERS = tuple((inertia, mode) for inertia in (0.7, 1.3) for mode in (0.8, 1.2))
"""Factors of load inertia and frequency of the structure with which the loops must hold their margins, too [-]."""

WORST_SUFFIX = ', worst'
"""Suffix of the name of a loop in the row with its smallest margins in all PLANT_CORNERS."""

NEAR_SHARE = 0.95
"""Share of a required crossover from which on a loop counts as fast enough [-]."""

SLOWDOWN_FACTOR, MAX_SLOWDOWNS = 0.85, 12
"""Factor by which a loop without its margins is made slower, and number of tried crossovers."""

STILL_AIR_PARAMETERS = {'scenario.ship': False, 'scenario.program.source': 'target', 'acu.initial_mode': 'program',
                        'adu.initially_enabled': True, 'adu.wind.azimuth': 0.0, 'adu.wind.elevation': 0.0,
                        'adu.wind.gust.kind': 'none'}
"""Parameters for the measurement of a plant: ashore, in still air."""


class LoopError(ValueError):
    """The loops of a plant cannot be designed, or not closed with the required margins; one line."""


REQUIREMENT_OPTIONS = {'speed_bandwidth': 'speed', 'position_bandwidth': 'position', 'phase_margin': 'phase_margin',
                       'gain_margin': 'gain_margin'}
"""{option of the verb: field of LoopRequirements}."""


@dataclasses.dataclass(frozen=True)
class LoopRequirements:
    """Required crossovers of speed and position loop [Hz], None to derive from the other loop; margins [deg], [dB]."""
    speed: float | None = None
    position: float | None = None
    phase_margin: float = 45.0
    gain_margin: float = 6.0

    def __post_init__(self):
        for name, low, high, unit in (('speed', 0.1, 500.0, 'Hz'), ('position', 0.01, 50.0, 'Hz'),
                                      ('phase_margin', 20.0, 80.0, 'deg'), ('gain_margin', 3.0, 20.0, 'dB')):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise LoopError(f'{name} = {value:g} {unit}: must be {low:g} to {high:g}')


@dataclasses.dataclass(frozen=True)
class Plant:
    """Model of one axis, from its adu_drive.params.AxisParameters, the mean wind torque [Nm] and the beamwidth [rad].

    Raises LoopError if the motors cannot move the axis.
    """
    name: str
    axis: object
    wind: float = 0.0
    beamwidth: float = math.inf

    def __post_init__(self):
        if self.acceleration <= 0.0:
            raise LoopError(f'adu.{self.name}: the motors cannot move the axis: friction, unbalance and wind need '
                            'more torque than both torque limits')

    @property
    def motor_inertia(self):
        """Inertia J_m of a motor, the mean of both [kg m2]."""
        return 0.5 * (self.axis.motor_1.inertia + self.axis.motor_2.inertia)

    @property
    def ratio(self):
        """Gear ratio N from motor to load [-]."""
        return self.axis.gear_train.ratio

    @property
    def inertia(self):
        """Inertia J that one motor moves, on its shaft [kg m2]."""
        return self.motor_inertia + self.axis.load.inertia / (2.0 * self.ratio**2)

    @property
    def mode(self):
        """Frequency of the structure on locked motors [Hz], 0 if no structure is declared."""
        structure = self.axis.structure
        return structure.frequency if structure.inertia_share > 0.0 else 0.0

    @property
    def free_mode(self):
        """Frequency of the structure on a free axis [Hz], 0 if no structure is declared."""
        return self.mode / math.sqrt(1.0 - self.axis.structure.inertia_share)

    @property
    def gear_inertia(self):
        """Inertia that one motor moves above the frequency of the structure, on its shaft [kg m2]."""
        on_gear = (1.0 - self.axis.structure.inertia_share) * self.axis.load.inertia
        return self.motor_inertia + on_gear / (2.0 * self.ratio**2)

    @property
    def whole_inertia(self):
        """Inertia of load and motors, seen at the load [kg m2]."""
        return 2.0 * self.inertia * self.ratio**2

    @property
    def acceleration(self):
        """Acceleration of the load at the torque limits of the motors, minus friction, unbalance and wind [rad/s2]."""
        torque = (self.axis.motor_1.torque_limit + self.axis.motor_2.torque_limit) * self.ratio
        return (torque - self.axis.friction.coulomb - abs(self.axis.load.unbalance) - abs(self.wind)
                ) / self.whole_inertia


def rate_slope(plant):
    """Return the largest change of the rate command [rad/s2], a quarter of the torque below the limits."""
    return 1.3 * TORQUE_SHARE * plant.acceleration


def drive_gains(plant, w_s):
    """Return {key of adu.AXIS: value} for a crossover w_s [rad/s] of the speed loop."""
    K_p, rated = w_s * plant.gear_inertia, plant.axis.thermal.rated_torque
    return {'speed_loop.proportional': K_p, 'speed_loop.integral': K_p * w_s / 5.0,
            'speed_loop.load_inertia': plant.axis.load.inertia, 'bias.torque': 0.4 * rated, 'bias.hold': 0.47 * rated,
            'bias.out': 1.5 * rated, 'limits.deceleration': 0.5 * plant.acceleration}


def position_crossover(plant, w_s):
    """Return the crossover [rad/s] of the position loop that follows from that of the speed loop and the structure."""
    w_p = w_s / CROSSOVER_RATIO
    return min(w_p, 2.0 * math.pi * plant.mode / MODE_RATIO) if plant.mode else w_p


def shaper_gains(plant, w_s):
    """Return {key of acu.AXIS.shaper: value} for a crossover w_s [rad/s] of the speed loop."""
    a, f = TORQUE_SHARE * plant.acceleration, plant.mode
    if not f:
        return {'acceleration': a, 'jerk': 0.75 * a * w_s, 'h0': 3.5 / w_s}
    bend = min(MAX_BEND_RAD, BEND_SHARE * plant.beamwidth)
    a = min(a, CLOSED_TEETH_SHARE * plant.acceleration, bend * (2.0 * math.pi * f) ** 2)
    return {'acceleration': a, 'jerk': a * min(0.75 * w_s, f), 'h0': max(3.5 / w_s, MODE_H0 / f)}


def control_gains(plant, w_s, w_p):
    """Return {key of acu.AXIS: value} for crossovers w_s, w_p [rad/s] of the speed and the position loop."""
    shaper = {f'shaper.{key}': value for key, value in shaper_gains(plant, w_s).items()}
    return {'controller': 'feedforward', 'feedforward.bandwidth': w_p, 'feedforward.inertia': plant.whole_inertia,
            'feedforward.friction': plant.axis.friction.coulomb,
            'shaper.rate': SHAPER_RATE_SHARE * plant.axis.limits.rate, **shaper,
            'limits.rate': plant.axis.limits.rate, 'limits.acceleration': rate_slope(plant)}


def _rounded(gains):
    return {key: value if isinstance(value, str) else float(f'{value:.4g}') for key, value in gains.items()}


def smallest(every):
    """Return the smallest value of each metric in several frequency.margins; NaN only if no margin has the metric."""
    return {key: (np.fmin.reduce([margins[key][0] for margins in every]), unit) for key, (_, unit) in every[0].items()}


def meets_margins(margins, required):
    """Return True if margins of frequency.margins meet LoopRequirements.

    A gain margin outside the band (NaN) is met; a loop that is never above 1 has no phase margin and fails.
    """
    phase, gain = margins['phase_margin_deg'][0], margins['gain_margin_db'][0]
    return phase >= required.phase_margin and not gain < required.gain_margin


class Loops:
    """The loops of a scenario during their design: gains {'adu.azimuth.speed_loop.proportional': value}.

    source: a name or a path; overrides: texts 'node.key=value'. Raises LoopError for a drive without motors.
    """

    def __init__(self, source, overrides=()):
        chosen = scenario.load(source, overrides)
        if chosen.header.beam:
            raise LoopError(f'scenario {chosen.name}: an electronic beam has no loops to tune')
        self.source, self.overrides, self.name = source, tuple(overrides), chosen.name
        drive = chosen.node_parameters('adu')
        beamwidth = chosen.node_parameters('tracking_receiver').antenna.beamwidth
        self.plants = {name: Plant(name, getattr(drive, name), getattr(drive.wind, name), beamwidth) for name in AXES}
        self.gains = {}

    def set(self, node, name, gains):
        """Set gains {key: value} of an axis of a node."""
        self.gains |= {f'{node}.{name}.{key}': value for key, value in _rounded(gains).items()}

    def designed(self, loop, name):
        """Return the crossover [rad/s] for which the gains of a loop, speed or position, were designed."""
        if loop == 'position':
            return self.gains[f'acu.{name}.feedforward.bandwidth']
        return self.gains[f'adu.{name}.speed_loop.proportional'] / self.plants[name].gear_inertia

    def _case(self, corner=(1.0, 1.0)):
        """Return the Case of a measurement; corner: factors of load inertia and frequency of flexible axes."""
        given = dict(text.split('=', 1) for text in self.overrides)
        changed = {}
        for name, plant in self.plants.items():
            if plant.mode and corner != (1.0, 1.0):
                changed |= {f'adu.{name}.load.inertia': corner[0] * plant.axis.load.inertia,
                            f'adu.{name}.structure.frequency': corner[1] * plant.mode}
        return frequency.case(self.name, self.source, {**given, **self.gains, **changed, **STILL_AIR_PARAMETERS})

    def _sweep(self, axis, sweep, period):
        """Return a sweep with limited peak and frequency.

        To keep the teeth closed, its torque stays below half of the bias torque. Its highest frequency is below half
        of the step rate of the drive.
        """
        peak = 0.5 * axis.bias.torque / max(axis.speed_loop.proportional * axis.gear_train.ratio, 1e-9)
        return dataclasses.replace(sweep, peak=min(sweep.peak, peak or sweep.peak),
                                   highest=min(sweep.highest, 0.475 / period))

    def response(self, loop, name, corner=(1.0, 1.0)):
        """Return the frequency.Response of a loop of an axis with the present gains, None if the drive trips.

        loop: 'current' (of the motor with the smaller phase margin), 'speed' or 'position'; corner: see PLANT_CORNERS.
        """
        case = self._case(corner)
        drive = case.loaded().node_parameters('adu')
        axis = getattr(drive, name)
        if loop == 'current':
            travel = drive.azimuth.limits
            limits = dataclasses.replace(axis.limits, lower=travel.lower, upper=travel.upper)
            found = frequency.current(dataclasses.replace(drive, azimuth=dataclasses.replace(axis, limits=limits)))
            return min(found.values(), key=lambda response: frequency.margins(response)['phase_margin_deg'][0])
        if loop == 'speed':
            sweep = frequency.FLEXIBLE_SPEED_SWEEP if self.plants[name].mode else frequency.SPEED_SWEEP
            return frequency.speed(drive, self._sweep(axis, sweep, SPEED_LOOP_PERIOD_S), (name,))[f'speed/{name}']
        sweep = self._sweep(axis, frequency.POSITION_SWEEP, drive.period)
        found = frequency.position(case, (name,), sweep)[f'position/{name}/{self.name}']
        # A tripped drive returns no signal.
        return found if np.isfinite(found.open_loop).all() and found.open_loop.all() else None

    def measured(self, loop, name, corner=(1.0, 1.0)):
        """Return the frequency.margins of `response`, None if the drive trips."""
        found = self.response(loop, name, corner)
        if found is None:
            return None
        # The dish holds a flexible axis at its own frequency. There |L| falls below 1 long before the crossover.
        return frequency.margins(found, above=corner[1] * self.plants[name].free_mode if loop == 'speed' else 0.0)

    def close(self, loop, name, required, set_to, fastest):
        """Return (w, rows) of the first loop, from crossover `fastest` [rad/s] down, that meets LoopRequirements.

        rows: [(name of the loop, margins)], with the smallest values in all PLANT_CORNERS if a structure is declared.
        set_to(w) sets the gains for w. Raises LoopError if no loop meets the requirements.
        """
        for w in fastest * SLOWDOWN_FACTOR**np.arange(MAX_SLOWDOWNS):
            set_to(w)
            every = []
            for corner in ((1.0, 1.0), *(PLANT_CORNERS if self.plants[name].mode else ())):
                margins = self.measured(loop, name, corner)
                every.append(margins)
                if not (margins and meets_margins(margins, required)):
                    break
            else:
                return w, [(loop, every[0]), (f'{loop}{WORST_SUFFIX}', smallest(every))][:1 + (len(every) > 1)]
        found = 'the drive trips'
        if margins:
            phase, gain = margins['phase_margin_deg'][0], margins['gain_margin_db'][0]
            found = f'it has {phase:.3g} deg and {gain:.3g} dB'
        raise LoopError(f'{self.name}, {name}: the {loop} loop cannot be closed with {required.phase_margin:g} deg '
                        f'and {required.gain_margin:g} dB: at {w / (2.0 * math.pi):.3g} Hz {found}')


def design(loops, axes, required, progress):
    """Design the loops of some axes for LoopRequirements.

    Return the rows of the table [(loop, axis, required Hz, margins)]. progress(share, text) is called for each loop.
    Raises LoopError.
    """
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
        rows.append(('current', name, current, loops.measured('current', name)))

        def set_speed(w, name=name, plant=plant):
            loops.set('adu', name, drive_gains(plant, w))
        reached[name], closed = loops.close('speed', name, required, set_speed, wanted_s)
        rows += [(loop, name, wanted_s / (2.0 * math.pi), margins) for loop, margins in closed]
    for i, name in enumerate(axes):
        progress((i + 0.5) / len(axes), f'{name}: position loop')
        plant, w_s = loops.plants[name], reached[name]
        w_p = (min(2.0 * math.pi * required.position, wanted_s / CROSSOVER_RATIO) if required.position
               else position_crossover(plant, w_s))

        def set_position(w, name=name, plant=plant, w_s=w_s):
            loops.set('acu', name, control_gains(plant, w_s, w))
        _, closed = loops.close('position', name, required, set_position, w_p)
        wanted = required.position or w_p / (2.0 * math.pi)
        rows += [(loop, name, wanted, margins) for loop, margins in closed]
    return rows


def refuse_outside(loops):
    """Raise ScenarioError if a gain is outside its range."""
    scenario.load(loops.source, [*loops.overrides, *(scenario.override(*gain) for gain in loops.gains.items())])


def table(rows, required):
    """Return lines: each loop with measured and required values."""
    width = max(20, *(len(f'{name} {loop}') for loop, name, *_ in rows))
    lines = [f'{"loop":{width}} {"required":>9} {"crossover":>10} {"bandwidth":>10} {"phase margin":>21} '
             f'{"gain margin":>20}']
    for loop, name, wanted, margins in rows:
        values = {key: value for key, (value, _) in margins.items()}
        limits = required.phase_margin, required.gain_margin
        floor = [f'(>= {limit:g})' for limit in limits] if loop != 'current' else ('', '')
        lines.append(f'{f"{name} {loop}":{width}} {wanted:6.3g} Hz {_text(values["crossover_hz"], "Hz", 10)} '
                     f'{_text(values["bandwidth_hz"], "Hz", 10)} {_text(values["phase_margin_deg"], "deg", 13)} '
                     f'{floor[0]:>7} {_text(values["gain_margin_db"], "dB", 12)} {floor[1]:>7}'.rstrip())
    return lines


def _text(value, unit, width):
    return f'{f"{value:.3g} {unit}" if math.isfinite(value) else "none":>{width}}'


def remarks(loops, rows):
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


def main(options, progress):
    """Design the loops for the options of the verb, write the parameter file and return the lines to print.

    Raises LoopError.
    """
    for name in ('filter', 'feedforward', 'runs', 'seed', 'duration'):
        if not (getattr(options, name) is None or getattr(options, name) is False):
            raise LoopError(f'--{name}: cannot be combined with --loops, which measures the plant')
    required = LoopRequirements(**{field: getattr(options, name) for name, field in REQUIREMENT_OPTIONS.items()
                                   if getattr(options, name) is not None})
    axes = AXES if options.axis == 'both' else (options.axis,)
    loops = Loops(options.source, options.param)
    file = options.output or pathlib.Path(f'{loops.name}-loops.yaml')
    if file.exists() or not file.parent.is_dir():
        raise LoopError(f'--output {file}: must be a new file in a directory that exists')
    rows = design(loops, axes, required, progress)
    loops.gains = {key: value for key, value in loops.gains.items() if key.split('.')[1] in axes}
    refuse_outside(loops)
    lines = [*table(rows, required), *remarks(loops, rows)]
    made = [f'made by: {options.command}', f'git {configuration.git_revision() or "unknown"}', *lines]
    sections = {node: {key.removeprefix(f'{node}.'): value for key, value in loops.gains.items()
                       if key.startswith(f'{node}.')} for node in ('adu', 'acu')}
    file.write_text(''.join(f'# {line}\n' for line in made) + parameter_file.text(sections))
    return [*lines, '', *(f'{name:44} {value}' for name, value in loops.gains.items()),
            f'written: {file}  (pedestal run {options.source} --params-file {file})']
