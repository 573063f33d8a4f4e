"""Injected faults of the receiver: their effects on the constants and the messages of its unit."""
import numpy as np

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.injection import message_faults, schedule, table
from pedestal_common.quantities import Pair
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP

MESSAGE_FAULT_CODES = message_faults.codes('tracking_receiver')
Fault = codes([fault.name for fault in table.INJECTED_FAULTS['tracking_receiver']])

SLOPE_BOTH, SLOPE_CROSS_ELEVATION, SLOPE_ELEVATION = range(3)  # choices of the fault wrong_slope


class Injected(Record):
    """Record of the faults.

    power, cos_phi, sin_phi, latency_ns     values of receiver.Constants without a fault
        clock_ns                                offset of the stamps
        bias                                    offset of the errors [rad]
        message_fault                           faults of the published results
    """
    power: float
    cos_phi: float
    sin_phi: float
    latency_ns: int
    clock_ns: int
    bias: Pair
    message_fault: message_faults.MessageFault


ANGLE_ERROR_TOPIC, ANGLE_RATE_TOPIC = 'tracking_receiver/angle_error', 'tracking_receiver/angle_rate'
RANGE_TOPIC = 'tracking_receiver/range'


def initial(constants) -> np.ndarray:
    """Return Injected (1,) without a fault, for receiver.Constants (1,)."""
    e = Injected.zeros()
    for name in ('power', 'cos_phi', 'sin_phi', 'latency_ns'):
        e[name] = constants[name]
    return e


@compiled
def _clear_faults(c, e):
    """Restore the constants c of the receiver, and clear the faults in the record e of Injected."""
    c.power, c.cos_phi, c.sin_phi, c.latency_ns = e.power, e.cos_phi, e.sin_phi, e.latency_ns
    c.sign[0] = c.sign[1] = 1.0
    e.clock_ns = 0
    e.bias[0] = e.bias[1] = 0.0
    message_faults.clear(e.message_fault)


@compiled
def _apply_fault(c, e, fault, values):
    """Apply a fault to the constants c of the receiver and to the record e of Injected.

    values: arguments of the fault, in the order of injection/table.py.
    """
    message_faults.apply(e.message_fault, MESSAGE_FAULT_CODES, fault, values)
    if fault == Fault.DELAY:
        c.latency_ns += round(values[0] * NS_PER_SECOND)
    elif fault == Fault.BIAS:
        e.bias[0] += values[0]
        e.bias[1] += values[1]
    elif fault == Fault.FADE:
        c.power *= 10.0**(-0.1 * values[0])
    elif fault == Fault.WRONG_SLOPE:
        for i in range(2):
            if values[0] == SLOPE_BOTH or values[0] == SLOPE_CROSS_ELEVATION + i:
                c.sign[i] = -1.0
    elif fault == Fault.PHASE_180:
        c.cos_phi, c.sin_phi = -e.cos_phi, -e.sin_phi
    elif fault == Fault.CLOCK_STEP:
        e.clock_ns += round(values[0] * NS_PER_SECOND)


@compiled
def apply_due_faults(m, stamp):
    """Clear all faults, then apply the faults in force in the step of a stamp [ns]; m: record of unit.Record."""
    _clear_faults(m.constants, m.injected)
    schedule.begin(m.schedule)
    for i in range(schedule.MAX_ACTIVE_FAULTS):
        row = m.schedule.row[i]
        if schedule.in_force(m.schedule, row, stamp):
            _apply_fault(m.constants, m.injected, row.fault, row.values)


@compiled
def corrupt_messages(e, stamp, outputs):
    """Corrupt the results of a step, according to the record e of Injected."""
    error, rate, distance = outputs[ANGLE_ERROR_TOPIC], outputs[ANGLE_RATE_TOPIC], outputs[RANGE_TOPIC]
    for i in range(2):
        error.vector[i] += e.bias[i]
        if e.message_fault.sigma > 0.0:
            error.vector[i] += message_faults.noise(e.message_fault, stamp, i)
    # Indices at which a freeze stores the numbers: errors 0 to 2, rates 3 to 5, range 6.
    message_faults.numbers(e.message_fault, error.vector, 0)
    message_faults.numbers(e.message_fault, rate.vector, 3)
    message_faults.numbers(e.message_fault, distance.range, 6)
    for message in (error, rate):
        if message.stamp != NO_STAMP:
            message.stamp = NO_STAMP if e.message_fault.drop != 0 else message.stamp + e.clock_ns
    if distance.stamp != NO_STAMP:
        distance.stamp = NO_STAMP if e.message_fault.drop != 0 else distance.stamp + e.clock_ns
