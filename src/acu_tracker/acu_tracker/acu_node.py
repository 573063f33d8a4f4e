"""ROS node of the control unit: a UnitNode that also watches the lost steps in the diagnostics of the drive.

Only the drive knows all lost steps: those that it missed, and those that it made without a new command. A control unit
that is late cannot tell from its inputs that its commands came too late.
"""
import collections

from acu_tracker.unit import Acu
from pedestal_common.graph import nodes
from pedestal_common.node.unit_node import UnitNode
from pedestal_common.quantities import Message, Seconds

STEP_KEYS = ('step', 'lost_steps')  # keys of the diagnostics of the drive: number of its last step, lost steps
LOSS_WINDOW_S = 5.0                 # time over which the lost steps are counted [s]
START_COUNTS = 3                    # number of the first diagnostics that are not taken
MAX_LOST_SHARE = 0.01               # largest share of lost steps without an alarm [-]


class StepLosses:
    """Lost steps of the last LOSS_WINDOW_S. Because the nodes of a graph start one after another, the first counts are
    not taken, and nothing is judged before the first window is full."""

    def __init__(self, period: Seconds) -> None:
        self._window = round(LOSS_WINDOW_S / period)    # [steps]
        # (number of the step, lost steps) of the diagnostics in the window, and of the last ones before it
        self._counts: collections.deque[tuple[int, int]] = collections.deque()
        self._untaken = START_COUNTS

    def take(self, step: int, lost: int) -> str:
        """Take the counts of the drive. Return the losses as text if they are excessive, else ''. Lower counts than
        before are those of a drive that was started again."""
        counts = self._counts
        if counts and (step < counts[-1][0] or lost < counts[-1][1]):
            counts.clear()
        if self._untaken > 0:
            self._untaken -= 1
            return ''
        counts.append((step, lost))
        while len(counts) > 1 and step - counts[1][0] >= self._window:
            counts.popleft()
        steps, missing = step - counts[0][0], lost - counts[0][1]
        if steps < self._window or missing <= MAX_LOST_SHARE * steps:
            return ''
        return f'{missing} of the last {steps} steps were lost, {min(missing / steps, 1.0):.0%}'


class AcuNode(UnitNode):
    """Node of an Acu."""
    unit: Acu

    def begin(self) -> None:
        """Follow the trigger of the unit and, in realtime, the diagnostics. In lockstep no step is lost."""
        super().begin()
        self._losses = StepLosses(self.unit.parameters.period)
        if not self.graph.lockstep:
            self.message_reader('diagnostics', self._take_diagnostics)

    def _take_diagnostics(self, array: Message) -> None:
        for status in array.status:
            if status.name == nodes.DRIVE_NODE:
                counts = {pair.key: pair.value for pair in status.values if pair.key in STEP_KEYS}
                if len(counts) == len(STEP_KEYS) and all(text.isdecimal() for text in counts.values()):
                    self.unit.take_losses(self._losses.take(*(int(counts[key]) for key in STEP_KEYS)))
