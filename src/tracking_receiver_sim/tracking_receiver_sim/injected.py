"""Injected faults of the receiver: their effects on the constants and the messages of its unit."""
import math
from typing import Protocol

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.injection import message_faults, schedule, table
from pedestal_common.quantities import AnyRecord, Floats, Nanoseconds, Pair, Records
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP
from tracking_receiver_sim import receiver

MESSAGE_FAULT_CODES = message_faults.codes('tracking_receiver')
Fault = codes([fault.name for fault in table.INJECTED_FAULTS['tracking_receiver']])

SLOPE_BOTH, SLOPE_CROSS_ELEVATION, SLOPE_ELEVATION = range(3)  # choices of the fault wrong_slope


class Injected(Record):
    """The faults in force, and the values of receiver.Constants without a fault."""
    power: float                # of receiver.Constants
    cos_beta: float
    sin_beta: float
    cos_phi: float
    sin_phi: float
    latency_ns: Nanoseconds
    clock_ns: Nanoseconds       # offset of the stamps
    bias: Pair                  # offset of the errors [rad]
    message_fault: message_faults.MessageFault  # faults of the published results


class _Unit(Protocol):
    """The parts of the record of a unit that a fault changes."""
    constants: receiver.Constants
    injected: Injected
    schedule: schedule.Schedule


ANGLE_ERROR_TOPIC, ANGLE_RATE_TOPIC = 'tracking_receiver/angle_error', 'tracking_receiver/angle_rate'
RANGE_TOPIC = 'tracking_receiver/range'


def initial(constants: Records) -> Records:
    """Return the Injected (1,) without a fault, for receiver.Constants (1,)."""
    e = Injected.zeros()
    for name in ('power', 'cos_beta', 'sin_beta', 'cos_phi', 'sin_phi', 'latency_ns'):
        e[name] = constants[name]
    return e


@compiled
def _clear_faults(constants: receiver.Constants, injected: Injected) -> None:
    constants.power, constants.latency_ns = injected.power, injected.latency_ns
    constants.cos_beta, constants.sin_beta = injected.cos_beta, injected.sin_beta
    constants.cos_phi, constants.sin_phi = injected.cos_phi, injected.sin_phi
    constants.sign[0] = constants.sign[1] = 1.0
    injected.clock_ns = 0
    injected.bias[0] = injected.bias[1] = 0.0
    message_faults.clear(injected.message_fault)


@compiled
def _apply_fault(constants: receiver.Constants, injected: Injected, fault: int, values: Floats) -> None:
    """Apply a fault; values: arguments in the order of injection/table.py."""
    message_faults.apply(injected.message_fault, MESSAGE_FAULT_CODES, fault, values)
    if fault == Fault.DELAY:
        constants.latency_ns += round(values[0] * NS_PER_SECOND)
    elif fault == Fault.BIAS:
        injected.bias[0] += values[0]
        injected.bias[1] += values[1]
    elif fault == Fault.FADE:
        constants.power *= 10.0**(-0.1 * values[0])
    elif fault == Fault.WRONG_SLOPE:
        for i in range(2):
            if values[0] == SLOPE_BOTH or values[0] == SLOPE_CROSS_ELEVATION + i:
                constants.sign[i] = values[1]
        cos_turn, sin_turn = math.cos(values[2]), math.sin(values[2])
        constants.cos_beta = injected.cos_beta * cos_turn - injected.sin_beta * sin_turn
        constants.sin_beta = injected.sin_beta * cos_turn + injected.cos_beta * sin_turn
    elif fault == Fault.PHASE_180:
        constants.cos_phi, constants.sin_phi = -injected.cos_phi, -injected.sin_phi
    elif fault == Fault.CLOCK_STEP:
        injected.clock_ns += round(values[0] * NS_PER_SECOND)


@compiled
def apply_due_faults(record: _Unit, stamp: Nanoseconds) -> None:
    """Clear all faults, then apply the faults in force in the step of a stamp."""
    _clear_faults(record.constants, record.injected)
    schedule.begin(record.schedule)
    for i in range(schedule.MAX_ACTIVE_FAULTS):
        row = record.schedule.row[i]
        if schedule.in_force(record.schedule, row, stamp):
            _apply_fault(record.constants, record.injected, row.fault, row.values)


@compiled
def corrupt_messages(injected: Injected, stamp: Nanoseconds, outputs: AnyRecord) -> None:
    """Corrupt the results of a step."""
    error, rate, distance = outputs[ANGLE_ERROR_TOPIC], outputs[ANGLE_RATE_TOPIC], outputs[RANGE_TOPIC]
    for i in range(2):
        error.vector[i] += injected.bias[i]
        if injected.message_fault.sigma > 0.0:
            error.vector[i] += message_faults.noise(injected.message_fault, stamp, i)
    # Indices at which a freeze stores the numbers: errors 0 to 2, rates 3 to 5, range 6.
    message_faults.numbers(injected.message_fault, error.vector, 0)
    message_faults.numbers(injected.message_fault, rate.vector, 3)
    message_faults.numbers(injected.message_fault, distance.range, 6)
    for message in (error, rate):
        if message.stamp != NO_STAMP:
            message.stamp = NO_STAMP if injected.message_fault.drop != 0 else message.stamp + injected.clock_ns
    if distance.stamp != NO_STAMP:
        distance.stamp = NO_STAMP if injected.message_fault.drop != 0 else distance.stamp + injected.clock_ns
