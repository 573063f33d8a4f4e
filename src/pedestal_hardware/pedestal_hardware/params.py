"""Parameters of `drive_node` and of the simulated drives: those of the drive unit, the bus, and the drives on it."""
import dataclasses

from drive_law.axis_params import SpeedLoopParameters
from drive_law.params import AduNodeParameters
from pedestal_common.parameters import ParameterError, Parameters, choice, flag, group, parameter, text
from pedestal_hardware import pdo

CONTROLS = ('velocity', 'drive', 'torque')  # divisions of the control between drive_node and the drives

MAX_TORQUE_PERIOD_S = 1e-3
"""Longest period with control `torque` [s]. With a longer one the axis oscillates (docs/hardware/servo-drives.md)."""

MAX_CAN_BITRATE = 1_000_000  # largest bit rate of a CAN bus [bit/s]
MAX_OBJECT_VALUE = 0xFFFF  # largest value of the objects 60F9:1 and :2

FRAME_BITS, STUFFED_BITS, BITS_PER_STUFF_BIT = 47, 33, 4
"""Bits of a standard CAN frame without its data, those that may be stuffed, and the bits for each stuff bit."""


def frame_bits(data_bytes: int) -> int:
    """Return the largest number of bits of a CAN frame with this number of data bytes."""
    return FRAME_BITS + 8 * data_bytes + (STUFFED_BITS + 8 * data_bytes) // BITS_PER_STUFF_BIT


def period_bits() -> int:
    """Return the largest number of bits on a CAN bus in one period: synchronisation, commands and reports."""
    commands = pdo.DRIVE_COUNT * frame_bits(pdo.COMMAND_DTYPE.itemsize)
    reports = sum(frame_bits(pdo.REPORT_PARTS[k][1]) for drive in range(pdo.DRIVE_COUNT)
                  for k in pdo.reports_of(drive))
    return frame_bits(0) + commands + reports


@dataclasses.dataclass(frozen=True)
class BusParameters(Parameters):
    """CAN bus of the drives, by python-can."""
    interface: str = choice('socketcand', ('socketcand', 'socketcan', 'slcan'), 'socketcand: a bus behind a TCP '
                            'server; socketcan: a CAN interface of this machine; slcan: a serial adapter')
    channel: str = text('can0', 'name of the bus, of the CAN interface or of the serial device')
    host: str = text('127.0.0.1', 'socketcand: address of the server')
    port: int = parameter(29536, 1, 65535, '', 'socketcand: TCP port of the server')
    bitrate: int = parameter(1_000_000, 10_000, 10_000_000, 'bit/s', 'rate of the bus; above 1000000 only with '
                             'socketcand, for a bus without a wire')
    report_share: float = parameter(0.5, 0.1, 0.9, '', 'share of the period in which the node waits for the reports '
                                    'of the drives')
    report_timeout: float = parameter(0.2, 0.01, 5.0, 's', 'time without reports after which a motor is lost')
    heartbeat: float = parameter(0.25, 0.02, 5.0, 's', 'time without the heartbeat of this node after which each '
                                 'drive stops by itself; at least twice the longest stall of the machine')
    connect_time: float = parameter(10.0, 0.1, 600.0, 's', 'longest wait for the drives at the start')
    sdo_time: float = parameter(0.3, 0.01, 10.0, 's', 'longest wait for the answer about one object of a drive')


@dataclasses.dataclass(frozen=True)
class AxisDriveParameters(Parameters):
    """The two drives of an axis."""
    node_1: int = parameter(1, 1, 126, '', 'CANopen node of the drive of motor 1, to which the load encoder is wired')
    node_2: int = parameter(2, 1, 126, '', 'CANopen node of the drive of motor 2')
    reversed_1: bool = flag(False, 'motor 1 turns against its axis')
    reversed_2: bool = flag(False, 'motor 2 turns against its axis')
    load_reversed: bool = flag(False, 'the load encoder counts against its axis')
    load_zero: float = parameter(0.0, -20.0, 20.0, 'rad', 'angle of the axis at which the load encoder counts 0')


@dataclasses.dataclass(frozen=True)
class DrivesParameters(Parameters):
    """Parameters of the four drives."""
    azimuth: AxisDriveParameters = group(AxisDriveParameters)
    elevation: AxisDriveParameters = group(AxisDriveParameters, node_1=3, node_2=4)
    gain_step: float = parameter(1e-3, 0.0, 10.0, 'Nms/rad', 'control velocity: gain of one step of object 60F9:1 of '
                                 "the drives; 0: the gains are set with the maker's tool")
    integral_step: float = parameter(1e-2, 1e-6, 100.0, 'Nm/rad', 'control drive: integral gain of one step of object '
                                     '60F9:2 of the drives')
    follow_time: float = parameter(0.05, 1e-4, 1.0, 's', 'control drive: time constant with which motor 2 follows the '
                                   'torque of motor 1')
    enable_time: float = parameter(3.0, 0.1, 60.0, 's', 'longest time of a drive until it is enabled, its brake '
                                   'included')
    reset_time: float = parameter(2.0, 0.1, 60.0, 's', 'longest time of a drive for the reset of its fault')
    start_after: float = parameter(0.0, 0.0, 600.0, 's', 'time from the answer of all drives to time 0, in place of '
                                   'graph.start; 0: time 0 is graph.start')
    profile: int = parameter(402, 0, 65535, '', 'simulated drives: profile of their device type')

    def check(self) -> None:
        """Raise ParameterError for two drives with one node."""
        numbers = self.nodes
        if len(set(numbers)) < len(numbers):
            raise ParameterError(f'azimuth.node_1, .node_2, elevation.node_1, .node_2 = {", ".join(map(str, numbers))}'
                                 ': must be four different nodes')

    @property
    def nodes(self) -> tuple[int, ...]:
        """CANopen nodes of the four drives."""
        return tuple(getattr(axis, f'node_{motor}') for axis in (self.azimuth, self.elevation) for motor in (1, 2))


@dataclasses.dataclass(frozen=True)
class ServoDriveParameters(AduNodeParameters):
    """Parameters of drive_node, and of the simulated drives. The simulated drives use those of the plant."""
    REALTIME_ONLY = ' for servo drives'

    control: str = choice('velocity', CONTROLS, 'division of the control. velocity: the drives '
                          'contain the proportional part of the speed loops, this node the other parts; drive: the '
                          'drive of motor 1 contains the speed loop, and motor 2 follows its torque; torque: this '
                          'node contains the speed loops')
    bus: BusParameters = group(BusParameters)
    drives: DrivesParameters = group(DrivesParameters)

    def check(self) -> None:
        """Raise ParameterError for stow pins, and for a period that the bus or the control does not allow."""
        super().check()
        if self.stow_pins:
            raise ParameterError('stow_pins = true: must be false; servo drives do not move stow pins')
        for axis in ('azimuth', 'elevation'):
            self._check_speed_loop(axis, getattr(self, axis).speed_loop)
        if self.control == 'torque' and self.period > MAX_TORQUE_PERIOD_S:
            raise ParameterError(f'period = {self.period:g} s: must be at most {MAX_TORQUE_PERIOD_S:g} s with control '
                                 '= torque')
        if self.bus.interface != 'socketcand' and self.bus.bitrate > MAX_CAN_BITRATE:
            raise ParameterError(f'bus.bitrate = {self.bus.bitrate}: must be at most {MAX_CAN_BITRATE} with '
                                 f'bus.interface = {self.bus.interface}')
        shortest = period_bits() / self.bus.bitrate
        if self.period < shortest:
            raise ParameterError(f'period = {self.period:g} s: must be at least {shortest:.4f} s, the time of the '
                                 f'frames of a period at bus.bitrate = {self.bus.bitrate}')

    def _check_speed_loop(self, axis: str, loop: SpeedLoopParameters) -> None:
        if loop.structure != 'mean':
            raise ParameterError(f'{axis}.speed_loop.structure = {loop.structure}: must be mean for servo drives')
        if self.control == 'drive' and loop.disturbance_observer > 0.0:
            raise ParameterError(f'{axis}.speed_loop.disturbance_observer = {loop.disturbance_observer:g}: must be 0 '
                                 'with control = drive, because the speed loops are in the drives')
        steps = [('proportional', 'gain_step')] + [('integral', 'integral_step')] * (self.control == 'drive')
        for name, step in steps if self.drives.gain_step else ():
            gain, largest = getattr(loop, name), MAX_OBJECT_VALUE * getattr(self.drives, step)
            if gain > largest:
                raise ParameterError(f'{axis}.speed_loop.{name} = {gain:g}: must be at most {largest:g} with '
                                     f'drives.{step} = {getattr(self.drives, step):g}')

    def torque_mode(self, drive: int) -> bool:
        """Return True if a drive is in the mode of torque."""
        return self.control == 'torque' or self.control == 'drive' and drive % 2 == 1
