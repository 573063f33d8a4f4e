"""The list of alarms as a message: diagnostic_msgs/DiagnosticArray on acu/alarms."""
from acu_tracker.alarms import annunciator, machine, table
from pedestal_common.node.unit import ERROR, OK, WARN
from pedestal_common.wire import messages

MOST = 10
"""Alarms that are annunciated at once at the most: those of the highest priority, the first of them first."""

LEVELS = {'critical': ERROR, 'high': ERROR, 'medium': WARN, 'low': WARN}


def order(s):
    """Indices of the alarms that are told: by priority, then by the time at which they were raised. s: view of
    annunciator.ALARMS, here and below."""
    told = [i for i in range(annunciator.COUNT) if machine.ANNUNCIATED[s['alarm'][i]['state']]]
    return sorted(told, key=lambda i: (table.PRIORITIES.index(table.ALARMS[i].priority), s['alarm'][i]['raised'], i))


def annunciated(s):
    """Indices of the alarms that an operator's attention is asked for: MOST of those that stand under no other."""
    return [i for i in order(s) if annunciator.above(s, i) == annunciator.NONE][:MOST]


def listed(s):
    """Indices of all alarms that are not normal: the annunciated, their consequences, those that are shelved."""
    first = annunciated(s)
    shelved = [i for i in range(annunciator.COUNT) if s['alarm'][i]['state'] == machine.State.SHELVED]
    return [*first, *(i for i in order(s) if i not in first), *shelved]


def status(s, i, detail='', reason=''):
    """The DiagnosticStatus of alarm i. detail: what else is known; reason: why it is shelved."""
    alarm, row, above = s['alarm'][i], table.ALARMS[i], annunciator.above(s, i)
    shelved = alarm['state'] == machine.State.SHELVED
    values = {'state': machine.STATES[alarm['state']], 'priority': row.priority,
              'annunciated': str(int(i in annunciated(s))), 'raised_s': f'{alarm["raised"]:.3f}',
              'first_out': str(int(alarm['first'])),
              'cause': table.NAMES[above] if above != annunciator.NONE else '', 'action': row.action}
    if detail:
        values['detail'] = detail
    if shelved:
        values |= {'shelved_until_s': f'{alarm["until"]:.3f}', 'shelved_reason': reason}
    return messages.DiagnosticStatus(
        level=OK if shelved else LEVELS[row.priority], name=row.name, message=row.meaning, hardware_id='acu',
        values=[messages.KeyValue(key=key, value=value) for key, value in values.items()])


def message(s, details, reasons):
    """The DiagnosticArray of the list; details, reasons: {index: text} of some alarms."""
    return messages.DiagnosticArray(header=messages.header(''), status=[
        status(s, i, details.get(i, ''), reasons.get(i, '')) for i in listed(s)])
