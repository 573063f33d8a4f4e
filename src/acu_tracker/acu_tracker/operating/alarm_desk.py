"""The commands of an operator to the alarms: acknowledge, reset, shelve, unshelve."""
from collections.abc import Callable

from acu_tracker.alarms import annunciator, machine, table
from pedestal_common.parameters import did_you_mean
from pedestal_common.quantities import AnyRecord, Seconds
from pedestal_common.wire.commands import Reply


class AlarmDesk:
    """Handler of the alarm commands.

    state    view of control_unit.State, which holds the alarms and the stamp
    reset    the function control_unit.reset
    reasons  {index of a shelved alarm: reason for shelving}

    The methods have the names of command_table.ALARM_COMMANDS. They raise ValueError for an unknown alarm.
    """

    def __init__(self, state: AnyRecord, reset: Callable[[AnyRecord], int]) -> None:
        self._state, self._reset = state, reset
        self.reasons: dict[int, str] = {}

    def prepare(self) -> None:
        """Compile the functions behind the commands. The state changes; the caller restores it."""
        self.reset()
        self.acknowledge()
        self.shelve(table.ALARM_NAMES[0], 1.0, 'none')
        self.unshelve(table.ALARM_NAMES[0])
        self.reasons.clear()

    @property
    def alarms(self) -> AnyRecord:
        """Record of all alarms."""
        return self._state['supervision']['alarms']

    def reset(self) -> Reply:
        """Return the Reply to a reset of the latched alarms and faults.

        The reset is refused while the cause of one of them is present.
        """
        cause = self._reset(self._state)
        if cause == annunciator.NO_ALARM:
            return Reply(True, 'cleared')
        return Reply(False, f'refused: the cause of {table.ALARM_NAMES[cause]} is still there')

    def acknowledge(self, name: str = '') -> Reply:
        """Return the Reply to an acknowledgement of an alarm and of its consequences.

        name: of the alarm; '': every alarm.
        """
        chosen = [_index(name)] if name else range(annunciator.ALARM_COUNT)
        done = sum([annunciator.acknowledge(self.alarms, i, self._state['stamp']) for i in chosen])
        return Reply(done > 0, 'acknowledged' if done else 'refused: no alarm waits for an acknowledgement')

    def shelve(self, name: str, seconds: Seconds, reason: str) -> Reply:
        """Return the Reply to the command that shelves an alarm for some seconds, for a reason."""
        i = _index(name)
        self.reasons[i] = reason
        annunciator.shelve(self.alarms, i, self._state['stamp'], seconds)
        return Reply(True, f'{table.ALARM_NAMES[i]} is shelved for {seconds:g} s: {reason}')

    def unshelve(self, name: str) -> Reply:
        """Return the Reply to the command that ends the shelving of an alarm."""
        i = _index(name)
        if annunciator.apply_event(self.alarms, i, machine.Event.UNSHELVE, self._state['stamp']):
            return Reply(True, f'{table.ALARM_NAMES[i]} is no longer shelved')
        return Reply(False, f'refused: {table.ALARM_NAMES[i]} is not shelved')


def _index(name: str) -> int:
    """Return the index of an alarm in the table. Raise ValueError for an unknown name."""
    name = name.replace('_', ' ')
    if name not in table.ALARM_INDEX:
        raise ValueError(f'alarm = {name!r}:{did_you_mean(name, table.ALARM_NAMES)} must be one of '
                         f'{", ".join(table.ALARM_NAMES)}')
    return table.ALARM_INDEX[name]
