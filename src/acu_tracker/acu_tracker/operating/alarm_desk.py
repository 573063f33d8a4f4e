"""What an operator does with the alarms: acknowledge, reset, shelve, take back."""
from acu_tracker.alarms import annunciator, machine, table
from pedestal_common.parameters import did_you_mean
from pedestal_common.wire.commands import Reply


class AlarmDesk:
    """state: view of control_unit.STATE, which holds the alarms and the stamp; reset: control_unit's, of it.

    Its methods have the names of verbs.ALARM_VERBS; they raise ValueError for the name of an alarm that there is not.
    """

    def __init__(self, state, reset):
        self._state, self._reset = state, reset
        self.reasons = {}

    def prepare(self):
        """Compile what the verbs call; the state changes, and is the caller's to put back."""
        self.reset()
        self.acknowledge()
        self.shelve(table.ALARM_NAMES[0], 1.0, 'none')
        self.unshelve(table.ALARM_NAMES[0])
        self.reasons.clear()

    @property
    def alarms(self):
        """The record of all alarms."""
        return self._state['supervision']['alarms']

    def reset(self):
        """The Reply to a reset of all that is latched; refused while a cause is there."""
        cause = self._reset(self._state)
        if cause == annunciator.NO_ALARM:
            return Reply(True, 'cleared')
        return Reply(False, f'refused: the cause of {table.ALARM_NAMES[cause]} is still there')

    def acknowledge(self, name=''):
        """The Reply to acknowledging the alarm of a name, with all that stands under it; '': of every alarm."""
        chosen = [_index(name)] if name else range(annunciator.ALARM_COUNT)
        done = sum([annunciator.acknowledge(self.alarms, i, self._state['stamp']) for i in chosen])
        return Reply(done > 0, 'acknowledged' if done else 'refused: there is nothing to acknowledge')

    def shelve(self, name, seconds, reason):
        """The Reply to putting the alarm of a name away for some seconds, and why."""
        i = _index(name)
        self.reasons[i] = reason
        annunciator.shelve(self.alarms, i, self._state['stamp'], seconds)
        return Reply(True, f'{table.ALARM_NAMES[i]} is shelved for {seconds:g} s: {reason}')

    def unshelve(self, name):
        """The Reply to taking the alarm of a name back."""
        i = _index(name)
        if annunciator.apply_event(self.alarms, i, machine.Event.UNSHELVE, self._state['stamp']):
            return Reply(True, f'{table.ALARM_NAMES[i]} is back')
        return Reply(False, f'refused: {table.ALARM_NAMES[i]} is not shelved')


def _index(name):
    """The place of an alarm in the table."""
    name = name.replace('_', ' ')
    if name not in table.ALARM_INDEX:
        raise ValueError(f'alarm = {name!r}:{did_you_mean(name, table.ALARM_NAMES)} must be one of '
                         f'{", ".join(table.ALARM_NAMES)}')
    return table.ALARM_INDEX[name]
