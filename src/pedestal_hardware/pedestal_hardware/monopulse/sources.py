"""Sources of samples: VITA 49 by UDP, sinks of GNU Radio by ZMQ, and recordings. Each has the call `read`.

read(timeout) waits at most this time [s] and returns a Chunk, or None if none is complete. It raises StreamError for
data that do not fit; the next call continues. `close` ends the source; `counts` are its events by name; `full_scale`
is the largest part of a sample, None if the samples have no limit.
"""
import socket
import struct
import time

import numpy as np

from pedestal_hardware.monopulse import sigmf, vita49
from pedestal_hardware.monopulse.blocks import NS_PER_SECOND, ArrivalClock, Chunk, StreamError
from pedestal_hardware.monopulse.params import CHANNELS, SCANNED_CHANNELS
from pedestal_hardware.monopulse.vita49 import INTEGER_FULL_SCALE

TAG_MAGIC, TAG_VERSION = 0x5FF0, 1
TAG_HEADER = struct.Struct('<HBQQ')
"""Header of a ZMQ sink of GNU Radio with tags: magic number, version, number of the first item, number of tags."""

RECEIVE_BUFFER_BYTES = 8_000_000  # requested size of the receive buffer [bytes]; the kernel may give less
MAX_QUEUED_MESSAGES = 1000  # largest number of ZMQ messages that wait for this node
FULL_SCALE = (INTEGER_FULL_SCALE - 1.0) / INTEGER_FULL_SCALE  # largest real or imaginary part of a sample of integers
MAX_MESSAGE_BYTES = 64_000_000  # largest ZMQ message [bytes]


class VitaSource:
    """Packets of VITA 49 that arrive by UDP. full_scale: largest number of a sample, None for floats."""

    def __init__(self, p, channels, _clock):
        self.full_scale = FULL_SCALE if p.format == 'ci16' else None
        self.format, self.joiner = p.format, vita49.Joiner(p.rate, p.streams[:len(channels)])
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        try:
            self.socket.bind((p.host, p.port))
        except OSError as error:
            self.socket.close()
            raise StreamError(f'source.address = {p.url}: {error.strerror}') from None

    def read(self, timeout):
        """Return the next Chunk, or None."""
        self.socket.settimeout(timeout)
        try:
            data = self.socket.recv(vita49.MAX_PACKET_BYTES)
        except TimeoutError:
            return None
        packet = vita49.decode(data, self.format)
        return None if packet is None else self.joiner.put(packet)

    @property
    def counts(self):
        """Numbers of its events."""
        return {'incomplete_packets': self.joiner.incomplete}

    def close(self):
        """End the source."""
        self.socket.close()


class ZmqSource:
    """Stream of interleaved complex64 from a sink of GNU Radio. clock() returns the UTC [ns]."""

    full_scale = None

    def __init__(self, p, channels, clock):
        try:
            import zmq
        except ImportError as error:
            raise StreamError(f"{error}: pip install 'pedestal_hardware[sdr]'") from None
        self.zmq, self.channels, self.clock = zmq, channels, clock
        self.context = zmq.Context()
        self.socket = self.context.socket(zmq.SUB if p.kind == 'zmq_sub' else zmq.PULL)
        self.socket.setsockopt(zmq.LINGER, 0)
        self.socket.setsockopt(zmq.RCVHWM, MAX_QUEUED_MESSAGES)
        self.socket.setsockopt(zmq.MAXMSGSIZE, MAX_MESSAGE_BYTES)
        if p.kind == 'zmq_sub':
            self.socket.setsockopt(zmq.SUBSCRIBE, b'')
        try:
            self.socket.connect(p.url)
        except zmq.ZMQError as error:
            self.close()
            raise StreamError(f'source.address = {p.url}: {error}') from None
        # A message contains no number of channels, but another number makes another rate.
        own = len(channels)
        other = len(CHANNELS) + len(SCANNED_CHANNELS) - own
        self.times = ArrivalClock(p.rate, p.delay, {
            other / own: f'or the messages have {other} channels, must be {own} (feed.kind)'})
        self.silence_ns = round(p.silence * NS_PER_SECOND)
        self.next, self.item, self.arrived, self.refused = 0, None, None, 0

    def read(self, timeout):
        """Return the next Chunk, or None."""
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

    def _without_tags(self, data):
        """Return (samples, number of the first one or None) of a message. Raises StreamError for tags, which have no
        fixed length."""
        if len(data) < TAG_HEADER.size or len(data) % 8 != TAG_HEADER.size % 8:
            return data, None
        magic, version, first, tags = TAG_HEADER.unpack_from(data)
        if (magic, version) != (TAG_MAGIC, TAG_VERSION):
            return data, None
        if tags:
            raise StreamError(f'ZMQ message with {tags} tags: switch off `pass tags` in the sink')
        return data[TAG_HEADER.size:], first

    @property
    def counts(self):
        """Numbers of its events."""
        return {'refused_messages': self.refused}

    def close(self):
        """End the source."""
        self.socket.close()
        self.context.term()


class SigmfSource:
    """Recording, played in the time of the clock: its first sample has the UTC of the first call. clock() returns the
    UTC [ns]."""

    def __init__(self, p, channels, clock):
        self.recording = sigmf.Recording(p.url, channels, p.rate)
        self.full_scale = None if self.recording.type.kind == 'c' else FULL_SCALE
        self.block = max(round(p.rate * 0.005), 1)
        self.pieces, self.clock, self.shift, self.ended = self._pieces(), clock, None, False

    def _pieces(self):
        for chunk in self.recording.chunks():
            for k in range(0, len(chunk.samples), self.block):
                yield Chunk(chunk.samples[k:k + self.block], chunk.first + k,
                            chunk.utc + round(k * NS_PER_SECOND / self.recording.rate))

    def read(self, timeout):
        """Return the next Chunk when its time has come. Raises StreamError once, for a file that is cut."""
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
    def counts(self):
        """Numbers of its events."""
        return {}

    def close(self):
        """End the source."""


SOURCES = {'vita49': VitaSource, 'zmq_sub': ZmqSource, 'zmq_pull': ZmqSource, 'sigmf': SigmfSource}


def opened(p, clock):
    """Return the source of MonopulseParameters. clock() returns the UTC [ns]. Raises StreamError."""
    return SOURCES[p.source.kind](p.source, p.feed.channels, clock)
