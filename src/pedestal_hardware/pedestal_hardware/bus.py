"""Bus of the drives: the calls that the node needs of it. Nothing above this interface knows which bus it is."""
import typing

from pedestal_common.quantities import Bools, Records


class BusError(OSError):
    """Error of a bus or of a drive on it; the message names the drive, the object and the cause."""


class Bus(typing.Protocol):
    """A drive stays ready after its `start` until it has no longer reported; the bus then keeps running for the other
    drives. `notes` holds texts about rejected messages; the node logs and removes them."""
    notes: list[str]

    def start(self, drive: int, torque_mode: bool) -> None:
        """Identify a drive, map its data and read the mapping back. Then the drive supervises this node. Raises
        BusError. torque_mode: True if its command holds the target torque in place of the torque offset."""

    def exchange(self, commands: Records, reports: Records) -> Bools:
        """Send a command to each drive, let all drives act on it at the same time, and receive their reports, once a
        period.

        commands: (4,) of pdo.COMMAND_DTYPE; reports: (4,) of pdo.REPORT_DTYPE, changed for drives that have reported.
        Return for each drive whether it has reported completely.
        """

    def read(self, drive: int, index: int, subindex: int, kind: str) -> int:
        """Return the value of an object of a drive. kind: one of 'bBhHiI', as in struct. Raises BusError."""

    def write(self, drive: int, index: int, subindex: int, kind: str, value: int) -> None:
        """Write an object of a drive. Raises BusError."""

    def stop(self) -> None:
        """End the exchange and leave the bus."""
