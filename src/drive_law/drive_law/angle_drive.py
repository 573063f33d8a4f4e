"""Base of the units of drives that follow angles instead of rates: the beam of an array, a rotator.

Such a drive has no brakes. Two switches in its record determine its state: `wanted`, which clients request, and
`emergency`, a latched emergency stop.
"""

from pedestal_common.graph import nodes, topics
from pedestal_common.node.unit import Unit
from pedestal_common.quantities import Seconds
from pedestal_common.wire.commands import Reply

REFERENCE_TOPIC, DRIVE_STATE_TOPIC = 'acu/reference', 'adu/state'

ENABLED_TEXT, EMERGENCY_STOP_TEXT = 'enabled', 'emergency stop'
"""Texts of adu/state that the requests and the diagnosis name."""


class AngleDrive(Unit):
    """Unit with a part `switches` of its record, which has at least the fields wanted and emergency."""
    COMMAND = REFERENCE_TOPIC
    REQUESTS = nodes.DRIVE_SERVICES
    STATE_TEXTS: tuple[str, ...] = topics.TOPIC_BY_NAME[DRIVE_STATE_TOPIC].texts    # texts of adu/state by their code

    rests = True
    """True always, because the drive has no brakes to wait for."""

    @property
    def condition_code(self) -> int:
        """Present code of STATE_TEXTS, also between two steps."""
        raise NotImplementedError

    @property
    def condition(self) -> str:
        """Present text of adu/state, also between two steps."""
        return self.STATE_TEXTS[self.condition_code]

    def latency(self, topic: str) -> Seconds:
        """Return the age of the command in a step: one period."""
        return self.parameters.period

    def encode(self, topic: str, code: int) -> str:
        """Return the text of a code of adu/state."""
        return self.STATE_TEXTS[code]

    def request(self, name: str) -> Reply:
        """Execute one of REQUESTS. Return the Reply with the resulting state, or with the reason for a refusal."""
        switches = self.parts['switches']
        if name == 'adu/enable' and switches['emergency']:
            return Reply(False, 'refused: an emergency stop is latched (adu/reset_faults); '
                         f'drive is {self.condition}')
        if name in ('adu/enable', 'adu/disable'):
            switches['wanted'] = name == 'adu/enable'
        else:
            switches['emergency'] = name == 'adu/emergency_stop'
        return Reply(True, f'drive is {self.condition}')

    def requests_for(self, topic: str, text: str) -> list[str]:
        """Return the services that lead to a text of adu/state."""
        if text == EMERGENCY_STOP_TEXT:
            return ['adu/emergency_stop']
        latched = self.parts['switches']['emergency']
        return [*(['adu/reset_faults'] if latched else []), 'adu/enable' if text == ENABLED_TEXT else 'adu/disable']
