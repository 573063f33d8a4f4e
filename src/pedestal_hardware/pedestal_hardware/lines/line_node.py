"""Base of the nodes that publish what a device sends: no unit, no trigger, one message for each message of the device.

The thread of the reader publishes. A lock keeps it apart from the diagnostics, which the executor publishes.
"""
import threading

from pedestal_common.graph import nodes
from pedestal_common.node import shell
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_WARN
from pedestal_hardware.lines.reader import LineReader


class LineNode(shell.Shell):
    """Node of a device that sends lines. A subclass has `take_line(line)` and `diagnosed()`.

    silence     longest time between two published messages that is no error [s]
    reader      the LineReader, None for a device that sends no lines
    """

    def __init__(self, module):
        row = nodes.of_executable(module)
        super().__init__(row.name, row.parameters_type())
        self.lock, self.reader, self._published = threading.Lock(), None, None
        self.diagnose_with(self.diagnose)

    def read_lines(self, url, baud_rate):
        """Begin to read the lines of a device."""
        self.reader = LineReader(url, baud_rate, self._guarded(self._locked_line))
        self.reader.start()

    def _locked_line(self, line):
        with self.lock:
            self.take_line(line)

    def published(self, stamp):
        """Note that a message with a stamp [ns] is about to be published."""
        self.begin_step(stamp)
        self._published = self.clock()[0]

    def diagnose(self):
        """Return the Diagnosis: ERROR while the device is silent, else that of the subclass with the counts of the
        reader."""
        with self.lock:
            diagnosis = self.diagnosed()
        reader = self.reader
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
    def quiet_reason(self):
        """Text for a device that sends nothing over an open connection."""
        return f'no line from {self.reader.url}' if self.reader else 'no message'

    def close(self):
        """End the reader and the node."""
        if self.reader is not None:
            self.reader.close()
        super().close()
