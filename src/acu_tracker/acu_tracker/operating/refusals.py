"""Texts of the reasons why a mode is refused, with what an operator needs to mend it."""
import math
from typing import TYPE_CHECKING

import numpy as np

from acu_tracker import control_unit, modes
from acu_tracker.modes import Mode, Reason
from pedestal_common.compiled import compiled
from pedestal_common.geometry import pointing_model
from pedestal_common.graph import layouts, topics
from pedestal_common.quantities import Radians

if TYPE_CHECKING:
    from acu_tracker.params import AcuParameters
    from acu_tracker.unit import Acu

SILENCE_REFUSAL = 'no joint_states, the drive is silent'  # refusal of every mode except standby

# {name in signals.INVALID_INPUTS: (topic, fields of its message that the control unit needs)}
NEEDED_FIELDS = {'encoder': ('joint_states', ('position', 'velocity')),
                 'attitude': ('ship/imu/data', ('orientation', 'angular_velocity')),
                 'attitude_error': ('ins/error', ('position', 'velocity'))}

# {reason of a refused mode: name in NEEDED_FIELDS of the input that is invalid}
INPUTS_OF_REASONS = {Reason.ENCODER_INVALID: 'encoder', Reason.ATTITUDE_INVALID: 'attitude'}


def now(unit: 'Acu') -> dict[str, str]:
    """Return {name of a mode: text of the reason} for the modes that would be refused now."""
    if unit.silent:
        return dict.fromkeys((mode for mode in modes.MODES if mode != 'standby'), SILENCE_REFUSAL)
    parts, reasons = unit.parts, np.zeros(len(modes.MODES), np.int64)
    control_unit.refusals(parts['state'], parts['constants'], parts['inputs'], unit.memory.tables, reasons)
    why = reasons.tolist()
    words = {code: modes.REASONS[code] for code in set(why) - {Reason.NONE}}
    if Reason.DRIVE_NOT_READY in words:
        words[Reason.DRIVE_NOT_READY] += f': {unit.drive_status}'
    if Reason.NO_POSITION in words:
        words[Reason.NO_POSITION] = of_mode(unit, Mode.SUN, Reason.NO_POSITION)
    for reason, name in INPUTS_OF_REASONS.items():
        if reason in words and (text := missing(unit, name)):
            words[reason] += f', {text}'
    refused = {mode: words[code] for mode, code in zip(modes.MODES, why) if code in words}
    return {mode: text + _beyond_limits(unit, mode) if text == modes.REASONS[Reason.OUTSIDE_LIMITS] else text
            for mode, text in refused.items()}


def of_mode(unit: 'Acu', mode: int, reason: int) -> str:
    """Return the text of the reason why a mode is refused, with its details."""
    predictor = unit.followed.predictor
    more = predictor.refusal_details(mode, reason, unit.now * 1e-9) if mode in (Mode.TLE, Mode.SUN) else ''
    more = more or missing(unit, INPUTS_OF_REASONS.get(reason, ''))
    beyond = _beyond_limits(unit, modes.MODES[mode]) if reason == Reason.OUTSIDE_LIMITS else ''
    return modes.REASONS[reason] + (f', {more}' if more else beyond)


def missing(unit: 'Acu', name: str) -> str:
    """Return the text that names the numbers which the last message of an input lacks; '' if it lacks none.

    name: key of NEEDED_FIELDS. A decoded number is NaN if the message does not contain it or marks it as no data.
    """
    topic, needed = NEEDED_FIELDS.get(name, ('', ()))
    if topic not in unit.reads and topic != unit.trigger:
        return ''
    message, absent = unit.inputs[0][topic], []     # inputs (1,): the record of the last step
    for field in needed:
        numbers = np.isnan(message[field])
        names = [column.name for column in layouts.columns(topic) if column.field == field]
        absent += [field] if numbers.all() else [name for name, nan in zip(names, numbers) if nan]
    return f'{topic}: {", ".join(absent)} missing' if absent else ''


@compiled
def _encoder_angles(pointing: pointing_model.PointingModel, azimuth: Radians,
                    elevation: Radians) -> tuple[Radians, Radians]:
    A, E, _ = pointing_model.encoder_of(pointing, azimuth, elevation)
    return A, E


def _beyond_limits(unit: 'Acu', mode: str) -> str:
    """Return the details of the reason OUTSIDE_LIMITS for the modes preset and stow; '' for another mode."""
    p, state = unit.parameters, unit.parts['state']
    angles = {'preset': _encoder_angles(state['tracking']['pointing']['model'],
                                        *state['guidance']['preset']['angle'].tolist()),
              'stow': (p.azimuth.stow, p.elevation.stow)}.get(mode)
    return '' if angles is None else f', {_unreachable(p, angles)}'


def _unreachable(parameters: 'AcuParameters', angles: tuple[Radians, Radians]) -> str:
    """Return the reason why encoder angles cannot be reached: the axes outside their limits, or else the floor."""
    outside = [f'{axis} {math.degrees(angle):.2f} deg: must be {math.degrees(limits.low):.2f} to '
               f'{math.degrees(limits.high):.2f} deg'
               for axis, angle in zip(topics.AXES, angles)
               if not (limits := getattr(parameters, axis).limits).low <= angle <= limits.high]
    azimuth, elevation = (f'{math.degrees(angle):.2f} deg' for angle in angles)
    return ', '.join(outside) or f'elevation {elevation} is below the parameter floor at azimuth {azimuth}'
