"""Sources of samples: VITA 49 by UDP, sinks of GNU Radio by ZMQ, and recordings. See Source."""
import socket
import struct
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol, TypeAlias

import numpy as np

from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.quantities import Nanoseconds, Seconds
from pedestal_common.stream import bound
from pedestal_hardware.monopulse import sigmf, vita49
from pedestal_hardware.monopulse.blocks import ArrivalClock, Chunk, StreamError
from pedestal_hardware.monopulse.params import CHANNELS, SCANNED_CHANNELS, MonopulseParameters, SourceParameters
from pedestal_hardware.monopulse.vita49 import INTEGER_FULL_SCALE

TAG_MAGIC, TAG_VERSION = 0x5FF0, 1
TAG_HEADER = struct.Struct('<HBQQ')  # of a sink with tags: magic number, version, first item, number of tags
RECEIVE_BUFFER_BYTES = 8_000_000  # requested size of the receive buffer [bytes]; the kernel may give less
MAX_QUEUED_MESSAGES = 1000  # largest number of ZMQ messages that wait for this node
FULL_SCALE = (INTEGER_FULL_SCALE - 1.0) / INTEGER_FULL_SCALE  # largest real or imaginary part of a sample of integers
MAX_MESSAGE_BYTES = 64_000_000  # largest ZMQ message [bytes]


Clock: TypeAlias = Callable[[], Nanoseconds]    # returns the UTC


class Source(Protocol):
    """Source of samples."""
    full_scale: float | None    # largest part of a sample, None if the samples have no limit

    def read(self, timeout: Seconds) -> Chunk | None:
        """Return the next chunk, or None if none is complete in this time. Raises StreamError for data that do not
        fit; the next call continues."""

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of its events, by name."""

    def close(self) -> None:
        """End the source."""


class VitaSource:
    """Packets of VITA 49 that arrive by UDP. Floats have no full scale."""

    def __init__(self, params: SourceParameters, channels: Sequence[str], _clock: Clock) -> None:
        self.full_scale = FULL_SCALE if params.format == 'ci16' else None
        self.format, self.joiner = params.format, vita49.Joiner(params.rate, params.streams[:len(channels)])
        try:
            self.socket = bound(params.host, params.port)
        except OSError as error:
            raise StreamError(f'source.address = {params.url}: {error.strerror}') from None
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)

    def read(self, timeout: Seconds) -> Chunk | None:
        """Return the next chunk, or None."""
        self.socket.settimeout(timeout)
        try:
            data = self.socket.recv(vita49.MAX_PACKET_BYTES)
        except TimeoutError:
            return None
        packet = vita49.decode(data, self.format)
        return None if packet is None else self.joiner.put(packet)

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of its events."""
        return {'incomplete_packets': self.joiner.incomplete}

    def close(self) -> None:
        """End the source."""
        self.socket.close()


class ZmqSource:
    """Stream of interleaved complex64 from a sink of GNU Radio."""

    full_scale: float | None = None

    def __init__(self, params: SourceParameters, channels: Sequence[str], clock: Clock) -> None:
        try:
            import zmq
        except ImportError as error:
            raise StreamError(f"{error}: pip install 'pedestal_hardware[sdr]'") from None
        self.zmq, self.channels, self.clock = zmq, channels, clock
        self.context = zmq.Context()
        self.socket = self.context.socket(zmq.SUB if params.kind == 'zmq_sub' else zmq.PULL)
        self.socket.setsockopt(zmq.LINGER, 0)
        self.socket.setsockopt(zmq.RCVHWM, MAX_QUEUED_MESSAGES)
        self.socket.setsockopt(zmq.MAXMSGSIZE, MAX_MESSAGE_BYTES)
        if params.kind == 'zmq_sub':
            self.socket.setsockopt(zmq.SUBSCRIBE, b'')
        try:
            self.socket.connect(params.url)
        except zmq.ZMQError as error:
            self.close()
            raise StreamError(f'source.address = {params.url}: {error}') from None
        # A message contains no number of channels, but another number makes another rate.
        own = len(channels)
        other = len(CHANNELS) + len(SCANNED_CHANNELS) - own
        self.times = ArrivalClock(params.rate, params.delay, {
            other / own: f'or the messages have {other} channels, must be {own} (feed.kind)'})
        self.silence_ns = round(params.silence * NS_PER_SECOND)
        self.next, self.refused = 0, 0          # next: number of the next sample
        self.item: int | None = None            # number of the next item, as the sink counts
        self.arrived: Nanoseconds | None = None     # UTC of the last message

    def read(self, timeout: Seconds) -> Chunk | None:
        """Return the next chunk, or None."""
        if not self.socket.poll(round(1000 * timeout)):
            return None
        data, arrived = self.socket.recv(), self.clock()
        while self.socket.getsockopt(self.zmq.RCVMORE):     # a part before the samples holds the filter key
            data = self.socket.recv()
        if self.arrived is not None and arrived - self.arrived > self.silence_ns:
            # A restarted flowgraph counts again. The time shows about how many samples are missing.
            self.next += round((arrived - self.arrived) * self.times.rate / NS_PER_SECOND)
            self.times.clear()
        self.arrived = arrived
        data, first = self._without_tags(data)
        item = 8 * len(self.channels)
        if not data or len(data) % item:
            self.refused += 1
            self.next += 1
            raise StreamError(f'ZMQ message of {len(data)} bytes: must be a multiple of {item}, '
                              f'{len(self.channels)} interleaved channels of complex64')
        samples = np.frombuffer(data, '<c8').reshape(-1, len(self.channels))
        if first is not None:
            # A restarted sink counts its items from 0 again.
            self.next += max(first - self.item, 0) if self.item is not None else 0
            self.item = first + len(samples)
        self.next += self.times.lost(self.next + len(samples), arrived)
        number, self.next = self.next, self.next + len(samples)
        self.times.check_rate(self.next, arrived)
        return Chunk(samples, number, self.times.utc(number, len(samples), arrived))

    def _without_tags(self, data: bytes) -> tuple[bytes, int | None]:
        """Return (samples, number of the first one). Tags are refused: they have no fixed length."""
        if len(data) < TAG_HEADER.size or len(data) % 8 != TAG_HEADER.size % 8:
            return data, None
        magic, version, first, tags = TAG_HEADER.unpack_from(data)
        if (magic, version) != (TAG_MAGIC, TAG_VERSION):
            return data, None
        if tags:
            raise StreamError(f'ZMQ message with {tags} tags: switch off `pass tags` in the sink')
        return data[TAG_HEADER.size:], first

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of its events."""
        return {'refused_messages': self.refused}

    def close(self) -> None:
        """End the source."""
        self.socket.close()
        self.context.term()


class SigmfSource:
    """Recording, played in the time of the clock: its first sample has the UTC of the first call."""

    def __init__(self, params: SourceParameters, channels: Sequence[str], clock: Clock) -> None:
        self.recording = sigmf.Recording(params.url, channels, params.rate)
        self.full_scale = None if self.recording.type.kind == 'c' else FULL_SCALE
        self.block = max(round(params.rate * 0.005), 1)
        self.pieces, self.clock, self.ended = self._pieces(), clock, False
        self.shift: Nanoseconds | None = None       # of the times of the recording

    def _pieces(self) -> Iterator[Chunk]:
        for chunk in self.recording.chunks():
            for k in range(0, len(chunk.samples), self.block):
                yield Chunk(chunk.samples[k:k + self.block], chunk.first + k,
                            chunk.utc + round(k * NS_PER_SECOND / self.recording.rate))

    def read(self, timeout: Seconds) -> Chunk | None:
        """Return the next chunk when its time has come. Raises StreamError once, for a file that is cut."""
        chunk = next(self.pieces, None)
        if chunk is None:
            if self.recording.cut and not self.ended:
                self.ended = True
                raise StreamError(self.recording.cut)
            time.sleep(timeout)
            return None
        if self.shift is None:
            self.shift = self.clock() - chunk.utc
        end = chunk.utc + self.shift + round(len(chunk.samples) * NS_PER_SECOND / self.recording.rate)
        time.sleep(max(end - self.clock(), 0) / NS_PER_SECOND)
        return chunk._replace(utc=chunk.utc + self.shift)

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of its events."""
        return {}

    def close(self) -> None:
        """End the source."""


SOURCES: dict[str, Callable[[SourceParameters, Sequence[str], Clock], Source]] = {
    'vita49': VitaSource, 'zmq_sub': ZmqSource, 'zmq_pull': ZmqSource, 'sigmf': SigmfSource}


def opened(params: MonopulseParameters, clock: Clock) -> Source:
    """Return the source of a receiver. Raises StreamError."""
    return SOURCES[params.source.kind](params.source, params.feed.channels, clock)
