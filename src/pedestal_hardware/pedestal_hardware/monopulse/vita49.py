"""Data packets of VITA 49.0 (VITA Radio Transport, ANSI/VITA 49.0-2015, section 6): samples with the time of the first
one. A channel is a stream. Words are big-endian.

    header      type 4 bits (1: data with stream), class 1, trailer 1, 2 unused, TSI 2 (1: UTC), TSF 2 (2: ps),
                count 4, size 16 in words of 32 bits
    stream, class (2 words, if the class bit is 1), seconds, picoseconds (2 words), payload, trailer (1 word)
"""
import collections
import math
import struct
import typing
from collections.abc import Sequence

import numpy as np

from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.quantities import Hertz, Nanoseconds
from pedestal_hardware.monopulse.blocks import RATE_TOLERANCE, Chunk, Samples, StreamError

DATA_TYPE, TSI_UTC, TSF_PICOSECONDS = 1, 1, 2
OTHER_TYPES = frozenset((4, 5, 6, 7))  # types of packets that describe a stream or command it. They are ignored.
MAX_PACKET_BYTES = 65507  # largest UDP datagram [bytes]

WORD_BYTES, TRAILER_BYTES, CLASS_BYTES = 4, 4, 8
PICOSECONDS_PER_NS = 1000
INTEGER_FULL_SCALE = 32768.0  # number of the payload ci16 that stands for the amplitude 1
MAX_OPEN_PACKETS = 64  # largest number of times at which packets of some channels wait for the packets of the others
PACKET_COUNTS = 16  # number of values of the packet counter


class Packet(typing.NamedTuple):
    """Packet of a stream."""
    stream: int
    counter: int
    utc: Nanoseconds    # of the first sample
    samples: Samples    # (n,)


def encode(packet: Packet, kind: str, full_scale: float = 1.0) -> bytes:
    """Return the bytes of a packet. kind: ci16 or cf32; full_scale: amplitude of the largest integer."""
    if kind == 'ci16':
        scaled = packet.samples.view(np.float32) * np.float32(INTEGER_FULL_SCALE / full_scale)
        payload = np.clip(np.rint(scaled), -INTEGER_FULL_SCALE, INTEGER_FULL_SCALE - 1.0).astype('>i2').tobytes()
    else:
        payload = packet.samples.view(np.float32).astype('>f4').tobytes()
    seconds, rest = divmod(packet.utc, NS_PER_SECOND)
    words = 5 + len(payload) // WORD_BYTES
    header = DATA_TYPE << 28 | TSI_UTC << 22 | TSF_PICOSECONDS << 20 | (packet.counter % PACKET_COUNTS) << 16 | words
    return struct.pack('>IIIQ', header, packet.stream, seconds, rest * PICOSECONDS_PER_NS) + payload


def decode(data: bytes, kind: str) -> Packet | None:
    """Return the Packet of a datagram; None for a packet without samples. Raises StreamError."""
    if len(data) < WORD_BYTES:
        raise StreamError(f'VITA 49 packet of {len(data)} bytes: must have a header of 4 bytes')
    [header] = struct.unpack_from('>I', data)
    if header >> 28 in OTHER_TYPES:
        return None
    if header >> 28 != DATA_TYPE:
        raise StreamError(f'VITA 49 packet of type {header >> 28}: must be 1, data with a stream')
    size = WORD_BYTES * (header & 0xFFFF)
    if size != len(data):
        raise StreamError(f'VITA 49 packet states {size} bytes and has {len(data)}: cut, or another protocol')
    tsi, tsf = header >> 22 & 3, header >> 20 & 3
    if (tsi, tsf) != (TSI_UTC, TSF_PICOSECONDS):
        raise StreamError(f'VITA 49 packet with TSI {tsi}, TSF {tsf}: must be 1 (UTC), 2 (picoseconds)')
    begin = 2 * WORD_BYTES + (CLASS_BYTES if header >> 27 & 1 else 0)
    end = size - (TRAILER_BYTES if header >> 26 & 1 else 0)
    item = 4 if kind == 'ci16' else 8
    if end <= begin + 12 or (end - begin - 12) % item:
        raise StreamError(f'VITA 49 payload of {end - begin - 12} bytes: must be a multiple of {item} '
                          f'(source.format = {kind})')
    [stream] = struct.unpack_from('>I', data, WORD_BYTES)
    seconds, picoseconds = struct.unpack_from('>IQ', data, begin)
    if picoseconds >= PICOSECONDS_PER_NS * NS_PER_SECOND:
        raise StreamError(f'VITA 49 fraction of {picoseconds} ps: must be below 1 s')
    payload = np.frombuffer(data[begin + 12:end], '>i2' if kind == 'ci16' else '>f4').astype(np.float32)
    if kind == 'ci16':
        payload /= np.float32(INTEGER_FULL_SCALE)
    return Packet(stream, header >> 16 & 15, seconds * NS_PER_SECOND + picoseconds // PICOSECONDS_PER_NS,
                  payload.view(np.complex64))


class Joiner:
    """Chunks of all channels, made of the packets of their streams by time."""
    incomplete: int         # number of times at which the packet of a channel was missing
    suspected: Hertz        # wrong sample rate that the times of the last two packets show, NaN without
    last: tuple[int, Nanoseconds, int, int] | None      # counter, UTC, samples and number of the sample after the
                                                        # last one, of the last chunk

    def __init__(self, rate: Hertz, streams: Sequence[int]) -> None:
        self.rate, self.streams, self.incomplete = rate, streams, 0
        self.open: collections.OrderedDict[Nanoseconds, dict[int, Packet]] = collections.OrderedDict()
        self.suspected = math.nan
        self.last = None

    def put(self, packet: Packet) -> Chunk | None:
        """Take a packet and return the chunk that it completes, or None. Raises StreamError."""
        if packet.stream not in self.streams:
            raise StreamError(f'VITA 49 stream {packet.stream}: must be one of {", ".join(map(str, self.streams))} '
                              '(source.stream_sum, ...)')
        parts = self.open.setdefault(packet.utc, {})
        parts[packet.stream] = packet
        if len(parts) < len(self.streams):
            if len(self.open) > MAX_OPEN_PACKETS:
                _, found = self.open.popitem(last=False)
                self.incomplete += 1
                missing = [str(stream) for stream in self.streams if stream not in found]
                raise StreamError(f'VITA 49: no packet of stream {", ".join(missing)} for one time; '
                                  f'{len(self.streams)} channels are needed')
            return None
        while self.open:      # packets of earlier times will not be completed any more
            utc, _ = self.open.popitem(last=False)
            if utc == packet.utc:
                break
            self.incomplete += 1
        columns = [parts[stream].samples for stream in self.streams]
        lengths = [len(column) for column in columns]
        if len(set(lengths)) > 1:
            raise StreamError(f'VITA 49 packets of {", ".join(map(str, lengths))} samples at one time: must have '
                              'equal lengths')
        return Chunk(np.stack(columns, axis=1), self._number(parts[self.streams[0]]), packet.utc)

    def _number(self, packet: Packet) -> int:
        count = len(packet.samples)
        if self.last is None:
            self.last = packet.counter, packet.utc, count, count
            return 0
        before, utc, length, following = self.last
        elapsed = packet.utc - utc
        if elapsed <= 0:
            self.last = packet.counter, packet.utc, count, following + count + 1
            raise StreamError(f'VITA 49 time goes back by {-elapsed * 1e-9:.6f} s')
        missing = elapsed * self.rate / NS_PER_SECOND - length
        # Within 1 % of a packet, and of one sample, the packets follow each other.
        lost = 0 if abs(missing) <= max(1.0, 0.01 * length) else max(round(missing), 1)
        self.last = packet.counter, packet.utc, count, following + lost + count
        # Once this is an overrun of the device; twice with the same result it is its sample rate.
        rate = length * NS_PER_SECOND / elapsed
        suspected, follows = self.suspected, packet.counter == (before + 1) % PACKET_COUNTS
        self.suspected = rate if lost and follows and lost < PACKET_COUNTS * length else math.nan
        if abs(self.suspected / suspected - 1.0) < RATE_TOLERANCE:
            raise StreamError(f'sample rate {rate:.0f} S/s by the times of the packets: must be {self.rate:.0f} S/s '
                              '(source.rate)')
        return following + lost
