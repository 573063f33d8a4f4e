"""The published list of alarms: which alarms are in it, their order, and the message on acu/alarms.

An alarm is listed in every state except normal and suppressed. Annunciated alarms, at most MAX_ANNUNCIATED_ALARMS,
come first; their consequences and the shelved alarms follow. `alarms` is an annunciator.AlarmList.
"""
from collections.abc import Mapping

from acu_tracker.alarms import annunciator, machine, table
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN
from pedestal_common.quantities import AnyRecord, Message
from pedestal_common.wire import messages

MAX_ANNUNCIATED_ALARMS = 10  # those of the highest priority, among equals the earliest
DIAGNOSTIC_LEVELS = {'critical': LEVEL_ERROR, 'high': LEVEL_ERROR, 'medium': LEVEL_WARN, 'low': LEVEL_WARN}


def order(alarms: AnyRecord) -> list[int]:
    """Return the indices of the alarms that are listed and not shelved, by priority, then by the time of raising."""
    chosen = [i for i in range(annunciator.ALARM_COUNT) if machine.IS_ANNUNCIATED[alarms['alarm'][i]['state']]]
    return sorted(chosen, key=lambda i: (table.ALARM_PRIORITIES.index(table.ALARMS[i].priority),
                                         alarms['alarm'][i]['raised'], i))


def annunciated(alarms: AnyRecord) -> list[int]:
    """Return the indices of the annunciated alarms: the first that are no consequence of another one."""
    causes = [i for i in order(alarms) if annunciator.active_parent(alarms, i) == annunciator.NO_ALARM]
    return causes[:MAX_ANNUNCIATED_ALARMS]


def listed(alarms: AnyRecord) -> list[int]:
    """Return the indices of the published alarms: first the annunciated, then their consequences, then the shelved."""
    first = annunciated(alarms)
    shelved = [i for i in range(annunciator.ALARM_COUNT) if alarms['alarm'][i]['state'] == machine.State.SHELVED]
    return [*first, *(i for i in order(alarms) if i not in first), *shelved]


def status(alarms: AnyRecord, i: int, detail: str = '', reason: str = '') -> Message:
    """Return the DiagnosticStatus of an alarm; reason: text why the alarm is shelved."""
    alarm, row, above = alarms['alarm'][i], table.ALARMS[i], annunciator.active_parent(alarms, i)
    shelved = alarm['state'] == machine.State.SHELVED
    values = {'state': machine.ALARM_STATES[alarm['state']], 'priority': row.priority,
              'annunciated': str(int(i in annunciated(alarms))), 'raised_s': f'{alarm["raised"]:.3f}',
              'first_out': str(int(alarm['first'])),
              'cause': table.ALARM_NAMES[above] if above != annunciator.NO_ALARM else '', 'action': row.action}
    if detail:
        values['detail'] = detail
    if shelved:
        values |= {'shelved_until_s': f'{alarm["until"]:.3f}', 'shelved_reason': reason}
    return messages.DiagnosticStatus(
        level=LEVEL_OK if shelved else DIAGNOSTIC_LEVELS[row.priority], name=row.name, message=row.meaning,
        hardware_id='acu',
        values=[messages.KeyValue(key=key, value=value) for key, value in values.items()])


def message(alarms: AnyRecord, details: Mapping[int, str], reasons: Mapping[int, str]) -> Message:
    """Return the DiagnosticArray of the list; details, reasons: by index of an alarm, as in `status`."""
    return messages.DiagnosticArray(header=messages.header(''), status=[
        status(alarms, i, details.get(i, ''), reasons.get(i, '')) for i in listed(alarms)])
