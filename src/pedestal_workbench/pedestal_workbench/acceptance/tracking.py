"""Methods of tracking: pointing in autotrack and program, acquisition, a fade, and the slopes of the receiver.

The argument `target` is `own`, the target of the scenario as it is, or a simulated one:

    beacon      stands still at the arguments azimuth and elevation
    pass        a satellite that culminates in the middle of the exercise
    manoeuvre   moves as a sine about this place on both axes, with the argument acceleration

The program track of a simulated target has no error. The level of beacon and manoeuvre does not depend on the range.
"""
import itertools
import math

import numpy as np

from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import Bools, Floats, Json, Pairs, Radians, Seconds, Times
from pedestal_common.wire.commands import Argument
from pedestal_results import intervals, tracking
from pedestal_results.recorded_run import RecordedRun
from pedestal_results.results import RESULT_BY_NAME
from pedestal_workbench.acceptance.exercise import Action, Antenna, Exercise, Performed, Span
from pedestal_workbench.acceptance.method import NEVER, Arguments, Measured, Method, of_parts
from pedestal_workbench.calibration import collect, predicted
from pedestal_workbench.calibration.receiver import beacon_offsets, matrix

RECEIVER = 'tracking_receiver'
RATE_MARGIN = 1.1   # largest permitted rate of an axis over its largest rate command [-]
BLOCK_COUNT = 16    # number of blocks of the jackknife
MIN_CORRELATION, MAX_CORRELATION = 0.25, 0.8    # of neighbouring blocks, as the uncertainty takes it [-]
ACTION_TIME_S = 10.0    # time of the first action in autotrack [s]
MANOEUVRE_FREQUENCY_HZ = 0.05   # frequency of the manoeuvre [Hz]
TARGET_RANGE_M = 3.6e7  # range of beacon and manoeuvre [m]; from a ship under way, it hides the motion of the ship
POINT_TIME_S, CIRCLE_POINTS = 2.5, 8        # time at each offset about the beacon [s]; points of the circle
CROSS_BEAMWIDTHS = (0.2, -0.2, 0.1, -0.1)   # offsets about the beacon on each axis [beamwidths]
CROSS_TALK = 'cross-talk'
CHANNELS = {'cross-elevation': (0, 0), 'elevation': (1, 1), CROSS_TALK: (0, 1)}     # row and column of the slopes
TIME_STEPS = 2.0                # uncertainty of a time: its begin and its end are known to a step each [steps]


def _target(*options: str) -> Argument:
    return Argument('target', 'target that the antenna follows', options=options, default=options[0])


_DURATION = Argument('duration', 'duration of the exercise', 15.0, 3600.0, 's', default=40.0)
_PLACE = (Argument('azimuth', 'azimuth of beacon or manoeuvre', -360.0, 360.0, 'deg', default=0.0),
          Argument('elevation', 'elevation of beacon or manoeuvre', 0.0, 90.0, 'deg', default=35.0))


def travel(antenna: Antenna) -> tuple[Span, Span]:
    """Return the envelope of the whole travel of the axes, with their largest rates."""
    azimuth, elevation = (Span(*map(math.degrees, (*antenna.travel(axis), RATE_MARGIN * getattr(
        antenna.acu, axis).limits.rate))) for axis in AXES)
    return azimuth, elevation


def inside(antenna: Antenna, name: str, axis: str, angle: float) -> Radians:
    """Return an angle [deg] of an axis in radians. Raises ValueError for an angle outside the travel. name: of the
    argument from which it follows."""
    span = travel(antenna)[AXES.index(axis)]
    if not span.low <= angle <= span.high:
        raise ValueError(f'{name}: {axis} {angle:g} deg must be {span.low:g} to {span.high:g} deg, its travel')
    return math.radians(angle)


def place(antenna: Antenna, arguments: Arguments) -> tuple[Radians, Radians]:
    """Return the place of the arguments azimuth and elevation. Raises ValueError outside the travel."""
    azimuth, elevation = (inside(antenna, axis, axis, float(arguments[axis])) for axis in AXES)
    return azimuth, elevation


def _amplitude(antenna: Antenna, arguments: Arguments) -> Radians:
    """Return the amplitude of the manoeuvre. Raises ValueError where an axis cannot follow it."""
    w = 2.0 * math.pi * MANOEUVRE_FREQUENCY_HZ
    acceleration = math.radians(float(arguments['acceleration']))
    largest = min(min(limit.acceleration, limit.rate * w)
                  for limit in (antenna.acu.azimuth.shaper, antenna.acu.elevation.shaper))
    if acceleration > largest:
        raise ValueError(f'acceleration = {arguments["acceleration"]} deg/s2: must be at most '
                         f'{math.degrees(largest):.4g} deg/s2, which both axes can follow')
    for axis, sign in itertools.product(AXES, (-1.0, 1.0)):
        inside(antenna, 'acceleration', axis, float(arguments[axis]) + sign * math.degrees(acceleration / w**2))
    return acceleration / w**2


def simulated(antenna: Antenna, arguments: Arguments) -> dict[str, Json]:
    """Return {'node.key': value} for a target. Raises ValueError for a target that the antenna cannot have."""
    target = arguments['target']
    if target == 'own':
        return {}
    if RECEIVER not in antenna.simulated:
        raise ValueError(f'target = {target}: must be own, because this antenna has no simulated target')
    found: dict[str, Json] = {f'scenario.program.{name}_offset': 0.0 for name in ('time', *AXES)}
    of_target = f'{RECEIVER}.target'
    if target == 'pass':
        return {**found, f'{of_target}.kind': 'leo_pass', f'{of_target}.leo_pass.start_time': ''}
    amplitude = _amplitude(antenna, arguments) if target == 'manoeuvre' else 0.0
    for axis, angle in zip(AXES, place(antenna, arguments)):
        found |= {f'{of_target}.angle.{axis}': angle, f'{of_target}.angle.{axis}_amplitude': amplitude,
                  f'adu.initial_{axis}': angle}
    return {**found, f'{RECEIVER}.receiver.range_exponent': 0.0, f'{of_target}.kind': 'sine',
            f'{of_target}.angle.range': TARGET_RANGE_M, f'{of_target}.angle.frequency': MANOEUVRE_FREQUENCY_HZ}


def _follow(antenna: Antenna, arguments: Arguments, *actions: Action, handover: bool = True,
            alarms: tuple[str, ...] = ()) -> Exercise:
    """Return the exercise that follows a target from its begin. handover: from program to autotrack."""
    changes = simulated(antenna, arguments)
    return Exercise(float(arguments['duration']), travel(antenna), actions, alarms=alarms,
                    changes=changes if handover else {**changes, 'acu.tracker.handover': False})


def _program(antenna: Antenna, arguments: Arguments) -> Exercise:
    if RECEIVER not in antenna.simulated:
        raise ValueError('program_rms: must have a simulated receiver, which states the true direction of its target')
    return _follow(antenna, arguments, handover=False)


def _acquisition(antenna: Antenna, arguments: Arguments) -> Exercise:
    """Return the exercise that stops the antenna, so that the target leaves the beam, and then commands `program`."""
    return _follow(antenna, arguments, Action(ACTION_TIME_S, 'acu', 'stop'),
                   Action(ACTION_TIME_S + float(arguments['pause']), 'acu', 'program'))


def _fade(antenna: Antenna, arguments: Arguments) -> Exercise:
    command = f'fade depth={arguments["depth"]} duration={arguments["fade"]}'
    return _follow(antenna, arguments, Action(ACTION_TIME_S, RECEIVER, command), alarms=('signal lost', 'diverged'))


def _offsets(antenna: Antenna, arguments: Arguments) -> Exercise:
    """Return the exercise of `preset` at offsets about a beacon: a cross, and the circle of the verification."""
    if antenna.on_ship:
        raise ValueError('receiver_slope: must be ashore, because the offsets contain the attitude of a ship')
    circle = [(beacon_offsets.CIRCLE_BEAMWIDTHS * math.cos(angle), beacon_offsets.CIRCLE_BEAMWIDTHS * math.sin(angle))
              for angle in np.arange(CIRCLE_POINTS) * 2.0 * math.pi / CIRCLE_POINTS]
    offsets = [*((x, 0.0) for x in CROSS_BEAMWIDTHS), *((0.0, y) for y in CROSS_BEAMWIDTHS), *circle]
    azimuth, elevation = start = place(antenna, arguments)
    changes = {key: value for key, value in simulated(antenna, arguments).items() if not key.startswith('adu.')}
    actions = [Action((1 + i) * POINT_TIME_S, 'acu', f'preset azimuth={azimuth + x / math.cos(elevation):.7f} '
                      f'elevation={elevation + y:.7f}') for i, (x, y) in enumerate(np.array(offsets)
                                                                                   * antenna.beamwidth)]
    return Exercise((1 + len(offsets)) * POINT_TIME_S, travel(antenna), tuple(actions), start, changes=changes)


def _by_correlation(values: Floats) -> float:
    """Return the factor sqrt((1 + r) / (1 - r)) by which a half width grows, because neighbouring blocks may be
    correlated. r is the correlation of successive pseudo-values. Because r of BLOCK_COUNT values is itself uncertain
    by MIN_CORRELATION, r is at least that."""
    rest = values - values.mean()
    r = min(max(float(rest[1:] @ rest[:-1] / (rest @ rest)), MIN_CORRELATION), MAX_CORRELATION)
    return math.sqrt((1.0 + r) / (1.0 - r))


def _of_blocks(errors: Pairs, value: float) -> Measured:
    """Return an rms of errors in the order of time with its uncertainty, by the jackknife over blocks."""
    return of_parts(np.array_split(errors, BLOCK_COUNT), tracking.known_rms, _by_correlation)._replace(value=value)


def _autotrack_rms(performed: Performed, _: Arguments) -> Measured:
    run = RecordedRun(performed.recording)
    found, name = run.evaluated, 'measured_pointing_rms_deg' if run.no_truth else 'pointing_rms_deg'
    if not found.tracking.any():
        raise ValueError('the recording holds no settled autotrack')
    errors = found.measured[found.tracking] if run.no_truth else found.true
    return _of_blocks(errors * tracking.DEG_PER_RAD, RESULT_BY_NAME[name].measure(found))


def _program_rms(performed: Performed, _: Arguments) -> Measured:
    errors = RecordedRun(performed.recording).parts.get('program')
    if not isinstance(errors, np.ndarray):
        raise ValueError('the recording holds no settled program with the truth of the target')
    return _of_blocks(errors, RESULT_BY_NAME['program_pointing_rms_deg'].measure(errors))


def _pointing_offset(performed: Performed, _: Arguments) -> Measured:
    return of_mean(collect.points(performed.recording, predicted.programs(performed.recording))[2])


def of_mean(offsets: Pairs) -> Measured:
    """Return the length of the mean of offsets (n, 2), without the bias by their noise.

        length = sqrt(max(|mean|^2 - s^2 / n, 0))

        s^2     variance of the offsets, of both directions together

    The bias |mean| - length is a part of the uncertainty, so that the interval also covers an offset of 0.
    Raises ValueError for less than two offsets.
    """
    if len(offsets) < 2:
        raise ValueError('the recording holds one offset, must be at least 2')
    mean, noise = offsets.mean(axis=0), offsets.std(axis=0, ddof=1) / math.sqrt(len(offsets))
    size = math.hypot(*mean)
    length = math.sqrt(max(size**2 - float(noise @ noise), 0.0))
    halves = [intervals.half_width(column) for column in offsets.T]
    return Measured(length, math.hypot(*(mean * halves)) / size + size - length)


def first(performed: Performed, since: Seconds, t: Times, met: Bools) -> Measured:
    """Return the time from a time since the begin of the exercise to the first of the times t that meets a condition.
    """
    times = t[(t >= performed.begin + since) & met]
    return Measured(float(times[0]) - (performed.begin + since),
                    TIME_STEPS * performed.antenna.period) if times.size else NEVER


def _acquisition_time(performed: Performed, _: Arguments) -> Measured:
    run = RecordedRun(performed.recording).evaluated
    return first(performed, performed.times('program')[-1], run.t, run.mode == 'autotrack')


def _fade_recovery(performed: Performed, arguments: Arguments) -> Measured:
    run, end = RecordedRun(performed.recording).evaluated, float(arguments['fade'])
    return first(performed, performed.times('fade')[-1] + end, run.t,
                 (run.mode == 'autotrack') & np.isfinite(run.measured[:, 0]))


def _slope(performed: Performed, arguments: Arguments) -> Measured:
    """Return a slope of the errors as the control unit uses them."""
    performed.times('preset')
    points, channel = beacon_offsets.read(performed.recording), arguments['channel']
    corrected = points.errors @ tracking.error_matrix(performed.recording).T
    slopes = matrix.fit(points.offsets[points.fitted], corrected[points.fitted])
    row, column = CHANNELS[str(channel)]
    if channel == CROSS_TALK and abs(slopes.C[column, row]) > abs(slopes.C[row, column]):
        row, column = column, row
    return Measured(float(slopes.C[row, column]), float(slopes.half[row, column]))


_TRACKED = (_target('pass', 'beacon', 'own'), *_PLACE, _DURATION)
METHODS = (
    Method('autotrack_rms', 'follow a target in autotrack: rms pointing error of both axes together, against the '
           'truth of the target or, without truth, by the receiver', 'deg', '<=',
           (_target('beacon', 'pass', 'manoeuvre', 'own'), *_PLACE, _DURATION,
            Argument('acceleration', 'largest acceleration of the manoeuvre', 1e-3, 100.0, 'deg/s2', default=0.1)),
           _follow, _autotrack_rms),
    Method('program_rms', 'follow a target by its program track: rms pointing error of both axes together', 'deg',
           '<=', _TRACKED, _program, _program_rms),
    Method('pointing_offset', 'follow a target in autotrack: mean of its direction, by encoders and receiver, less '
           'its program track', 'deg', '<=', _TRACKED, _follow, _pointing_offset),
    Method('acquisition_time', 'stop beside a target, then command `program`: time to autotrack', 's', '<=',
           (*_TRACKED, Argument('pause', 'time in mode stop', 0.5, 60.0, 's', default=1.0)),
           _acquisition, _acquisition_time),
    Method('fade_recovery', 'let the signal fade in autotrack: time after the fade to autotrack with a locked '
           'receiver', 's', '<=',
           (_target('own', 'pass', 'beacon'), *_TRACKED[1:],
            Argument('fade', 'duration of the fade', 0.1, 60.0, 's', default=4.0),
            Argument('depth', 'loss of level', 0.0, 200.0, 'dB', default=30.0)), _fade, _fade_recovery),
    Method('receiver_slope', 'point beside a beacon by `preset`: slope of a receiver channel or larger cross-talk, as '
           'corrected by the control unit; ashore only', '1', '+-',
           (_target('beacon', 'own'), *_PLACE,
            Argument('channel', 'channel of the receiver', options=tuple(CHANNELS), default='elevation')),
           _offsets, _slope))
