"""Makes a readable bag of what is there in a damaged one: killed recorder, full disk, cut or corrupted file.

The file is read through mmap, chunk after chunk, and each chunk whose checksum holds is copied as it is: the memory
taken is that of one chunk and of the index, whatever the size of the recording.
"""
import collections
import dataclasses
import io
import mmap
import pathlib
import re
import shutil
import struct
import zlib

import yaml
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.stream_reader import get_chunk_data_stream

from pedestal_bringup.bags import bag as bags
from pedestal_bringup.bags.container import MAGIC, MESSAGE, BagError, Container, compressed, reason
from pedestal_common import nodes, topics

_RECORD = struct.Struct('<BQ')
_READ = {Opcode.SCHEMA: records.Schema.read, Opcode.CHANNEL: records.Channel.read,
         Opcode.METADATA: records.Metadata.read, Opcode.CHUNK: records.Chunk.read}
_END = (Opcode.DATA_END, Opcode.FOOTER)
_COMPRESSION = re.compile(rb'\x04\x00\x00\x00zstd|\x03\x00\x00\x00lz4')
_BEFORE_COMPRESSION = 9 + 8 + 8 + 8 + 4
"""Bytes of a chunk record before the name of its compression."""

_FOOTER = 9 + 20 + len(MAGIC)


@dataclasses.dataclass
class Gap:
    """Bytes [start, stop) of the file that cannot be used, why, and the log times [ns] around (None where none)."""
    start: int
    stop: int
    why: str
    before: int | None
    after: int | None = None

    def line(self):
        said = f'bytes {self.start} to {self.stop} unused ({self.why})'
        said += f', after {self.before / 1e9:.6f} s' if self.before is not None else ''
        return said + (f', before {self.after / 1e9:.6f} s' if self.after is not None else '')


@dataclasses.dataclass
class Recovered:
    """What was recovered, and what is missing.

    counts: {topic: messages}; first, last: log times [ns]; ended: whether the recorder came to its end; duration: how
    long the run was to be [s], None when the bag does not say; lost: {topic: messages missing between those that are
    there, by the recorder's sequence numbers}.
    """
    path: pathlib.Path
    counts: dict
    first: int
    last: int
    ended: bool
    duration: float | None
    gaps: list
    lost: dict

    @property
    def unused(self):
        """Bytes of the file that cannot be used."""
        return sum(gap.stop - gap.start for gap in self.gaps)

    def lines(self):
        """The report as text: the gaps, what is lost by them and at the end, the new bag last."""
        lines = [gap.line() for gap in self.gaps]
        if self.lost:
            steps = max((count for name, count in self.lost.items()
                         if nodes.plain(name) in topics.BY_NAME
                         and topics.BY_NAME[nodes.plain(name)].rate == 'step'), default=0)
            lines.append(f'lost in the middle: {steps} steps, {sum(self.lost.values())} messages: '
                         + ', '.join(f'{count} of {name}' for name, count in self.lost.items()))
        planned = self.duration is not None and self.last / 1e9 < self.duration
        if planned or not self.ended:
            lines.append(f'the recording {"ends" if self.ended else "breaks off"} after {self.last / 1e9:.6f} s'
                         + (f', the run was to go on to {self.duration:.6f} s' if planned else ''))
        total = sum(self.counts.values())
        return [*(lines or ['nothing is missing']),
                f'{self.path}: {total} messages, {len(self.counts)} topics, {self.first / 1e9:.6f} to '
                f'{self.last / 1e9:.6f} s; {self.unused} bytes unused']


def recover(path, output=None) -> Recovered:
    """Write what can be read of a bag as a new bag, by default beside it with '-recovered' after its name.

    Raises BagError when nothing can be read, when it is being written, or when the new bag cannot be written; then
    nothing of the new one is left. The old one is only read.
    """
    file = bags.locate(path)
    if output is None:
        whole = pathlib.Path(path).absolute()
        output = whole.with_name((whole.name if whole.is_dir() else whole.stem) + '-recovered')
    container = Container(output)
    try:
        with open(file, 'rb') as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
            salvage = _Salvage(file, container)
            salvage.take_all(data)
        if not container.counts:
            raise BagError(f'{file}: not one message in it can be read')
        found = salvage.found()
        container.add(records.Metadata(name='recovered', metadata={
            'messages_lost': str(sum(found.lost.values())), 'bytes_unused': str(found.unused)}))
        container.close()
    except BaseException as error:
        shutil.rmtree(output, ignore_errors=True)
        if isinstance(error, OSError):
            raise BagError(f'{file}: {reason(error)}') from None
        raise
    return found


def _frame(data, at):
    """(opcode, where its content ends) of the record at a place; ValueError when none is there."""
    if at + 9 > len(data):
        raise ValueError('the file ends')
    opcode, length = _RECORD.unpack_from(data, at)
    if not Opcode.HEADER <= opcode <= Opcode.DATA_END:
        raise ValueError('no record')
    if at + 9 + length > len(data):
        raise ValueError('the file ends inside a record')
    return opcode, at + 9 + length


def _follows(data, at):
    try:
        return bool(_frame(data, at))
    except ValueError:
        return False


def _read(opcode, content):
    """The record, None of a kind that is not kept; (record, bytes unpacked) of a chunk, whose checksum must hold."""
    if opcode not in _READ:
        return None
    record = _READ[opcode](ReadDataStream(io.BytesIO(content)))
    if opcode != Opcode.CHUNK:
        return record
    try:
        stream, size = get_chunk_data_stream(record, validate_crc=True)
    except Exception:  # a wrong checksum, or whatever the decompressor says
        raise ValueError('a corrupted chunk') from None
    return record, stream.read(size)


def _next_chunk(data, start):
    """Where the next chunk begins whose checksum holds; the end of the data when there is none."""
    for found in _COMPRESSION.finditer(data, start):
        at = found.start() - _BEFORE_COMPRESSION
        try:
            if at >= start and data[at] == Opcode.CHUNK:
                opcode, stop = _frame(data, at)
                _read(opcode, data[at + 9:stop])
                return at
        except Exception:  # whatever a decoder makes of bytes that are no chunk
            continue
    return len(data)


def _pieces(data):
    """(opcode, start, stop, record or why not) of each record of the data section; opcode 0: not to be used.

    After a broken record comes the one behind it if there is one, else the next whole chunk behind everything that
    was good.
    """
    at = good = len(MAGIC)
    while at < len(data):
        stop = None
        try:
            opcode, stop = _frame(data, at)
            record = _read(opcode, data[at + 9:stop])
        except Exception as error:  # as above
            if stop is None or not _follows(data, stop):
                stop = _next_chunk(data, good)
            if stop > at:
                yield 0, at, stop, str(error) or type(error).__name__
        else:
            yield opcode, at, stop, record
            if opcode in _END:
                return
            if record is not None:
                good = stop
        at = stop


def _summary(data):
    """Schemas and channels of the summary, where there is one: the chunk that declares them may be broken."""
    footer = len(data) - _FOOTER
    if footer < len(MAGIC) or data[footer] != Opcode.FOOTER or data[-len(MAGIC):] != MAGIC:
        return
    at, _, crc = struct.unpack_from('<QQI', data, footer + 9)
    if not at or at > footer or crc and zlib.crc32(data[at:footer + 25]) != crc:
        return
    while at < footer:
        opcode, stop = _frame(data, at)
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            yield _read(opcode, data[at + 9:stop])
        at = stop


class _Salvage:
    """What is good of a file goes into a container, what is not into `gaps`."""

    def __init__(self, file, container):
        self._file, self._container = file, container
        self._loose = bytearray()
        self._metadata = {}
        self._sequence = {}
        self._unsure = set()
        self._lost = collections.Counter()
        self._first = self._last = None
        self._gaps = []
        self._ended = False

    def take_all(self, data):
        """One pass over the bytes of a file."""
        self._declare(_summary(data), self._container.add)
        for opcode, start, stop, record in _pieces(data):
            try:
                self._take(opcode, record, data[start:stop] if opcode == Opcode.MESSAGE else b'')
            except BagError:
                raise
            except (ValueError, struct.error) as error:
                self._skip(start, stop, str(error))
        self._put_loose()

    def _take(self, opcode, record, loose):
        if opcode == 0:
            raise ValueError(record)
        if opcode == Opcode.MESSAGE:
            self._loose += loose
            if len(self._loose) >= bags.CHUNK_SIZE:
                self._put_loose()
        elif opcode == Opcode.CHUNK:
            self._put_loose()
            self._put(*record)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._declare([record], self._container.add)
        elif opcode == Opcode.METADATA and record.name != 'recovered':
            self._metadata[record.name] = record.metadata
            self._container.add(record)
        elif opcode == Opcode.ATTACHMENT:
            raise ValueError('an attachment')
        self._ended = opcode in _END

    def _declare(self, declared, keep):
        for record in declared:
            known = self._container.schemas if isinstance(record, records.Schema) else self._container.channels
            if isinstance(record, records.Channel) and record.message_encoding != 'cdr':
                raise bags.foreign_encoding(self._file, record)
            if record.id not in known:
                keep(record)

    def _skip(self, start, stop, why):
        self._put_loose()
        if self._gaps and self._gaps[-1].stop == start:
            self._gaps[-1].stop = stop
            return
        self._gaps.append(Gap(start, stop, why, self._last))
        self._unsure = set(self._container.channels)

    def _put_loose(self):
        """Messages outside a chunk become one."""
        if self._loose:
            raw, self._loose = bytes(self._loose), bytearray()
            self._put(None, raw)

    def _put(self, chunk, raw):
        """Append a chunk; ValueError when a message in it belongs to no known channel."""
        index, sequences, at = collections.defaultdict(list), collections.defaultdict(list), 0
        while at < len(raw):
            opcode, stop = _frame(raw, at)
            if opcode == Opcode.MESSAGE:
                _, _, channel, sequence, log, _ = MESSAGE.unpack_from(raw, at)
                index[channel] += (log, at)
                sequences[channel].append(sequence)
            else:
                self._declare([_read(opcode, raw[at + 9:stop])], self._container.know)
            at = stop
        unknown = set(index) - set(self._container.channels)
        if unknown:
            raise ValueError(f'channel {min(unknown)} is declared nowhere')
        if not index:
            return
        first = min(min(places[::2]) for places in index.values())
        last = max(max(places[::2]) for places in index.values())
        if chunk is None:
            chunk = compressed(raw, first, last)
        self._container.add_chunk(dataclasses.replace(chunk, message_start_time=first, message_end_time=last), index)
        self._count(sequences)
        for gap in self._gaps:
            gap.after = first if gap.after is None else gap.after
        self._first = first if self._first is None else min(self._first, first)
        self._last = last if self._last is None else max(self._last, last)

    def _count(self, sequences):
        """Where the recorder numbers its messages from 1, the first after a gap says how many were in it."""
        for channel, numbers in sequences.items():
            if channel in self._unsure:
                self._lost[channel] += numbers[0] - self._sequence.get(channel, 0) - 1
            self._sequence[channel] = numbers[-1]
        self._unsure -= set(sequences)

    def found(self):
        names = {number: channel.topic.lstrip('/') for number, channel in self._container.channels.items()}
        ours = 'pacing' in self._metadata.get('pedestal', {})
        counts = {name: self._container.counts[number] for number, name in names.items()}
        lost = {names[number]: count for number, count in self._lost.items() if ours and count > 0}
        return Recovered(self._container.path, counts, self._first, self._last, self._ended, self._duration(),
                         self._gaps, lost)

    def _duration(self):
        try:
            return yaml.safe_load(self._metadata['parameters']['recorder'])['duration'] or None
        except (KeyError, TypeError, yaml.YAMLError):
            return None
