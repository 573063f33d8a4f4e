"""`pedestal recover`: write the readable messages of a damaged bag to a new bag of one file.

The recorder of the bag was killed, its disk was full, or its file was cut or corrupted. The messages of each chunk
with a correct checksum are written. Memory is needed for one chunk and the index, not for the whole recording.
"""
import collections
import dataclasses
import pathlib
import shutil
import struct
import zlib
from collections.abc import Callable, Iterator

from mcap import records
from mcap.opcode import Opcode

from pedestal_common.graph import nodes, topics
from pedestal_common.quantities import Nanoseconds
from pedestal_recording import bag as bags
from pedestal_recording import bag_files
from pedestal_recording.mcap_file import (
    END_OPCODES,
    MAGIC,
    MESSAGE_HEAD,
    ZSTD_MAGIC,
    BagError,
    Content,
    McapFile,
    frames,
    parsed,
    reason,
    walk,
)
from pedestal_recording.writer import BagFile

_COPIED_OPCODES = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA, Opcode.CHUNK)
"""Kinds of records that are copied to the new bag."""
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
    """Write the readable messages of a bag to a new bag, by default beside it, with '-recovered' after its name.

    Raises BagError if nothing is readable, if the old bag is being written, or if the new bag cannot be written. After
    an error, no part of the new bag remains.
    """
    files = [McapFile(file) for file in bag_files.locate(path)]
    if output is None:
        whole = pathlib.Path(path).absolute()
        output = whole.with_name((whole.name if whole.is_dir() else whole.stem) + '-recovered')
    bag = BagFile(output)
    try:
        salvage = _Salvage(bag, len(files) > 1)
        for file in files:
            salvage.add_file(file)
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


def _summary(file: McapFile) -> Iterator[records.McapRecord | None]:
    """Yield the schemas and channels that the summary at the end of a file repeats; none in a file without a summary.

    This avoids the loss of messages whose schema and channel stand in a broken chunk.
    """
    with file.mapped() as data:
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

    def add_file(self, file: McapFile) -> None:
        self._file = file
        self._schemas, self._channels, self._before, self._offsets = {}, {}, dict(self._sequence), {}
        try:
            for declared in _summary(file):
                self._declare(declared)
        except BagError:
            raise
        except Exception:  # a decoder may raise anything on broken bytes; the file itself declares all again
            pass
        for opcode, start, stop, content in walk(file, _COPIED_OPCODES, self._skip):
            try:
                self._take(opcode, file.read(start, stop) if opcode == Opcode.MESSAGE else content)
                self._ended = opcode in END_OPCODES
            except BagError:
                raise
            except (ValueError, struct.error) as error:
                self._skip(start, stop, str(error))

    def _take(self, opcode: int, content: Content) -> None:
        """Add a record of the file to the bag. Raises ValueError for unusable bytes."""
        if isinstance(content, bytes):     # of a chunk or of a message
            self._add_messages(content)
        elif isinstance(content, records.Metadata) and content.name not in ('recovered', *self._metadata):
            self._metadata[content.name] = content.metadata
            self._bag.add_metadata(content.name, content.metadata)
        elif opcode == Opcode.ATTACHMENT:
            raise ValueError('an attachment')
        else:
            self._declare(content)

    def _declare(self, record: Content) -> None:
        if isinstance(record, records.Schema):
            if record.id not in self._schemas:
                self._schemas[record.id] = self._once(self._bag.add_schema, record.name, record.encoding, record.data)
        elif not isinstance(record, records.Channel):
            return
        elif record.message_encoding != 'cdr':
            raise bag_files.foreign_encoding(self._file.path, record)
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
        """Note the unusable bytes as a new Gap, or as a part of the Gap that ends at `start`."""
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
        found = []
        for opcode, at, stop in frames(raw):
            if opcode == Opcode.MESSAGE:
                _, channel, sequence, log, publish = MESSAGE_HEAD.unpack_from(raw, at)
                if channel not in self._channels:
                    raise ValueError(f'channel {channel} is not declared')
                if stop < at + MESSAGE_HEAD.size or log >= 2**63:
                    raise ValueError('a message with an invalid head')
                found.append((channel, sequence, log, publish, at + MESSAGE_HEAD.size, stop))
            else:
                self._declare(parsed(opcode, raw[at + 9:stop]))
        if not found:
            return
        self._file.count(len(found))
        for channel, sequence, log, publish, start, stop in found:
            self._add(self._channels[channel], sequence, log, publish, raw[start:stop])
        logs = [log for _, _, log, *_ in found]
        first, last = min(logs), max(logs)
        for gap in self._gaps:
            gap.after = first if gap.after is None else gap.after
        self._first = first if self._first is None else min(self._first, first)
        self._last = last if self._last is None else max(self._last, last)

    def _add(self, channel: int, sequence: int, log: Nanoseconds, publish: Nanoseconds, data: bytes) -> None:
        """Add a message to a channel of the bag.

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
            raise bag_files.compressed_messages(self._file.path, 'zstd')
        assert self._first is not None and self._last is not None
        ours = 'pacing' in self._metadata.get('pedestal', {})
        lost = {self._names[channel]: count for channel, count in self._lost.items() if ours and count > 0}
        return Recovered(self._bag.path, self._counts, self._first, self._last, self._ended,
                         bags.planned_end(self._metadata), bags.start(self._metadata), self._gaps, lost)
