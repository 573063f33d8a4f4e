"""Methods of safety: limits of travel, stow, emergency stop, and the reports of injected faults.

The faults of the methods are FAULTS. A loss of the receiver or of the INS has two forms: with `nan` the messages come
without valid numbers, with `drop` no message comes. Because a lockstep graph would wait for the message, a graph of
acceptance with such a `drop` runs in realtime. The loss of the commands is adu.drop. These faults are left out:

    clock_step, delay   would stop a lockstep graph, and do not lose a message
    adu.delay       can make the position loop unstable
    adu.pin_stuck   has an effect in stow only, and leaves a pin half in
    adu.gust, adu.lost_tooth    belong to the methods of the servo: gust, lash
    ship_motion.freeze, bias, noise    have an effect only on an INS that navigates with the data of the IMU
"""
import dataclasses
import functools
import math

import numpy as np

from acu_tracker.alarms.table import ALARM_NAMES
from acu_tracker.guidance.manual import ACCELERATION_SHARE, RATE_REQUEST_TIMEOUT_S
from acu_tracker.mode.stow import MAX_REST_RATE_RAD_S
from acu_tracker.servo.travel import braking_distance
from pedestal_common.graph.nodes import DRIVE_NODE
from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import Floats, Seconds, Times
from pedestal_common.wire.commands import Argument
from pedestal_recording import recording as recordings
from pedestal_results import tracking
from pedestal_results.recorded_run import RecordedRun
from pedestal_workbench.acceptance.exercise import Action, Antenna, Exercise, Performed
from pedestal_workbench.acceptance.method import NEVER, Arguments, Measured, Method
from pedestal_workbench.acceptance.servo import AXIS, BEGIN_S, encoder_uncertainty, plan
from pedestal_workbench.acceptance.tracking import TIME_STEPS, first, inside, travel

REST_TIME_S = 3.0               # time until an axis has come to rest [s]
LARGEST_OVERSHOOT_DEG = 1.0     # angle beyond a limit of travel at which the exercise is stopped [deg]
BEYOND_RAD = 0.1                # angle of the refused preset beyond the limit [rad]
CRUISE_TIME_S = 0.5             # time at the largest rate before a limit or an emergency stop [s]
EMERGENCY_STOP, RESET_FAULTS = 'adu/emergency_stop', 'adu/reset_faults'     # requests of the drive
RETURN_DEG = 1.0                # way back from a limit after which the axis has returned [deg]
STANDSTILL_SHARE = 0.02         # rate below which an axis stands after an emergency stop, over its rate before [-]
FAULT_TIME_S, RECOVERY_TIME_S = 10.0, 5.0   # time of the begin of a fault, and time after its end [s]
ENVELOPE_DEG = 10.0             # of a fault outside autotrack, about the motion [deg]
MIN_RATE_SHARE = 0.9            # least share of the largest rate at an emergency stop [-]
RAMP_DEG_S = 1.0                # rate of the azimuth in the mode `ramp` of a fault [deg/s]
REPORT_TOPICS = 'acu/alarms', 'acu/mode', 'adu/state'   # whose changes report a fault
TARGET_MODES = 'autotrack', 'program', 'tle', 'search', 'acquire'   # modes with an error towards the target

ANY_MODE = 'preset', 'ramp', 'autotrack'
MOVING, TRACKING = ANY_MODE[1:], ANY_MODE[2:]
FAULTS = {
    **dict.fromkeys(('adu.motor_loss', 'adu.encoder_jump', 'adu.bias', 'adu.nan', 'adu.noise'), ANY_MODE),
    **dict.fromkeys(('adu.encoder_stuck', 'adu.brake_stuck', 'adu.drop', 'adu.freeze'), MOVING),
    **{f'{node}.{name}': TRACKING for node, names in {
        'tracking_receiver': ('drop', 'freeze', 'nan', 'fade', 'wrong_slope', 'phase_180', 'bias', 'noise'),
        'ship_motion': ('drop', 'nan'),
        'ins': ('drop', 'freeze', 'nan', 'noise', 'ins_jump', 'bias')}.items() for name in names}}
"""{'NODE.FAULT': modes in which it has an effect} of the faults that an acceptance provokes. Noise and bias have no
report except that of adu.bias and ins.noise; fault_error is for them."""


def _limit(antenna: Antenna, arguments: Arguments) -> Exercise:
    """Return the exercise that drives an axis into a limit, first by a refused preset, and then by rate. The opposite
    rate brings the axis back."""
    planned, sign = plan(antenna, arguments), 1.0 if arguments['side'] == 'high' else -1.0
    axis, i, rate, start = planned.name, planned.number, planned.rate, list(planned.place)
    (low, high), deceleration = antenna.travel(axis), getattr(antenna.acu, axis).limits.deceleration
    end = high if sign > 0.0 else low
    rise = rate / (ACCELERATION_SHARE * planned.acceleration)
    way = min(rate * (0.5 * rise + CRUISE_TIME_S) + braking_distance(rate, deceleration, antenna.acu.reaction),
              0.5 * (high - low))
    start[i] = end - sign * way
    back = 2.0 * BEGIN_S + rise + way / rate + REST_TIME_S
    finish = back + rise + CRUISE_TIME_S
    actions = [Action(BEGIN_S, 'acu', f'preset {axis}={end + sign * BEYOND_RAD:.6f}'),
               *(Action(t, 'acu', f'rate {axis}={(sign if t < back else -sign) * rate:.6f}')
                 for t in np.arange(2.0 * BEGIN_S, finish, 0.5 * RATE_REQUEST_TIMEOUT_S).tolist()),
               Action(finish, 'acu', 'stop')]
    spans = list(travel(antenna))
    spans[i] = spans[i]._replace(low=spans[i].low - LARGEST_OVERSHOOT_DEG, high=spans[i].high + LARGEST_OVERSHOOT_DEG)
    return Exercise(finish + REST_TIME_S, (spans[0], spans[1]), tuple(actions), (start[0], start[1]),
                    alarms=(f'{axis} at limit',))


def _beyond(performed: Performed, arguments: Arguments) -> tuple[Times, Floats]:
    """Return (times, angles beyond the limit [deg]). Raises ValueError if the axis did not come near the limit."""
    performed.times('rate')
    joints, axis = performed.recording.table('joint_states'), str(arguments['axis'])
    (low, high), angle = performed.antenna.travel(axis), joints[f'{axis}.position']
    beyond = np.degrees(angle - high if arguments['side'] == 'high' else low - angle)
    if not np.nanmax(beyond, initial=-math.inf) > -RETURN_DEG:
        raise ValueError(f'the {axis} stayed more than {RETURN_DEG:g} deg away from its limit')
    return joints['t'], beyond


def _limit_overshoot(performed: Performed, arguments: Arguments) -> Measured:
    return Measured(float(_beyond(performed, arguments)[1].max()),
                    encoder_uncertainty(performed.antenna, str(arguments['axis'])))


def _limit_return(performed: Performed, arguments: Arguments) -> Measured:
    rates = [done for done in performed.executed if done.action.command.startswith('rate ')]
    opposite = next(done for done in rates if done.action.command != rates[0].action.command)
    t, beyond = _beyond(performed, arguments)
    return first(performed, opposite.t, t, beyond < -RETURN_DEG)


def _stow(antenna: Antenna, arguments: Arguments) -> Exercise:
    """Return the exercise that stows the antenna from a distance, and unstows it."""
    start, slew = [], 0.0
    for axis, place in zip(AXES, plan(antenna, {'axis': AXES[0]}).place):
        of_axis = getattr(antenna.acu, axis)
        way = math.copysign(math.radians(float(arguments['distance'])), place - of_axis.stow)
        start.append(inside(antenna, 'distance', axis, math.degrees(of_axis.stow + way)))
        slew = max(slew, abs(way) / of_axis.shaper.rate + 2.0 * of_axis.shaper.rate / of_axis.shaper.acceleration)
    pins = {'adu.stow_pins': True, **{f'adu.pins.{axis}': getattr(antenna.acu, axis).stow for axis in AXES}}
    simulated = arguments['pins'] == 'simulated'
    if simulated and DRIVE_NODE not in antenna.simulated:
        raise ValueError('pins = simulated: must be own, because this antenna has no simulated drive')
    stow, rest = Action(BEGIN_S, 'acu', 'stow'), BEGIN_S + slew + REST_TIME_S
    if not simulated and not antenna.acu.stow_pins:
        return Exercise(rest, travel(antenna), (stow,), (start[0], start[1]))
    unstow = rest + antenna.acu.stow_timeout
    return Exercise(unstow + antenna.acu.stow_timeout, travel(antenna), (stow, Action(unstow, 'acu', 'unstow')),
                    (start[0], start[1]), changes=pins if simulated else {})


def _unstow(antenna: Antenna, arguments: Arguments) -> Exercise:
    if arguments['pins'] == 'own' and not antenna.acu.stow_pins:
        raise ValueError('unstow_time: must have stow pins; this antenna has none (acu.stow_pins)')
    return _stow(antenna, arguments)


def _pins(performed: Performed, command: str, state: str) -> Measured:
    """Return the time from a command until both pins have a state."""
    states = performed.recording.table('adu/stow_pins')
    wanted = ', '.join(f'{axis} {state}' for axis in AXES)
    return first(performed, performed.times(command)[-1], np.array(states['t']),
                 np.array([text == wanted for text in states['data']]))


def _stow_time(performed: Performed, _: Arguments) -> Measured:
    """Return the time from `stow` until the pins are in or, without pins, until the axes rest at their stow angles."""
    if 'adu/stow_pins' in performed.recording.topics:
        return _pins(performed, 'stow', 'in')
    begin, acu = performed.begin + performed.times('stow')[-1], performed.antenna.acu
    joints = performed.recording.table('joint_states')
    outside = np.logical_or.reduce([
        (np.abs(joints[f'{axis}.position'] - getattr(acu, axis).stow) > acu.stow_window)
        | (np.abs(joints[f'{axis}.velocity']) > MAX_REST_RATE_RAD_S) for axis in AXES])
    if outside[-1]:
        return NEVER
    last = joints['t'][outside & (joints['t'] >= begin)].max(initial=begin)
    return Measured(float(last) - begin, TIME_STEPS * performed.antenna.period)


def _unstow_time(performed: Performed, _: Arguments) -> Measured:
    return _pins(performed, 'unstow', 'out')


def _emergency(antenna: Antenna, arguments: Arguments) -> Exercise:
    """Return the exercise of an emergency stop of an axis at its largest rate, in the middle of its travel."""
    axis = plan(antenna, arguments)
    rise = axis.rate / axis.acceleration
    if (least := axis.rate * (1.5 * rise + CRUISE_TIME_S)) > axis.travel:
        raise ValueError(f'axis = {axis.name}: {math.degrees(axis.travel):.4g} deg of its travel are too short for '
                         f'its largest rate, must be at least {math.degrees(least):.4g} deg')
    half, stop = 0.5 * axis.travel, BEGIN_S + rise + CRUISE_TIME_S
    actions = (axis.preset(BEGIN_S, half), Action(stop, DRIVE_NODE, EMERGENCY_STOP),
               Action(stop + REST_TIME_S, DRIVE_NODE, RESET_FAULTS), Action(stop + 2.0 * REST_TIME_S, 'acu', 'stop'))
    made = axis.exercise(stop + 3.0 * REST_TIME_S, half, axis.rate, *actions, start=-half)
    return dataclasses.replace(made, alarms=('emergency stop', f'{axis.name} following error'))


def _stopping(part: str, performed: Performed, arguments: Arguments) -> Measured:
    """Return time or angle from the emergency stop to the standstill of the axis. The angle counts from the step
    before the request. Because the request acts within a step, the angle is uncertain by the way of a step."""
    begin, joints = performed.begin + performed.times(EMERGENCY_STOP)[-1], performed.recording.table('joint_states')
    axis, full = str(arguments['axis']), performed.antenna.rate(str(arguments['axis']))
    during = (joints['t'] > begin - 1.5 * performed.antenna.period) & (joints['t'] < begin + REST_TIME_S)
    t, rate, angle = (joints[name][during] for name in ('t', f'{axis}.velocity', f'{axis}.position'))
    if not np.abs(rate[:1]).sum() > MIN_RATE_SHARE * full:
        raise ValueError(f'the {axis} did not move at its largest rate, {math.degrees(full):.4g} deg/s')
    moving = np.flatnonzero(np.abs(rate) > STANDSTILL_SHARE * abs(rate[0]))
    if moving[-1] == t.size - 1:
        return NEVER
    if part == 'time':
        return Measured(float(t[moving[-1] + 1] - begin), TIME_STEPS * performed.antenna.period)
    way, step = math.degrees(np.abs(angle - angle[0]).max()), math.degrees(abs(angle[1] - angle[0]))
    return Measured(way, math.hypot(step, encoder_uncertainty(performed.antenna, axis)))


def _faulty(antenna: Antenna, arguments: Arguments) -> Exercise:
    """Return the exercise of a fault in a mode. Raises ValueError for a fault that it cannot provoke."""
    (node, _, fault), mode = str(arguments['fault']).partition('.'), str(arguments['mode'])
    if mode not in (modes := FAULTS[f'{node}.{fault}']):
        raise ValueError(f'mode = {mode}: must be one of {", ".join(modes)}, in which {node}.{fault} has an effect')
    end = FAULT_TIME_S + float(arguments['duration'])
    actions = [Action(FAULT_TIME_S, node, f'{fault} duration={arguments["duration"]}'),
               *(Action(end + RECOVERY_TIME_S, *command) for command in (
                   (DRIVE_NODE, RESET_FAULTS), ('acu', 'reset'), ('acu', 'stop')))]
    finish = end + 2.0 * RECOVERY_TIME_S
    if mode == 'autotrack':
        return Exercise(finish, travel(antenna), tuple(actions), alarms=ALARM_NAMES)
    axis, rate = plan(antenna, {'axis': AXES[0]}), math.radians(RAMP_DEG_S) if mode == 'ramp' else 0.0
    made = axis.exercise(finish, math.radians(ENVELOPE_DEG) + rate * finish, axis.rate,
                         axis.preset(BEGIN_S, 0.0, rate, finish), *actions)
    # A fault shows in both axes, as the noise of the encoders does.
    azimuth, elevation = (span._replace(rate=largest.rate) for span, largest in zip(made.envelope, travel(antenna)))
    return dataclasses.replace(made, envelope=(azimuth, elevation), alarms=ALARM_NAMES)


def _onset(performed: Performed, arguments: Arguments) -> tuple[Seconds, Seconds]:
    """Return the times of the fault and of the recovery. Raises ValueError if the antenna was not in its mode then."""
    begin = performed.begin + performed.times(str(arguments['fault']).partition('.')[2])[-1]
    mode = recordings.modes(performed.recording, np.array([begin - performed.antenna.period]))[0]
    wanted = 'autotrack' if arguments['mode'] == 'autotrack' else 'preset'
    if mode != wanted:
        raise ValueError(f'mode at the fault = {mode}: must be {wanted}')
    return begin, begin + float(arguments['duration']) + RECOVERY_TIME_S


def _fault_report(performed: Performed, arguments: Arguments) -> Measured:
    """Return the time from the fault to the first change of a topic of REPORT_TOPICS before the recovery."""
    (begin, end), recording = _onset(performed, arguments), performed.recording
    times = np.sort(np.concatenate([recording.table(topic)['t'] for topic in REPORT_TOPICS
                                    if topic in recording.topics]))
    return first(performed, begin - performed.begin, times, times < end)


def _fault_error(performed: Performed, arguments: Arguments) -> Measured:
    """Return the largest error from the fault until the mode is left, or until the recovery."""
    (begin, end), run = _onset(performed, arguments), RecordedRun(performed.recording).evaluated
    towards = arguments['mode'] == 'autotrack'
    left = run.t[(run.t > begin) & ~np.isin(run.mode, TARGET_MODES if towards else ('preset',))]
    during = (run.t >= begin) & (run.t < min([end, *left]))
    errors = run.following
    if towards:
        errors = tracking.DEG_PER_RAD * (run.error if np.isfinite(run.error).any() else run.measured)
    if towards and during.any() and not np.isfinite(errors[during]).any():
        raise ValueError('the recording holds no error during the fault')
    known = np.nan_to_num(errors[during])   # no error counts where the fault ends the mode at once
    return Measured(float(np.hypot(*known.T).max(initial=0.0)), 0.0)


_LIMIT = (AXIS, Argument('side', 'end of its travel', options=('low', 'high'), default='high'))
_STOW = (Argument('distance', 'distance of the start from the stow angle, each axis', 0.0, 90.0, 'deg', default=10.0),
         Argument('pins', 'stow pins; own: as the drive has', options=('own', 'simulated'), default='own'))
_FAULT = (Argument('fault', 'node and fault', options=tuple(FAULTS), default='adu.drop'),
          Argument('mode', 'mode at the fault; ramp: preset at a rate', options=ANY_MODE, default='autotrack'),
          Argument('duration', 'duration of the fault', 0.1, 60.0, 's', default=5.0))
METHODS = (
    Method('limit_overshoot', 'command a preset beyond a limit of travel, then the largest rate into it: largest '
           'angle beyond the limit', 'deg', '<=', _LIMIT, _limit, _limit_overshoot),
    Method('limit_return', f'as limit_overshoot, then the opposite rate: time until {RETURN_DEG:g} deg inside', 's',
           '<=', _LIMIT, _limit, _limit_return),
    Method('stow_time', 'command `stow`: time until the pins are in or, without pins, until the axes rest', 's', '<=',
           _STOW, _stow, _stow_time),
    Method('unstow_time', 'as stow_time, then `unstow`: time until the pins are out', 's', '<=', _STOW, _unstow,
           _unstow_time),
    *(Method(f'emergency_stop_{part}', f'request an emergency stop at the largest rate: {part} to standstill', unit,
             '<=', (AXIS,), _emergency, functools.partial(_stopping, part))
      for part, unit in (('time', 's'), ('angle', 'deg'))),
    Method('fault_report', 'inject a fault: time to the first alarm, or to a change of the mode or of the state of '
           'the drive', 's', '<=', _FAULT, _faulty, _fault_report),
    Method('fault_error', 'inject a fault: largest error until the mode ends, towards the target in autotrack, else '
           'following error', 'deg', '<=', _FAULT, _faulty, _fault_error))
