"""Diagnosis of the control unit on /diagnostics: a level, one line of text, and values."""
import math
from typing import TYPE_CHECKING

from acu_tracker import modes, signals
from acu_tracker.operating import announcement, refusals
from pedestal_common.graph import topics
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import AnyRecord

if TYPE_CHECKING:
    from acu_tracker.unit import Acu

FAULT_TEXTS = {
    'uncommanded motion': 'uncommanded motion: {motion}; call acu/reset_faults once the cause is known',
    'drive frozen': 'the drive repeats its numbers although motion is commanded; call acu/reset_faults once the cause '
                    'is known',
    'diverged': "autotrack diverged: the receiver's errors led away from the target; call acu/reset_faults once "
                'slope, phase and sign of the errors are right'}
"""Text of each latched fault of mode.interruptions, the gravest first."""

# {names in signals.INVALID_INPUTS: text of the diagnosis if exactly these inputs are invalid}
GATED_ERROR_TEXTS = {('error_gated',): 'an error of the receiver was outside the gate and was not used',
                     ('error_noisy',): 'the errors of the receiver are noise and are not used',
                     ('error_gated', 'error_noisy'): 'the errors of the receiver are noise and are not used'}

# Codes of the modes that point to a direction on the sky.
DIRECTED_MODES = tuple(i for i, row in enumerate(modes.MODE_ROWS) if row.follows or row.name == 'preset')


def of(unit: 'Acu') -> Diagnosis:
    """Return the Diagnosis of the unit."""
    invalid = tuple(name for i, name in enumerate(signals.INVALID_INPUTS) if unit.parts['invalid'] >> i & 1)
    values = _values(unit, invalid)
    return Diagnosis(*_gravest(unit, invalid), values)


def _gravest(unit: 'Acu', invalid: tuple[str, ...]) -> tuple[int, str]:
    """Return (level, text) of the gravest finding."""
    state, outputs, faults = unit.parts['state'], unit.parts['outputs'], unit.faults
    if faults:
        motion = ', '.join('{} {:.3g} deg/s, commanded {:.3g} to {:.3g}'.format(axis, *map(math.degrees, rates))
                           for axis, rates in zip(topics.AXES, state['unasked']['measured']))
        return LEVEL_ERROR, FAULT_TEXTS[faults[0]].format(motion=motion)
    if unit.model.refused:
        return LEVEL_ERROR, f'pointing model refused, the pedestal counts as ideal: {unit.model.refused}'
    if invalid in GATED_ERROR_TEXTS:
        return LEVEL_WARN, GATED_ERROR_TEXTS[invalid]
    if invalid:
        why = [text for name in invalid if (text := refusals.missing(unit, name))]
        return LEVEL_ERROR, '; '.join((f'invalid input: {" ".join(invalid)}', *why))
    mode = f'{modes.MODES[outputs["mode"]]} ({modes.REASONS[outputs["reason"]]})'
    if state['guidance']['turn']['under_way']:
        return LEVEL_WARN, f'{mode}: {announcement.turn(unit)}'
    if outputs['mode'] in DIRECTED_MODES and state['guidance']['unreachable']:
        return LEVEL_WARN, (f'{mode}: the direction is in the cone about the zenith that the axes cannot reach '
                            '(P3, P4); the beam points to the nearest direction')
    # held: last instant at which a limit held the beam off the target [s]; the instant of a command is not before the
    # stamp of its step.
    if state['guidance']['held'] >= state['stamp']:
        return LEVEL_WARN, f'{mode}: an axis is held at a limit, and the beam is off the target'
    if state['guidance']['overtravel']:
        return LEVEL_WARN, announcement.overtravel(unit)
    if announcement.reaches_end(unit):
        return LEVEL_WARN, f'{mode}: {announcement.end_of_travel(unit)}'
    now = unit.now * 1e-9
    if inaccurate := [*unit.followed.predictor.problems(now), *unit.followed.air.problems(now)]:
        return LEVEL_WARN, f'{mode}: {"; ".join(inaccurate)}'
    return LEVEL_WARN if outputs['coasting'] else LEVEL_OK, mode


def progress(outputs: AnyRecord) -> str:
    """Return the words for the mode and its progress: stowing, then stowed."""
    row = modes.MODE_ROWS[outputs['mode']]
    return (row.arrived if outputs['arrived'] else row.going) or row.name


def _values(unit: 'Acu', invalid: tuple[str, ...]) -> list[tuple[str, str]]:
    state, outputs = unit.parts['state'], unit.parts['outputs']
    values = [('mode', modes.MODES[outputs['mode']]), ('progress', progress(outputs)),
              ('reason', modes.REASONS[outputs['reason']]),
              ('fallback', modes.FALLBACK_NAMES[int(state['mode']['fallback'])]), ('control', unit.authority.holder),
              ('requester', unit.authority.requester(unit.now)),
              ('faults', ', '.join(unit.faults)), ('locked', str(int(outputs['locked']))),
              ('coasting', str(int(outputs['coasting']))), ('drive', unit.drive_status)]
    if unit.parameters.stow_pins:
        pins = int(unit.parts['inputs']['pins'])
        known = pins != topics.NO_TEXT_CODE
        values.append(('stow_pins', topics.TOPIC_BY_NAME['adu/stow_pins'].texts[pins] if known else 'unknown'))
    values += [('invalid_input', ' '.join(invalid)), ('errors gated', str(int(outputs['gated']))),
               ('rates gated', str(int(outputs['rates_gated']))),
               ('ranges gated', str(int(outputs['ranges_gated'])))]
    values += [(f'{axis} limit_s', f'{time:.1f}') for axis, time in zip(topics.AXES, outputs['time_to_limit'])]
    kinds = ('angle', 'rate', 'acceleration')
    values += [(f'{axis} limited', ' '.join(kind for kind in kinds if outputs[f'{kind}_limited'][i]))
               for i, axis in enumerate(topics.AXES)]
    for axis, innovation, nis in zip(topics.AXES, outputs['innovation'], outputs['nis']):
        values += [(f'{axis} innovation_deg', f'{math.degrees(innovation):.4g}'), (f'{axis} nis', f'{nis:.4g}')]
    if state['excitation']['count']:
        values.append(('excited', topics.AXES[state['excitation']['axis']]))
    pointing = state['tracking']['pointing']
    if title := unit.model.title(pointing):
        if pointing['changing']:
            title += f'; in force from {announcement.instant(pointing["ends"], unit.epoch)} on'
        values.append(('pointing_model', title))
    return [*values, ('blocked', str(int(outputs['blocked']))), *announcement.numbers(state['guidance']['lookahead']),
            *unit.followed.predictor.diagnostic_values(unit.now * 1e-9),
            *unit.followed.air.diagnostic_values(unit.now * 1e-9),
            *((f'refused {mode}', why) for mode, why in refusals.now(unit).items())]
