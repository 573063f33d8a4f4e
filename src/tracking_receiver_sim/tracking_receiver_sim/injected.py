"""The faults that can be injected into the receiver: what each of them breaks."""
import numpy as np

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.graph.steps import SECOND
from pedestal_common.injection import schedule, spoil, table
from pedestal_common.wire.records import NEVER

MESSAGES = spoil.codes('tracking_receiver')
Fault = codes([fault.name for fault in table.FAULTS['tracking_receiver']])

BOTH, CROSS_ELEVATION, ELEVATION = range(3)
"""Options of wrong_slope."""

INJECTED = np.dtype([('power', 'f8'), ('cos_phi', 'f8'), ('sin_phi', 'f8'), ('latency_ns', 'i8'),
                     ('clock_ns', 'i8'), ('bias', 'f8', (2,)), ('said', spoil.SPOILT)], align=True)
"""power ... latency_ns: constants of the receiver (receiver.CONSTANTS) when nothing is broken; clock_ns: added to the
stamps; bias: added to the errors [rad]; said: what spoils the results."""

ERRORS, RATE, RANGE = 'tracking_receiver/angle_error', 'tracking_receiver/angle_rate', 'tracking_receiver/range'


def initial(constants) -> np.ndarray:
    """INJECTED (1,) of receiver.CONSTANTS (1,): nothing is broken."""
    e = np.zeros(1, INJECTED)
    for name in ('power', 'cos_phi', 'sin_phi', 'latency_ns'):
        e[name] = constants[name]
    return e


@compiled
def _mend(c, e):
    """Nothing is broken."""
    c.power, c.cos_phi, c.sin_phi, c.latency_ns = e.power, e.cos_phi, e.sin_phi, e.latency_ns
    c.sign[0] = c.sign[1] = 1.0
    e.clock_ns = 0
    e.bias[0] = e.bias[1] = 0.0
    spoil.restore(e.said)


@compiled
def _break(c, e, fault, values):
    """What a fault does to constants and results of the receiver."""
    spoil.apply(e.said, MESSAGES, fault, values)
    if fault == Fault.DELAY:
        c.latency_ns += round(values[0] * SECOND)
    elif fault == Fault.BIAS:
        e.bias[0] += values[0]
        e.bias[1] += values[1]
    elif fault == Fault.FADE:
        c.power *= 10.0**(-0.1 * values[0])
    elif fault == Fault.WRONG_SLOPE:
        for i in range(2):
            if values[0] == BOTH or values[0] == CROSS_ELEVATION + i:
                c.sign[i] = -1.0
    elif fault == Fault.PHASE_180:
        c.cos_phi, c.sin_phi = -e.cos_phi, -e.sin_phi
    elif fault == Fault.CLOCK_STEP:
        e.clock_ns += round(values[0] * SECOND)


@compiled
def take(m, stamp):
    """Mend everything, then break what is broken in the step of a stamp [ns]; m: unit.RECORD."""
    _mend(m.constants, m.injected)
    schedule.begin(m.schedule)
    for i in range(schedule.SLOTS):
        row = m.schedule.row[i]
        if schedule.in_force(m.schedule, row, stamp):
            _break(m.constants, m.injected, row.fault, row.values)


@compiled
def spoil_messages(e, stamp, outputs):
    """The results of a step, spoilt."""
    error, rate, distance = outputs[ERRORS], outputs[RATE], outputs[RANGE]
    for i in range(2):
        error.vector[i] += e.bias[i]
        if e.said.sigma > 0.0:
            error.vector[i] += spoil.noise(e.said, stamp, i)
    spoil.numbers(e.said, error.vector, 0)
    spoil.numbers(e.said, rate.vector, 3)
    spoil.numbers(e.said, distance.range, 6)
    for message in (error, rate):
        if message.stamp != NEVER:
            message.stamp = NEVER if e.said.drop != 0 else message.stamp + e.clock_ns
    if distance.stamp != NEVER:
        distance.stamp = NEVER if e.said.drop != 0 else distance.stamp + e.clock_ns
