"""ROS node of a monopulse receiver of I/Q samples: takes the place of `tracking_receiver_node`.

A thread receives the samples. Each block of them is a step of the unit `unit.MonopulseReceiver`, whose law is in
`front_end`.
"""
import threading
import time

from pedestal_common.graph.nodes import Node
from pedestal_common.node import unit_node
from pedestal_common.node.unit import Diagnosis
from pedestal_common.quantities import Seconds
from pedestal_hardware.monopulse import blocks, sigmf, sources
from pedestal_hardware.monopulse.params import MonopulseParameters
from pedestal_hardware.monopulse.unit import MonopulseReceiver
from pedestal_hardware.start import StartsWithEquipment

READ_TIMEOUT_S = 0.1  # longest wait for samples before the node looks whether it ends [s]
MAX_SATURATED_SHARE = 0.01  # largest share of the samples of a block at full scale [-]


class MonopulseReceiverNode(StartsWithEquipment, unit_node.UnitNode):
    """Node of a receiver of I/Q samples."""
    parameters: MonopulseParameters
    unit: MonopulseReceiver

    def __init__(self, row: Node) -> None:
        self.source: sources.Source | None = None
        self.receiving: threading.Thread | None = None
        self.blocks: blocks.Blocks | None = None
        self.ending = False
        self.heard: Seconds | None = None       # time of the monotonic clock of the last samples
        self.fault = -blocks.FAULT_TIME_S, ''   # time and text of the last fault
        self.fault_log = blocks.FaultLog()
        super().__init__(row)

    def begin(self) -> None:
        """Open the source and receive."""
        p, recorder = self.parameters, None
        self.source = sources.opened(p, lambda: self.clock()[1])
        if p.source.record:
            # A node that is started again during a run must not fail at its own recording.
            path = sigmf.free_path(p.source.record)
            recorder = sigmf.Recorder(path, p.source.rate, p.feed.channels, 'received')
            self.get_logger().info(f'samples are recorded to {path}')
        self.blocks = blocks.Blocks(p.source.rate, p.block, recorder)
        self.comparison, self.begun = blocks.ClockComparison(), time.monotonic()
        self.receiving = threading.Thread(target=self._guarded(self._receive), daemon=True)
        self.receiving.start()

    @property
    def awaits(self) -> str:
        """Text that names the inputs for which the node waits."""
        source = self.parameters.source
        return f'samples of {source.url} ({source.kind})'

    def _receive(self) -> None:
        assert self.source is not None and self.blocks is not None
        while not self.ending:
            try:
                chunk = self.source.read(READ_TIMEOUT_S)
            except blocks.StreamError as error:
                self._note_fault(str(error))
                continue
            if chunk is not None:
                before = self.heard
                self.heard = time.monotonic()
                if before is not None and self.heard - before > self.parameters.source.silence:
                    self.get_logger().info(f'samples again, after {self.heard - before:.1f} s')
                recorded = self.blocks.recorder_fault
                made = self.blocks.put(chunk)
                if self.blocks.recorder_fault != recorded:
                    self._note_fault(f'the recording ends: {self.blocks.recorder_fault}')
                for block in made:
                    self._make(block)
            if chunk is None or made:
                self._look_for_faults()

    def _note_fault(self, text: str) -> None:
        now = time.monotonic()
        if self.fault_log.due(text, now):
            self.get_logger().warning(text)
        self.fault = now, text
        self._look_for_faults()

    def _look_for_faults(self) -> None:
        """Give the unit the present fault and the counts of the stream, and publish a change at once."""
        assert self.source is not None and self.blocks is not None
        now, (at, text) = time.monotonic(), self.fault
        silent = now - (self.begun if self.heard is None else self.heard)
        if now - at > blocks.FAULT_TIME_S:
            text = ''
        if silent > self.parameters.source.silence:
            text = text or (f'no samples for {silent:.0f} s' if self.heard is not None else 'no samples so far')
        unit = self.unit
        unit.source_fault = text
        unit.counts = {'lost_samples': self.blocks.lost, 'gaps': self.blocks.gaps, **self.source.counts}
        if [unit.urgent] != self._urgent and self.diagnose_now():
            self._urgent = [unit.urgent]

    def _make(self, block: blocks.Block) -> None:
        assert self.source is not None
        [port] = self.ports
        if block.missing:
            self._note_fault(f'{block.missing} samples are missing')
        share = blocks.saturated_share(block.samples, self.source.full_scale)
        if share > MAX_SATURATED_SHARE:
            self._note_fault('samples are at full scale: the signal is too strong for the front end, lower its gain')
        self.comparison.note(block.middle, self.clock()[1])
        if self.comparison.fault:
            self._note_fault(self.comparison.fault)
        self.unit.take(block)
        port.step(block.middle, {})
        start, lead = self.start_time or self.graph.start, self.parameters.source.start_after
        if lead and self.start_time is None:
            start = self.choose_start(start, lead)
        if block.middle - self.unit.age_ns < start:   # before time 0 of a run the graph publishes no measurements
            return
        self.begin_step(block.middle)
        port.publish()
        self.after_step()

    def diagnosed(self) -> Diagnosis:
        """Return the Diagnosis, with the error that ended the recording, and time 0 if it was chosen."""
        diagnosis = super().diagnosed()
        if self.blocks is not None and self.blocks.recorder_fault:
            diagnosis = diagnosis._replace(values=[*diagnosis.values,
                                                   ('recording_fault', self.blocks.recorder_fault)])
        return self.with_start(diagnosis)

    def close(self) -> None:
        """Close the source and the recording, and end."""
        self.ending = True
        if self.receiving is not None:
            self.receiving.join(1.0)
        if self.source is not None:
            self.source.close()
        if self.blocks is not None and self.blocks.recorder is not None:
            try:
                self.blocks.recorder.close()
            except blocks.StreamError as error:
                self.get_logger().warning(f'the recording is cut: {error}')
        super().close()
