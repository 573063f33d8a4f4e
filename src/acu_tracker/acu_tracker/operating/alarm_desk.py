"""The commands of an operator to single alarms: acknowledge, shelve, unshelve."""
from acu_tracker.alarms import annunciator, machine, table
from pedestal_common.parameters import did_you_mean
from pedestal_common.quantities import AnyRecord, Seconds
from pedestal_common.wire.commands import Reply


class AlarmDesk:
    """Handler of the alarm commands.

    reasons  {index of a shelved alarm: reason for shelving}

    The methods have the names of their commands. Their argument `state` is the control_unit.State. They
    raise ValueError for an unknown alarm.
    """

    def __init__(self) -> None:
        self.reasons: dict[int, str] = {}

    def prepare(self, state: AnyRecord) -> None:
        """Compile the functions behind the commands. The state changes; the caller restores it."""
        self.acknowledge(state)
        self.shelve(state, table.ALARM_NAMES[0], 1.0, 'none')
        self.unshelve(state, table.ALARM_NAMES[0])
        self.reasons.clear()

    def acknowledge(self, state: AnyRecord, name: str = '') -> Reply:
        """Return the Reply to an acknowledgement of an alarm and of its consequences.

        name: of the alarm; '': every alarm.
        """
        chosen = [_index(name)] if name else range(annunciator.ALARM_COUNT)
        done = sum([annunciator.acknowledge(_alarms(state), i, state['stamp']) for i in chosen])
        return Reply(done > 0, 'acknowledged' if done else 'refused: no alarm waits for an acknowledgement')

    def shelve(self, state: AnyRecord, name: str, seconds: Seconds, reason: str) -> Reply:
        """Return the Reply to the command that shelves an alarm for some seconds, for a reason."""
        i = _index(name)
        self.reasons[i] = reason
        annunciator.shelve(_alarms(state), i, state['stamp'], seconds)
        return Reply(True, f'{table.ALARM_NAMES[i]} is shelved for {seconds:g} s: {reason}')

    def unshelve(self, state: AnyRecord, name: str) -> Reply:
        """Return the Reply to the command that ends the shelving of an alarm."""
        i = _index(name)
        if annunciator.apply_event(_alarms(state), i, machine.Event.UNSHELVE, state['stamp']):
            return Reply(True, f'{table.ALARM_NAMES[i]} is no longer shelved')
        return Reply(False, f'refused: {table.ALARM_NAMES[i]} is not shelved')


def _alarms(state: AnyRecord) -> AnyRecord:
    return state['supervision']['alarms']


def _index(name: str) -> int:
    """Return the index of an alarm in the table. Raise ValueError for an unknown name."""
    name = name.replace('_', ' ')
    if name not in table.ALARM_INDEX:
        raise ValueError(f'alarm = {name!r}:{did_you_mean(name, table.ALARM_NAMES)} must be one of '
                         f'{", ".join(table.ALARM_NAMES)}')
    return table.ALARM_INDEX[name]
