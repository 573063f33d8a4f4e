"""ROS node of an antenna with four CiA 402 servo drives, in place of `adu_node`. A thread of the node commissions
drives that have not been used yet or that return to the bus."""
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from drive_law.rate_drive_node import RateDriveNode
from pedestal_common.graph.nodes import Node
from pedestal_common.node.unit import Diagnosis
from pedestal_common.quantities import Message
from pedestal_hardware import commissioning, errors
from pedestal_hardware.bus import BusError
from pedestal_hardware.params import ServoDriveParameters
from pedestal_hardware.start import StartsWithEquipment
from pedestal_hardware.unit import DRIVE_LABELS, ServoDrives

if TYPE_CHECKING:
    from pedestal_hardware.canopen_bus import CanopenBus

RETRY_PERIOD_S = 0.5  # time between two tries to commission drives that report nothing [s]


ENABLE_LEAD_S = 2.0  # time before time 0 in which the drives are enabled [s]
LEAVE_TIME_S = 2.0  # longest wait for the end of the commissioning thread, after the node has left the bus [s]
ANSWER_POLL_S = 0.02  # time between two checks whether all drives answer [s]


class DriveNode(StartsWithEquipment, RateDriveNode):
    """Node of four servo drives."""
    parameters: ServoDriveParameters
    unit: ServoDrives

    def __init__(self, row: Node) -> None:
        self.recommission: set[int] = set()     # drives that the thread commissions again, because of a reset
        self.changed, self.ending = threading.Event(), False
        self.bus: CanopenBus | None = None
        self.commissioning: threading.Thread | None = None
        self.shown_errors: list[int] = []
        self.shown_problems: list[str] = []
        super().__init__(row)

    def begin(self) -> None:
        """Prepare the bus and the steps. The first step waits until all drives answer."""
        # The bus is imported here, because python-can is an extra of this package.
        try:
            from pedestal_hardware.canopen_bus import CanopenBus
        except ImportError as error:
            raise BusError(f"{error}: pip install 'pedestal_hardware[can]'") from None
        p = self.parameters
        self.bus = CanopenBus(p.bus, p.drives.nodes, DRIVE_LABELS, p.period)
        self.answer_limit = time.monotonic() + p.bus.connect_time
        self.commissioning = threading.Thread(target=self.commission_lost_drives, daemon=True)
        self.commissioning.start()
        self.FIRST_STEP = -round(ENABLE_LEAD_S / p.period)      # the drives are enabled before time 0
        super().begin()

    @property
    def awaits(self) -> str:
        """Condition for the first step: the drives answer, then the start time."""
        drives = self.parameters.drives
        answer = f'the drives {", ".join(map(str, drives.nodes))}'
        return answer if drives.start_after else f'{answer}, then {super().awaits}'

    def make_due_step(self) -> None:
        """Make the due step as soon as all drives have answered. Raises BusError if one does not answer in time."""
        unit = self.unit
        if unit.bus is None:
            missing = [i for i in range(len(DRIVE_LABELS)) if not unit.parts['drives']['ready'][i]]
            tried = [i for i in missing if unit.problems[i]]
            if tried and time.monotonic() > self.answer_limit:
                raise BusError(f'{self.label(tried[0])}: {unit.problems[tried[0]]}')
            if missing:
                self.wait = ANSWER_POLL_S
                return
            self._use_bus()
        super().make_due_step()

    def _use_bus(self) -> None:
        drives = range(len(DRIVE_LABELS))
        assert self.bus is not None
        found = [self.bus.read(drive, 0x603F, 0, 'H') for drive in drives]
        # The drives have an error of the bus because this node or the bus was absent. This start clears it.
        if any(found) and all(errors.is_of_the_bus(code) for code in found if code):
            self.unit.reset_drives(list(drives))
        self.unit.bus = self.bus
        if lead := self.parameters.drives.start_after:
            self._epoch = self.choose_start(self.epoch(self.clock()[1]), lead)
        self.get_logger().info(f'drives {", ".join(map(str, self.parameters.drives.nodes))} answer')

    def diagnosed(self) -> Diagnosis:
        """Return the Diagnosis of the drives, with time 0 if it follows their answer."""
        return self.with_start(super().diagnosed())

    def label(self, drive: int) -> str:
        """Return the name of a drive for texts, with its CANopen node."""
        return f'{DRIVE_LABELS[drive]} (node {self.parameters.drives.nodes[drive]})'

    def commission(self, drive: int) -> bool:
        """Start a drive and verify its settings. Return True if it can be used; otherwise keep the reason."""
        assert self.bus is not None
        try:
            self.bus.start(drive, self.parameters.torque_mode(drive))
            self.unit.use_drive(drive, commissioning.commission(self.bus, drive, self.parameters))
        except BusError as error:
            self.unit.problems[drive] = str(error)
            return False
        return True

    def commission_lost_drives(self) -> None:
        """Commission drives that have returned to the bus or whose faults are reset, until the node ends."""
        while not self.ending:
            again = self.recommission.copy()
            self.recommission.difference_update(again)      # a request in the meantime stays
            for drive in sorted({*self.unit.lost, *again}):
                self.unit.parts['drives']['ready'][drive] = 0
                if not self.ending and self.commission(drive) and self.unit.bus is not None:
                    self.get_logger().info(f'{self.label(drive)} is on the bus again')
            self.changed.wait(RETRY_PERIOD_S)
            self.changed.clear()

    def _service(self, name: str) -> Callable[[Message, Message], Message]:
        """Let a reset also commission the faulty drives again, because some drives accept the reset only then."""
        serve = super()._service(name)

        def call(request: Message, response: Message) -> Message:
            faulty = self.unit.faulty
            answer = serve(request, response)
            if name == 'adu/reset_faults' and answer.success and faulty:
                self.recommission.update(faulty)
                self.changed.set()
            return answer
        return call

    def after_step(self) -> None:
        """Log new errors of the drives, and what the bus has rejected."""
        super().after_step()
        shown = self.unit.parts['drives']['error'].tolist()
        if shown != self.shown_errors:
            for drive, (before, now) in enumerate(zip(self.shown_errors or [0] * len(shown), shown)):
                if now and now != before:
                    self.get_logger().warning(f'{self.label(drive)}: error {errors.name(now)}')
            self.shown_errors = shown
        if self.unit.problems != self.shown_problems:
            for drive, problem in enumerate(self.unit.problems):
                if problem and problem not in self.shown_problems:
                    self.get_logger().warning(f'{self.label(drive)}: {problem}')
            self.shown_problems = list(self.unit.problems)
        assert self.bus is not None
        while self.bus.notes:
            self.get_logger().warning(self.bus.notes.pop(0))

    def close(self) -> None:
        """Leave the bus and end."""
        self.ending = True
        self.changed.set()
        if self.bus is not None:
            self.bus.stop()
        if self.commissioning is not None:
            self.commissioning.join(LEAVE_TIME_S)
        super().close()
