"""Bus of the drives: the five calls that the node needs of it. Nothing above this interface knows which bus it is."""
import typing

from pedestal_common.quantities import Bools, Records


class BusError(OSError):
    """Error of a bus or of a drive on it; the message names the drive, the object and the cause."""


class Bus(typing.Protocol):
    """Bus with pdo.DRIVE_COUNT drives.

    A drive is `ready` after its `start`. It stays ready until it has no longer reported; the bus then keeps running
    for the other drives. `notes` holds texts about rejected messages; the node logs and removes them.
    """
    notes: list[str]

    def start(self, drive: int, torque_mode: bool) -> None:
        """Bring a drive to the point where it exchanges data. Raises BusError.

        The bus identifies the drive, maps its data and reads the mapping back. Then the drive supervises this node.

        torque_mode: True if its command holds the target torque in place of the torque offset.
        """

    def exchange(self, commands: Records, reports: Records) -> Bools:
        """Send a command to each drive, let all drives act on it at the same time, and receive their reports.

        commands: (4,) of pdo.COMMAND_DTYPE; reports: (4,) of pdo.REPORT_DTYPE, changed for drives that have reported.
        Return for each drive whether it has reported completely. Called once a period.
        """

    def read(self, drive: int, index: int, subindex: int, kind: str) -> int:
        """Return the value of an object of a drive. kind: one of 'bBhHiI', as in struct. Raises BusError."""

    def write(self, drive: int, index: int, subindex: int, kind: str, value: int) -> None:
        """Write an object of a drive. Raises BusError."""

    def stop(self) -> None:
        """End the exchange and leave the bus."""
