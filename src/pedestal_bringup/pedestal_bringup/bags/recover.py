"""Makes a readable bag of what is there in a damaged one: killed recorder, full disk, cut or corrupted file.

The file is read through mmap, chunk after chunk, and the messages of each chunk whose checksum holds are written anew:
the memory taken is that of one chunk and of the index, whatever the size of the recording.
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
from pedestal_bringup.bags.bag import MAGIC, MESSAGE, BagError, reason
from pedestal_bringup.bags.writer import BagFile
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
    """Bytes [start, stop) of the file that cannot be used, why, and the log times [ns] before and after them; None
    where no message is there."""
    start: int
    stop: int
    why: str
    before: int | None
    after: int | None = None

    def line(self):
        """The gap as text."""
        return (f'bytes {self.start} to {self.stop} unused ({self.why})'
                + (f', after {self.before / 1e9:.6f} s' if self.before is not None else '')
                + (f', before {self.after / 1e9:.6f} s' if self.after is not None else ''))


@dataclasses.dataclass
class Recovered:
    """What was recovered into the bag at `path`, and what is missing.

    counts: {topic: messages}; first, last: log times [ns]; ended: whether the recorder came to its end; duration: how
    long the run was to be [s], None when the bag does not say; gaps: [Gap]; lost: {topic: messages missing between
    those that are there, by the recorder's sequence numbers}.
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
    bag = BagFile(output)
    try:
        with open(file, 'rb') as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
            salvage = _Salvage(file, bag)
            salvage.take_all(data)
        if not bag.messages:
            raise BagError(f'{file}: not one message in it can be read')
        bag.flush()
        recovered = salvage.recovered()
        bag.add_metadata('recovered', {'messages_lost': str(sum(recovered.lost.values())),
                                       'bytes_unused': str(recovered.unused)})
        bag.close()
    except BaseException as error:
        shutil.rmtree(output, ignore_errors=True)
        if isinstance(error, OSError):
            raise BagError(f'{file}: {reason(error)}') from None
        raise
    return recovered


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
    """The record, None of a kind that is not kept; of a chunk its records as bytes, whose checksum must hold."""
    if opcode not in _READ:
        return None
    record = _READ[opcode](ReadDataStream(io.BytesIO(content)))
    if opcode != Opcode.CHUNK:
        return record
    try:
        stream, size = get_chunk_data_stream(record, validate_crc=True)
    except Exception:  # a wrong checksum, or whatever the decompressor says
        raise ValueError('a corrupted chunk') from None
    return stream.read(size)


def _next_chunk(data, start):
    """Where the next chunk begins whose checksum holds; the end of the data when there is none."""
    for name in _COMPRESSION.finditer(data, start):
        at = name.start() - _BEFORE_COMPRESSION
        try:
            if at >= start and data[at] == Opcode.CHUNK:
                opcode, stop = _frame(data, at)
                _read(opcode, data[at + 9:stop])
                return at
        except Exception:  # whatever a decoder makes of bytes that are no chunk
            continue
    return len(data)


def _pieces(data):
    """Iterator of (opcode, start, stop, record) of the records of the data section; of bytes that cannot be used
    (0, start, stop, why).

    After a broken record comes the one behind it if there is one, else the next whole chunk behind everything that
    was good.
    """
    at = good = len(MAGIC)
    while at < len(data):
        stop = None
        try:
            opcode, stop = _frame(data, at)
            record = _read(opcode, data[at + 9:stop])
        except Exception as error:  # whatever a decoder makes of broken bytes
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
    """Adds the messages of a damaged file to a new BagFile and keeps count of what cannot be used.

    _schemas, _channels: {number in the file: number in the bag}; _names: {channel in the file: topic}; _counts:
    {topic: messages added}; _first, _last: their log times [ns]; _sequence: {channel: number of its last message};
    _unsure: channels without a message since the last gap.
    """

    def __init__(self, file, bag):
        self._file, self._bag = file, bag
        self._schemas, self._channels, self._names = {}, {}, {}
        self._metadata = {}
        self._counts, self._lost = {}, collections.Counter()
        self._first = self._last = None
        self._sequence, self._unsure = {}, set()
        self._gaps = []
        self._ended = False

    def take_all(self, data):
        """One pass over the bytes of a file."""
        for record in _summary(data):
            self._declare(record)
        for opcode, start, stop, record in _pieces(data):
            try:
                self._take(opcode, record, data[start:stop] if opcode == Opcode.MESSAGE else b'')
            except BagError:
                raise
            except (ValueError, struct.error) as error:
                self._skip(start, stop, str(error))

    def _take(self, opcode, record, message):
        if opcode == 0:
            raise ValueError(record)
        if opcode == Opcode.MESSAGE:
            self._add_messages(message)
        elif opcode == Opcode.CHUNK:
            self._add_messages(record)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._declare(record)
        elif opcode == Opcode.METADATA and record.name != 'recovered':
            self._metadata[record.name] = record.metadata
            self._bag.add_metadata(record.name, record.metadata)
        elif opcode == Opcode.ATTACHMENT:
            raise ValueError('an attachment')
        self._ended = opcode in _END

    def _declare(self, record):
        """Take over a schema or channel that is new."""
        if isinstance(record, records.Schema):
            if record.id not in self._schemas:
                self._schemas[record.id] = self._bag.add_schema(record.name, record.encoding, record.data)
        elif record.message_encoding != 'cdr':
            raise bags.foreign_encoding(self._file, record)
        elif record.id not in self._channels and record.schema_id in self._schemas:
            self._channels[record.id] = self._bag.add_channel(record.topic, self._schemas[record.schema_id],
                                                              record.metadata)
            self._names[record.id] = record.topic.lstrip('/')
            self._counts.setdefault(self._names[record.id], 0)

    def _skip(self, start, stop, why):
        if self._gaps and self._gaps[-1].stop == start:
            self._gaps[-1].stop = stop
            return
        self._gaps.append(Gap(start, stop, why, self._last))
        self._unsure = set(self._channels)

    def _add_messages(self, raw):
        """Add the messages of a chunk's bytes; ValueError, and none added, when one belongs to no known channel."""
        rows, at = [], 0
        while at < len(raw):
            opcode, stop = _frame(raw, at)
            if opcode == Opcode.MESSAGE:
                rows.append((*MESSAGE.unpack_from(raw, at)[1:], raw[at + MESSAGE.size:stop]))
            else:
                self._declare(_read(opcode, raw[at + 9:stop]))
            at = stop
        unknown = {channel for channel, *_ in rows} - set(self._channels)
        if unknown:
            raise ValueError(f'channel {min(unknown)} is declared nowhere')
        if not rows:
            return
        for channel, sequence, log, publish, data in rows:
            self._bag.add_message(self._channels[channel], sequence, log, publish, data)
            self._count(channel, sequence)
        first, last = min(log for _, _, log, _, _ in rows), max(log for _, _, log, _, _ in rows)
        for gap in self._gaps:
            gap.after = first if gap.after is None else gap.after
        self._first = first if self._first is None else min(self._first, first)
        self._last = last if self._last is None else max(self._last, last)

    def _count(self, channel, sequence):
        """Where the recorder numbers its messages from 1, the first after a gap says how many were in it."""
        if channel in self._unsure:
            self._lost[channel] += sequence - self._sequence.get(channel, 0) - 1
            self._unsure.remove(channel)
        self._sequence[channel] = sequence
        self._counts[self._names[channel]] += 1

    def recovered(self):
        """The Recovered of the bag, once a message was added."""
        ours = 'pacing' in self._metadata.get('pedestal', {})
        lost = {self._names[channel]: count for channel, count in self._lost.items() if ours and count > 0}
        return Recovered(self._bag.path, self._counts, self._first, self._last, self._ended, self._duration(),
                         self._gaps, lost)

    def _duration(self):
        try:
            return yaml.safe_load(self._metadata['parameters']['recorder'])['duration'] or None
        except (KeyError, TypeError, yaml.YAMLError):
            return None
