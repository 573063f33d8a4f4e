"""Base of the nodes that publish what a device sends: no unit, no trigger, one message for each message of the device.

The thread of the reader publishes. A lock keeps it apart from the diagnostics, which the executor publishes.
"""
import threading

from pedestal_common.graph import nodes
from pedestal_common.node import shell
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import Nanoseconds
from pedestal_hardware.lines.reader import LineReader


class LineNode(shell.Shell):
    """Node of a device that sends lines. `silence` of its parameters: longest time between two published messages."""

    def __init__(self, row: nodes.Node) -> None:
        super().__init__(row.name, row.parameters_type())
        self.lock = threading.Lock()
        self.line_reader: LineReader | None = None      # None for a device that sends no lines
        self._published: Nanoseconds | None = None      # time of the steady clock
        self.diagnose_with(self.diagnose)

    def take_line(self, line: bytes) -> None:
        """Publish what a line states; overridden by a node that reads lines."""
        raise NotImplementedError

    def diagnosed(self) -> Diagnosis:
        """Return the Diagnosis of the unit; overridden by each node."""
        raise NotImplementedError

    def read_lines(self, url: str, baud_rate: int) -> None:
        """Begin to read the lines of a device."""
        self.line_reader = LineReader(url, baud_rate, self._guarded(self._locked_line))
        self.line_reader.start()

    def _locked_line(self, line: bytes) -> None:
        with self.lock:
            self.take_line(line)

    def published(self, stamp: Nanoseconds) -> None:
        """Note that a message is about to be published."""
        self.begin_step(stamp)
        self._published = self.clock()[0]

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis: ERROR while the device is silent, else that of the subclass."""
        with self.lock:
            diagnosis = self.diagnosed()
        reader = self.line_reader
        counts = reader.counts if reader else {}
        values = [*diagnosis.values, *((name, str(count)) for name, count in counts.items())]
        since = None if self._published is None else (self.clock()[0] - self._published) * 1e-9
        if since is None or since > self.parameters.silence:
            text = 'nothing published so far' if since is None else f'nothing published for {since:.1f} s'
            reason = (reader.silence if reader else '') or (diagnosis.message if diagnosis.level else '')
            return diagnosis._replace(level=LEVEL_ERROR, values=values,
                                      message=f'{text}: {reason or self.quiet_reason}')
        if reader and reader.silence and diagnosis.level < LEVEL_WARN:
            return diagnosis._replace(level=LEVEL_WARN, message=reader.silence, values=values)
        return diagnosis._replace(values=values)

    @property
    def quiet_reason(self) -> str:
        """Text for a device that sends nothing over an open connection."""
        return f'no line from {self.line_reader.url}' if self.line_reader else 'no message'

    def close(self) -> None:
        """End the reader and the node."""
        if self.line_reader is not None:
            self.line_reader.close()
        super().close()
