"""The alarms of the control unit: one row each, every cause before its consequences."""
import typing

from pedestal_common.codes import bits
from pedestal_common.graph.topics import AXES

ALARM_PRIORITIES = ('critical', 'high', 'medium', 'low')

JUDGED_CASES = ('always', 'motors', 'moving', 'following')
"""When an alarm is judged, beside which it is suppressed by design: always; where the axes have motors; there in any
mode but standby; in a mode that follows a target."""


class Alarm(typing.NamedTuple):
    """A row of ALARMS.

    priority     of ALARM_PRIORITIES
    on_delay     time for which its condition must be there before it is raised [s]; off_delay: gone before it clears
    latched      whether it stays until it is reset
    cause        names of the alarms that it may be a consequence of
    meaning      what is wrong; action: what the operator shall do
    judged       of JUDGED_CASES
    """
    name: str
    priority: str
    on_delay: float
    off_delay: float
    latched: bool
    cause: tuple
    meaning: str
    action: str
    judged: str = 'always'


def _of_axes(name, *columns, cause=(), judged='motors'):
    """A row for each axis. Of the causes, '*' stands for the axis."""
    priority, on_delay, off_delay, latched, meaning, action = columns
    return tuple(Alarm(f'{axis} {name}', priority, on_delay, off_delay, latched,
                       tuple(one.replace('*', axis) for one in cause), meaning, action, judged) for axis in AXES)


def _both(*names):
    return tuple(f'{axis} {name}' for name in names for axis in AXES)


ALARMS = (
    Alarm('emergency stop', 'high', 0.0, 0.0, False, (),
          'an emergency stop is latched in the drive',
          'find out who stopped it and why; `adu/reset_faults` once the cause is gone, then a new mode'),
    Alarm('drive silent', 'high', 0.0, 1.0, False, (),
          'nothing comes from the drive: neither angles nor time',
          'look at the drive and its network'),
    Alarm('time jump', 'medium', 0.0, 10.0, False, ('drive silent',),
          'the stamps of two steps in a row are more than `step_gap` apart; the axes went on from where they were',
          "look at the drive's clock and at the load of the computers"),
    Alarm('receiver silent', 'medium', 0.95, 1.0, False, ('drive silent', 'time jump'),
          'no message of the receiver, neither locked nor unlocked, or the same numbers again and again',
          'look at the receiver and its network; choose a mode that does without it', 'following'),
    Alarm('INS lost', 'high', 0.0, 1.0, False, ('drive silent', 'time jump'),
          'no attitude of the ship for `attitude_timeout`; modes that follow a target end',
          'look at the INS; stow the antenna if it stays away'),
    Alarm('INS jump', 'medium', 0.0, 1.0, False, ('drive silent', 'time jump', 'INS lost'),
          'the attitude has jumped by more than 3 mrad against the rates of the deck; it is let in at 1 mrad/s',
          'compare with another heading; in autotrack the receiver leads, other modes follow the attitude'),
    Alarm('receiver noisy', 'medium', 0.1, 1.0, False, ('receiver silent', 'INS lost', 'INS jump'),
          'the errors of the receiver differ from one to the next by five times their noise, and are not used',
          'look for interference, and at the receiver; a mode that does without it', 'following'),
    Alarm('drive frozen', 'high', 0.0, 0.0, True, ('drive silent',),
          'the drive tells the same angles, rates and torques again and again though it is told to move by 3 mrad; '
          'leads to standby',
          'see that the antenna stands; have the encoders, their interface and the drive looked at; then reset'),
    *_of_axes('motor lost', 'medium', 0.0, 1.0, False,
              'one motor of the pair makes no torque; the other carries the axis, without bias and with half the '
              'torque', 'finish the pass if wind and rates allow it; have the amplifier and the motor looked at'),
    *_of_axes('stow pin', 'high', 0.0, 1.0, False,
              'the stow pin has failed, or both are not where they were asked to be after `stow_timeout`',
              'keep clear; have pin, hole and switches looked at; `adu/reset_faults` tries it again'),
    *_of_axes('encoder jump', 'high', 0.0, 1.0, True,
              'the load encoder moved 3 mrad in a step in which the motors did not',
              'compare with the motor encoders; have encoder, coupling and cable looked at; then reset',
              cause=('time jump',)),
    *_of_axes('encoder stuck', 'high', 0.0, 1.0, True,
              'the load encoder stands while the motors turn by 3 mrad',
              'stop the antenna: it may be elsewhere than shown; have encoder and coupling looked at; then reset'),
    *_of_axes('encoder disagreement', 'high', 0.0, 1.0, True,
              'the load encoder has moved by 10 mrad more or less than the motors within some seconds',
              'compare the encoders; have gear, couplings and cables looked at; then reset',
              cause=('time jump', '* encoder jump', '* encoder stuck')),
    *_of_axes('brake not released', 'high', 0.5, 1.0, False,
              'the drive has pushed with 50 times the friction for half a second, whether the axis moves or not',
              'go to standby; have the brakes looked at, and whether something blocks the axis', judged='moving'),
    *_of_axes('immobile', 'high', 0.3, 1.0, False,
              'the axis is told to move and its motors turn at less than a tenth of that',
              'go to standby; look at drive, motors and end stops',
              cause=('drive silent', 'drive frozen', '* brake not released', '* motor lost'), judged='moving'),
    *_of_axes('brake not gripping', 'critical', 0.05, 1.0, False,
              'the drive has been off for 2.5 s and the axis still moves',
              'keep clear of the antenna; secure it by hand or pin; have the brakes looked at'),
    *_of_axes('runaway', 'critical', 0.005, 1.0, True,
              'the axis moves against its command',
              'keep it stopped; have the wiring of motors and encoders looked at; then reset',
              cause=('* brake not gripping', '* encoder stuck', '* motor lost')),
    Alarm('moves unasked', 'critical', 0.0, 1.0, True,
          ('drive frozen', *_both('runaway', 'brake not gripping', 'encoder stuck', 'motor lost')),
          'a rate beyond the envelope of the commands of late by more than `unasked_rate` for 14 ms, in standby too; '
          'leads to standby and `adu/emergency_stop`',
          'keep it stopped until it is known why; then reset'),
    *_of_axes('oscillation', 'medium', 0.0, 5.0, False,
              'the following error swings faster than once a second, more than noise does',
              'choose another controller or lower its bandwidth; look at backlash, bias and the notch',
              cause=('* motor lost', '* encoder stuck'), judged='moving'),
    *_of_axes('following error', 'medium', 1.0, 1.0, False,
              'the axis is more than a quarter of a beamwidth off its reference though it is at no limit',
              'look at wind, motors and friction; a slower mode',
              cause=('drive silent', 'time jump', 'drive frozen', '* motor lost', '* encoder jump', '* encoder stuck',
                     '* encoder disagreement', '* brake not released', '* immobile', '* runaway',
                     '* oscillation'), judged='moving'),
    *_of_axes('at limit', 'low', 1.0, 1.0, False,
              'the axis is wanted beyond its limits or below the floor, and stands in front of them',
              'choose another target, or another turn of the azimuth; any mode leads back from behind a limit',
              judged='moving'),
    Alarm('drive fault', 'high', 0.0, 0.0, False,
          ('emergency stop', *_both('motor lost', 'stow pin', 'encoder jump', 'encoder stuck', 'encoder disagreement',
                                    'brake not released', 'immobile', 'brake not gripping', 'runaway', 'oscillation',
                                    'following error'), 'moves unasked'),
          'the drive has tripped on a fault, which `adu/state` names, and stands on its brakes',
          'clear what it names; `adu/reset_faults`, then a new mode'),
    Alarm('diverged', 'medium', 0.0, 1.0, True,
          ('INS lost', *_both('encoder jump', 'encoder stuck', 'encoder disagreement', 'immobile',
                              'following error')),
          'in autotrack, innovations squared over their variance: 7 in the mean of 100 errors, or 2 when the signal '
          'goes; or the error of an axis moves with the beam as it would if its slope were reversed; leads to '
          '`program`, or `standby` without a program, and autotrack is refused',
          "check slope, phase and sign of the receiver's errors; then reset"),
    Alarm('signal lost', 'medium', 0.5, 1.0, False,
          ('emergency stop', 'drive silent', 'time jump', 'receiver silent', 'INS lost', 'INS jump', 'receiver noisy',
           'drive frozen',
           *_both('motor lost', 'encoder jump', 'encoder stuck', 'brake not released', 'immobile', 'runaway',
                  'oscillation', 'following error', 'at limit'), 'moves unasked', 'drive fault', 'diverged'),
          'autotrack coasts, or has ended, without a signal, and nothing that was foreseen explains it',
          'compare with the prediction; search, or choose another target'),
    Alarm('program too early', 'low', 0.0, 1.0, False, (),
          'the program track was asked for before its first row',
          'wait for its begin, or shift it by `offset`'),
    Alarm('program gap', 'medium', 0.0, 1.0, False, (),
          'the rows of the program track end here and others come later: the axes stand',
          'send the rows that are missing, or ask for `program` again when the next segment has begun'),
    Alarm('program turnaround', 'medium', 0.0, 1.0, False, (),
          'the last segment of the program track was refused: the axes cannot be at its first row in time',
          'send a segment that begins later, or where the one before ends'),
    Alarm('program ended', 'low', 0.0, 1.0, False, (),
          'the program track has come to its end', 'send the next segment, or choose another mode'),
    Alarm('invalid input', 'low', 0.0, 5.0, False,
          ('drive silent', 'time jump', 'receiver silent', 'INS lost', 'INS jump', 'receiver noisy'),
          'an input was no number or could not be believed; `/diagnostics` says which',
          'look at the sender of it'),
)

ALARM_NAMES = tuple(alarm.name for alarm in ALARMS)
ALARM_INDEX = {name: i for i, name in enumerate(ALARM_NAMES)}

ON_DELAYS_S = tuple(alarm.on_delay for alarm in ALARMS)
OFF_DELAYS_S = tuple(alarm.off_delay for alarm in ALARMS)
LATCHED_FLAGS = tuple(int(alarm.latched) for alarm in ALARMS)
CAUSE_BITS = tuple(sum(1 << ALARM_INDEX[name] for name in alarm.cause) for alarm in ALARMS)
"""Of each alarm the bits of its causes."""

JUDGED_ALARM_BITS = tuple(sum(1 << i for i,
                              alarm in enumerate(ALARMS) if alarm.judged == when) for when in JUDGED_CASES)
"""Of each of JUDGED_CASES the bits of the alarms that are judged then."""

Bit = bits(ALARM_NAMES)
"""Of each alarm; shifted to the left, that of an alarm of the azimuth is that of the elevation."""
