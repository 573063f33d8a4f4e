"""Unit of a receiver of I/Q samples: blocks of samples in, angle errors out, without stream and without ROS."""
import cmath
import math
import typing
from collections.abc import Iterable, Mapping

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.graph import nodes
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis, Unit
from pedestal_common.quantities import AnyRecord, Complexes, Floats, Hertz, Nanoseconds, Records, Seconds, Stamps
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP
from pedestal_hardware.monopulse import feed, front_end, scan
from pedestal_hardware.monopulse.blocks import Block, Samples
from pedestal_hardware.monopulse.params import MonopulseParameters
from receiver_law import detector

ANGLE_ERROR_TOPIC = 'tracking_receiver/angle_error'

AXIS_NAMES = 'cross_elevation', 'elevation'

MAX_PASSED_GAP_S = 0.2  # longest gap after which the frequency stays [s]: 600 Hz at 3 kHz/s


class ReceiverRecord(Record):
    """Records of a receiver of three channels."""
    state: front_end.State
    constants: front_end.Constants
    outputs: front_end.Outputs


class ScannedRecord(ReceiverRecord):
    """Records of a receiver of a scanned feed."""
    window: scan.Window


class Memory(typing.NamedTuple):
    """Memory of the unit for three channels."""
    record: Records         # ReceiverRecord (1,)
    samples: Samples        # (n, 3) of a block
    dumps: Complexes        # (parts, 3) integrals


class ScannedMemory(typing.NamedTuple):
    """Memory of the unit for a scanned feed."""
    record: Records         # ScannedRecord (1,)
    samples: Samples        # (n, 2) of a block
    dumps: Complexes        # (parts, 2) integrals and means


@compiled
def publish(error: AnyRecord, stamp: Nanoseconds, outputs: front_end.Outputs) -> None:
    """Write the outputs of the receiver to the message of a stamp."""
    error.stamp = stamp
    error.vector[0], error.vector[1], error.vector[2] = outputs.cross_elevation, outputs.elevation, outputs.cn0_dbhz


@compiled
def law(memory: Memory, stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Execute the step of a block. stamp: middle of the block."""
    record = memory.record[0]
    front_end.step(record.state, record.constants, memory.samples, memory.dumps, record.outputs)
    publish(outputs[ANGLE_ERROR_TOPIC], stamp, record.outputs)


@compiled
def laws(memory: Memory, stamps: Stamps, inputs: Records, outputs: Records) -> None:
    """Execute `law` for each element of arrays."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])


@compiled
def scanned_law(memory: ScannedMemory, stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Execute the step of a block of a scanned feed. The stamp of an error is the middle of its window."""
    record = memory.record[0]
    if scan.step(record.state, record.constants, record.window, memory.samples, memory.dumps, record.outputs):
        publish(outputs[ANGLE_ERROR_TOPIC], stamp - record.window.age_ns, record.outputs)
    else:
        outputs[ANGLE_ERROR_TOPIC].stamp = NO_STAMP


@compiled
def scanned_laws(memory: ScannedMemory, stamps: Stamps, inputs: Records, outputs: Records) -> None:
    """Execute `scanned_law` for each element of arrays."""
    for k in range(len(stamps)):
        scanned_law(memory, stamps[k], inputs[k], outputs[k])


class MonopulseReceiver(Unit):
    """A receiver of three channels or of a scanned feed. Before each step `take` takes the block of the step."""
    parameters: MonopulseParameters
    memory: Memory | ScannedMemory
    integration: Seconds        # effective time of an error, see feed.effective_integration
    age_ns: Nanoseconds         # time from the stamp of an error to the middle of the block that completes it
    source_fault: str           # fault of the stream of samples, '' without one
    counts: dict[str, int]      # of the events of the stream, by name
    NODE, LAWS = nodes.MONOPULSE_RECEIVER, {Memory: (law, laws), ScannedMemory: (scanned_law, scanned_laws)}

    def __init__(self, parameters: MonopulseParameters, reads: Iterable[str]) -> None:
        super().__init__(parameters, reads)
        p = parameters
        parts, channels = p.receiver.samples_per_step, len(p.feed.channels)
        if p.feed.scanned:
            record = ScannedRecord.of(state=front_end.initial_state(p), constants=scan.constants(p),
                                      window=scan.initial_window(p))
        else:
            record = ReceiverRecord.of(state=front_end.initial_state(p),
                                       constants=front_end.constants(p))
        record['outputs']['status'] = front_end.Status.WAIT
        self.memory = (ScannedMemory if p.feed.scanned else Memory)(
            record, np.zeros((p.block, channels), np.complex64), np.zeros((parts, channels), np.complex128))
        self.integration = feed.effective_integration(p)
        self.age_ns = int(self.parts['window']['age_ns']) if p.feed.scanned else 0
        self.search = front_end.Search(p)
        self.source_fault, self.counts = '', {}

    def take(self, block: Block) -> None:
        """Take a block for the next step. After a long gap the carrier is searched again."""
        self.memory.samples[...] = block.samples
        state = self.parts['state']
        if block.missing:
            front_end.pass_gap(state, block.missing > MAX_PASSED_GAP_S * self.parameters.source.rate)
            self.search.clear()
            if self.parameters.feed.scanned:
                scan.begin_again(self.parts['window'])
        if state['carrier'] == 0 and np.isfinite(block.samples[:, 0]).all():
            turn = self.search.put(block.samples[:, 0])
            if turn is not None:
                front_end.use_carrier(state, turn)
        else:
            self.search.clear()

    def prepare_requests(self) -> None:
        """Compile the functions that the node calls between two steps."""
        super().prepare_requests()
        front_end.use_carrier(self.parts['state'], 0.0)
        front_end.pass_gap(self.parts['state'], True)
        if self.parameters.feed.scanned:
            scan.begin_again(self.parts['window'])

    @property
    def urgent(self) -> tuple[object, ...]:
        """Values whose change is published at once: lock and fault of the stream."""
        return int(self.parts['outputs']['locked']), bool(self.source_fault)

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis: ERROR for a fault of the stream, of its samples or of the scan, WARN without lock."""
        p, state, outputs = self.parameters, self.parts['state'], self.parts['outputs']
        hertz = p.source.rate / (2.0 * math.pi)
        sigma = (detector.angle_noise(p.antenna, p.receiver, float(outputs['cn0_dbhz']), p.period)
                 * math.sqrt(p.period / self.integration))
        values = [('cn0_dbhz', f'{outputs["cn0_dbhz"]:.2f}'), ('locked', str(int(outputs['locked']))),
                  ('carrier_hz', f'{state["turn"] * hertz:.1f}'), ('residual_hz', f'{state["error"] * hertz:.2f}'),
                  ('search_level_db', f'{self.search.level:.1f}'),
                  ('noise_power_db', f'{10.0 * math.log10(max(state["noise"], front_end.SMALLEST_POWER)):.2f}'),
                  ('angle_noise_deg', f'{math.degrees(sigma):.4g}'),
                  ('effective_integration_s', f'{self.integration:.4g}')]
        values += self._of_scan() if p.feed.scanned else self._of_ratios()
        values += [('bad_blocks', str(int(state['bad']))), *((name, str(count)) for name, count in
                                                            self.counts.items())]
        if self.source_fault:
            return Diagnosis(LEVEL_ERROR, self.source_fault, values)
        status = int(outputs['status'])
        text = front_end.STATUS_TEXT_BY_CODE[status]
        if status == front_end.Status.WRONG_SCAN:
            text += self._wrong_scan
        if status in (front_end.Status.NOT_FINITE, front_end.Status.NO_SCAN, front_end.Status.WRONG_SCAN):
            return Diagnosis(LEVEL_ERROR, text, values)
        return Diagnosis(LEVEL_OK if status == front_end.Status.LOCKED else LEVEL_WARN, text, values)

    def _of_ratios(self) -> list[tuple[str, str]]:
        state, values = self.parts['state'], []
        for name, real, imag, skew in zip(AXIS_NAMES, state['ratio_real'], state['ratio_imag'], state['skew']):
            ratio = complex(real, imag)
            values += [(f'{name}_ratio', f'{abs(ratio):.5f}'), (f'{name}_phase_deg',
                                                               f'{math.degrees(cmath.phase(ratio)):.2f}'),
                       (f'{name}_skew', f'{skew:.5f}')]
        return values

    def _of_scan(self) -> list[tuple[str, str]]:
        window = self.parts['window']
        return [('scan_hz', f'{self._scan_hz:.2f}'), ('scan_mean', f'{abs(window["mean"]):.3f}'),
                ('scan_reversals', f'{window["reversals"]:.2f}'),
                *((f'{name}_modulation', f'{value:.5f}') for name, value in zip(AXIS_NAMES, window['slope']))]

    @property
    def _scan_hz(self) -> Hertz:
        """Measured rate of the scan, negative for the wrong direction."""
        p = self.parameters
        return float(self.parts['window']['advance']) / (2.0 * math.pi) * p.receiver.samples_per_step / p.period

    @property
    def _wrong_scan(self) -> str:
        window, rate = self.parts['window'], self.parameters.feed.scan_rate
        if window['reversals'] > scan.MAX_REVERSALS:
            return f': it turns by more than 110 deg {window["reversals"]:.1f} times in a scan, must be 0'
        if abs(self._scan_hz - rate) > scan.MAX_RATE_SHARE * rate:
            return f': {self._scan_hz:.1f} Hz, must be {rate:g} Hz'
        return f': its mean is {abs(window["mean"]):.2f} of its amplitude, must be 0'

    @staticmethod
    def idle(numbers: Mapping[str, Floats]) -> str:
        """Return a reason if no error is finite: such a recording does not exercise the receiver."""
        return '' if np.isfinite(numbers[ANGLE_ERROR_TOPIC][:, 0]).any() else 'the receiver never locked'
