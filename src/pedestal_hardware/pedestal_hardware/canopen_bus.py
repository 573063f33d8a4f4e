"""Bus of CANopen drives, by the packages canopen and python-can.

In each period the node sends the commands (RPDO 1 of each drive) and then the synchronisation (SYNC). With the SYNC
each drive takes its command, measures, and sends its reports (TPDO 1 to 3). The call `exchange` itself receives them.
The node's heartbeat comes from the same call, so that drives also notice a node that hangs. A thread receives only
while no exchange does so, for the answers to the settings of the drives.
"""
import contextlib
import logging
import struct
import threading
import time
from collections.abc import Callable, Iterator, Sequence

import can
import canopen
import numpy as np

from pedestal_common.quantities import Bools, Records, Seconds
from pedestal_hardware import pdo
from pedestal_hardware.bus import BusError
from pedestal_hardware.can_line import Frame, Line, PythonCanLine, SocketcandLine
from pedestal_hardware.params import BusParameters

CIA402_PROFILE = 402  # profile of a drive in the low half of its device type (1000)

SYNC_COB_ID, RPDO_1_COB_ID, HEARTBEAT_COB_ID, EMERGENCY_COB_ID = 0x80, 0x200, 0x700, 0x80
TPDO_COB_IDS = 0x180, 0x280, 0x380
MASTER_NODE = 127  # CANopen node of this computer, whose heartbeat the drives supervise

NMT_START, NMT_PRE_OPERATIONAL, NMT_RESET_COMMUNICATION = 1, 128, 130
HEARTBEAT_OPERATIONAL = b'\x05'
INVALID_COB_ID, NO_REMOTE_REQUEST = 1 << 31, 1 << 30  # bits of the COB-ID of a PDO: it is off; no remote request
HEARTBEATS_PER_TIMEOUT = 5  # number of heartbeats of this node in the time after which the drives miss it
BOOT_TIME_S = 1.0  # longest wait for the boot-up message of a drive after a reset of its communication [s]

IDLE_TIME_S, IDLE_POLL_S = 0.05, 0.005
"""Time after an exchange from which on the thread receives, and its longest wait for a frame [s]."""

MAX_NOTES = 50  # largest number of notes that are kept

# The errors of a bus and of its drives reach the node as BusError; these loggers would print them a second time.
for _name in ('canopen', 'can'):
    logging.getLogger(_name).setLevel(logging.CRITICAL)


class _Sender:
    """Bus of a canopen.Network, which only sends by it."""

    def __init__(self, send: Callable[[list[Frame]], None]) -> None:
        self._send = send

    def send(self, message: can.Message) -> None:
        """Send a can.Message."""
        self._send([(message.arbitration_id, bytes(message.data))])


class CanopenBus:
    """CANopen bus with four drives. nodes: their CANopen nodes; labels: their names for texts."""

    def __init__(self, parameters: BusParameters, nodes: Sequence[int], labels: Sequence[str],
                 period: Seconds) -> None:
        self.notes: list[str] = []
        self._p, self._nodes, self._labels, self._period = parameters, nodes, labels, period
        self._network: canopen.Network | None = None
        self._line: Line | None = None
        self._drives: list[canopen.RemoteNode] = []
        self._closed = False
        self._opening, self._reading, self._sending = threading.Lock(), threading.Lock(), threading.Lock()
        size = pdo.REPORT_DTYPE.itemsize
        self._places = {cob + node: (i, i * size + pdo.REPORT_PARTS[k][0], pdo.REPORT_PARTS[k][1])
                        for i, node in enumerate(nodes) for k, cob in enumerate(TPDO_COB_IDS)
                        if k in pdo.reports_of(i)}
        self._started = [False] * len(nodes)
        self._buffer = bytearray(len(nodes) * size)
        self._received = np.frombuffer(self._buffer, pdo.REPORT_DTYPE)
        self._awaited: set[int] = set()                 # COB-IDs of the reports of this period
        self._refused: set[tuple[int, int]] = set()     # (COB-ID, length) of the frames that were noted
        self._last_heartbeat = self._exchanged = -np.inf

    def start(self, drive: int, torque_mode: bool = False) -> None:
        """Identify a drive and map its data; see bus.Bus."""
        with self._opening:
            if self._closed:
                raise BusError('the bus is closed')
            if self._line is None:
                self._open()
        self._started[drive] = False
        node = self._nodes[drive]
        self._reset_communication(drive)
        profile = self.read(drive, 0x1000, 0, 'I') & 0xFFFF
        if profile != CIA402_PROFILE:
            raise BusError(f'object 1000: device profile {profile}: must be {CIA402_PROFILE}, a drive')
        commands = pdo.COMMAND_MAPPINGS[torque_mode]
        for k, mapping in enumerate(commands):
            self._map(drive, 0x1400 + k, 0x1600 + k, RPDO_1_COB_ID + node, mapping)
        for k in range(len(commands), 4):
            with contextlib.suppress(BusError):     # a drive may have fewer PDOs
                self.write(drive, 0x1400 + k, 1, 'I', INVALID_COB_ID | RPDO_1_COB_ID + 0x100 * k + node)
        for k in pdo.reports_of(drive):
            self._map(drive, 0x1800 + k, 0x1A00 + k, (TPDO_COB_IDS[k] + node) | NO_REMOTE_REQUEST,
                      pdo.REPORT_MAPPING[k])
        with contextlib.suppress(BusError):         # some drives have no period of the SYNC
            self.write(drive, 0x1006, 0, 'I', round(self._period * 1e6))
        self._write_verified(drive, 0x1016, 1, 'I', MASTER_NODE << 16 | round(self._p.heartbeat * 1e3))
        self._send(0, bytes((NMT_START, node)))
        self._started[drive] = True

    def exchange(self, commands: Records, reports: Records) -> Bools:
        """Exchange commands for reports; see bus.Bus."""
        reported = np.zeros(len(self._nodes), bool)
        if self._line is None:
            return reported
        # The thread gives way before this call waits for it; otherwise it could take the lock again and again.
        now = self._exchanged = time.monotonic()
        frames = [(RPDO_1_COB_ID + node, commands[i].tobytes())
                  for i, node in enumerate(self._nodes) if self._started[i]]
        frames.append((SYNC_COB_ID, b''))
        if now - self._last_heartbeat >= self._p.heartbeat / HEARTBEATS_PER_TIMEOUT:
            self._last_heartbeat = now
            frames.append((HEARTBEAT_COB_ID + MASTER_NODE, HEARTBEAT_OPERATIONAL))
        with self._reading:
            expected = [i for i, started in enumerate(self._started) if started]
            end = now + self._p.report_share * self._period
            try:
                self._receive(0.0)      # reports of an earlier period
                self._awaited = {cob for cob, (i, _, _) in self._places.items() if i in expected}
                self._send_all(frames)
                while self._awaited and (left := end - time.monotonic()) > 0.0:
                    self._receive(left)
            except BusError as error:
                self._note(str(error))
                return reported
        reported[expected] = True
        for cob in self._awaited:
            reported[self._places[cob][0]] = False
        reports[reported] = self._received[reported]
        return reported

    def read(self, drive: int, index: int, subindex: int, kind: str) -> int:
        """Return the value of an object; see bus.Bus. Raises BusError."""
        with self._errors_named(index, subindex):
            data = self._drives[drive].sdo.upload(index, subindex)
        size = struct.calcsize(kind)
        if len(data) < size:
            raise BusError(f'object {index:04X}:{subindex}: {len(data)} bytes: must be {size}')
        return struct.unpack(f'<{kind}', data[:size])[0]

    def write(self, drive: int, index: int, subindex: int, kind: str, value: int) -> None:
        """Write an object; see bus.Bus. Raises BusError."""
        with self._errors_named(index, subindex):
            self._drives[drive].sdo.download(index, subindex, struct.pack(f'<{kind}', value))

    def stop(self) -> None:
        """Stop the exchange of all drives, and leave the bus. No drive can be started afterwards."""
        self._closed = True
        with self._opening:
            with contextlib.suppress(BusError):
                for drive, node in enumerate(self._nodes):
                    if self._started[drive]:
                        # The drives are off. This avoids an error of the heartbeat after an orderly end of the node.
                        self.write(drive, 0x1016, 1, 'I', 0)
                    self._send(0, bytes((NMT_PRE_OPERATIONAL, node)))
            self._close()

    def _open(self) -> None:
        self._close()
        p = self._p
        line: Line
        try:
            if p.interface == 'socketcand':
                line = SocketcandLine(p.host, p.port, p.channel, p.sdo_time)
            else:
                line = PythonCanLine(interface=p.interface, channel=p.channel,
                                     **{'bitrate': p.bitrate} if p.interface == 'slcan' else {})
        except (OSError, can.CanError, ValueError) as error:
            where = f' at {p.host}:{p.port}' if p.interface == 'socketcand' else ''
            raise BusError(f'no {p.interface} bus {p.channel}{where}: {error}') from None
        network = canopen.Network(_Sender(self._send_all))  # type: ignore[arg-type]  # it only sends by its bus
        self._drives = [network.add_node(canopen.RemoteNode(node, canopen.ObjectDictionary()))
                        for node in self._nodes]
        for drive in self._drives:
            drive.sdo.RESPONSE_TIMEOUT, drive.sdo.MAX_RETRIES = p.sdo_time, 1
        self._started, self._network, self._line = [False] * len(self._nodes), network, line
        threading.Thread(target=self._receive_between_exchanges, args=(line,), daemon=True).start()

    def _receive_between_exchanges(self, line: Line) -> None:
        while self._line is line:
            if time.monotonic() - self._exchanged < IDLE_TIME_S:
                time.sleep(IDLE_TIME_S)
                continue
            with self._reading, contextlib.suppress(BusError):
                self._receive(IDLE_POLL_S)

    def _close(self) -> None:
        line, self._line, self._network = self._line, None, None
        if line is not None:
            with contextlib.suppress(can.CanError, OSError):
                line.close()

    def _receive(self, timeout: Seconds) -> None:
        """Take the frames that arrive, as the holder of `_reading`. An error closes the line. Raises BusError."""
        line = self._line
        if line is None:
            raise BusError('the bus is closed')
        try:
            frames = line.receive(timeout)
        except (OSError, ValueError) as error:    # ValueError: closed in the meantime
            self._close()
            raise BusError(f'the bus is lost: {error}') from None
        for cob, data in frames:
            if cob in self._places:
                self._take(cob, data)
            else:
                self._notify(cob, data)

    def _notify(self, cob: int, data: bytes) -> None:
        """Give a frame that is no report to the package canopen. A frame that canopen cannot read is noted once."""
        network = self._network
        if network is None:
            return
        try:
            network.notify(cob, bytearray(data), 0.0)
        except Exception as error:      # what the parsers of canopen raise, such as struct.error
            if len(self._refused) < MAX_NOTES and (cob, len(data)) not in self._refused:
                self._refused.add((cob, len(data)))
                self._note(f'frame 0x{cob:03X} of {len(data)} bytes is refused: {error}')
        if EMERGENCY_COB_ID < cob <= EMERGENCY_COB_ID + MASTER_NODE:
            # The reports hold the errors. The package canopen would keep every emergency message for ever.
            for drive in self._drives:
                drive.emcy.reset()

    def _send_all(self, frames: list[Frame]) -> None:
        line = self._line
        if line is None:
            raise BusError('the bus is closed')
        try:
            with self._sending:
                line.send(frames)
        except OSError as error:
            raise BusError(f'frame 0x{frames[0][0]:03X} not sent: {error}') from None

    def _reset_communication(self, drive: int) -> None:
        """Reset the communication of a drive. It clears the errors of the bus, and lets the drive answer in a known
        state."""
        booted, cob, network = threading.Event(), HEARTBEAT_COB_ID + self._nodes[drive], self._network
        if network is None:
            raise BusError('the bus is closed')

        def note(_cob: int, data: bytearray, _time: float) -> None:
            if data and data[0] == 0:
                booted.set()
        network.subscribe(cob, note)
        self._send(0, bytes((NMT_RESET_COMMUNICATION, self._nodes[drive])))
        booted.wait(BOOT_TIME_S)
        network.unsubscribe(cob, note)

    def _map(self, drive: int, communication: int, mapping: int, cob: int, objects: pdo.Mapping) -> None:
        """Map objects to a PDO in the order that CiA 301 prescribes, and read the mapping back. Raises BusError."""
        self.write(drive, communication, 1, 'I', cob | INVALID_COB_ID)
        self.write(drive, mapping, 0, 'B', 0)
        for k, (index, subindex, bits) in enumerate(objects, 1):
            self._write_verified(drive, mapping, k, 'I', index << 16 | subindex << 8 | bits)
        self._write_verified(drive, mapping, 0, 'B', len(objects))
        self._write_verified(drive, communication, 2, 'B', 1)
        if communication >= 0x1800:
            with contextlib.suppress(BusError):     # inhibit time
                self.write(drive, communication, 3, 'H', 0)
        self._write_verified(drive, communication, 1, 'I', cob)

    def _write_verified(self, drive: int, index: int, subindex: int, kind: str, value: int) -> None:
        self.write(drive, index, subindex, kind, value)
        found = self.read(drive, index, subindex, kind)
        if found != value:
            raise BusError(f'object {index:04X}:{subindex} is 0x{found:X} after writing 0x{value:X}')

    def _send(self, cob: int, data: bytes) -> None:
        self._send_all([(cob, data)])

    @contextlib.contextmanager
    def _errors_named(self, index: int, subindex: int) -> Iterator[None]:
        where = f'object {index:04X}:{subindex}'
        try:
            yield
        except canopen.SdoAbortedError as error:
            raise BusError(f'{where}: abort {error}') from None
        except canopen.SdoCommunicationError:
            raise BusError(f'{where}: no answer within {self._p.sdo_time:g} s') from None
        except (OSError, can.CanError, RuntimeError, IndexError, struct.error) as error:
            raise BusError(f'{where}: {error}') from None

    def _take(self, cob: int, data: bytes) -> None:
        i, first, size = self._places[cob]
        if len(data) != size:
            self._note(f'{self._labels[i]}: frame 0x{cob:03X} has {len(data)} bytes: must have {size}')
            return
        self._buffer[first:first + size] = data
        self._awaited.discard(cob)

    def _note(self, text: str) -> None:
        if len(self.notes) < MAX_NOTES:
            self.notes.append(text)
