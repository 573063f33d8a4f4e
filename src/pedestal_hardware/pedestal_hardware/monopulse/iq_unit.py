"""Unit of the simulated I/Q: from the true beam and the truth of the ship to the samples of all channels of a feed.

Target, path, antenna and injected faults are those of the simulated receiver (tracking_receiver_sim). Their voltages
modulate a carrier with Doppler shift. The noise power of a sample is 1 in each channel. The power of the carrier in
one sample is C/N0 divided by the sample rate.
"""
import math
import typing

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.graph import nodes, noise
from pedestal_common.injection import schedule, table
from pedestal_common.injection.simulated import Simulated
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, Diagnosis, joined
from pedestal_hardware.monopulse import feed
from pedestal_hardware.monopulse.params import CONICAL_SCAN, ONE_CHANNEL, THREE_CHANNELS
from tracking_receiver_sim import injected, receiver, target
from tracking_receiver_sim import unit as receiver_unit

LIGHT_SPEED_M_S = 299_792_458.0
SIGNAL_FAULTS = {THREE_CHANNELS: ('fade', 'wrong_slope', 'phase_180'),
                 ONE_CHANNEL: ('fade', 'wrong_slope', 'phase_180'), CONICAL_SCAN: ('fade',)}
"""{kind of a feed: injected faults of the receiver that its samples can have}. A conical scan has no differences."""

Record = np.dtype([('state', receiver.State.dtype), ('constants', receiver.Constants.dtype),
                         ('inputs', receiver.Inputs.dtype), ('outputs', receiver.Outputs.dtype), ('row', 'i8'),
                         ('schedule', schedule.Schedule.dtype), ('injected', injected.Injected.dtype),
                         ('closing', 'f8'), ('feed', feed.Feed.dtype)], align=True)
"""Record of the unit, with the records of the simulated receiver. row: row of `normals` for the next step; closing:
rate of the distance of the target [m/s], positive away, NaN without a target."""


class Memory(typing.NamedTuple):
    """All data of the unit.

    record: (1,) of Record; breaks, coefficients: track of the target; normals: (steps, n) noise of the
    scintillation; voltages: (rows, channels) of the last step without noise. A row belongs to an integral of three
    channels, and to a sample of a scanned feed, whose second channel is its reference.
    """
    record: np.ndarray
    breaks: np.ndarray
    coefficients: np.ndarray
    normals: np.ndarray
    voltages: np.ndarray


@compiled
def closing_speed(s, i, o):
    """Return the rate of the distance from the antenna to the target [m/s], positive away."""
    if o.target_valid == 0:
        return math.nan
    ve, vn, vu = line_of_sight.to_earth(i.mat_ed, s.antenna_velocity[0], s.antenna_velocity[1], s.antenna_velocity[2])
    e, n, u = (o.target_position[0] - s.antenna[0], o.target_position[1] - s.antenna[1],
               o.target_position[2] - s.antenna[2])
    distance = max(math.sqrt(e * e + n * n + u * u), 1.0)
    return (e * (o.target_velocity[0] - ve) + n * (o.target_velocity[1] - vn)
            + u * (o.target_velocity[2] - vu)) / distance


@compiled
def law(memory, stamp, inputs, outputs):
    """Execute one step at a stamp [ns]: the voltages since the last step."""
    m = memory.record[0]
    s, c, i, o = m.state, m.constants, m.inputs, m.outputs
    if schedule.pending(m.schedule, stamp):
        injected.apply_due_faults(m, stamp)
    receiver_unit.decode(i, stamp, inputs[receiver_unit.DRIVE_TRUTH_TOPIC], inputs[receiver_unit.SHIP_TRUTH_TOPIC])
    normals = memory.normals[m.row]
    m.row += 1
    m.closing = math.nan
    true, elapsed_ns = receiver.begin(s, c, i, o, memory.breaks, memory.coefficients)
    voltages = memory.voltages
    voltages[:] = 0.0
    if m.feed.kind != feed.THREE_CHANNELS_KIND:
        feed.turn(voltages, m.feed)
    if elapsed_ns > 0 and receiver.inputs_known(i):
        seen = receiver.incidence(s, c, i, o, true, normals)
        feed.fill(voltages, m.feed, s, c, seen)
        receiver.finish(s, o, true, seen)
        m.closing = closing_speed(s, i, o)
    elif elapsed_ns > 0:
        s.error_known = 0
        o.status = receiver.Status.NO_BEAM
    truth = outputs[receiver_unit.TARGET_TRUTH_TOPIC]
    truth.stamp = stamp
    truth.orientation[3] = 1.0
    for axis in range(3):
        truth.position[axis], truth.twist_linear[axis] = o.target_position[axis], o.target_velocity[axis]


@compiled
def laws(memory, stamps, inputs, outputs):
    """Execute `law` for each row of arrays."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])


@compiled
def modulate(voltages, scale, turns, samples, phase):
    """Add a carrier with voltages (rows, channels) to samples (n, channels). Return its phase after them [rad].

    scale: (m,) complex gain of the first m channels; turns: frequency at the first and after the last sample
    [rad/sample]; phase: phase of the first sample [rad].
    """
    n, parts = samples.shape[0], voltages.shape[0]
    slope = (turns[1] - turns[0]) / max(n, 1)
    for k in range(parts):
        first, last = k * n // parts, (k + 1) * n // parts
        angle = phase + turns[0] * first + 0.5 * slope * first * first
        turn = turns[0] + slope * 0.5 * (first + last)
        carrier, rotation = complex(math.cos(angle), math.sin(angle)), complex(math.cos(turn), math.sin(turn))
        for i in range(first, last):
            for channel in range(scale.shape[0]):
                samples[i, channel] += scale[channel] * voltages[k, channel] * carrier
            carrier *= rotation
    return (phase + turns[0] * n + 0.5 * slope * n * n) % (2.0 * math.pi)


class SimulatedIq(Simulated):
    """The simulated I/Q of MonopulseParameters. After each step `samples` makes the samples since the last step."""
    NODE, LAWS = nodes.SIMULATED_IQ, {Memory: (law, laws)}
    VERBS, FAULTS_OF = table.INJECT_COMMANDS['tracking_receiver'], 'tracking_receiver'

    def __init__(self, parameters, reads):
        super().__init__(parameters, reads)
        p = parameters
        self.target = target.build(p.target, p.duration, p.receiver.horizon_mask)
        # The scintillation has the stream that it has in the simulated receiver.
        self._air, self._iq = noise.generator(p.seed, 'tracking_receiver').spawn(2)
        constants = receiver.constants(p, p.period, self.target)
        constants['first_scintillation_normal'] = 0
        count = receiver.normals_per_step(p) - receiver.NORMALS_PER_SAMPLE * p.receiver.samples_per_step
        record = joined(Record, state=receiver.initial_state(), constants=constants, schedule=schedule.empty(),
                        injected=injected.initial(constants), feed=feed.record(p))
        record['inputs']['mat_ed'] = line_of_sight.ashore_matrix()
        rows = p.block if p.feed.scanned else p.receiver.samples_per_step
        self.memory = Memory(record, self.target.breaks, self.target.coefficients, np.zeros((1, count)),
                             np.zeros((rows, len(p.feed.channels)), np.complex128))
        phases = np.array([0.0] if p.feed.scanned else [0.0, p.simulated.x_phase, p.simulated.e_phase])
        self.scale = np.exp(1j * phases) / math.sqrt(p.block / p.receiver.samples_per_step)
        self.phase, self.turn = 0.0, None

    def block(self, steps):
        """Return the memory with the noise of the scintillation for the next steps."""
        self.parts['row'] = 0
        return self.memory._replace(normals=self._air.standard_normal((steps, self.memory.normals.shape[1])))

    @property
    def frequency(self):
        """Present frequency of the carrier in the samples [Hz]; NaN without a target."""
        p, closing = self.parameters.simulated, float(self.parts['closing'])
        return p.offset - p.carrier * closing / LIGHT_SPEED_M_S

    def samples(self, count):
        """Return the next samples (count, channels) complex64, with the voltages of the last step."""
        normals = self._iq.standard_normal((count, 2 * self.scale.size), np.float32)
        normals *= np.float32(math.sqrt(0.5))
        samples, voltages = normals.view(np.complex64), self.memory.voltages
        if self.parameters.feed.scanned:
            samples = np.column_stack((samples, voltages[np.arange(count) * len(voltages) // count, 1]
                                       .astype(np.complex64)))
        turn = 2.0 * math.pi * self.frequency / self.parameters.source.rate
        if math.isfinite(turn):
            turns = np.array([turn if self.turn is None else self.turn, turn])
            self.phase = modulate(voltages, self.scale, turns, samples, self.phase)
            self.turn = turn
        else:
            self.turn = None
        return samples

    def execute(self, command, arguments):
        """Inject a fault; see Simulated. Raises ValueError for a fault of messages, which samples do not have, and for
        a fault of differences in a conical scan."""
        kind = self.parameters.feed.kind
        if command.verb not in (*SIGNAL_FAULTS[kind], table.CLEAR_COMMAND.name):
            raise ValueError(f'{command.verb}: simulated I/Q of {kind} has the faults '
                             f'{", ".join(SIGNAL_FAULTS[kind])}')
        return super().execute(command, arguments)

    def prepare_requests(self):
        """Compile the functions that the node calls between two steps."""
        super().prepare_requests()
        modulate(self.memory.voltages, self.scale, np.zeros(2),
                 np.zeros((1, self.memory.voltages.shape[1]), np.complex64), 0.0)

    def diagnose(self):
        """Return the Diagnosis, with the frequency of the carrier."""
        status = int(self.parts['outputs']['status'])
        values = [('carrier_hz', f'{self.frequency:.1f}'), ('target', self.parameters.target.kind)]
        if self.target.start_time:
            values.append(('stamp_0_utc', self.target.start_time))
        values += zip(('track_log', 'track_flight'), self.target.summary)
        faults = (*receiver_unit.FAULT_STATUSES, receiver.Status.HIDDEN, receiver.Status.BELOW_HORIZON)
        if status in faults:
            return Diagnosis(LEVEL_ERROR, receiver.STATUS_TEXT_BY_CODE[status], values)
        return Diagnosis(LEVEL_OK, 'samples flow', values)
