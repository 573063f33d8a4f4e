"""Base class of the units of simulated equipment, which accepts the commands to inject faults."""
from collections.abc import Mapping

from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.injection import schedule, table
from pedestal_common.node.unit import Unit
from pedestal_common.quantities import Nanoseconds, Value
from pedestal_common.wire.commands import Command, Reply
from pedestal_common.wire.records import NO_STAMP


class Simulated(Unit):
    """Unit of simulated equipment. Its record has a field `schedule` (schedule.Schedule), which its law reads.
    Its parameters have the field `inject`.
    """
    FAULTS_OF = ''      # node of table.INJECTED_FAULTS whose faults it has; '': its own node

    @property
    def _faulty(self) -> str:
        return self.FAULTS_OF or self.NODE.name

    def schedule(self) -> list[tuple[Nanoseconds, Command]]:
        """Return the commands of the parameter `inject` with their times."""
        return table.scheduled_commands(self._faulty, self.parameters.inject)

    def execute(self, command: Command, arguments: Mapping[str, Value]) -> Reply:
        """Inject a fault from the next step; the Reply states the stamp of the step before."""
        part, node = self.parts['schedule'], self._faulty
        since = '' if part['stamp'] == NO_STAMP else f' from the step after {part["stamp"] / NS_PER_SECOND:.6f} s on'
        if command.verb == table.CLEAR_COMMAND.name:
            schedule.clear(part)
            return Reply(True, f'no fault{since}')
        refusal = self.lockstep and table.refused_in_lockstep(node, command.verb)
        if refusal:
            raise ValueError(refusal)
        *values, duration = [argument.options.index(arguments[argument.name]) if argument.options else
                             arguments[argument.name] for argument in self._fault(command.verb).arguments]
        schedule.add(part, table.code(node, command.verb), values, duration)
        return Reply(True, f'{command.verb}{since}' + (f', for {duration:g} s' if duration < table.MAX_FAULT_DURATION_S
                                                       else ''))

    def _fault(self, name: str) -> table.Fault:
        return table.INJECTED_FAULTS[self._faulty][table.code(self._faulty, name)]
