"""`pedestal recover`: write the readable messages of a damaged bag to a new bag.

The recorder of the bag was killed, its disk was full, or its file was cut or corrupted. Each file is read through
mmap, chunk after chunk; a chunk is a compressed group of messages with a checksum. The messages of each chunk with a
correct checksum are written to the new bag. Memory is needed for one chunk and the index, not for the whole recording.
A bag of several files becomes a bag of one file.
"""
import collections
import dataclasses
import mmap
import pathlib
import re
import shutil
import struct
import zlib
from collections.abc import Callable, Iterator

from mcap import records
from mcap.opcode import Opcode

from pedestal_common.graph import nodes, topics
from pedestal_common.quantities import Nanoseconds
from pedestal_recording import bag as bags
from pedestal_recording.mcap_file import (
    MAGIC,
    MESSAGE_HEAD,
    ZSTD_MAGIC,
    BagError,
    Data,
    McapFile,
    frame,
    frames,
    parsed,
    reason,
    unpacked,
)
from pedestal_recording.writer import BagFile

_COPIED_OPCODES = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA, Opcode.CHUNK)
"""Kinds of records that are copied to the new bag."""
_END_OPCODES = (Opcode.DATA_END, Opcode.FOOTER)  # kinds of records that end the messages of a file
_COMPRESSION = re.compile(rb'\x04\x00\x00\x00zstd|\x03\x00\x00\x00lz4')
"""Length and name of the compression in a chunk record. The search for intact chunks looks for these bytes."""
_BEFORE_COMPRESSION = 9 + 8 + 8 + 8 + 4
"""Length of a chunk record before the name of its compression [bytes].

It consists of opcode and length, first and last log time, unpacked size, checksum, and length of the name.
"""

_UNUSABLE = 0  # value in place of an opcode, for bytes that are no readable record
_LENGTH = struct.Struct('<Q')  # length of the compressed data in a chunk record [bytes]
_FOOTER = 9 + 20 + len(MAGIC)  # length of the footer record and the last bytes of a whole file [bytes]


@dataclasses.dataclass
class Gap:
    """Unusable bytes [start, stop) of a file."""
    start: int
    stop: int
    problem: str    # reason why the bytes are unusable
    before: Nanoseconds | None  # log time of the last message before the bytes
    after: Nanoseconds | None = None    # log time of the first message after the bytes
    file: str = ''  # name of the file, '' in a bag of one file

    def line(self, start: Nanoseconds = 0) -> str:
        """Return the gap as text, with its times relative to the stamp `start`."""
        return (f'bytes {self.start} to {self.stop}{self.file and f" of {self.file}"} unused ({self.problem})'
                + (f', after {(self.before - start) / 1e9:.6f} s' if self.before is not None else '')
                + (f', before {(self.after - start) / 1e9:.6f} s' if self.after is not None else ''))


@dataclasses.dataclass
class Recovered:
    """Result of `recover`: the recovered messages in the new bag at `path`, and the missing messages."""
    path: pathlib.Path
    counts: dict[str, int]  # recovered messages by topic
    first: Nanoseconds  # log time of the first recovered message
    last: Nanoseconds   # log time of the last recovered message
    ended: bool     # True if the recorder came to its end
    planned_end: Nanoseconds | None     # stamp of the planned end of the run, None if unknown
    start: Nanoseconds  # stamp of time 0 of the scenario
    gaps: list[Gap]     # the unusable bytes
    lost: dict[str, int]    # messages missing before the last one, by topic, by the sequence numbers of the recorder

    @property
    def unused(self) -> int:
        """Number of unusable bytes of all files."""
        return sum(gap.stop - gap.start for gap in self.gaps)

    def lines(self) -> list[str]:
        """Return the report as lines of text: the gaps, the losses in the middle and at the end, the new bag last."""
        lines = [gap.line(self.start) for gap in self.gaps]
        first, last = self.first - self.start, self.last - self.start
        if self.lost:
            steps = max((count for name, count in self.lost.items()
                         if nodes.plain(name) in topics.TOPIC_BY_NAME
                         and topics.TOPIC_BY_NAME[nodes.plain(name)].rate == 'step'), default=0)
            lines.append(f'lost in the middle: {steps} steps, {sum(self.lost.values())} messages: '
                         + ', '.join(f'{count} of {name}' for name, count in self.lost.items()))
        planned = self.planned_end if self.planned_end is not None and self.last < self.planned_end else None
        if planned is not None or not self.ended:
            lines.append(f'the recording {"ends" if self.ended else "breaks off"} after {last / 1e9:.6f} s'
                         + (f', the planned end is {(planned - self.start) / 1e9:.6f} s'
                            if planned is not None else ''))
        total = sum(self.counts.values())
        return [*(lines or ['nothing is missing']),
                f'{self.path}: {total} messages, {len(self.counts)} topics, {first / 1e9:.6f} to '
                f'{last / 1e9:.6f} s; {self.unused} bytes unused']


def recover(path: str | pathlib.Path, output: str | pathlib.Path | None = None) -> Recovered:
    """Write the readable messages of the bag at a path to a new bag. The old bag stays unchanged.

    output: directory of the new bag, by default beside the old bag, with '-recovered' after its name.
    Raises BagError if nothing is readable, if the old bag is being written, or if the new bag cannot be written. After
    an error, no part of the new bag remains.
    """
    files = [McapFile(file) for file in bags.locate(path)]
    if output is None:
        whole = pathlib.Path(path).absolute()
        output = whole.with_name((whole.name if whole.is_dir() else whole.stem) + '-recovered')
    bag = BagFile(output)
    try:
        salvage = _Salvage(bag, len(files) > 1)
        for file in files:
            with open(file.path, 'rb') as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
                salvage.add_file(file, data)
        if not bag.messages:
            raise BagError(f'{files[0].path}: no message in it is readable')
        bag.flush()
        recovered = salvage.recovered()
        bag.add_metadata('recovered', {'messages_lost': str(sum(recovered.lost.values())),
                                       'bytes_unused': str(recovered.unused)})
        bag.close()
    except BaseException as error:
        shutil.rmtree(output, ignore_errors=True)
        if isinstance(error, OSError):
            raise BagError(f'{path}: {reason(error)}') from None
        raise
    return recovered


def _record_begins(data: Data, position: int) -> bool:
    """Return True if a record with a possible length begins at a position."""
    try:
        return bool(frame(data, position))
    except ValueError:
        return False


def _read(file: McapFile, opcode: int, data: Data, start: int, stop: int) -> records.McapRecord | bytes | None:
    """Return the record at [start, stop) of data, for a chunk its unpacked bytes.

    Return None for a kind of record that is not copied.
    """
    if opcode not in _COPIED_OPCODES:
        return None
    record = parsed(opcode, data[start + 9:stop])
    if not isinstance(record, records.Chunk):
        return record
    file.spend(record)
    return unpacked(record)


def _next_chunk(file: McapFile, data: Data, start: int) -> int:
    """Return the position of the first chunk with a correct checksum from `start` on; the end of data without one."""
    for name in _COMPRESSION.finditer(data, start):
        at = name.start() - _BEFORE_COMPRESSION
        try:
            if at >= start and data[at] == Opcode.CHUNK:
                opcode, stop = frame(data, at)
                if name.end() + 8 + _LENGTH.unpack_from(data, name.end())[0] == stop:
                    _read(file, opcode, data, at, stop)
                    return at
        except Exception:  # a decoder may raise anything on bytes that are no chunk
            continue
    return len(data)


def _pieces(file: McapFile, data: Data) -> Iterator[tuple[int, int, int, records.McapRecord | bytes | str | None]]:
    """Yield (opcode, start, stop, record) of each record before the summary of a file; data: its bytes.

    Unusable bytes give (_UNUSABLE, start, stop, reason) instead. After a broken record whose stated length leads to
    the begin of another record, the reading continues there. Otherwise it continues at the next intact chunk after
    the last good record.
    """
    start = last_good_end = len(MAGIC)
    while start < len(data):
        stop = None
        try:
            opcode, stop = frame(data, start)
            record = _read(file, opcode, data, start, stop)
        except Exception as error:  # a decoder may raise anything on broken bytes
            if stop is None or not _record_begins(data, stop):
                stop = _next_chunk(file, data, last_good_end)
            if stop > start:
                yield _UNUSABLE, start, stop, str(error) or type(error).__name__
        else:
            yield opcode, start, stop, record
            if opcode in _END_OPCODES:
                return
            if record is not None:
                last_good_end = stop
        start = stop


def _summary(data: Data) -> Iterator[records.McapRecord | None]:
    """Yield the schemas and channels that the summary at the end of a file repeats; none in a file without a summary.

    This avoids the loss of messages whose schema and channel stand in a broken chunk.
    """
    footer = len(data) - _FOOTER
    if footer < len(MAGIC) or data[footer] != Opcode.FOOTER or data[-len(MAGIC):] != MAGIC:
        return
    at, _, crc = struct.unpack_from('<QQI', data, footer + 9)
    if not at or at > footer or crc and zlib.crc32(data[at:footer + 25]) != crc:
        return
    for opcode, start, stop in frames(data, at, footer):
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            yield parsed(opcode, data[start + 9:stop])


class _Salvage:
    """Writer of the messages of damaged files to a new BagFile, and counter of the unusable bytes.

    "File" means a file of the damaged bag, and "bag" the new bag.
    several: True if the damaged bag has several files, so a gap must name its file.
    """
    _file: McapFile

    def __init__(self, bag: BagFile, several: bool) -> None:
        self._bag, self._several = bag, several
        # number in the bag of a schema or channel, by its number in the current file
        self._schemas: dict[int, int] = {}
        self._channels: dict[int, int] = {}
        self._names: dict[int, str] = {}    # topic of a channel of the bag
        self._metadata: dict[str, dict[str, str]] = {}
        self._declared: dict[tuple[str, str], int] = {}     # number in the bag of the content of a schema or channel
        self._counts: dict[str, int] = {}   # added messages of a topic
        self._lost: collections.Counter[int] = collections.Counter()    # messages of a channel of the bag lost in gaps
        # smallest and largest log time of the added messages
        self._first: Nanoseconds | None = None
        self._last: Nanoseconds | None = None
        self._sequence: dict[int, int] = {}     # sequence number of the last message of a channel of the bag
        self._before: dict[int, int] = {}       # _sequence as it was before the current file
        self._offsets: dict[int, int] = {}      # addition to the sequence numbers of a channel in the current file
        self._unsure: set[int] = set()  # channels of the bag without a message since the last gap
        self._compressed = 0    # number of messages that are compressed one by one
        self._gaps: list[Gap] = []
        self._ended = False     # True if the last file comes to its regular end

    def add_file(self, file: McapFile, data: Data) -> None:
        """Add all readable messages of a file to the bag; data: its bytes."""
        self._file = file
        self._schemas, self._channels, self._before, self._offsets = {}, {}, dict(self._sequence), {}
        try:
            for declared in _summary(data):
                self._declare(declared)
        except BagError:
            raise
        except Exception:  # a decoder may raise anything on broken bytes; the file itself declares all again
            pass
        for opcode, start, stop, record in _pieces(file, data):
            try:
                self._take(opcode, record, data[start:stop] if opcode == Opcode.MESSAGE else b'')
            except BagError:
                raise
            except (ValueError, struct.error) as error:
                self._skip(start, stop, str(error))

    def _take(self, opcode: int, record: records.McapRecord | bytes | str | None, message: bytes) -> None:
        """Add a record of _pieces to the bag. Raises ValueError for unusable bytes.

        message: bytes of a message record outside chunks, b'' for any other record.
        """
        if opcode == _UNUSABLE:
            raise ValueError(record)
        if opcode == Opcode.MESSAGE:
            self._add_messages(message)
        elif isinstance(record, bytes):     # of a chunk
            self._add_messages(record)
        elif isinstance(record, records.Schema | records.Channel):
            self._declare(record)
        elif isinstance(record, records.Metadata) and record.name != 'recovered' and record.name not in self._metadata:
            self._metadata[record.name] = record.metadata
            self._bag.add_metadata(record.name, record.metadata)
        elif opcode == Opcode.ATTACHMENT:
            raise ValueError('an attachment')
        self._ended = opcode in _END_OPCODES

    def _declare(self, record: records.McapRecord | None) -> None:
        """Add a new schema or channel to the bag; other records are left out."""
        if isinstance(record, records.Schema):
            if record.id not in self._schemas:
                self._schemas[record.id] = self._once(self._bag.add_schema, record.name, record.encoding, record.data)
        elif not isinstance(record, records.Channel):
            return
        elif record.message_encoding != 'cdr':
            raise bags.foreign_encoding(self._file.path, record)
        elif record.id not in self._channels and record.schema_id in self._schemas:
            channel = self._once(self._bag.add_channel, record.topic, self._schemas[record.schema_id], record.metadata)
            self._channels[record.id] = channel
            self._names[channel] = record.topic.lstrip('/')
            self._counts.setdefault(self._names[channel], 0)

    def _once(self, add: Callable[..., int], *content: object) -> int:
        """Return the number of a schema or channel in the new bag; call add(*content) at its first occurrence.

        Because each file of a bag repeats the schemas and channels, this avoids a second copy.
        """
        key = add.__name__, str(content)
        if key not in self._declared or not self._several:
            self._declared[key] = add(*content)
        return self._declared[key]

    def _skip(self, start: int, stop: int, problem: str) -> None:
        """Note the unusable bytes [start, stop) as a new Gap, or as a part of the Gap that ends at `start`."""
        file = self._file.path.name if self._several else ''
        if self._gaps and self._gaps[-1].stop == start and self._gaps[-1].file == file:
            self._gaps[-1].stop = stop
            return
        self._gaps.append(Gap(start, stop, problem, self._last, file=file))
        self._unsure = set(self._channels.values())

    def _add_messages(self, raw: bytes) -> None:
        """Add the messages in records, given as bytes (of a chunk, or of one message).

        Raises ValueError, and adds none of the messages, if a message has no known channel or an invalid head.
        """
        logs = []
        for opcode, at, stop in frames(raw):
            if opcode == Opcode.MESSAGE:
                _, channel, _, log, _ = MESSAGE_HEAD.unpack_from(raw, at)
                if channel not in self._channels:
                    raise ValueError(f'channel {channel} is not declared')
                if stop < at + MESSAGE_HEAD.size or log >= 2**63:
                    raise ValueError('a message with an invalid head')
                logs.append(log)
            else:
                self._declare(parsed(opcode, raw[at + 9:stop]))
        if not logs:
            return
        self._file.count(len(logs))
        for opcode, at, stop in frames(raw):
            if opcode == Opcode.MESSAGE:
                _, channel, sequence, log, publish = MESSAGE_HEAD.unpack_from(raw, at)
                self._add(self._channels[channel], sequence, log, publish, raw[at + MESSAGE_HEAD.size:stop])
        first, last = min(logs), max(logs)
        for gap in self._gaps:
            gap.after = first if gap.after is None else gap.after
        self._first = first if self._first is None else min(self._first, first)
        self._last = last if self._last is None else max(self._last, last)

    def _add(self, channel: int, sequence: int, log: Nanoseconds, publish: Nanoseconds, data: bytes) -> None:
        """Add a message to a channel of the bag. data: CDR bytes.

        The recorder numbers the messages of each topic from 1 in each file. The sequence number of the first message
        after a gap therefore gives the number of lost messages. A tool that splits a recording continues the numbers
        of the file before. The number 0 marks a message of a foreign publisher.
        """
        if sequence:
            before = self._before.get(channel, 0)
            sequence += self._offsets.setdefault(channel, 0 if sequence > before else before)
            if channel in self._unsure:
                self._lost[channel] += sequence - self._sequence.get(channel, 0) - 1
                self._unsure.remove(channel)
            self._sequence[channel] = sequence
        self._bag.add_message(channel, sequence & 0xffffffff, log, publish, data)
        self._compressed += data[:len(ZSTD_MAGIC)] == ZSTD_MAGIC
        self._counts[self._names[channel]] += 1

    def recovered(self) -> Recovered:
        """Return the Recovered of the bag, after at least one message was added.

        Raises BagError if all messages are compressed one by one: the new bag would not state their compression.
        """
        if self._compressed == sum(self._counts.values()):
            raise bags.compressed_messages(self._file.path, 'zstd')
        assert self._first is not None and self._last is not None
        ours = 'pacing' in self._metadata.get('pedestal', {})
        lost = {self._names[channel]: count for channel, count in self._lost.items() if ours and count > 0}
        return Recovered(self._bag.path, self._counts, self._first, self._last, self._ended,
                         bags.planned_end(self._metadata), bags.start(self._metadata), self._gaps, lost)
