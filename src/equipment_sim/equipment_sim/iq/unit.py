"""Unit of the simulated I/Q: from the true beam and the truth of the ship to the samples of all channels of a feed.

Target, path, antenna and injected faults are those of the simulated receiver. Their voltages modulate a carrier with
Doppler shift. The noise power of a sample is 1 in each channel, the power of the carrier is C/N0 divided by the sample
rate.
"""
import math
import typing
from collections.abc import Iterable, Mapping

import numpy as np

from equipment_sim.iq import feed
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.geometry.geodesy import SPEED_OF_LIGHT_M_S
from pedestal_common.graph import nodes
from pedestal_common.injection import schedule, table
from pedestal_common.injection.schedule import Simulated
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, Diagnosis
from pedestal_common.quantities import (
    AnyRecord,
    Complexes,
    Floats,
    Hertz,
    MetersPerSecond,
    Nanoseconds,
    Pair,
    Radians,
    Records,
    Stamps,
    Value,
)
from pedestal_common.record import Record
from pedestal_common.wire.commands import Command, Reply
from pedestal_hardware.monopulse.blocks import Samples
from pedestal_hardware.monopulse.feed import THREE_CHANNELS_KIND
from pedestal_hardware.monopulse.params import CONICAL_SCAN, ONE_CHANNEL, THREE_CHANNELS, MonopulseParameters
from tracking_receiver_sim import injected, receiver, target
from tracking_receiver_sim import unit as receiver_unit

SIGNAL_FAULTS = {THREE_CHANNELS: ('fade', 'wrong_slope', 'phase_180'),
                 ONE_CHANNEL: ('fade', 'wrong_slope', 'phase_180'), CONICAL_SCAN: ('fade',)}
"""{kind of a feed: injected faults of the receiver that its samples can have}. A conical scan has no differences."""


class IqRecord(Record):
    """All data of the unit, with the records of the simulated receiver."""
    state: receiver.State
    constants: receiver.Constants
    inputs: receiver.Inputs
    outputs: receiver.Outputs
    row: int                    # of `normals` for the next step
    schedule: schedule.Schedule
    injected: injected.Injected
    closing: MetersPerSecond    # rate of the distance of the target, positive away, NaN without a target
    feed: feed.Feed


class Memory(typing.NamedTuple):
    """All data of the unit. A row of the voltages belongs to an integral, or to a sample of a scanned feed."""
    record: Records         # IqRecord (1,)
    breaks: Floats          # track of the target, see target.Target
    coefficients: Floats
    normals: Floats         # (steps, n), noise of the scintillation
    voltages: Complexes     # (rows, channels) of the last step, without noise


@compiled
def closing_speed(state: receiver.State, inputs: receiver.Inputs, outputs: receiver.Outputs) -> MetersPerSecond:
    """Return the rate of the distance from the antenna to the target, positive away."""
    if outputs.target_valid == 0:
        return math.nan
    of_antenna = state.antenna_velocity
    ve, vn, vu = line_of_sight.to_earth(inputs.mat_ed, of_antenna[0], of_antenna[1], of_antenna[2])
    e, n, u = (outputs.target_position[0] - state.antenna[0], outputs.target_position[1] - state.antenna[1],
               outputs.target_position[2] - state.antenna[2])
    distance = max(math.sqrt(e * e + n * n + u * u), 1.0)
    return (e * (outputs.target_velocity[0] - ve) + n * (outputs.target_velocity[1] - vn)
            + u * (outputs.target_velocity[2] - vu)) / distance


@compiled
def law(memory: Memory, stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Execute one step at a stamp: the voltages since the last step."""
    record = memory.record[0]
    state, constants, own, results = record.state, record.constants, record.inputs, record.outputs
    if schedule.pending(record.schedule, stamp):
        injected.apply_due_faults(record, stamp)
    receiver_unit.decode(own, stamp, inputs[receiver_unit.DRIVE_TRUTH_TOPIC], inputs[receiver_unit.SHIP_TRUTH_TOPIC])
    normals = memory.normals[record.row]
    record.row += 1
    record.closing = math.nan
    true, elapsed_ns = receiver.begin(state, constants, own, results, memory.breaks, memory.coefficients)
    voltages = memory.voltages
    voltages[:] = 0.0
    if record.feed.kind != THREE_CHANNELS_KIND:
        feed.turn(voltages, record.feed)
    if elapsed_ns > 0 and receiver.inputs_known(own):
        seen = receiver.incidence(state, constants, own, results, true, normals)
        feed.fill(voltages, record.feed, state, constants, seen)
        receiver.finish(state, results, true, seen)
        record.closing = closing_speed(state, own, results)
    elif elapsed_ns > 0:
        state.error_known = 0
        results.status = receiver.Status.NO_BEAM
    receiver_unit.encode_truth(results, stamp, outputs[receiver_unit.TARGET_TRUTH_TOPIC])


@compiled
def laws(memory: Memory, stamps: Stamps, inputs: Records, outputs: Records) -> None:
    """Execute `law` for each row of arrays."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])


@compiled
def modulate(voltages: Complexes, scale: Complexes, turns: Pair, samples: Samples, phase: Radians) -> Radians:
    """Add a carrier with voltages (rows, channels) to samples, and return its phase after them. scale: gain of the
    first channels; turns: frequency at the first and after the last sample [rad/sample]."""
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
    """The simulated I/Q. After each step `samples` makes the samples since the last step."""
    parameters: MonopulseParameters
    memory: Memory
    turn: float | None      # frequency of the carrier after the last samples [rad/sample], None without a target
    NODE, LAWS = nodes.SIMULATED_IQ, {Memory: (law, laws)}
    VERBS, FAULTS_OF = table.INJECT_COMMANDS['tracking_receiver'], 'tracking_receiver'

    def __init__(self, parameters: MonopulseParameters, reads: Iterable[str]) -> None:
        super().__init__(parameters, reads)
        p = parameters
        self.target = target.build(p.target, p.duration, p.receiver.horizon_mask)
        # The scintillation has the stream that it has in the simulated receiver.
        self._air, self._iq = nodes.noise(p.seed, 'tracking_receiver').spawn(2)
        constants = receiver.constants(p, p.period, self.target)
        constants['first_scintillation_normal'] = 0
        count = receiver.normals_per_step(p) - receiver.NORMALS_PER_SAMPLE * p.receiver.samples_per_step
        record = IqRecord.of(state=receiver.initial_state(), constants=constants,
                             schedule=schedule.empty(), injected=injected.initial(constants), feed=feed.record(p))
        record['inputs']['mat_ed'] = line_of_sight.ashore_matrix()
        rows = p.block if p.feed.scanned else p.receiver.samples_per_step
        self.memory = Memory(record, self.target.breaks, self.target.coefficients, np.zeros((1, count)),
                             np.zeros((rows, len(p.feed.channels)), np.complex128))
        phases: Floats = np.array([0.0] if p.feed.scanned else [0.0, p.simulated.x_phase, p.simulated.e_phase])
        self.scale = np.exp(1j * phases) / math.sqrt(p.block / p.receiver.samples_per_step)
        self.phase, self.turn = 0.0, None

    def block(self, steps: int) -> Memory:
        """Return the memory with the noise of the scintillation for the next steps."""
        self.parts['row'] = 0
        return self.memory._replace(normals=self._air.standard_normal((steps, self.memory.normals.shape[1])))

    @property
    def frequency(self) -> Hertz:
        """Present frequency of the carrier in the samples; NaN without a target."""
        p, closing = self.parameters.simulated, float(self.parts['closing'])
        return p.offset - p.carrier * closing / SPEED_OF_LIGHT_M_S

    def samples(self, count: int) -> Samples:
        """Return the next samples, with the voltages of the last step."""
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

    def execute(self, command: Command, arguments: Mapping[str, Value]) -> Reply:
        """Inject a fault. Raises ValueError for a fault of messages, or of differences in a conical scan."""
        kind = self.parameters.feed.kind
        if command.verb not in (*SIGNAL_FAULTS[kind], table.CLEAR_COMMAND.name):
            raise ValueError(f'{command.verb}: simulated I/Q of {kind} has the faults '
                             f'{", ".join(SIGNAL_FAULTS[kind])}')
        return super().execute(command, arguments)

    def prepare_requests(self) -> None:
        """Compile the functions that the node calls between two steps."""
        super().prepare_requests()
        modulate(self.memory.voltages, self.scale, np.zeros(2),
                 np.zeros((1, self.memory.voltages.shape[1]), np.complex64), 0.0)

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis, with the frequency of the carrier."""
        status = int(self.parts['outputs']['status'])
        values = [('carrier_hz', f'{self.frequency:.1f}'), ('target', self.parameters.target.kind),
                  *self.target.values]
        faults = (*receiver_unit.FAULT_STATUSES, receiver.Status.HIDDEN, receiver.Status.BELOW_HORIZON)
        if status in faults:
            return Diagnosis(LEVEL_ERROR, receiver.STATUS_TEXT_BY_CODE[status], values)
        return Diagnosis(LEVEL_OK, 'samples flow', values)
