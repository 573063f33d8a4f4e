"""Blocks of samples, and their times.

A source delivers chunks of any length, each with the number and the time of its first sample. `TimeBase` gives the
time of each sample by the sample counter, from one measured time. The time of arrival of a chunk alone never is the
time of its samples.
"""
import collections
import contextlib
import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.quantities import Hertz, Nanoseconds, Seconds

if TYPE_CHECKING:
    from pedestal_hardware.monopulse import sigmf

TIME_TOLERANCE_NS = 20_000  # largest deviation of a source's time before the counter is set again [ns]
ARRIVAL_WINDOW_S = 10.0  # time in which the earliest arrival sets the counter of a source without times
CLOCK_TOLERANCE_S, CLOCK_TIME_S = 0.1, 0.5  # largest deviation, and its time until it is a fault [s]: blocks may stall
LATE_INTERVAL_S, MIN_LATE_ARRIVALS = 0.25, 5  # of an interval, of which the earliest arrival counts: time, arrivals

LATE_TOLERANCE_S = 0.004
"""Largest delay of the earliest arrivals of two intervals before samples count as lost [s]. A clock that drifts by
200 ppm makes the arrivals as late in twice ARRIVAL_WINDOW_S."""

FAULT_TIME_S = 2.0  # time for which a fault of the stream is reported after its last occurrence [s]
RATE_WINDOW_S = 2.0  # time over which the sample rate of a source without times is measured [s]
CAUSE_TOLERANCE = 0.05  # largest relative deviation of a wrong sample rate from that of a possible cause
RATE_TOLERANCE, STALL_TIME_S = 0.01, 0.1  # of the measured sample rate, and delay of one arrival that is none [s]


class StreamError(ValueError):
    """Error of a stream of samples, one line that names the value and what it must be."""


Samples: TypeAlias = NDArray[np.complex64]   # (n, channels)


class Chunk(NamedTuple):
    """Samples that follow each other."""
    samples: Samples
    first: int          # number of the first sample
    utc: Nanoseconds    # of the first sample


class Block(NamedTuple):
    """Samples of a step."""
    samples: Samples
    middle: Nanoseconds     # UTC of their middle
    missing: int            # number of samples missing before them


def saturated_share(samples: Samples, full_scale: float | None) -> float:
    """Return the share of samples whose first channel is at full scale, 0 without a full scale."""
    if full_scale is None:
        return 0.0
    first = samples[:, 0]
    return float(((np.abs(first.real) >= full_scale) | (np.abs(first.imag) >= full_scale)).mean())


class TimeBase:
    """Time of the samples: `index` is the number of a sample, `utc` its time."""
    utc: Nanoseconds | None

    def __init__(self, rate: Hertz) -> None:
        self.rate, self.index, self.utc = rate, 0, None

    def at(self, index: int) -> Nanoseconds:
        """Return the UTC of a sample, after the first `note`."""
        assert self.utc is not None
        return self.utc + round((index - self.index) * NS_PER_SECOND / self.rate)

    def note(self, index: int, utc: Nanoseconds) -> bool:
        """Take the measured time of a sample. Return True if the times of the samples have changed."""
        if self.utc is not None and abs(utc - self.at(index)) <= TIME_TOLERANCE_NS:
            return False
        self.index, self.utc = index, utc
        return True


class Blocks:
    """Blocks of a size, made of chunks. recorder: recording to which the samples are written."""
    kept: Samples           # samples of an incomplete block
    next: int | None        # number of the sample after the last one
    lost: int               # number of samples that were missing
    gaps: int               # number of gaps
    recorder_fault: str     # text of the error that ended the recorder, '' without one

    def __init__(self, rate: Hertz, size: int, recorder: 'sigmf.Recorder | None' = None) -> None:
        self.size, self.base, self.recorder = size, TimeBase(rate), recorder
        self.kept, self.begin, self.next = np.zeros((0, 0), np.complex64), 0, None
        self.lost = self.gaps = self.missing = 0
        self.recorder_fault = ''

    def put(self, chunk: Chunk) -> list[Block]:
        """Take a chunk and return the complete blocks. A gap discards the samples of an incomplete block."""
        gap = False
        if self.next is not None and chunk.first != self.next:
            gap, lost = True, max(chunk.first - self.next, 1)
            self.lost, self.gaps, self.missing = self.lost + lost, self.gaps + 1, self.missing + lost
        if gap or self.next is None:
            self.kept, self.begin = chunk.samples[:0], chunk.first
        moved = self.base.note(chunk.first, chunk.utc)
        if self.recorder is not None:
            self._record(self.recorder, chunk, moved or gap or self.next is None)
        self.next = chunk.first + len(chunk.samples)
        self.kept = np.concatenate((self.kept, chunk.samples)) if len(self.kept) else chunk.samples
        made = []
        for k in range(len(self.kept) // self.size):
            middle = self.base.at(self.begin) + round(0.5 * self.size * NS_PER_SECOND / self.base.rate)
            made.append(Block(self.kept[k * self.size:(k + 1) * self.size], middle, self.missing))
            self.begin, self.missing = self.begin + self.size, 0
        self.kept = self.kept[len(made) * self.size:]
        return made

    def _record(self, recorder: 'sigmf.Recorder', chunk: Chunk, begins: bool) -> None:
        """An error ends the recorder, not the blocks."""
        try:
            recorder.write(chunk, begins)
        except StreamError as error:
            self.recorder, self.recorder_fault = None, str(error)
            with contextlib.suppress(StreamError):      # a full disk takes the rest of the samples neither
                recorder.close()


class FaultLog:
    """Choice of the faults that a node logs. A fault that continues, perhaps with other numbers, is logged once."""

    def __init__(self) -> None:
        self.last: dict[str, Seconds] = {}      # {text without its numbers: time of the last occurrence}

    def due(self, text: str, now: Seconds) -> bool:
        """Take a fault at a time of the monotonic clock; return True if it is new, or was absent for FAULT_TIME_S."""
        words = re.sub(r'\d+', '', text)
        absent = now - self.last.get(words, -math.inf)
        self.last[words] = now
        return absent > FAULT_TIME_S


class ClockComparison:
    """Comparison of the times of the blocks with the clock. fault: text of their deviation, '' without one."""

    def __init__(self) -> None:
        self.fault, self.shown = '', 0
        self.since: Nanoseconds | None = None       # begin of the deviation

    def note(self, middle: Nanoseconds, now: Nanoseconds) -> None:
        """Take the middle of a block and the UTC at which it was complete."""
        deviation = middle - now
        if abs(deviation) <= CLOCK_TOLERANCE_S * NS_PER_SECOND:
            self.fault, self.since = '', None
            return
        self.since = now if self.since is None else self.since
        # The text stays while the deviation is about the same, so that the log does not repeat it.
        if now - self.since >= CLOCK_TIME_S * NS_PER_SECOND and not (
                self.fault and abs(deviation - self.shown) <= CLOCK_TOLERANCE_S * NS_PER_SECOND):
            self.shown = deviation
            self.fault = (f'time of the samples is {abs(deviation) / NS_PER_SECOND:.1f} s '
                          f'{"ahead of" if deviation > 0 else "behind"} the clock')


class ArrivalClock:
    """Times of the samples of a source without times, from the times at which they arrive. Call `lost`, then `utc`.
    The delay of a sample varies upwards. The earliest arrival of a window therefore sets the times, with the shortest
    delay known. causes: {ratio of a wrong sample rate and the right one: text on its possible cause}."""

    def __init__(self, rate: Hertz, delay: Seconds, causes: Mapping[float, str] | None = None) -> None:
        self.rate, self.delay_ns, self.causes = rate, round(delay * NS_PER_SECOND), causes or {}
        self.window_ns = round(ARRIVAL_WINDOW_S * NS_PER_SECOND)
        self.interval_ns = round(LATE_INTERVAL_S * NS_PER_SECOND)
        self.tolerance_ns = round(LATE_TOLERANCE_S * NS_PER_SECOND)
        # What becomes later by more between two intervals has a wrong rate, which check_rate names.
        self.spread_ns = round((RATE_TOLERANCE + STALL_TIME_S / RATE_WINDOW_S) * self.interval_ns)
        self.clear()

    def clear(self) -> None:
        """Begin again, after a gap."""
        self.offset: Nanoseconds = 0                # shortest delay known
        self.present: Nanoseconds = 0               # shortest delay of this window
        self.until: Nanoseconds | None = None       # end of this window, None before the first message
        self.arrivals: collections.deque[tuple[int, Nanoseconds]] = collections.deque()
        self.began: Nanoseconds | None = None       # begin of the interval
        self.earliest: Nanoseconds = 0              # shortest delay of the interval
        self.before: Nanoseconds | None = None      # shortest delay of the interval before
        self.count = 0

    def lost(self, next_sample: int, arrived: Nanoseconds) -> int:
        """Return the number of samples that were lost without a sign, 0 for none: for about 0.5 s, no arrival was as
        early as the times of the samples demand. The caller adds them to the numbers of the samples."""
        offset = arrived - round(next_sample * NS_PER_SECOND / self.rate)
        if self.began is None:
            self.began, self.earliest = arrived, offset
        if arrived - self.began < self.interval_ns or self.count < MIN_LATE_ARRIVALS:
            self.earliest, self.count = min(self.earliest, offset), self.count + 1
            return 0
        before, earliest = self.before, self.earliest
        self.before, self.began, self.earliest, self.count = earliest, arrived, offset, 1
        if before is None or abs(earliest - before) > self.spread_ns:
            return 0
        late = min(before, earliest) - self.offset
        if late <= self.tolerance_ns:
            return 0
        # The numbers that grow take the delay away, so the offset stays the shortest one that is known.
        self.arrivals.clear()
        self.began = self.before = None
        self.count = 0
        return round(late * self.rate / NS_PER_SECOND)

    def utc(self, first: int, count: int, arrived: Nanoseconds) -> Nanoseconds:
        """Return the UTC of sample number `first` of `count` samples that arrived at a UTC."""
        offset = arrived - round((first + count) * NS_PER_SECOND / self.rate)
        if self.until is None or arrived > self.until:
            # The clocks of source and machine drift, so each window begins with its own earliest arrival.
            self.offset = offset if self.until is None else self.present
            self.present, self.until = offset, arrived + self.window_ns
        self.present, self.offset = min(self.present, offset), min(self.offset, offset)
        return self.offset + round(first * NS_PER_SECOND / self.rate) - self.delay_ns

    def check_rate(self, next_sample: int, arrived: Nanoseconds) -> None:
        """Raise StreamError if the samples of the last RATE_WINDOW_S arrived at a wrong rate."""
        window = self.arrivals
        window.append((next_sample, arrived))
        while arrived - window[1][1] > RATE_WINDOW_S * NS_PER_SECOND if len(window) > 1 else False:
            window.popleft()
        elapsed = arrived - window[0][1]
        if elapsed >= RATE_WINDOW_S * NS_PER_SECOND:
            rate = (next_sample - window[0][0]) * NS_PER_SECOND / elapsed
            # A stall of the machine delays one arrival, so short windows deviate more.
            if abs(rate / self.rate - 1.0) > RATE_TOLERANCE + STALL_TIME_S * NS_PER_SECOND / elapsed:
                cause = next((f'; {text}' for ratio, text in self.causes.items()
                              if abs(rate / (ratio * self.rate) - 1.0) < CAUSE_TOLERANCE), '')
                raise StreamError(f'sample rate {rate:.0f} S/s: must be {self.rate:.0f} S/s (source.rate){cause}')
