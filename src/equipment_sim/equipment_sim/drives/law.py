"""Law of the simulated drives: state machine, speed loop and brake of each drive, and the plant of adu_drive.

A drive runs its speed loop every 0.5 ms. It takes commands and gives reports in whole steps of its units. The brakes
of both motors of an axis hang on one relay, which the brake outputs of both drives hold open: the axis is free while
one of them does.
"""
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, TypeAlias

from adu_drive import axis, drive_unit, injected
from adu_drive import unit as adu_unit
from drive_law import loops, rate_drive
from drive_law.axis_params import SPEED_LOOP_PERIOD_S
from pedestal_common.compiled import compiled
from pedestal_common.injection import schedule
from pedestal_common.quantities import AnyRecord, Bit, Nanoseconds, NewtonMeters, RadiansPerSecond, Records, Stamps
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP
from pedestal_hardware import cia402, pdo, servo_drives
from pedestal_hardware.cia402 import State

if TYPE_CHECKING:
    from equipment_sim.drives.unit import Memory

TICK_NS = round(SPEED_LOOP_PERIOD_S * 1e9)  # period of the speed loop of a drive [ns]
MAX_CATCH_UP_TICKS = 4000  # largest number of periods that the drives make up after a stall of the machine; 2 s
ENCODER_TURNS = 1  # turns of the motor in which its encoder counts its resolution (608F)
STANDSTILL_RAD_S = 0.05  # speed of a motor below which it stands [rad/s]
MAX_STOP_S = 2.0  # longest ramp to standstill; then the drive removes the torque [s]
HOLD_INTEGRAL_PER_S = 30.0  # ratio of integral and proportional gain while a drive ramps to standstill by itself [1/s]
STAY = -1  # value of `leaving` of a drive that does not leave its state
ERROR_SUPPLY_LOW = 0x5113  # error of a drive with the injected fault `motor_loss`

class Drive(Record):
    """State of a drive. Objects are in the units of the drive."""
    state: int              # code of cia402.STATE_NAMES
    control: int            # last controlword
    mode: int               # object: mode of operation
    target: int             # object: target velocity
    velocity_offset: int    # object
    torque_offset: int      # object
    target_torque: int      # object
    error: int              # object: error code
    leaving: int            # state to which the drive goes after its stop, or STAY
    entering: Bit           # 1 while its brake opens
    power: Bit              # 1 while the motor may make torque
    brake_open: Bit         # 1 if the drive holds the brake open
    brake_ticks: int        # periods since the last change of the brake
    stop_ticks: int         # periods of the present ramp to standstill
    limited: Bit            # 1 if a limit acted since the last report
    quick_stop_code: int    # object 605A
    K_p: float              # [Nms/rad]
    K_i: float              # [Nm/rad]
    velocity_unit: RadiansPerSecond     # one step
    torque_unit: NewtonMeters           # one step
    ramp: RadiansPerSecond  # change of speed of the quick stop in a period
    torque_limit: NewtonMeters
    rate: RadiansPerSecond  # speed reference
    sum: NewtonMeters       # integral part


FourDrives: TypeAlias = Annotated[Sequence[Drive], (pdo.DRIVE_COUNT,)]


class DrivesRecord(Record):
    """All data of the simulated drives. The own fields come first. Numba takes a record that begins with the fields of
    the drive unit for its subtype, and warns about it."""
    drive: FourDrives
    tick: int               # number of the last period of the speed loops
    period: Nanoseconds     # time between two synchronisations
    state: drive_unit.State
    constants: drive_unit.Constants
    inputs: drive_unit.Inputs
    outputs: drive_unit.Outputs
    link: rate_drive.Link
    schedule: schedule.Schedule
    injected: injected.DriveInjected


@compiled
def _switch_off(drive: Drive, state: int) -> None:
    drive.power = drive.entering = 0
    drive.leaving, drive.rate, drive.sum, drive.state = STAY, 0.0, 0.0, state
    _move_brake(drive, 0)


@compiled
def _move_brake(drive: Drive, open_: Bit) -> None:
    if drive.brake_open != open_:
        drive.brake_open, drive.brake_ticks = open_, 0


@compiled
def raise_fault(drive: Drive, code: int) -> None:
    """Bring a drive into the state `fault`, with a ramp to standstill if its motor runs. code: error code."""
    if drive.state == State.FAULT or drive.state == State.FAULT_REACTION_ACTIVE:
        return
    drive.error = code
    if not drive.power or code & 0xF000 == 0x2000 or code == ERROR_SUPPLY_LOW:
        _switch_off(drive, State.FAULT)
    else:
        drive.state, drive.entering, drive.leaving, drive.stop_ticks = State.FAULT_REACTION_ACTIVE, 0, STAY, 0


@compiled
def obey(drive: Drive, control: int) -> None:
    """Take a controlword."""
    before, drive.control = drive.control, control
    new = cia402.successor(drive.state, control, before)
    runs = drive.state == State.OPERATION_ENABLED or drive.state == State.QUICK_STOP_ACTIVE
    if new == drive.state:
        if drive.leaving != STAY:
            _move_brake(drive, 1)
        drive.leaving = STAY
        if drive.entering:
            _switch_off(drive, drive.state)
    elif drive.state == State.FAULT:
        drive.state, drive.error = new, 0
    elif new == State.OPERATION_ENABLED:
        drive.leaving = STAY
        if runs:
            drive.state = new
        elif not drive.entering:
            drive.entering = drive.power = 1
            drive.rate = drive.sum = 0.0
            _move_brake(drive, 1)
    elif new == State.QUICK_STOP_ACTIVE:
        drive.state, drive.leaving, drive.stop_ticks = new, STAY, 0
    elif runs and new != State.SWITCH_ON_DISABLED:
        if drive.leaving == STAY:
            drive.stop_ticks = 0
        drive.leaving = new
    else:
        _switch_off(drive, new)


@compiled
def _ramps(drive: Drive) -> bool:
    return (drive.state != State.OPERATION_ENABLED or drive.leaving != STAY
            or drive.control & cia402.CONTROL_HALT != 0 or not (
                drive.mode == servo_drives.MODE_CYCLIC_VELOCITY or drive.mode == servo_drives.MODE_CYCLIC_TORQUE))


@compiled
def _torque(drive: Drive, omega: RadiansPerSecond) -> NewtonMeters:
    if not drive.power:
        return 0.0
    offset = 0.0
    if _ramps(drive):
        drive.rate -= min(max(drive.rate, -drive.ramp), drive.ramp)
        drive.sum += HOLD_INTEGRAL_PER_S * drive.K_p * (drive.rate - omega) * SPEED_LOOP_PERIOD_S
    elif drive.mode == servo_drives.MODE_CYCLIC_TORQUE:
        # A later ramp to standstill begins at the present speed and torque.
        drive.rate, drive.sum = omega, (drive.target_torque + drive.torque_offset) * drive.torque_unit
    else:
        drive.rate = (drive.target + drive.velocity_offset) * drive.velocity_unit
        offset = drive.torque_offset * drive.torque_unit
        drive.sum = drive.sum if drive.K_i > 0.0 else 0.0
    wanted = drive.K_p * (drive.rate - omega) + drive.sum + offset
    made = min(max(wanted, -drive.torque_limit), drive.torque_limit)
    if drive.mode == servo_drives.MODE_CYCLIC_VELOCITY and not _ramps(drive):
        drive.sum = loops.integral(drive.sum, drive.rate - omega, drive.K_i * SPEED_LOOP_PERIOD_S, wanted - made)
    if made != wanted:
        drive.limited = 1
    return made


@compiled
def _advance_state(drive: Drive, omega: RadiansPerSecond, engage_ticks: int, release_ticks: int) -> None:
    drive.brake_ticks += 1
    if drive.entering and drive.brake_ticks >= release_ticks:
        drive.entering, drive.state = 0, State.OPERATION_ENABLED
    if drive.state == State.FAULT_REACTION_ACTIVE:
        after = State.FAULT
    elif drive.leaving != STAY:
        after = drive.leaving
    elif drive.state == State.QUICK_STOP_ACTIVE and drive.quick_stop_code < 5:
        after = State.SWITCH_ON_DISABLED
    else:
        return
    drive.stop_ticks += 1
    stands = drive.rate == 0.0 and abs(omega) < STANDSTILL_RAD_S
    if stands or drive.stop_ticks * SPEED_LOOP_PERIOD_S > MAX_STOP_S:
        # The motor holds the axis until the brake grips.
        _move_brake(drive, 0)
        if drive.brake_ticks >= engage_ticks:
            _switch_off(drive, after)


@compiled
def _grips(first: Drive, second: Drive, engage_ticks: int, release_ticks: int) -> bool:
    for_first = first.brake_open and first.brake_ticks >= release_ticks or (
        not first.brake_open and first.brake_ticks < engage_ticks)
    for_second = second.brake_open and second.brake_ticks >= release_ticks or (
        not second.brake_open and second.brake_ticks < engage_ticks)
    return not (for_first or for_second)


@compiled
def _drive_motor(drive: Drive, motor: axis.MotorState, constants: axis.MotorConstants, lost: Bit, engage_ticks: int,
                 release_ticks: int) -> None:
    axis.read_motor_sensors(motor, constants)
    if motor.limited:
        drive.limited = 1
    motor.limited = 0
    if lost:
        raise_fault(drive, ERROR_SUPPLY_LOW)
    _advance_state(drive, motor.measured, engage_ticks, release_ticks)
    motor.i_ref = _torque(drive, motor.measured) * constants.per_K_t_hat
    motor.inhibited = 0 if drive.power else 1


@compiled
def _drive_axis(unit: DrivesRecord, of_axis: axis.State, constants: axis.Constants, number: int) -> None:
    first, second = unit.drive[2 * number], unit.drive[2 * number + 1]
    engage = unit.constants.engage_periods * unit.constants.speed_ticks
    release = unit.constants.release_periods * unit.constants.speed_ticks
    _drive_motor(first, of_axis.motor_1, constants.motor_1, of_axis.motor_lost[0], engage, release)
    _drive_motor(second, of_axis.motor_2, constants.motor_2, of_axis.motor_lost[1], engage, release)
    axis.begin_period(of_axis, constants, _grips(first, second, engage, release))
    drive_unit.between_speed_periods(of_axis, constants, unit.constants.substeps)


@compiled
def advance(records: Records, now: Nanoseconds) -> None:
    """Advance drives and plant to a time, at most by MAX_CATCH_UP_TICKS. records: DrivesRecord (1,)."""
    _advance(records[0], now)


@compiled
def _advance(unit: DrivesRecord, now: Nanoseconds) -> None:
    state, constants = unit.state, unit.constants
    due = now // TICK_NS
    if unit.tick == NO_STAMP:
        unit.tick = due
    unit.tick = max(unit.tick, due - MAX_CATCH_UP_TICKS)
    while unit.tick < due:
        if unit.tick % constants.speed_ticks == 0:
            state.k = unit.tick // constants.speed_ticks
            external = drive_unit.external_torques(state, constants, unit.inputs)
            state.azimuth.external, state.elevation.external, _ = external
        _drive_axis(unit, state.azimuth, constants.azimuth, 0)
        _drive_axis(unit, state.elevation, constants.elevation, 1)
        unit.tick += 1


@compiled
def status(drive: Drive) -> int:
    """Return the statusword of a drive and forget the limits that acted."""
    word = cia402.STATUS_OF_STATE[drive.state] | cia402.STATUS_VOLTAGE | cia402.STATUS_REMOTE
    if drive.state == State.OPERATION_ENABLED and not _ramps(drive):
        word |= cia402.STATUS_FOLLOWS
    if drive.limited:
        word |= cia402.STATUS_LIMIT
    drive.limited = 0
    return word


@compiled
def _steps(x: float, bits: int) -> int:
    largest = 2.0 ** (bits - 1)
    return int(math.floor(min(max(x, -largest), largest - 1.0) + 0.5))


@compiled
def report(records: Records, reports: Records) -> None:
    """Write the reports of the drives (4,), with the fields of pdo.REPORT_DTYPE."""
    unit = records[0]
    state, constants, outputs = unit.state, unit.constants, unit.outputs
    drive_unit.read(state, constants, outputs)
    for number in range(2):
        of_axis, of_constants, made = ((state.azimuth, constants.azimuth, outputs.azimuth) if number == 0 else
                                       (state.elevation, constants.elevation, outputs.elevation))
        for motor in range(2):
            drive, written = unit.drive[2 * number + motor], reports[2 * number + motor]
            per_rad = of_constants.motor_1.per_rad if motor == 0 else of_constants.motor_2.per_rad
            written.status, written.error = status(drive), drive.error
            written.mode, written.inputs = drive.mode, 0
            written.position = _steps(made.motor_position[motor] * per_rad, 32)
            written.velocity = _steps(made.motor_velocity[motor] / drive.velocity_unit, 32)
            written.torque = _steps(made.motor_torque[motor] / drive.torque_unit, 16)
            written.load = _steps(of_axis.reading, 32)


@compiled
def law(memory: 'Memory', stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Advance to a stamp and write the truth of the step in which it lies."""
    unit = memory.record[0]
    if schedule.pending(unit.schedule, stamp):
        injected.apply_due_faults(unit, stamp)
    ship = inputs[rate_drive.SHIP_TRUTH_TOPIC]
    if ship.stamp != NO_STAMP:
        adu_unit.deck_acceleration(unit.inputs, unit.link, ship)
    _advance(unit, stamp)
    drive_unit.read(unit.state, unit.constants, unit.outputs)
    adu_unit.encode_truth(unit.outputs, stamp // unit.period * unit.period, outputs[rate_drive.DRIVE_TRUTH_TOPIC])


@compiled
def laws(memory: 'Memory', stamps: Stamps, inputs: Records, outputs: Records) -> None:
    """Apply `law` to each element of arrays."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])
