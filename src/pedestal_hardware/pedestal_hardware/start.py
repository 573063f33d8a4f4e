"""Time 0 of a run that follows the answer of the equipment, in place of graph.start.

The node of the equipment chooses time 0 and publishes it in its diagnostics. The simulated equipment and the command
line take it from there.
"""
from collections.abc import Sequence

from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node.shell import Shell
from pedestal_common.node.unit import Diagnosis
from pedestal_common.quantities import Message, Nanoseconds, Seconds

START_KEY = 'start'  # key of time 0 (UTC, ns) in the diagnostics of the node that chooses it


class StartsWithEquipment(Shell):
    """Base of a node that chooses time 0."""
    start_time: Nanoseconds | None = None       # None before the choice

    def choose_start(self, start: Nanoseconds, lead: Seconds) -> Nanoseconds:
        """Return time 0, and publish it: `start`, moved by whole seconds to at least a lead time after now."""
        early = (start - self.clock()[1] - round(lead * NS_PER_SECOND)) // NS_PER_SECOND
        self.start_time = start - early * NS_PER_SECOND
        self.diagnose_now()
        return self.start_time

    def with_start(self, diagnosis: Diagnosis) -> Diagnosis:
        """Return a Diagnosis with time 0, if the node has chosen it."""
        if self.start_time is None:
            return diagnosis
        return diagnosis._replace(values=[*diagnosis.values, (START_KEY, str(self.start_time))])


def starts(statuses: Sequence[Message], node: str) -> list[Nanoseconds]:
    """Return time 0 in the DiagnosticStatus of a node, [] without one."""
    return [int(value.value) for status in statuses if status.name == node
            for value in status.values if value.key == START_KEY]
