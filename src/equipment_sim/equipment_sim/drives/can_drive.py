"""CANopen side of a simulated drive: objects by SDO, PDO on SYNC, supervision of the master's heartbeat."""
import struct
import time
from collections.abc import Callable

import can
import canopen
import numpy as np
from canopen import objectdictionary
from canopen.sdo.base import SdoVariable

from drive_law.axis_params import SPEED_LOOP_PERIOD_S
from equipment_sim.drives import law, objects
from equipment_sim.drives.socketcand_server import SocketcandServer
from equipment_sim.drives.unit import SimulatedDrives
from pedestal_common.quantities import AnyRecord, Seconds
from pedestal_hardware import cia402, commissioning, errors, pdo
from pedestal_hardware.can_line import Frame
from pedestal_hardware.canopen_bus import (
    EMERGENCY_COB_ID,
    HEARTBEAT_COB_ID,
    INVALID_COB_ID,
    NMT_RESET_COMMUNICATION,
    SYNC_COB_ID,
)

NMT_RESET_NODE = 129
OBJECT_OF_FIELD = dict(zip(
    ((index, subindex) for mapping in pdo.REPORT_MAPPING for index, subindex, _ in mapping), pdo.REPORT_FIELDS))
"""{(index, subindex): field of the report} of the objects that change by themselves."""

PLACE_OF_OBJECT = {key: pdo.REPORT_OFFSETS[field] for key, field in OBJECT_OF_FIELD.items()}
"""{(index, subindex): first byte in the record of a report} of these objects."""

FIELD_OF_OBJECT = {(0x6060, 0): 'mode', (0x60FF, 0): 'target', (0x60B1, 0): 'velocity_offset',
                   (0x60B2, 0): 'torque_offset', (0x6071, 0): 'target_torque',
                   (0x605A, 0): 'quick_stop_code'}
"""{(index, subindex): field of law.Drive} of the objects that a write changes directly."""

COMMUNICATION_OBJECTS = range(0x1000, 0x1C00)
"""Indices of the objects that a reset of the communication sets to their defaults."""

CONNECTION_LOST_FAULT = 1  # value of 6007 with which a lost connection is a fault of the drive

CONNECTION_LOST_COMMANDS = {2: cia402.COMMAND_DISABLE_VOLTAGE, 3: cia402.COMMAND_QUICK_STOP}
"""{value of 6007: controlword that the drive then obeys by itself}. With 0 it ignores a lost connection."""


class CanDrive:
    """Drive number `number` of the simulated drives on a network; node: its CANopen node."""

    def __init__(self, network: canopen.Network, node: int, number: int, unit: SimulatedDrives) -> None:
        self.network, self.node, self.number, self.unit = network, node, number, unit
        self.local = canopen.LocalNode(node, objects.dictionary(node, unit.parameters.drives.profile))
        network.add_node(self.local)
        self.local.add_write_callback(self._written)
        self.local.add_read_callback(self._read)
        self._staged: dict[int, bytes] = {}         # {number of the PDO: its data} until the next SYNC
        self._heard: Seconds | None = None          # time of the last heartbeat of the master, None before
        self._silent_until: Seconds = 0.0
        self._lost_since: Seconds | None = None     # time of the last heartbeat of a lost master
        self._consumer, self._limit_s = 0, 0.0
        self.notes: list[str] = []
        self._receives: dict[int, list[tuple[int, int, int]]] = {}
        self._sends: dict[int, list[tuple[int, int]]] = {}      # {number of the PDO: [(first byte, bytes)]}
        network.subscribe(0, self._on_nmt)
        for cob in range(0x200, 0x600, 0x100):
            network.subscribe(cob + node, self._stage)
        self._boot()

    @property
    def record(self) -> AnyRecord:
        """Record of the drive in the law."""
        return self.unit.parts['drive'][self.number]

    @property
    def silent(self) -> bool:
        """True while the drive is off the bus."""
        return time.monotonic() < self._silent_until

    def _boot(self) -> None:
        for index in COMMUNICATION_OBJECTS:
            self.local.data_store.pop(index, None)
        self._staged = {}
        self._supervise(0, 0.0)
        self._receives, self._sends = {}, {}
        self.local.nmt.send_command(0)
        self.local.nmt.state = 'PRE-OPERATIONAL'

    def _on_nmt(self, _cob: int, data: bytearray, _time: float) -> None:
        command, node = data[0], data[1]
        if node not in (0, self.node):
            return
        if command in (NMT_RESET_COMMUNICATION, NMT_RESET_NODE):
            self._boot()
        self._receives, sends = (self._mappings(base) for base in (0x1400, 0x1800))
        self._sends = {k: [(PLACE_OF_OBJECT[index, subindex], size) for index, subindex, size in mapping]
                       for k, mapping in sends.items()}

    def _object(self, index: int, subindex: int) -> int:
        found = self.local.sdo[index]
        member = found if isinstance(found, SdoVariable) else found[subindex]
        return int(member.raw)

    def _mappings(self, base: int) -> dict[int, list[tuple[int, int, int]]]:
        """Return {number of the PDO: [(index, subindex, bytes)]} of the valid PDOs. base: 0x1400 or 0x1800."""
        found = {}
        for k in range(objects.PDO_COUNT):
            if self._object(base + k, 1) & INVALID_COB_ID:
                continue
            index = base + 0x200 + k
            entries = [self._object(index, s) for s in range(1, self._object(index, 0) + 1)]
            found[k] = [(entry >> 16, entry >> 8 & 0xFF, (entry & 0xFF) // pdo.BITS_PER_BYTE) for entry in entries]
        return found

    def _stage(self, cob: int, data: bytearray, _time: float) -> None:
        k = (cob >> 8) - 2
        if self.local.nmt.state != 'OPERATIONAL' or k not in self._receives:
            return
        if len(data) != sum(size for _, _, size in self._receives[k]):
            self.fault(0x8210)
            return
        self._staged[k] = bytes(data)

    def act(self) -> None:
        """Take the staged commands, at a SYNC."""
        for k, data in self._staged.items():
            first = 0
            for index, subindex, size in self._receives[k]:
                signed = (index, subindex) != (0x6040, 0)
                self._put(index, subindex, int.from_bytes(data[first:first + size], 'little', signed=signed))
                first += size
        self._staged.clear()

    def report_frames(self, data: bytes) -> list[Frame]:
        """Return the frames of the reports after a SYNC. data: bytes of its record."""
        if self.silent or self.local.nmt.state != 'OPERATIONAL':
            return []
        return [(0x180 + 0x100 * k + self.node, b''.join([data[first:first + size] for first, size in places]))
                for k, places in self._sends.items()]

    def _read(self, index: int, subindex: int, od: objectdictionary.ODVariable) -> int | None:
        field = OBJECT_OF_FIELD.get((index, subindex))
        if field:
            return int(self.unit.measure()[self.number][field])
        axis = self.unit.axis_of(self.number)
        if (index, subindex) == (0x6076, 0):
            return round(axis.thermal.rated_torque * 1e3)
        return 1 << axis.encoder.motor_bits if (index, subindex) == (0x608F, 1) else None

    def _written(self, index: int, subindex: int, od: objectdictionary.ODVariable, data: bytes) -> None:
        signed = index not in (0x6040, 0x1016, 0x2F00, 0x60A9)
        self._put(index, subindex, int.from_bytes(data, 'little', signed=signed))

    def _put(self, index: int, subindex: int, value: int) -> None:
        d = self.record
        if (index, subindex) in FIELD_OF_OBJECT:
            d[FIELD_OF_OBJECT[index, subindex]] = value
        elif index == 0x6040:
            law.obey(d, value)
        elif index == 0x60F9:
            steps = self.unit.parameters.drives
            d['K_p' if subindex == 1 else 'K_i'] = value * (steps.gain_step if subindex == 1 else steps.integral_step)
        elif index == 0x6072:
            d['torque_limit'] = value * d['torque_unit']
        elif index == 0x6085:
            d['ramp'] = value * d['velocity_unit'] * SPEED_LOOP_PERIOD_S
        elif index == 0x60A9:
            d['velocity_unit'] = commissioning.velocity_unit(value)
        elif index == 0x1016 and subindex == 1:
            self._supervise(value >> 16 & 0x7F, (value & 0xFFFF) * 1e-3)
        elif (index, subindex) == objects.ERROR_OBJECT and value:
            self.fault(value)
        elif (index, subindex) == objects.SILENCE_OBJECT and value:
            self._silent_until = time.monotonic() + value * 1e-3
            self.unit.power_up(self.number)

    def _supervise(self, node: int, limit: Seconds) -> None:
        """Supervise the heartbeat of a node, from its next heartbeat on. limit: 0: off."""
        if self._consumer:
            self.network.unsubscribe(HEARTBEAT_COB_ID + self._consumer, self._note_heartbeat)
        self._consumer, self._limit_s, self._heard = node if limit else 0, limit, None
        if limit:
            self.network.subscribe(HEARTBEAT_COB_ID + node, self._note_heartbeat)

    def _note_heartbeat(self, _cob: int, _data: bytearray, _time: float) -> None:
        self._heard = time.monotonic()

    def watch(self) -> None:
        """Raise a fault if the heartbeat is missing; return to the bus after a silence."""
        if self._silent_until and not self.silent:
            self._silent_until = 0.0
            self._boot()
        now = time.monotonic()
        if self._heard is not None and now - self._heard > self._limit_s:
            self._lost_since, self._heard = self._heard, None
            self.notes.append(f'no heartbeat of node {self._consumer} for {now - self._lost_since:.3f} s')
            reaction = self._object(0x6007, 0)
            if reaction == CONNECTION_LOST_FAULT:
                self.fault(errors.ERROR_HEARTBEAT_LOST)
            elif reaction in CONNECTION_LOST_COMMANDS:
                law.obey(self.record, CONNECTION_LOST_COMMANDS[reaction])
        elif self._lost_since is not None and not self.record['power']:
            self.notes.append(f'the motor is off {now - self._lost_since:.3f} s after the last heartbeat')
            self._lost_since = None

    def fault(self, code: int) -> None:
        """Bring the drive into a fault and send its emergency message."""
        law.raise_fault(self.record, code)
        if not self.silent:
            self.network.send_message(EMERGENCY_COB_ID + self.node, struct.pack('<HB5x', code, 1))


class CanDrives:
    """The four drives on one CAN bus, which another object polls. on_sync: function that advances the unit to the time
    of a SYNC."""

    def __init__(self, bus: SocketcandServer, unit: SimulatedDrives, on_sync: Callable[[], None]) -> None:
        self.network = canopen.Network(bus)
        self._bus, self._unit, self._on_sync = bus, unit, on_sync
        unit.measure()
        self.drives = [CanDrive(self.network, node, i, unit) for i, node in enumerate(unit.parameters.drives.nodes)]
        self._packed = np.zeros(pdo.DRIVE_COUNT, pdo.REPORT_DTYPE)

    def poll(self, timeout: Seconds) -> None:
        """Take frames of the bus; then watch the heartbeats."""
        message = self._bus.recv(timeout)
        while message is not None:
            self._take(message)
            message = self._bus.recv(0.0)
        for drive in self.drives:
            drive.watch()

    def _take(self, message: can.Message) -> None:
        cob = message.arbitration_id
        if cob == SYNC_COB_ID:
            self._on_sync()
            reports = self._unit.measure()
            for name in pdo.REPORT_FIELDS:
                self._packed[name] = reports[name]
            data, frames = self._packed.tobytes(), []
            for i, drive in enumerate(self.drives):
                drive.act()
                frames += drive.report_frames(data[i * self._packed.itemsize:(i + 1) * self._packed.itemsize])
            self._bus.send_frames(frames)
            return
        if not any(drive.silent and cob & 0x7F == drive.node for drive in self.drives):
            self.network.notify(cob, message.data, message.timestamp)
