"""Law of the simulated drives: state machine, speed loop and brake of each drive, and the plant of adu_drive.

A drive runs its speed loop every 0.5 ms. It takes commands and gives reports in whole steps of its units. The brakes
of both motors of an axis hang on one relay, which the brake outputs of both drives hold open: the axis is free while
one of them does.

Arguments: d is the record of a drive (DRIVE_DTYPE), m that of the unit (Record).
"""
import math

import numpy as np

from adu_drive import axis, drive_unit, injected
from adu_drive import unit as adu_unit
from adu_drive.controller import pi
from adu_drive.params import SPEED_LOOP_PERIOD_S
from pedestal_common.compiled import compiled
from pedestal_common.injection import schedule
from pedestal_common.wire.records import NO_STAMP
from pedestal_hardware import cia402, pdo, servo_drives
from pedestal_hardware.cia402 import State

TICK_NS = round(SPEED_LOOP_PERIOD_S * 1e9)  # period of the speed loop of a drive [ns]
MAX_CATCH_UP_TICKS = 4000  # largest number of periods that the drives make up after a stall of the machine; 2 s
ENCODER_TURNS = 1  # turns of the motor in which its encoder counts its resolution (608F)
STANDSTILL_RAD_S = 0.05  # speed of a motor below which it stands [rad/s]
MAX_STOP_S = 2.0  # longest ramp to standstill; then the drive removes the torque [s]
HOLD_INTEGRAL_PER_S = 30.0  # ratio of integral and proportional gain while a drive ramps to standstill by itself [1/s]
STAY = -1  # value of `leaving` of a drive that does not leave its state
ERROR_SUPPLY_LOW = 0x5113  # error of a drive with the injected fault `motor_loss`

DRIVE_DTYPE = np.dtype([
    *((name, 'i8') for name in ('state', 'control', 'mode', 'target', 'velocity_offset', 'torque_offset',
                                'target_torque', 'error', 'leaving', 'entering', 'power', 'brake_open', 'brake_ticks',
                                'stop_ticks', 'limited', 'quick_stop_code')),
    *((name, 'f8') for name in ('K_p', 'K_i', 'velocity_unit', 'torque_unit', 'ramp', 'torque_limit', 'rate', 'sum')),
], align=True)
"""State of a drive.

state, control      code of cia402.STATE_NAMES; last controlword
mode, target, velocity_offset, torque_offset, target_torque, error    objects of these names, in units of the drive
leaving, entering   state to which the drive goes after its stop, or STAY; 1 while its brake opens
power               1 while the motor may make torque
brake_open, brake_ticks    1 if the drive holds the brake open; periods since the last change
stop_ticks          periods of the present ramp to standstill
limited             1 if a limit acted since the last report
quick_stop_code     object 605A
K_p, K_i            gains [Nms/rad, Nm/rad]; velocity_unit, torque_unit: one step [rad/s, Nm]
ramp                change of speed of the quick stop in a period [rad/s]; torque_limit: [Nm]
rate, sum           speed reference [rad/s]; integral part [Nm]
"""

# The own fields come first. Numba takes a record that begins with the fields of the drive unit for its subtype, and
# warns about it.
Record = np.dtype([('drive', DRIVE_DTYPE, (pdo.DRIVE_COUNT,)), ('tick', 'i8'), ('period', 'i8'),
                         ('state', drive_unit.State.dtype), ('constants', drive_unit.Constants.dtype),
                         ('inputs', drive_unit.Inputs.dtype), ('outputs', drive_unit.Outputs.dtype),
                         ('link', adu_unit.Link.dtype), ('schedule', schedule.Schedule.dtype),
                         ('injected', injected.DriveInjected.dtype)], align=True)
"""All data of the simulated drives. tick: number of the last period of the speed loops; period: time between two
synchronisations [ns]."""


@compiled
def _switch_off(d, state):
    """Remove the torque at once, close the brake, and enter a state."""
    d.power = d.entering = 0
    d.leaving, d.rate, d.sum, d.state = STAY, 0.0, 0.0, state
    _move_brake(d, 0)


@compiled
def _move_brake(d, open_):
    """Command the brake of a drive."""
    if d.brake_open != open_:
        d.brake_open, d.brake_ticks = open_, 0


@compiled
def raise_fault(d, code):
    """Bring a drive into the state `fault`, with a ramp to standstill if its motor runs. code: error code."""
    if d.state == State.FAULT or d.state == State.FAULT_REACTION_ACTIVE:
        return
    d.error = code
    if not d.power or code & 0xF000 == 0x2000 or code == ERROR_SUPPLY_LOW:
        _switch_off(d, State.FAULT)
    else:
        d.state, d.entering, d.leaving, d.stop_ticks = State.FAULT_REACTION_ACTIVE, 0, STAY, 0


@compiled
def obey(d, control):
    """Take a controlword."""
    before, d.control = d.control, control
    new = cia402.successor(d.state, control, before)
    runs = d.state == State.OPERATION_ENABLED or d.state == State.QUICK_STOP_ACTIVE
    if new == d.state:
        if d.leaving != STAY:
            _move_brake(d, 1)
        d.leaving = STAY
        if d.entering:
            _switch_off(d, d.state)
    elif d.state == State.FAULT:
        d.state, d.error = new, 0
    elif new == State.OPERATION_ENABLED:
        d.leaving = STAY
        if runs:
            d.state = new
        elif not d.entering:
            d.entering = d.power = 1
            d.rate = d.sum = 0.0
            _move_brake(d, 1)
    elif new == State.QUICK_STOP_ACTIVE:
        d.state, d.leaving, d.stop_ticks = new, STAY, 0
    elif runs and new != State.SWITCH_ON_DISABLED:
        if d.leaving == STAY:
            d.stop_ticks = 0
        d.leaving = new
    else:
        _switch_off(d, new)


@compiled
def _ramps(d):
    """Return True if a drive ramps to standstill by itself."""
    return (d.state != State.OPERATION_ENABLED or d.leaving != STAY
            or d.control & cia402.CONTROL_HALT != 0 or not (
                d.mode == servo_drives.MODE_CYCLIC_VELOCITY or d.mode == servo_drives.MODE_CYCLIC_TORQUE))


@compiled
def _torque(d, omega):
    """Return the torque of a drive [Nm] for one period of its speed loop. omega: speed of the motor [rad/s]."""
    if not d.power:
        return 0.0
    offset = 0.0
    if _ramps(d):
        d.rate -= min(max(d.rate, -d.ramp), d.ramp)
        d.sum += HOLD_INTEGRAL_PER_S * d.K_p * (d.rate - omega) * SPEED_LOOP_PERIOD_S
    elif d.mode == servo_drives.MODE_CYCLIC_TORQUE:
        # A later ramp to standstill begins at the present speed and torque.
        d.rate, d.sum = omega, (d.target_torque + d.torque_offset) * d.torque_unit
    else:
        d.rate = (d.target + d.velocity_offset) * d.velocity_unit
        offset = d.torque_offset * d.torque_unit
        d.sum = d.sum if d.K_i > 0.0 else 0.0
    wanted = d.K_p * (d.rate - omega) + d.sum + offset
    made = min(max(wanted, -d.torque_limit), d.torque_limit)
    if d.mode == servo_drives.MODE_CYCLIC_VELOCITY and not _ramps(d):
        d.sum = pi.integral(d.sum, d.rate - omega, d.K_i * SPEED_LOOP_PERIOD_S, wanted - made)
    if made != wanted:
        d.limited = 1
    return made


@compiled
def _advance_state(d, omega, engage_ticks, release_ticks):
    """Advance brake and automatic transitions of a drive by a period. omega: speed of the motor [rad/s]."""
    d.brake_ticks += 1
    if d.entering and d.brake_ticks >= release_ticks:
        d.entering, d.state = 0, State.OPERATION_ENABLED
    if d.state == State.FAULT_REACTION_ACTIVE:
        after = State.FAULT
    elif d.leaving != STAY:
        after = d.leaving
    elif d.state == State.QUICK_STOP_ACTIVE and d.quick_stop_code < 5:
        after = State.SWITCH_ON_DISABLED
    else:
        return
    d.stop_ticks += 1
    stands = d.rate == 0.0 and abs(omega) < STANDSTILL_RAD_S
    if stands or d.stop_ticks * SPEED_LOOP_PERIOD_S > MAX_STOP_S:
        # The motor holds the axis until the brake grips.
        _move_brake(d, 0)
        if d.brake_ticks >= engage_ticks:
            _switch_off(d, after)


@compiled
def _grips(first, second, engage_ticks, release_ticks):
    """Return True if the brakes of an axis grip, from its two drives."""
    for_first = first.brake_open and first.brake_ticks >= release_ticks or (
        not first.brake_open and first.brake_ticks < engage_ticks)
    for_second = second.brake_open and second.brake_ticks >= release_ticks or (
        not second.brake_open and second.brake_ticks < engage_ticks)
    return not (for_first or for_second)


@compiled
def _drive_motor(d, motor, k, lost, engage_ticks, release_ticks):
    """Run one period of a drive with its motor. k: constants of the motor; lost: 1 for the fault `motor_loss`."""
    axis.read_motor_sensors(motor, k)
    if motor.limited:
        d.limited = 1
    motor.limited = 0
    if lost:
        raise_fault(d, ERROR_SUPPLY_LOW)
    _advance_state(d, motor.measured, engage_ticks, release_ticks)
    motor.i_ref = _torque(d, motor.measured) * k.per_K_t_hat
    motor.inhibited = 0 if d.power else 1


@compiled
def _drive_axis(m, a, c, i):
    """Run one period of the drives and of the plant of axis i (0, 1). a, c: its state and constants."""
    first, second = m.drive[2 * i], m.drive[2 * i + 1]
    engage = m.constants.engage_periods * m.constants.speed_ticks
    release = m.constants.release_periods * m.constants.speed_ticks
    _drive_motor(first, a.motor_1, c.motor_1, a.motor_lost[0], engage, release)
    _drive_motor(second, a.motor_2, c.motor_2, a.motor_lost[1], engage, release)
    axis.begin_period(a, c, _grips(first, second, engage, release))
    drive_unit.between_speed_periods(a, c, m.constants.substeps)


@compiled
def advance(records, now):
    """Advance drives and plant to a time [ns], at most by MAX_CATCH_UP_TICKS. records: (1,) of Record."""
    _advance(records[0], now)


@compiled
def _advance(m, now):
    s, c = m.state, m.constants
    due = now // TICK_NS
    if m.tick == NO_STAMP:
        m.tick = due
    m.tick = max(m.tick, due - MAX_CATCH_UP_TICKS)
    while m.tick < due:
        if m.tick % c.speed_ticks == 0:
            s.k = m.tick // c.speed_ticks
            s.azimuth.external, s.elevation.external, _ = drive_unit.external_torques(s, c, m.inputs)
        _drive_axis(m, s.azimuth, c.azimuth, 0)
        _drive_axis(m, s.elevation, c.elevation, 1)
        m.tick += 1


@compiled
def status(d):
    """Return the statusword of a drive and forget the limits that acted."""
    word = cia402.STATUS_OF_STATE[d.state] | cia402.STATUS_VOLTAGE | cia402.STATUS_REMOTE
    if d.state == State.OPERATION_ENABLED and not _ramps(d):
        word |= cia402.STATUS_FOLLOWS
    if d.limited:
        word |= cia402.STATUS_LIMIT
    d.limited = 0
    return word


@compiled
def _steps(x, bits):
    """Return the nearest whole number of an object with this number of bits."""
    largest = 2.0 ** (bits - 1)
    return int(math.floor(min(max(x, -largest), largest - 1.0) + 0.5))


@compiled
def report(records, reports):
    """Write the reports of the drives (4,) of pdo.REPORT_DTYPE, aligned. records: (1,) of Record."""
    m = records[0]
    s, c, y = m.state, m.constants, m.outputs
    drive_unit.read(s, c, y)
    for i in range(2):
        a, k, of_axis = (s.azimuth, c.azimuth, y.azimuth) if i == 0 else (s.elevation, c.elevation, y.elevation)
        for motor in range(2):
            d, r = m.drive[2 * i + motor], reports[2 * i + motor]
            per_rad = k.motor_1.per_rad if motor == 0 else k.motor_2.per_rad
            r.status, r.error, r.mode, r.inputs = status(d), d.error, d.mode, 0
            r.position = _steps(of_axis.motor_position[motor] * per_rad, 32)
            r.velocity = _steps(of_axis.motor_velocity[motor] / d.velocity_unit, 32)
            r.torque = _steps(of_axis.motor_torque[motor] / d.torque_unit, 16)
            r.load = _steps(a.reading, 32)


@compiled
def law(memory, stamp, inputs, outputs):
    """Advance to a stamp [ns] and write the truth of the step in which it lies."""
    m = memory.record[0]
    if schedule.pending(m.schedule, stamp):
        injected.apply_due_faults(m, stamp)
    ship = inputs[adu_unit.SHIP_TRUTH_TOPIC]
    if ship.stamp != NO_STAMP:
        adu_unit.deck_acceleration(m.inputs, m.link, ship)
    _advance(m, stamp)
    drive_unit.read(m.state, m.constants, m.outputs)
    adu_unit.encode_truth(m.outputs, stamp // m.period * m.period, outputs[adu_unit.DRIVE_TRUTH_TOPIC])


@compiled
def laws(memory, stamps, inputs, outputs):
    """Apply `law` to each element of arrays."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])
