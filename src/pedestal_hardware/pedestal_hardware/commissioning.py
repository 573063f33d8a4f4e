"""Commissioning of a drive: settings that are written, read back and compared before the drive is used, and its units.
"""
import math
import typing

from pedestal_common.graph import topics
from pedestal_common.quantities import NewtonMeters, Radians, RadiansPerSecond
from pedestal_hardware.bus import Bus, BusError
from pedestal_hardware.params import ServoDriveParameters
from pedestal_hardware.servo_drives import MODE_CYCLIC_TORQUE, MODE_CYCLIC_VELOCITY

MODE_NAMES = {MODE_CYCLIC_VELOCITY: 'cyclic synchronous velocity', MODE_CYCLIC_TORQUE: 'cyclic synchronous torque'}
"""{mode of operation (6060): its name}. Bit `mode - 1` of the supported modes (6502) belongs to it."""

UNIT_RPM, MILLI_PREFIX = 0xB44700, 0xFD  # velocity unit rpm in object 60A9, and the prefix 10^-3 in its first byte

RAD_S_PER_RPM = math.pi / 30.0
PERMILLE = 1e-3

TORQUE_UNITS_NM = (1e-3, 1e-6)
"""Units of the rated torque (6076) [Nm]: mNm by the profile; uNm on drives such as EPOS4."""

MAX_RATED_TORQUE_FACTOR = 3.0
"""Largest factor between the rated torque of a drive and the parameter `thermal.rated_torque`."""


class Scale(typing.NamedTuple):
    """Units of a drive: one step of its objects, on the motor shaft."""
    position: Radians
    velocity: RadiansPerSecond
    torque: NewtonMeters


class Setting(typing.NamedTuple):
    """Value of an object of a drive."""
    number: int                 # index of the object
    subindex: int
    kind: str                   # its type as in struct
    value: int
    meaning: str
    optional: bool = False      # True if a drive may lack it


def settings(parameters: ServoDriveParameters, drive: int, velocity: RadiansPerSecond,
             rated: NewtonMeters) -> list[Setting]:
    """Return the settings of a drive. velocity: size of one step of its velocity; rated: its rated torque."""
    axis = getattr(parameters, topics.AXES[drive // 2])
    motor = (axis.motor_1, axis.motor_2)[drive % 2]
    deceleration = axis.limits.deceleration * axis.gear_train.ratio / velocity
    gain, torque_mode = parameters.drives.gain_step, parameters.torque_mode(drive)
    integral = axis.speed_loop.integral if parameters.control == 'drive' and not torque_mode else 0.0
    # A period is a multiple of 0.5 ms up to 20 ms, so that the number of its steps fits into one byte.
    period_exponent = -4 if round(parameters.period * 1e4) % 10 else -3
    rows = [
        Setting(0x6060, 0, 'b', mode_of(torque_mode), 'mode of operation'),
        Setting(0x60C2, 2, 'b', period_exponent, 'exponent of the period', True),
        Setting(0x60C2, 1, 'B', round(parameters.period * 10.0 ** -period_exponent), 'period', True),
        Setting(0x6007, 0, 'h', 1, 'connection lost: fault'),
        Setting(0x605A, 0, 'h', 6, 'quick stop: ramp, then stay in quick stop active'),
        Setting(0x605B, 0, 'h', 1, 'shutdown: ramp', True),
        Setting(0x605C, 0, 'h', 1, 'disable operation: ramp', True),
        Setting(0x605D, 0, 'h', 1, 'halt: ramp', True),
        Setting(0x605E, 0, 'h', 2, 'fault: ramp of the quick stop', True),
        Setting(0x6085, 0, 'I', round(deceleration), 'deceleration of the quick stop'),
        Setting(0x6072, 0, 'H', min(round(motor.torque_limit / rated / PERMILLE), 0xFFFF), 'largest torque', True),
        Setting(0x60B1, 0, 'i', 0, 'velocity offset', True), Setting(0x6071, 0, 'h', 0, 'target torque', True)]
    if torque_mode:
        rows.append(Setting(0x60B2, 0, 'h', 0, 'torque offset', True))
    if gain:
        rows += [Setting(0x60F9, 1, 'H', round(axis.speed_loop.proportional / gain), 'gain'),
                 Setting(0x60F9, 2, 'H', round(integral / parameters.drives.integral_step), 'integral gain')]
    return rows


def mode_of(torque_mode: bool) -> int:
    """Return the mode of operation of a drive."""
    return MODE_CYCLIC_TORQUE if torque_mode else MODE_CYCLIC_VELOCITY


def commission(bus: Bus, drive: int, parameters: ServoDriveParameters) -> Scale:
    """Write and verify the settings of a drive, and return its Scale. Raises BusError."""
    mode = mode_of(parameters.torque_mode(drive))
    if not bus.read(drive, 0x6502, 0, 'I') & 1 << mode - 1:
        raise BusError(f'object 6502: the drive has no mode {MODE_NAMES[mode]}')
    velocity = _finest_velocity_unit(bus, drive)
    rated = _rated_torque(bus, drive, parameters)
    for setting in settings(parameters, drive, velocity, rated):
        _set(bus, drive, setting)
    increments, turns = (bus.read(drive, 0x608F, subindex, 'I') for subindex in (1, 2))
    motor_turns, shaft_turns = (bus.read(drive, 0x6091, subindex, 'I') for subindex in (1, 2))
    if motor_turns != shaft_turns:
        raise BusError(f'object 6091: gear ratio {motor_turns}:{shaft_turns}: must be 1:1; the gear belongs into '
                       'the parameters gear_train')
    if not increments or not turns:
        raise BusError(f'object 608F: {increments} increments in {turns} turns: must both be above 0')
    return Scale(2.0 * math.pi * turns / increments, velocity, PERMILLE * rated)


def velocity_unit(code: int) -> RadiansPerSecond:
    """Return the velocity unit that object 60A9 states: rpm with a power of ten. Raises BusError."""
    if code & 0xFFFFFF != UNIT_RPM:
        raise BusError(f'object 60A9: velocity unit 0x{code:08X}: must be 0x..B44700 (rpm with a prefix)')
    prefix = code >> 24
    return RAD_S_PER_RPM * 10.0 ** (prefix - 256 if prefix > 127 else prefix)


def _finest_velocity_unit(bus: Bus, drive: int) -> RadiansPerSecond:
    try:
        bus.write(drive, 0x60A9, 0, 'I', MILLI_PREFIX << 24 | UNIT_RPM)
    except BusError:
        pass     # the unit is then that which the drive has
    return velocity_unit(bus.read(drive, 0x60A9, 0, 'I'))


def _rated_torque(bus: Bus, drive: int, parameters: ServoDriveParameters) -> NewtonMeters:
    raw = bus.read(drive, 0x6076, 0, 'I')
    expected = getattr(parameters, topics.AXES[drive // 2]).thermal.rated_torque
    for unit in TORQUE_UNITS_NM:
        if expected / MAX_RATED_TORQUE_FACTOR <= raw * unit <= expected * MAX_RATED_TORQUE_FACTOR:
            return raw * unit
    raise BusError(f'object 6076: rated torque {raw}: must be thermal.rated_torque = {expected:g} Nm in mNm or uNm, '
                   f'within a factor of {MAX_RATED_TORQUE_FACTOR:g}')


def _set(bus: Bus, drive: int, setting: Setting) -> None:
    try:
        bus.write(drive, setting.number, setting.subindex, setting.kind, setting.value)
        found = bus.read(drive, setting.number, setting.subindex, setting.kind)
    except BusError as error:
        if setting.optional and 'abort' in str(error):
            return
        raise BusError(f'{error} ({setting.meaning})') from None
    if found != setting.value:
        raise BusError(f'object {setting.number:04X}:{setting.subindex} ({setting.meaning}) is {found} after writing '
                       f'{setting.value}')
