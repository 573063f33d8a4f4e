"""Methods of the servo: rates, steps, ramps, sines, standstill, and the mechanics that the motors show.

Each exercise moves one axis beside the middle of its travel, where its teeth are worn most. The error is reference
minus load encoder; the reference is the shaped one, so that a planned acceleration is no error.
"""
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from drive_law.axis_params import SPEED_LOOP_PERIOD_S, AxisParameters
from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import Bools, Degrees, Floats, Radians, RadiansPerSecond, Seconds, Times
from pedestal_common.wire.commands import Argument
from pedestal_recording import recording as recordings
from pedestal_results import metrics, tracking
from pedestal_results.intervals import half_width
from pedestal_workbench.acceptance.exercise import Action, Antenna, Exercise, Performed, Span, Track
from pedestal_workbench.acceptance.method import NEVER, Arguments, Measured, Method, of_parts
from pedestal_workbench.calibration.drive import motion_data
from pedestal_workbench.calibration.drive.motion_data import Motion

PLACE_SHARE, TRAVEL_SHARE = 0.53, 0.8   # place of the exercises in the travel, and largest share of it [-]
MARGIN_DEG, MARGIN_RATE = 1.0, 2.0      # of the envelope around angles, factor of it on rates [deg, -]
LARGEST_SHARE = 0.8     # of the shaper's rate and acceleration, for which 0 stands in an argument [-]
PART_COUNT, CYCLE_COUNT = 10, 4         # parts of a jackknife, motions forth and back
UNIFORM_SHARE = 0.475   # half width of 95 % of an evenly spread error, over the whole width of the error [-]
BEGIN_S, REST_S = 1.0, 1.0              # time of the first command of an exercise, and rest after a motion [s]
AXIS = Argument('axis', 'axis', options=AXES, default=AXES[0])


class Plan(NamedTuple):
    """The moved axis of an exercise; angles from the place of the exercises."""
    name: str
    number: int             # of the axis in AXES
    travel: Radians         # that an exercise may use
    place: tuple[Radians, Radians]  # of the exercises, of both axes
    rate: RadiansPerSecond  # largest of the shaper
    acceleration: float     # largest of the shaper [rad/s2]

    def preset(self, at: Seconds, angle: Radians, rate: RadiansPerSecond = 0.0, time: Seconds = 1.0) -> Action:
        """Return the command to go to an angle, and on from there at a rate for a time."""
        angles = list(self.place)
        angles[self.number] += angle
        move = f' {self.name}_rate={rate!r} moves={time!r}' if rate else ''
        return Action(at, 'acu', f'preset azimuth={angles[0]!r} elevation={angles[1]!r}{move}')

    def exercise(self, duration: Seconds, half: Radians, rate: RadiansPerSecond, *actions: Action,
                 start: Radians = 0.0, track: Track | None = None) -> Exercise:
        """Return the exercise that moves between the angles -half and half at up to a rate, from `start` on."""
        begin = list(self.place)
        begin[self.number] += start
        spans = [Span(math.degrees(place) - MARGIN_DEG, math.degrees(place) + MARGIN_DEG, 1.0) for place in self.place]
        around = math.degrees(half + min(rate**2 / self.acceleration, 0.05 * self.travel))
        low, high, _ = spans[self.number]
        spans[self.number] = Span(low - around, high + around, 1.0 + math.degrees(min(MARGIN_RATE * rate,
                                                                                      1.2 * self.rate)))
        return Exercise(math.ceil(duration), (spans[0], spans[1]), actions, (begin[0], begin[1]), track)

    def motions(self, way: Radians, rate: RadiansPerSecond, count: int = 1, rest: Seconds = 0.0) -> Exercise:
        """Return the exercise that moves along a way at a constant rate, forth and back in turn. rest: time between
        two motions."""
        time = way / rate
        moves = [self.preset(BEGIN_S + k * (time + rest), -0.5 * sign * way, sign * rate, time)
                 for k, sign in enumerate((1.0, -1.0) * count)][:count]
        return self.exercise(BEGIN_S + count * (time + rest), 0.5 * way, rate, *moves, start=-0.5 * way)

    def checked(self, arguments: Arguments, name: str, largest: float, unit: str) -> float:
        """Return an argument. Raises ValueError above its largest value."""
        value = float(arguments[name])
        if value > largest:
            raise ValueError(f'{name} = {value:g} {unit}: must be at most {largest:.4g} {unit} on the {self.name}')
        return value

    def rate_of(self, arguments: Arguments) -> RadiansPerSecond:
        """Return the argument `rate`, 0: LARGEST_SHARE of the largest. Raises ValueError."""
        largest = math.degrees(LARGEST_SHARE * self.rate)
        return math.radians(self.checked(arguments, 'rate', largest, 'deg/s') or largest)

    def settling(self, rate: RadiansPerSecond) -> Seconds:
        """Return the time after which the axis follows a constant rate; up to this rate the shaper catches up."""
        return 3.5 * rate / self.acceleration + 0.3


def plan(antenna: Antenna, arguments: Arguments) -> Plan:
    """Return the Plan for the argument `axis` of a method. Limits are the tighter of control unit and drive."""
    name, (low, high) = str(arguments['axis']), antenna.travel(str(arguments['axis']))
    azimuth, elevation = (lower + PLACE_SHARE * (upper - lower) for lower, upper in map(antenna.travel, AXES))
    return Plan(name, AXES.index(name), TRAVEL_SHARE * (high - low), (azimuth, elevation), antenna.rate(name),
                getattr(antenna.acu, name).shaper.acceleration)


def drive_of(antenna: Antenna, name: str) -> AxisParameters:
    """Return the drive parameters of an axis. Raises ValueError for an antenna without them."""
    if drive := antenna.drive(name):
        return drive
    raise ValueError('the parameters of the drive are not known; this method needs its gear ratio')


class Followed(NamedTuple):
    """Motion of the axis in an exercise; angles in degrees."""
    t: Times        # since the begin
    angle: Floats   # of the load encoder
    error: Floats   # reference minus angle
    uncertainty: Degrees    # of an angle, by the resolution of the encoder; 0 if not known

    @property
    def rate(self) -> Floats:
        """Rate of the angle by central differences [deg/s]."""
        return np.gradient(self.angle, self.t)

    def between(self, begin: Seconds, end: Seconds) -> Bools:
        """Return the mask of the steps between two times."""
        return (self.t >= begin) & (self.t <= end)

    def rms_error(self, begin: Seconds, end: Seconds = math.inf) -> Measured:
        """Return the rms error between two times."""
        return over_parts(self.error[self.between(begin, end)], tracking.rms).widened(self.uncertainty)


def followed(performed: Performed, arguments: Arguments) -> Followed:
    """Return the motion of the axis. Raises ValueError for a recording without reference or encoder."""
    name, bag = str(arguments['axis']), performed.recording
    if missing := recordings.missing(bag, 'joint_states', 'acu/reference'):
        raise ValueError(f'the recording holds no {missing}')
    joints = bag.table('joint_states')
    t, angle = joints['t'] - performed.begin, np.degrees(joints[f'{name}.position'])
    reference = np.degrees(recordings.at(bag, joints['t'], 'acu/reference', [f'{name}.position'])[:, 0])
    known = (t > -1e-9) & (t < performed.exercise.duration + 1e-9) & np.isfinite(angle) & np.isfinite(reference)
    if known.sum() < 2 * PART_COUNT:
        raise ValueError(f'the recording holds only {known.sum()} steps of the exercise')
    return Followed(t[known], angle[known], (reference - angle)[known], encoder_uncertainty(performed.antenna, name))


def encoder_uncertainty(antenna: Antenna, name: str) -> Degrees:
    """Return the uncertainty of an angle by the resolution of the load encoder, 0 if the resolution is not known."""
    drive = antenna.drive(name)
    return UNIFORM_SHARE * 360.0 / 2**drive.encoder.load_bits if drive else 0.0


def mean(values: Floats | list[float], uncertainty: float = 0.0) -> Measured:
    """Return the mean of values by their scatter. uncertainty: that all values share."""
    return Measured(float(np.mean(values)), half_width(np.ravel(values))).widened(uncertainty)


def over_parts(values: Floats, statistic: Callable[[Floats], float]) -> Measured:
    """Return a statistic of a stretch of values, with the jackknife over its parts. Raises ValueError."""
    if len(values) < 2 * PART_COUNT:
        raise ValueError(f'the recording holds {len(values)} steps of the motion, must be at least {2 * PART_COUNT}')
    return of_parts(np.array_split(values, PART_COUNT), statistic)


# Slew: rate, acceleration and braking.

def _slew(antenna: Antenna, arguments: Arguments) -> Exercise:
    axis = plan(antenna, arguments)
    half = 0.5 * min(4.0 * axis.rate**2 / axis.acceleration + 2.0 * axis.rate, axis.travel)
    back = BEGIN_S + 2.0 * half / axis.rate + axis.rate / axis.acceleration + 2.0
    return axis.exercise(2.0 * back, half, axis.rate, axis.preset(BEGIN_S, half), axis.preset(back, -half),
                         start=-half)


def _slews(performed: Performed, arguments: Arguments) -> tuple[Followed, list[tuple[int, int]]]:
    """Return the motion, and the steps of the middle half of the way of both slews. Raises ValueError."""
    performed.times('preset')
    motion = followed(performed, arguments)
    low, high = np.percentile(motion.angle, (0.5, 99.5))
    found = tracking.stretches(np.abs(motion.angle - 0.5 * (low + high)) < 0.25 * (high - low))
    if len(found) != 2 or high - low < MARGIN_DEG:
        raise ValueError(f'{len(found)} slews in the recording, must be 2')
    return motion, found


def _slew_rate(performed: Performed, arguments: Arguments) -> Measured:
    motion, found = _slews(performed, arguments)
    return over_parts(np.concatenate([np.abs(motion.rate[first:last]) for first, last in found]), np.mean)


def _crossing(t: Times, rate: Floats, level: float) -> Seconds:
    """Return the last time at which the rate rises through a level."""
    k = int(np.flatnonzero(rate[:-1] < level)[-1])
    return float(t[k] + (t[k + 1] - t[k]) * (level - rate[k]) / (rate[k + 1] - rate[k]))


def _acceleration(performed: Performed, arguments: Arguments) -> Measured:
    motion, found = _slews(performed, arguments)
    values, rises = [], []
    for first, last in found:
        top = np.median(np.abs(motion.rate[first:last]))
        rate = np.abs(motion.rate[:first + 1])
        rises.append(_crossing(motion.t, rate, 0.9 * top) - _crossing(motion.t, rate, 0.1 * top))
        values.append(0.8 * top / rises[-1])
    value = float(np.mean(values))
    return Measured(value, max(0.5 * float(np.ptp(values)), value * 0.5 * performed.antenna.period / min(rises)))


def _brake(antenna: Antenna, arguments: Arguments) -> Exercise:
    axis = plan(antenna, arguments)
    stop = 0.2 + axis.rate / axis.acceleration      # 0.2 s at the full rate
    half = 0.5 * axis.rate * (0.2 + 2.5 * axis.rate / axis.acceleration)
    return axis.exercise(BEGIN_S + stop + 3.0 * axis.rate / axis.acceleration + 2.0, half, axis.rate,
                         axis.preset(BEGIN_S, half), Action(BEGIN_S + stop, 'acu', 'stop'), start=-half)


def _braking_distance(performed: Performed, arguments: Arguments) -> Measured:
    motion, full = followed(performed, arguments), math.degrees(plan(performed.antenna, arguments).rate)
    at = performed.times('stop')[0]
    rate = float(np.abs(np.interp(at, motion.t, motion.rate)))
    if rate < 0.9 * full:
        raise ValueError(f'the axis stops from {rate:.4g} deg/s, must be from {full:.4g} deg/s')
    way = motion.angle[motion.t > motion.t[-1] - 0.5].mean() - np.interp(at, motion.t, motion.angle)
    return Measured(float(abs(way)), 0.5 * rate * performed.antenna.period)


# Errors of motions.

def _ramp(antenna: Antenna, arguments: Arguments) -> Exercise:
    axis = plan(antenna, arguments)
    rate = axis.rate_of(arguments)
    return axis.motions(min(rate * float(arguments['duration']), axis.travel), rate)


def _ramp_error(performed: Performed, arguments: Arguments) -> Measured:
    axis, at = plan(performed.antenna, arguments), performed.times('preset')[0]
    rate = axis.rate_of(arguments)
    return followed(performed, arguments).rms_error(
        at + axis.settling(rate), at + min(float(arguments['duration']), axis.travel / rate))


def _stand(antenna: Antenna, arguments: Arguments) -> Exercise:
    return plan(antenna, arguments).exercise(2.0 * BEGIN_S + float(arguments['duration']), 0.0, 0.0)


def _standstill_rms(performed: Performed, arguments: Arguments) -> Measured:
    return followed(performed, arguments).rms_error(2.0 * BEGIN_S)


def _sine(antenna: Antenna, arguments: Arguments) -> Exercise:
    if antenna.on_ship:
        raise ValueError('sine_error: must be ashore, because a program track moves against the motion of a ship')
    axis, f = plan(antenna, arguments), float(arguments['frequency'])
    w = 2.0 * math.pi * f
    largest = math.degrees(LARGEST_SHARE * min(axis.rate / w, axis.acceleration / w**2, 0.5 * axis.travel))
    amplitude = math.radians(axis.checked(arguments, 'amplitude', largest, 'deg') or min(largest, 1.0))
    duration = 2.0 * BEGIN_S + (1.0 + max(4.0, math.ceil(10.0 * f))) / f
    t = np.arange(0.0, duration + 2.0, min(0.02, 0.1 / w))
    angles = np.tile(axis.place, (len(t), 1))
    angles[:, axis.number] += amplitude * np.sin(w * np.maximum(t - 2.0 * BEGIN_S, 0.0))
    return axis.exercise(duration, amplitude, amplitude * w, Action(BEGIN_S, 'acu', 'program'),
                         track=Track(t, angles))


def _sine_error(performed: Performed, arguments: Arguments) -> Measured:
    performed.times('program')
    return followed(performed, arguments).rms_error(2.0 * BEGIN_S + 1.0 / float(arguments['frequency']))


def _step(antenna: Antenna, arguments: Arguments) -> Exercise:
    axis = plan(antenna, arguments)
    size = math.radians(axis.checked(arguments, 'size', math.degrees(axis.travel), 'deg'))
    time = size / axis.rate + 2.0 * math.sqrt(size / axis.acceleration) + 8.0
    return axis.exercise(2.0 * BEGIN_S + time, 0.5 * size, min(axis.rate, math.sqrt(size * axis.acceleration)),
                         axis.preset(BEGIN_S, -0.5 * size), axis.preset(2.0 * BEGIN_S, 0.5 * size), start=-0.5 * size)


def _stepped(performed: Performed, arguments: Arguments) -> tuple[Times, Floats, Degrees, Degrees]:
    """Return (times after the command, response [deg], its size [deg], noise of the encoder [deg]). Raises ValueError
    without a step. Twice the noise is at least the uncertainty of two angles and the interpolation error of an
    encoder, which no angle at rest shows."""
    motion, at = followed(performed, arguments), performed.times('preset')[1]
    reference, after = motion.angle + motion.error, motion.t >= at
    before = reference[motion.t < at][-1]
    size = float(reference[-1] - before)
    if size < 0.5 * float(arguments['size']):
        raise ValueError(f'the reference moved by {size:.4g} deg in the step, must be {arguments["size"]} deg')
    noise = float(np.std(motion.error[motion.t > motion.t[-1] - 2.0]))
    drive = performed.antenna.drive(str(arguments['axis']))
    waves = math.degrees(drive.encoder.error.interpolation) if drive else 0.0
    return (motion.t[after] - at, motion.angle[after] - before, size,
            max(noise, math.hypot(motion.uncertainty, 0.5 * waves)))


def _overshoot(performed: Performed, arguments: Arguments) -> Measured:
    _, y, size, noise = _stepped(performed, arguments)
    return Measured(metrics.overshoot_percent(y, size), 200.0 * noise / size)


SETTLED_S = 0.2     # shortest time within the band at the end of the exercise, so that noise does not count as settled


def _settling(performed: Performed, arguments: Arguments) -> Measured:
    t, y, size, noise = _stepped(performed, arguments)
    band = float(arguments['band'])
    found = [metrics.settling_time(t, y, size, max(width, noise) / size)
             for width in (band, band + 2.0 * noise, band - 2.0 * noise)]
    if not found[0] <= t[-1] - SETTLED_S:
        return NEVER
    value, *around = (float(t[-1]) if math.isnan(each) else each for each in found)
    return Measured(value, max(0.5 * performed.antenna.period, *(abs(each - value) for each in around)))


REVERSAL_S, REVERSAL_COUNT = 4.0, 6     # time between two reversals [s], and their number
GUST_S = 3.0    # length of a gust and of the rest after it [s]


def _peaks(command: str, dropped: int, time: Seconds) -> Callable[[Performed, Arguments], Measured]:
    """Return the measure of the mean of the largest errors within a time after each of the actions with a command.
    dropped: number of first actions that do not count."""
    def measure(performed: Performed, arguments: Arguments) -> Measured:
        motion = followed(performed, arguments)
        peaks = [metrics.peak(motion.error[motion.between(at, at + time)])
                 for at in performed.times(command)[dropped:]]
        return mean(peaks, motion.uncertainty)
    return measure


def _reversals(antenna: Antenna, arguments: Arguments) -> Exercise:
    axis = plan(antenna, arguments)
    rate = axis.rate_of(arguments)
    return axis.motions(rate * REVERSAL_S, rate, 1 + REVERSAL_COUNT)


def _gusts(antenna: Antenna, arguments: Arguments) -> Exercise:
    axis, drive = plan(antenna, arguments), drive_of(antenna, str(arguments['axis']))
    torque = axis.checked(arguments, 'torque', 0.3 * drive.gear_train.ratio * (
        drive.motor_1.torque_limit + drive.motor_2.torque_limit), 'Nm')
    gusts = [Action(2.0 * BEGIN_S + 2.0 * k * GUST_S, 'adu', f'gust axis={axis.name} torque={sign * torque!r} '
                    f'duration={GUST_S}') for k, sign in enumerate((1.0, -1.0, 1.0, -1.0))]
    return axis.exercise(2.0 * BEGIN_S + 8.0 * GUST_S, 0.0, math.radians(5.0), *gusts)


# Mechanics, by motors and load encoder.

def _mechanics(antenna: Antenna, arguments: Arguments) -> Exercise:
    axis = plan(antenna, arguments)
    drive_of(antenna, axis.name)
    rate = axis.rate_of(arguments)
    return axis.motions(min(5.0 * rate, axis.travel), rate, 2 * CYCLE_COUNT, REST_S)


def _pinion_turn(antenna: Antenna, arguments: Arguments) -> Exercise:
    axis = plan(antenna, arguments)
    way = 1.2 * 2.0 * math.pi / drive_of(antenna, axis.name).gear_train.pinion_ratio
    if way > axis.travel:
        raise ValueError(f'a turn of the pinion needs {math.degrees(way):.4g} deg of the {axis.name}: must be at most '
                         f'{math.degrees(axis.travel):.4g} deg')
    return axis.motions(way, axis.rate_of(arguments), 2, REST_S)


def _per_way(performed: Performed, arguments: Arguments, of: Callable[[Motion], Floats],
             statistic: Callable[[Floats], float] = np.mean) -> Floats:
    """Return a statistic of a number `of` the motion, at the constant rate of each way (cycles, 2), forth and back.
    Each way has the same angles, without those in which the axis accelerates. Raises ValueError."""
    axis, actions = plan(performed.antenna, arguments), performed.exercise.actions
    motion = motion_data.read(performed.recording, axis.name, drive_of(performed.antenna, axis.name))
    rate, begins = axis.rate_of(arguments), performed.times('preset')
    way = rate * (actions[1].at - actions[0].at - REST_S)
    inside = np.abs(motion.theta - axis.place[axis.number]) < 0.5 * way - min(0.3 * way, rate * axis.settling(rate))
    t, values, found = motion.t - performed.begin, of(motion), []
    for begin, end in zip(begins, (*begins[1:], performed.exercise.duration)):
        part = inside & (t > begin) & (t < end)
        if part.sum() < PART_COUNT:
            raise ValueError(f'the recording does not hold the motion of the {axis.name} forth and back')
        found.append(statistic(values[part]))
    return np.reshape(found, (-1, 2))


def _apart(motion: Motion) -> Floats:
    """Return the angle from motor 2 to motor 1, on the load axis [deg]."""
    return np.degrees(motion.motor_angle[:, 0] - motion.motor_angle[:, 1])


def _lash(performed: Performed, arguments: Arguments) -> Measured:
    return mean(_per_way(performed, arguments, _apart), _apart_uncertainty(performed, arguments))


def _apart_uncertainty(performed: Performed, arguments: Arguments) -> Degrees:
    """Return the uncertainty of `_apart` by the resolution of both motor encoders."""
    drive = drive_of(performed.antenna, str(arguments['axis']))
    return UNIFORM_SHARE * 360.0 / 2**drive.encoder.motor_bits / drive.gear_train.ratio * math.sqrt(2.0)


def _bias(performed: Performed, arguments: Arguments) -> Measured:
    """Return the bias torque. A count of a motor encoder in a period is a rate, to which the speed loop replies by a
    torque; this torque, for half of the difference of two motors, is the least uncertainty."""
    drive = drive_of(performed.antenna, str(arguments['axis']))
    count = 2.0 * math.pi / 2**drive.encoder.motor_bits * drive.speed_loop.proportional / SPEED_LOOP_PERIOD_S
    return mean(_per_way(performed, arguments, lambda motion: 0.5 * (motion.motor_torque @ (1.0, -1.0))),
                UNIFORM_SHARE * count / math.sqrt(2.0))


def _friction(performed: Performed, arguments: Arguments) -> Measured:
    ratio = drive_of(performed.antenna, str(arguments['axis'])).gear_train.ratio
    return mean(_per_way(performed, arguments, lambda motion: ratio * motion.motor_torque.sum(axis=1)) @ (0.5, -0.5))


def _encoder_lag(performed: Performed, arguments: Arguments) -> Measured:
    behind = _per_way(performed, arguments, lambda motion: motion.motor_angle.mean(axis=1) - motion.theta)
    axis = plan(performed.antenna, arguments)
    rate, uncertainty = axis.rate_of(arguments), math.radians(encoder_uncertainty(performed.antenna, axis.name))
    return mean(1e3 * (behind @ (0.5, -0.5)) / rate, 1e3 * uncertainty / rate)


def _tooth_error(performed: Performed, arguments: Arguments) -> Measured:
    peaks = _per_way(performed, arguments, _apart, lambda x: metrics.peak(x - np.median(x)))
    return Measured(float(peaks.max()), math.hypot(0.5 * float(np.ptp(peaks)),
                                                   _apart_uncertainty(performed, arguments)))


def _rate(default: float) -> Argument:
    return Argument('rate', f'rate; 0: {100.0 * LARGEST_SHARE:g} % of the largest', 0.0, 360.0, 'deg/s',
                    default=default)


def _duration(default: Seconds) -> Argument:
    return Argument('duration', 'duration, less where the travel ends it', 5.0, 3600.0, 's', default=default)


SIZE = Argument('size', 'size of the step', 1e-3, 180.0, 'deg', default=1.0)

METHODS = (
    Method('slew_rate', 'rate of a slew to a distant preset, forth and back', 'deg/s', '>=', (AXIS,), _slew,
           _slew_rate),
    Method('acceleration', 'acceleration of a slew, from 10 to 90 % of its rate', 'deg/s2', '>=', (AXIS,), _slew,
           _acceleration),
    Method('braking_distance', 'distance from the command `stop` at the largest rate to rest', 'deg', '<=', (AXIS,),
           _brake, _braking_distance),
    Method('ramp_error', 'rms following error at a constant rate', 'deg', '<=', (AXIS, _rate(1.0), _duration(12.0)),
           _ramp, _ramp_error),
    Method('sine_error', 'rms following error in a sine, a program track; ashore only', 'deg', '<=', (
        AXIS, Argument('frequency', 'frequency', 0.01, 5.0, 'Hz', default=0.1),
        Argument('amplitude', 'amplitude; 0: 1 deg, or less by rate and acceleration', 0.0, 45.0, 'deg',
                 default=0.0)), _sine, _sine_error),
    Method('step_overshoot', 'overshoot of the load encoder after a step of the preset', '%', '<=', (AXIS, SIZE),
           _step, _overshoot),
    Method('step_settling', 'time after a step of the preset until the load encoder stays within a band', 's', '<=', (
        AXIS, SIZE, Argument('band', 'half width of the band', 1e-4, 10.0, 'deg', default=0.01)), _step, _settling),
    Method('standstill_rms', 'rms error at rest', 'deg', '<=', (AXIS, _duration(60.0)), _stand, _standstill_rms),
    Method('creep_rms', 'rms error at a very low rate', 'deg', '<=', (AXIS, _rate(0.005), _duration(60.0)), _ramp,
           _ramp_error),
    Method('reversal_error', 'mean of the largest errors after six reversals of a rate', 'deg', '<=',
           (AXIS, _rate(0.1)), _reversals, _peaks('preset', 1, 0.75 * REVERSAL_S)),
    Method('gust_error', 'mean of the largest errors after the begin of four injected gusts', 'deg', '<=', (
        AXIS, Argument('torque', 'torque of the gust', 1.0, 1e5, 'Nm', default=1000.0)), _gusts,
        _peaks('gust', 0, GUST_S)),
    Method('lash', 'angle between both motors at the load while they pull against each other: lash and wind-up',
           'deg', '<=', (AXIS, _rate(0.2)), _mechanics, _lash),
    Method('bias', 'torque with which both motors pull against each other, on the motor shaft', 'Nm', '>=',
           (AXIS, _rate(0.2)), _mechanics, _bias),
    Method('friction', 'torque of both motors at the load that a constant rate needs, half of forth minus back', 'Nm',
           '<=', (AXIS, _rate(1.0)), _mechanics, _friction),
    Method('tooth_error', 'largest excursion of a motor against the other over a turn of the pinions', 'deg', '<=',
           (AXIS, _rate(4.0)), _pinion_turn, _tooth_error),
    Method('encoder_lag', 'age of the load encoder against the motor encoders, from a constant rate both ways', 'ms',
           '<=', (AXIS, _rate(0.0)), _mechanics, _encoder_lag))
