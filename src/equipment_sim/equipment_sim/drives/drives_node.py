"""ROS node of four simulated CiA 402 drives, with a bus of their own: a socketcand server on this machine.

A thread serves the bus. It advances drives and plant with the time, and publishes adu/truth at each SYNC.
"""
import threading
from collections.abc import Callable

from equipment_sim.drives import law
from equipment_sim.drives.unit import SimulatedDrives
from pedestal_common.graph.nodes import DRIVE_NODE, Node
from pedestal_common.node import unit_node
from pedestal_common.node.unit_node import Port
from pedestal_common.quantities import Message
from pedestal_common.wire import records
from pedestal_common.wire.records import NO_STAMP
from pedestal_hardware.bus import BusError
from pedestal_hardware.params import ServoDriveParameters
from pedestal_hardware.start import starts
from pedestal_hardware.unit import DRIVE_LABELS

POLL_S = 0.002  # longest time between two steps of the plant [s]


class DrivesNode(unit_node.UnitNode):
    """Node of the simulated drives."""
    parameters: ServoDriveParameters
    unit: SimulatedDrives

    PRECEDENCE = 2
    """Priority above that of the drive node, which waits for the reports of the drives in each step."""

    def __init__(self, row: Node) -> None:
        self.lock = threading.Lock()        # held while the unit steps or takes a command
        self.ending = False
        self.newest: dict[str, records.Decoded] = {}
        self.served: threading.Thread | None = None
        super().__init__(row)

    def begin(self) -> None:
        """Serve the bus."""
        try:
            from equipment_sim.drives.can_drive import CanDrives
            from equipment_sim.drives.socketcand_server import SocketcandServer
        except ImportError as error:
            raise BusError(f"{error}: pip install 'pedestal_hardware[can]'") from None
        p = self.parameters
        try:
            bus = SocketcandServer(p.bus.port)
        except OSError as error:
            raise BusError(f'bus.port = {p.bus.port}: {error.strerror}') from None
        [port] = self.ports
        for name, decoder in port.decoders.items():
            if name != self.unit.trigger:
                self.reader(name, unit_node.decoding(decoder), self._newest_receiver(name))
        if p.drives.start_after:
            self.message_reader('diagnostics', self._take_start)
        self.drives = CanDrives(bus, self.unit, self._on_sync)
        self.get_logger().info(f'{len(DRIVE_LABELS)} drives, nodes {", ".join(map(str, p.drives.nodes))}, on '
                               f'socketcand {p.bus.channel} at 127.0.0.1:{p.bus.port}')
        self.served = threading.Thread(target=self._guarded(self._serve), daemon=True)
        self.served.start()

    @property
    def awaits(self) -> str:
        """Text that names the inputs for which the node waits."""
        return f'the SYNC of a master on port {self.parameters.bus.port}'

    def _take_start(self, array: Message) -> None:
        """Take time 0 from the diagnostics of the node of the drives, which chooses it when all drives answer."""
        for start in starts(array.status, DRIVE_NODE):
            if start != self._epoch:
                with self.lock:
                    earlier, self._epoch = (self._epoch or 0) - start, start
                    if self.unit.parts['tick'] != NO_STAMP:
                        self.unit.parts['tick'] += earlier // law.TICK_NS

    def _newest_receiver(self, name: str) -> Callable[[records.Decoded, bool], None]:
        def take(message: records.Decoded, _: bool) -> None:
            self.newest[name] = message
        return take

    def _command_taker(self, port: Port) -> Callable[[Message], None]:
        take = super()._command_taker(port)

        def locked(message: Message) -> None:
            with self.lock:
                take(message)
        return locked

    def _serve(self) -> None:
        while not self.ending:
            self.drives.poll(POLL_S)
            with self.lock:
                _, utc = self.clock()
                law.advance(self.unit.memory.record, utc - self.epoch(utc))
            if (self.unit.urgent,) != tuple(self._urgent) and self.diagnose_now():
                self._urgent = [self.unit.urgent]
            for drive in self.drives.drives:
                while drive.notes:
                    self.get_logger().warning(f'{DRIVE_LABELS[drive.number]}: {drive.notes.pop(0)}')

    def _on_sync(self) -> None:
        [port] = self.ports
        with self.lock:
            _, utc = self.clock()
            values, self.newest = self.newest, {}
            port.step(utc, values)
            truth = self.unit.outputs[0]['adu/truth']
            if truth['stamp'] < 0:
                truth['stamp'] = NO_STAMP
                return
            self.begin_step(utc)
            port.publish()

    def close(self) -> None:
        """Close the bus and end."""
        self.ending = True
        if self.served is not None:
            self.served.join(1.0)
        super().close()
