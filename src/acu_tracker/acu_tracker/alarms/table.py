"""The table of alarms: one row for each alarm of the control unit.

In the table every cause stands before its consequences. The annunciator needs this order, because it searches the
parent of an alarm only among the rows before it. A row whose name holds '*' is an alarm of each axis, and '*' stands
for this axis. In the causes of another row '*' stands for both axes.
"""
from typing import NamedTuple

from pedestal_common.codes import bits
from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import Seconds

ALARM_PRIORITIES = ('critical', 'high', 'medium', 'low')

# Cases in which an alarm has a meaning and is judged; in the other cases it is suppressed by design.
JUDGED_CASES = ('always',       # in every step
                'motors',       # if the axes have motors
                'moving',       # if the axes have motors and the mode is not standby
                'following')    # in a mode that follows a target


class Alarm(NamedTuple):
    """Row of the table."""
    name: str               # in messages and commands
    priority: str           # of ALARM_PRIORITIES
    on_delay: Seconds       # time for which the condition must last before the alarm is raised
    off_delay: Seconds      # time for which the condition must be gone before the alarm clears
    latched: bool           # True if the alarm stays until it is reset
    cause: tuple[str, ...]  # names of the alarms that may cause this alarm
    meaning: str            # condition that is reported
    action: str             # recommended action of the operator
    judged: str = 'always'  # one of JUDGED_CASES


ALARM_ROWS = (
    Alarm('emergency stop', 'high', 0.0, 0.0, False, (),
          'an emergency stop is latched in the drive',
          'find the cause of the stop; once it is gone, call `adu/reset_faults`, then command a mode'),
    Alarm('drive silent', 'high', 0.0, 1.0, False, (),
          'the drive publishes neither angles nor time',
          'check the drive and its network'),
    Alarm('steps lost', 'medium', 0.0, 5.0, False, ('drive silent',),
          'the drive has made more than 1 % of its steps of the last 5 s without a new command, or not at all; the '
          'antenna follows worse than designed',
          'end other programs on the computers of drive and ACU, use a faster computer, or give the nodes a realtime '
          'priority (`scenario.priority`)'),
    Alarm('time jump', 'medium', 0.0, 10.0, False, ('drive silent', 'steps lost'),
          'the stamps of successive steps are more than `step_gap` apart; the axes restarted from their actual angles',
          'check the clock of the drive and the load of the computers'),
    Alarm('receiver silent', 'medium', 0.95, 1.0, False, ('drive silent', 'time jump'),
          'the receiver publishes no message at all, or repeats the same numbers',
          'check the receiver and its network; choose a mode that needs no receiver', 'following'),
    Alarm('INS lost', 'high', 0.0, 1.0, False, ('drive silent', 'time jump'),
          'no attitude of the ship for `attitude_timeout`; modes that follow a target end',
          'check the INS; stow the antenna if the INS stays silent'),
    Alarm('INS jump', 'medium', 0.0, 1.0, False, ('drive silent', 'time jump', 'INS lost'),
          'the attitude differs by more than 3 mrad from the attitude that the deck rates predict; the ACU applies '
          'the difference at 1 mrad/s',
          'compare the attitude with another heading; use autotrack, which follows the receiver, because all other '
          'modes follow the attitude'),
    Alarm('receiver noisy', 'medium', 0.1, 1.0, False, ('receiver silent', 'INS lost', 'INS jump'),
          'successive receiver errors differ by five times their noise; the ACU does not use them',
          'check for interference, and check the receiver; choose a mode that needs no receiver', 'following'),
    Alarm('drive frozen', 'high', 0.0, 0.0, True, ('drive silent',),
          'a motion of more than 3 mrad was commanded, and the drive repeats the same angles, rates and torques. The '
          'ACU enters standby',
          'make sure that the antenna is at rest; inspect the encoders, their interface and the drive; then reset '
          'the alarm'),
    Alarm('* motor lost', 'medium', 0.0, 1.0, False, (),
          'one motor of the pair makes no torque; the remaining motor drives the axis with half the torque and '
          'without bias torque',
          'finish the pass if wind and rates allow it; inspect amplifier and motor', 'motors'),
    Alarm('* stow pin', 'high', 0.0, 1.0, False, (),
          'the stow pin has failed, or the pins have not reached their commanded position within `stow_timeout`',
          'keep clear; inspect pin, hole and switches; a reset retries the motion of the pin', 'motors'),
    Alarm('* encoder jump', 'high', 0.0, 1.0, True, ('time jump',),
          'the load encoder moved 3 mrad in one step without the motors',
          'compare with the motor encoders; inspect encoder, coupling and cable; then reset the alarm', 'motors'),
    Alarm('* encoder stuck', 'high', 0.0, 1.0, True, (),
          'the load encoder stands still while the motors turn by 3 mrad',
          'stop the antenna, because its true angle may differ from the display; check encoder and coupling; then '
          'reset the alarm', 'motors'),
    Alarm('* encoder disagreement', 'high', 0.0, 1.0, True,
          ('time jump', '* encoder jump', '* encoder stuck'),
          'load encoder and motor encoders have moved by angles that differ by 10 mrad; the ACU lets this difference '
          'decay with a time constant of 2 s',
          'compare the encoders; inspect gear, couplings and cables; then reset the alarm', 'motors'),
    Alarm('* brake not released', 'high', 0.3, 1.0, False, (),
          'the motors push against a brake or an obstacle: their mean torque is above 50 times the Coulomb friction '
          '(`feedforward.friction`). For half a second the axis has stood in spite of its command, or has moved only '
          'with 80 times the friction, or for 10 s with 50 times the friction. Torque against a gust does not count',
          'go to standby; inspect the brakes; check for an obstacle that blocks the axis', 'moving'),
    Alarm('* immobile', 'high', 0.3, 1.0, False,
          ('drive silent', 'drive frozen', '* brake not released', '* motor lost'),
          'the motors of the axis turn at less than a tenth of the commanded rate',
          'go to standby; check drive, motors and end stops', 'moving'),
    Alarm('* brake not gripping', 'critical', 0.05, 1.0, False, (),
          'the drive has been off for 2.5 s and the axis still moves',
          'keep clear of the antenna; secure it by hand or by a pin; inspect the brakes', 'motors'),
    Alarm('* runaway', 'critical', 0.005, 1.0, True,
          ('* brake not gripping', '* encoder stuck', '* motor lost'),
          'the axis turns opposite to its rate command',
          'keep the antenna stopped; inspect the wiring of motors and encoders; then reset the alarm', 'motors'),
    Alarm('uncommanded motion', 'critical', 0.0, 1.0, True,
          ('drive frozen', '* runaway', '* brake not gripping', '* encoder stuck', '* motor lost'),
          'an axis moves faster than commanded, or without a command, also in standby. For 14 ms its rate has been '
          'outside the range of 0 and its recent rate commands, by more than `unasked_rate` plus a quarter of this '
          'range. The ACU enters standby and calls `adu/emergency_stop`',
          'keep the antenna stopped until the cause is known; then reset the alarm'),
    Alarm('* oscillation', 'medium', 0.0, 5.0, False, ('* motor lost', '* encoder stuck'),
          'the following error oscillates faster than 1 Hz, with half waves of more than 0.1 mrad s (1 mrad at 3 '
          'Hz)',
          'choose another controller or lower its bandwidth; check backlash, bias torque and the notch filter',
          'moving'),
    Alarm('* following error', 'medium', 1.0, 1.0, False,
          ('drive silent', 'time jump', 'drive frozen', '* motor lost', '* encoder jump', '* encoder stuck',
           '* encoder disagreement', '* brake not released', '* immobile', '* runaway', '* oscillation'),
          'the axis is more than a quarter of a beamwidth off its reference, and its command is not limited. The '
          'errors of an axis that stands in spite of its commands add up',
          'check wind, motors and friction; choose a slower motion', 'moving'),
    Alarm('* at limit', 'low', 1.0, 1.0, False, (),
          'the reference is beyond the limits of the axis or below the floor; the axis holds at the limit',
          'choose another target or another azimuth wrap; beyond a limit, every mode moves the axis back inside',
          'moving'),
    Alarm('drive fault', 'high', 0.0, 0.0, False,
          ('emergency stop', '* motor lost', '* stow pin', '* encoder jump', '* encoder stuck',
           '* encoder disagreement', '* brake not released', '* immobile', '* brake not gripping', '* runaway',
           '* oscillation', '* following error', 'uncommanded motion'),
          'the drive has tripped on the fault that `adu/state` states, and holds the axes with the brakes',
          'remove the cause of the fault; reset, then command a mode'),
    Alarm('diverged', 'medium', 0.0, 1.0, True,
          ('INS lost', '* encoder jump', '* encoder stuck', '* encoder disagreement', '* immobile',
           '* following error'),
          'the estimate departs from the target. In autotrack the mean of the last 100 squared innovations, divided '
          'by their variance, exceeds 8, or at a loss of signal the mean of the last 50 exceeds 1.75 times that of '
          'the last 1000, or the receiver errors move with the beam as with a reversed sign or turned axes, or '
          'autotrack has departed from the program twice, the second time within 10 s of its lock. The ACU enters '
          '`program`, or `standby` without a program, and refuses autotrack until a reset of the alarm',
          "check slope, phase and sign of the receiver's error signals; then reset the alarm"),
    Alarm('signal lost', 'medium', 0.5, 1.0, False,
          ('emergency stop', 'drive silent', 'time jump', 'receiver silent', 'INS lost', 'INS jump', 'receiver noisy',
           'drive frozen', '* motor lost', '* encoder jump', '* encoder stuck', '* brake not released', '* immobile',
           '* runaway', '* oscillation', '* following error', '* at limit', 'uncommanded motion', 'drive fault',
           'diverged'),
          'autotrack coasts or has ended without a signal, and no predicted blockage or keyhole explains the loss',
          'compare the direction of the antenna with the prediction; command `search`, or choose another target'),
    Alarm('program too early', 'low', 0.0, 1.0, False, (),
          'mode `program` was commanded before the first row of the program track',
          'wait for its first row, or shift it by `offset`'),
    Alarm('program gap', 'medium', 0.0, 1.0, False, (),
          'the program track has no rows here, and more rows later; the axes stop',
          'send the missing rows, or command `program` again when the next segment has begun'),
    Alarm('program turnaround', 'medium', 0.0, 1.0, False, (),
          'the last segment of the program track was refused: the axes cannot reach its first row in time',
          'send a segment that begins later, or where the previous segment ends'),
    Alarm('program ended', 'low', 0.0, 1.0, False, (),
          'the program track has ended', 'send the next segment, or choose another mode'),
    Alarm('invalid input', 'low', 0.0, 5.0, False,
          ('drive silent', 'time jump', 'receiver silent', 'INS lost', 'INS jump', 'receiver noisy'),
          'an input was not finite or not plausible; `/diagnostics` names the input',
          'check the publisher of the input'),
)


def _alarm(row: Alarm, axes: tuple[str, ...]) -> Alarm:
    """Return a row with these axes in the place of '*' in its names."""
    cause = [name.replace('*', axis) for name in row.cause for axis in axes]
    return row._replace(name=row.name.replace('*', axes[0]), cause=tuple(dict.fromkeys(cause)))


ALARMS = tuple(_alarm(row, axes) for row in ALARM_ROWS for axes in (zip(AXES) if '*' in row.name else (AXES,)))
ALARM_NAMES = tuple(alarm.name for alarm in ALARMS)
ALARM_INDEX = {name: i for i, name in enumerate(ALARM_NAMES)}

ON_DELAYS_S = tuple(alarm.on_delay for alarm in ALARMS)
OFF_DELAYS_S = tuple(alarm.off_delay for alarm in ALARMS)
LATCHED_FLAGS = tuple(int(alarm.latched) for alarm in ALARMS)
CAUSE_BITS = tuple(sum(1 << ALARM_INDEX[name] for name in alarm.cause) for alarm in ALARMS)
JUDGED_ALARM_BITS = tuple(sum(1 << i for i, alarm in enumerate(ALARMS) if alarm.judged == case)
                          for case in JUDGED_CASES)

# Bit of each alarm. The bit of an azimuth alarm, shifted left by one, is the bit of the same alarm in elevation.
Bit = bits(ALARM_NAMES)
