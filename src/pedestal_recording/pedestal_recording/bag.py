"""Reading of a bag, the recording of a run: a rosbag2 directory with its MCAP files, or one MCAP file, without ROS."""
import contextlib
import copy
import functools
import logging
import pathlib
import typing
from collections.abc import Iterable, Iterator, Mapping

import numpy as np
import yaml
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema, Statistics

from pedestal_common.graph import nodes
from pedestal_common.parameters import did_you_mean
from pedestal_common.quantities import DType, Ints, Json, Message, Nanoseconds, Records, Seconds, Table
from pedestal_common.text_files import plain_yaml
from pedestal_common.wire import messages
from pedestal_common.wire.cdr import STAMPED_TYPES
from pedestal_recording import bag_files, columns, mcap_file
from pedestal_recording import recording as recordings
from pedestal_recording.mcap_file import MESSAGE_HEAD, ZSTD_MAGIC, McapFile
from pedestal_recording.mcap_file import BagError as BagError  # its users write bag.BagError
from pedestal_recording.readable import Readable

MAX_CACHE_BYTES = 64_000_000  # largest size of the cache of unpacked chunks [bytes]

MAX_SEARCHED_DIAGNOSTICS = 100  # messages at an end of a bag in which the diagnostics of a node are searched

MAX_CHANNELS = 2000  # largest number of channels of a file; a channel is the record of a topic in an MCAP file
MAX_SHOWN_FOREIGN_MESSAGES = 3  # largest number of foreign messages of a topic whose time and size are shown
INDEX_BLOCK_ROWS = 65_536  # largest number of rows that are added to the index, or taken from it, at once

INDEX_FIELDS = [(name, 'i8') for name in ('channel', 'sequence', 'log', 'publish', 'stamp', 'foreign', 'chunk',
                                          'start', 'stop')]     # of Bag.index
_UNREADABLE, _OTHER_PUBLISHER = 1, 2    # values of the field `foreign` for a foreign message: its reason
_KINDS = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.METADATA, Opcode.CHUNK,
          Opcode.MESSAGE)   # records outside chunks that are read
Index: typing.TypeAlias = np.recarray[tuple[int], DType]    # rows of Bag.index
Content = typing.TypeVar('Content')  # type of the values in a dictionary {topic or node: value}
MetadataRecords = Mapping[str, Mapping[str, str]]  # metadata records of a bag, {name: {text: text}}

RETIRED_PARAMETERS = {'ins': ('alignment.classical_bandwidth', 'alignment.adrc.observer', 'alignment.adrc.control',
                              'alignment.adrc.start')}
"""{node: parameters that no longer exist}; older recordings contain them, and the configuration leaves them out."""


def read(path: str | pathlib.Path, beam: str | None = None) -> 'Bag':
    """Return the Bag in a directory or an .mcap file; beam: see Bag.view, None for all beams.

    Logs a warning for each topic with foreign messages. Raises BagError if the bag is missing, empty, damaged or no
    ROS 2 recording, or has no such beam.
    """
    bag = load(path)
    for line in bag.foreign:
        logging.getLogger(__name__).warning('%s: %s', path, line)
    if bag.damage:
        where = bag.file if len(bag.files) == 1 else bag.path
        raise BagError(f'{where}: {bag.damage}; `pedestal recover` recovers its readable messages')
    return bag if beam is None else bag.view(beam)


def chosen_topics(bag: 'Bag', names: Iterable[str]) -> list[str]:
    """Return the topics with these names, each once. Raises BagError with a similar name for a missing topic."""
    chosen = list(dict.fromkeys(name.lstrip('/') for name in names))
    for name in chosen:
        if name not in bag.topics:
            raise BagError(f'{bag.path}: no topic {name} in it;{did_you_mean(name, bag.topics)} '
                           f'there are {", ".join(bag.topics)}')
    return chosen


def load(path: str | pathlib.Path) -> 'Bag':
    """Return the Bag at a path, up to its first damage. Raises BagError if nothing is readable."""
    opened = [McapFile(file) for file in bag_files.locate(path)]
    try:
        return Bag(pathlib.Path(path), opened)
    except OSError as error:
        raise BagError(f'{path}: {mcap_file.reason(error)}') from None


def start(metadata_records: MetadataRecords) -> Nanoseconds:
    """Return the stamp of time 0 of the scenario: UTC in realtime, else 0."""
    return _nanoseconds(metadata_records.get('pedestal', {}).get('start')) or 0


def planned_end(metadata_records: MetadataRecords) -> Nanoseconds | None:
    """Return the planned end of a run, a stamp; None if unknown."""
    planned = _nanoseconds(metadata_records.get('pedestal', {}).get('planned_end_ns'))
    if planned is None:  # an older recording has only the parameter `duration` of the recorder
        with contextlib.suppress(KeyError, TypeError, ValueError, OverflowError, yaml.YAMLError):
            planned = round(plain_yaml.parse(metadata_records['parameters']['recorder'])['duration'] * 1e9) or None
    return None if planned is None else start(metadata_records) + planned


def _nanoseconds(text: str | None) -> Nanoseconds | None:
    return int(text) if text and text.isdecimal() and len(text) < 20 else None


class Bag:
    """A recording: an index of all its messages, and the methods that read them.

    Fields of a row of the index:
    channel            number of the channel in its file, plus 65536 times the number of the file
    sequence           sequence number of the message, counted by the recorder from 1 for each topic and file
    log                log time [ns]: the stamp, or the time of the drive where the recorder could not accept the stamp
    publish            publish time [ns]: in lockstep the stamp of the step, in realtime the wall time of the publisher
    stamp              stamp in the header of the message [ns], its log time for a type without header
    foreign            0 in `index`; the reason of a foreign message in the rows of `recorded`
    chunk              number of the chunk that holds the message; -1 - number of the file, outside a chunk
    start, stop        its CDR bytes are at [start, stop) of the unpacked chunk, or of the file
    """

    def __init__(self, path: pathlib.Path, opened: list[McapFile]) -> None:
        self.path = path
        self.beam = ''  # prefix of the topic names of the only beam in a view, '' outside a view
        self.files = [file.path for file in opened]     # its MCAP files in their order
        self.file = self.files[0]
        self.topics: dict[str, str] = {}    # {name without the leading '/': type}
        self.metadata_records: dict[str, dict[str, str]] = {}   # by name, each from the first file that holds it
        # number of messages of each topic that the summaries of the files state, None if a file has no summary
        self.statistics: dict[str, int] | None = None
        self.breaks: list[str] = []  # on files without a summary before the last file: their recorder was killed
        self.damage = ''    # place and reason of a broken or early ended file; '' for a whole bag
        self._opened = opened
        self._cache: dict[int, bytes] = {}
        self._chunks: list[tuple[McapFile, int, int]] = []
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, str] = {}
        self._stamped: list[int] = []
        self._counts: dict[str, int] = {}
        self._judges: dict[int, Readable] = {}
        self._compressed = 0
        blocks, ended = [np.zeros(0, INDEX_FIELDS)], True
        for number, file in enumerate(opened):
            try:
                self._scan(number, file, blocks)
            except EOFError as error:
                ended = False
                text = f'{file.path.name}: {error}' if len(opened) > 1 else str(error)
                if file is opened[-1] or not str(error).startswith('the file ends'):
                    self.damage = text
                    break
                self.breaks.append(text)
        if ended and self._counts:
            self.statistics = self._counts
        self._recorded: Index = np.concatenate(blocks).view(np.recarray)
        if self._compressed and self._compressed == len(self._recorded):
            raise bag_files.compressed_messages(self.path, 'zstd')
        self._mark_other_publishers()
        self.index: Index = self._recorded[self._recorded.foreign == 0]

    def _mark_other_publishers(self) -> None:
        """Mark the messages with the sequence number 0 as foreign: the recorder gives it to foreign publishers.

        Other tools write the number 0 for all messages. Therefore a topic without any other number stays unmarked.
        """
        rows = self._recorded
        if 'pacing' in self.metadata:
            zero = rows.sequence == 0
            numbered = np.unique(rows.channel[~zero])
            rows.foreign[zero & np.isin(rows.channel, numbered) & (rows.foreign == 0)] = _OTHER_PUBLISHER

    def _scan(self, number: int, file: McapFile, blocks: list[Records]) -> None:
        for opcode, start, stop, content in mcap_file.walk(file, _KINDS):
            try:
                if opcode == Opcode.CHUNK:
                    self._chunks.append((file, start, stop))
                if isinstance(content, bytes):
                    offset, chunk = (0, len(self._chunks) - 1) if opcode == Opcode.CHUNK else (start, -1 - number)
                    blocks += self._walk(number, content, offset, chunk)
                else:
                    self._declare(number, content)
            except BagError:
                raise
            except Exception as error:  # a decoder may raise anything on broken bytes
                raise EOFError(f'broken record at byte {start}: {error}') from None

    def _walk(self, number: int, data: bytes, offset: int, chunk: int) -> Iterator[Records]:
        """Yield blocks of the index for messages at a byte `offset` of the file, which is 0 for an unpacked chunk."""
        unpack, base, at = MESSAGE_HEAD.unpack_from, number << 16, 0
        rows: list[tuple[int, ...]] = []
        add, file = rows.append, self._opened[number]
        while at < len(data):
            if data[at] == Opcode.MESSAGE:
                length, channel, sequence, log, publish = unpack(data, at)
                add((base | channel, sequence, log, publish, log, 0, chunk, at + MESSAGE_HEAD.size, at + 9 + length))
                if len(rows) == INDEX_BLOCK_ROWS:
                    yield self._block(file, rows, data, offset)
                    rows.clear()
                at += 9 + length
            else:
                opcode, stop = mcap_file.frame(data, at)
                self._declare(number, mcap_file.parsed(opcode, data[at + 9:stop]))
                at = stop
        if at > len(data):
            raise ValueError('a message that is longer than its chunk')
        if rows:
            yield self._block(file, rows, data, offset)

    def _block(self, file: McapFile, rows: list[tuple[int, ...]], data: bytes, offset: int) -> Records:
        """Return rows of the index as an array, with the stamp from the header of each message that has one."""
        file.count(len(rows))
        block = np.array(rows, INDEX_FIELDS)
        unknown = set(np.unique(block['channel']).tolist()) - set(self._channels)
        if unknown:
            raise ValueError(f'channel {min(unknown) & 0xffff} is not declared')
        if (block['stop'] < block['start']).any():
            raise ValueError('a message that is shorter than its head')
        stamped = np.isin(block['channel'], self._stamped) & (block['stop'] - block['start'] >= 12)
        places = block['start'][stamped, np.newaxis] + np.arange(4, 12)
        pairs = np.frombuffer(data, np.uint8)[places].view('<u4').astype(np.int64)
        block['stamp'][stamped] = pairs[:, 0].astype(np.int32) * np.int64(1_000_000_000) + pairs[:, 1]
        self._judge(block, data)
        block['start'] += offset
        block['stop'] += offset
        return block

    def _judge(self, block: Records, data: bytes) -> None:
        """Mark unreadable messages of a block as foreign, and count the messages that are compressed one by one."""
        for channel in np.unique(block['channel']).tolist():
            rows = np.flatnonzero(block['channel'] == channel)
            start, stop = block['start'][rows], block['stop'][rows]
            head = start[stop - start >= len(ZSTD_MAGIC), np.newaxis] + np.arange(len(ZSTD_MAGIC))
            wanted = np.frombuffer(ZSTD_MAGIC, np.uint8)
            self._compressed += int((np.frombuffer(data, np.uint8)[head] == wanted).all(axis=1).sum())
            name = self._channels[channel]
            if self.topics[name] in messages.ROS_TYPESTORE.fielddefs:
                if channel not in self._judges:
                    self._judges[channel] = Readable(name, self.topics[name], 'pacing' in self.metadata)
                block['foreign'][rows[~self._judges[channel].mask(data, start, stop)]] = _UNREADABLE

    def _declare(self, number: int, record: mcap_file.Content) -> None:
        """Note a record of the file with a number. Raises BagError for a channel that is not CDR."""
        base = number << 16
        if isinstance(record, Schema):
            self._schemas[base | record.id] = record.name
        elif isinstance(record, Channel):
            if record.message_encoding != 'cdr':
                raise bag_files.foreign_encoding(self.files[number], record)
            name = record.topic.lstrip('/')
            if not name.isprintable() or not name:
                raise ValueError(f'a topic with the name {record.topic!r}')
            if len(self._channels) >= MAX_CHANNELS * len(self.files):
                raise ValueError(f'more than {MAX_CHANNELS} channels in a file')
            self._channels[base | record.id] = name
            self.topics[name] = self._schemas[base | record.schema_id]
            if self.topics[name] in STAMPED_TYPES:
                self._stamped.append(base | record.id)
        elif isinstance(record, Metadata):
            self.metadata_records.setdefault(record.name, record.metadata)
        elif isinstance(record, Statistics):
            for channel, name in self._channels.items():
                if channel >> 16 == number:
                    count = record.channel_message_counts.get(channel & 0xffff, 0)
                    self._counts[name] = self._counts.get(name, 0) + count

    def _bytes(self, chunk: int, start: int, stop: int) -> bytes:
        if chunk < 0:
            return self._opened[-1 - chunk].read(start, stop)
        if chunk not in self._cache:
            file, first, last = self._chunks[chunk]
            data = file.chunk(first, last, again=True)
            while self._cache and sum(map(len, self._cache.values())) + len(data) > MAX_CACHE_BYTES:
                del self._cache[next(iter(self._cache))]
            self._cache[chunk] = data
        return self._cache[chunk][start:stop]

    @property
    def metadata(self) -> dict[str, str]:
        """Metadata of the run (record `pedestal`); empty in a foreign bag."""
        return self.metadata_records.get('pedestal', {})

    @property
    def beams(self) -> int:
        """Number of beams of the recorded array; 0 for a drive with motors."""
        several = sum(1 for name in self.topics if nodes.plain(name) == 'joint_states' != name)
        beams = self.metadata.get('beams', '0')
        if not (beams.isdecimal() and max(several, int(beams[:9])) <= nodes.MAX_BEAMS):
            raise BagError(f'{self.file}: beams = {beams}: must be 0 to {nodes.MAX_BEAMS}')
        return several or int(beams)

    @property
    def start(self) -> Nanoseconds:
        """Stamp of time 0 of the scenario: UTC in realtime, else 0."""
        return start(self.metadata_records)

    @property
    def end(self) -> Seconds:
        """Log time of the last message, minus the start."""
        return float(self.index.log.max() - self.start) / 1e9

    @property
    def planned_end(self) -> Nanoseconds | None:
        """Planned end of the run, a stamp; None if unknown."""
        return planned_end(self.metadata_records)

    @property
    def servo(self) -> bool:
        """True if simulated servo drives took the place of the drive unit."""
        return self.metadata.get('servo') == '1'

    @property
    def iq(self) -> bool:
        """True if a receiver of I/Q samples took the place of the receiver."""
        given = recordings.parameters(self, 'tracking_receiver')
        return self.metadata.get('iq') == '1' or any(key.startswith('source.') for key in given)

    @property
    def own(self) -> str:
        """Programs of the user in the recorded graph, as in nodes.own_rows. Raises BagError for another text."""
        try:
            nodes.own_rows(text := self.metadata.get('own', ''))
        except ValueError as error:
            raise BagError(f'{self.file}: its record `pedestal`: {error}') from None
        return text

    @property
    def graph(self) -> dict[str, nodes.Link]:
        """Topics of the recorded graph by name."""
        return nodes.links(self.beams, self.servo, self.iq, self.own)

    def view(self, beam: str = '') -> 'Bag':
        """Return this Bag reduced to one beam of an array; '' for the first beam. Raises BagError for a missing beam.

        It has the topics of the beam under their plain names, and the topics that all beams share.
        """
        prefixes = nodes.prefixes(self.beams)
        if prefixes == ('',) and beam:
            raise BagError(f'{self.path}: beam {beam!r}: the bag has one beam only')
        prefix = f'{beam}/' if beam else prefixes[0]
        if prefix not in prefixes:
            raise BagError(f'{self.path}: beam {beam!r}: must be one of {", ".join(name[:-1] for name in prefixes)}')
        if not prefix:
            return self

        def own(content: Mapping[str, Content]) -> dict[str, Content]:
            return {nodes.plain(name): value for name, value in content.items()
                    if nodes.beam_of(name) in ('', prefix[:-1])}

        view = copy.copy(self)
        view.beam = prefix
        view.topics = own(self.topics)
        view._channels = {channel: nodes.plain(name) for channel, name in self._channels.items()
                          if nodes.beam_of(name) in ('', prefix[:-1])}
        view.index, view._recorded = (rows[np.isin(rows.channel, list(view._channels))].view(np.recarray)
                                      for rows in (self.index, self._recorded))
        view.statistics = None if self.statistics is None else own(self.statistics)
        view.metadata_records = {**self.metadata_records, 'pedestal': {**self.metadata, 'beams': '1'}}
        if 'parameters' in self.metadata_records:
            view.metadata_records['parameters'] = own(self.metadata_records['parameters'])
        for cached in ('configuration', 'foreign'):
            view.__dict__.pop(cached, None)
        receiver = recordings.parameters(view, 'tracking_receiver')
        if 'antenna.beamwidth' in receiver:
            view.metadata['beamwidth'] = str(receiver['antenna.beamwidth'])
        return view

    @functools.cached_property
    def configuration(self) -> dict[str, Json]:
        """Scenario as YAML, and {node: {dotted name: value}} of the parameters; both empty in a foreign bag.

        Raises BagError for invalid YAML, or for a node without a section of parameters.
        """
        parameters: dict[str, dict[str, Json]] = {}
        for node, text in self.metadata_records.get('parameters', {}).items():
            try:
                parameters[node] = plain_yaml.parse(text)
            except yaml.YAMLError as error:
                raise BagError(f'{self.file}: its record `parameters`: {plain_yaml.problem(error)}') from None
            if not isinstance(parameters[node], dict):
                raise BagError(f'{self.file}: its record `parameters`: {node} must hold a value for each parameter')
            for name in RETIRED_PARAMETERS.get(node, ()):
                parameters[node].pop(name, None)
        return {'scenario': self.metadata_records.get('scenario', {}).get('yaml', ''), 'parameters': parameters}

    def where(self, topic: str) -> Ints:
        """Return the positions in `index` of the rows of a topic. Raises BagError for a missing topic."""
        name = topic.lstrip('/')
        if name not in self.topics:
            raise BagError(f'{self.path}: no topic {name} in it; there are {", ".join(self.topics)}')
        channels = [channel for channel, channel_name in self._channels.items() if channel_name == name]
        return np.flatnonzero(np.isin(self.index.channel, channels))

    def rows(self, topic: str) -> Index:
        """Return the rows of `index` of a topic."""
        return self.index[self.where(topic)].view(np.recarray)

    def recorded(self, topic: str) -> Index:
        """Return the rows of all messages of a topic, also those of foreign messages."""
        channels = [channel for channel, name in self._channels.items() if name == topic]
        return self._recorded[np.isin(self._recorded.channel, channels)].view(np.recarray)

    @functools.cached_property
    def foreign(self) -> list[str]:
        """Lines about the foreign messages, which are left out: one for each topic and reason.

        A foreign message is no message of its topic, or another publisher than that of the graph sent it.
        """
        lines = []
        for name in self.topics:
            rows = self.recorded(name)
            for reason in (_UNREADABLE, _OTHER_PUBLISHER):
                left_out = rows[rows.foreign == reason]
                if left_out.size:
                    lines.append(self._foreign_line(name, left_out, reason))
        return lines

    def _foreign_line(self, name: str, rows: Index, reason: int) -> str:
        shown = ', '.join(f'{(row.log - self.start) / 1e9:.6f} s ({row.stop - row.start} bytes)'
                          for row in rows[:MAX_SHOWN_FOREIGN_MESSAGES])
        more = f' and {rows.size - MAX_SHOWN_FOREIGN_MESSAGES} more' if rows.size > MAX_SHOWN_FOREIGN_MESSAGES else ''
        text = 'sent by another publisher'
        if reason == _UNREADABLE:
            data = bytes(self._bytes(*(int(rows[0][field]) for field in ('chunk', 'start', 'stop'))))
            text = self._judges[int(rows[0].channel)].problem(data)
        count = f'{rows.size} foreign message{"s" if rows.size > 1 else ""}'
        return f'{name}: {count} left out, at {shown}{more}: {text}'

    def last_values(self, node: str, first: bool = False) -> dict[str, str]:
        """Return {key: value} of the last readable diagnostics of a node, {} without any. first: True for the first
        diagnostics in place of the last."""
        rows = self.rows('diagnostics') if 'diagnostics' in self.topics else self.index[:0]
        for _, _, _, data in self.take((rows if first else rows[::-1])[:MAX_SEARCHED_DIAGNOSTICS]):
            with contextlib.suppress(ValueError):
                for status in messages.deserialize(data, 'diagnostic_msgs/msg/DiagnosticArray').status:
                    if status.name == node:
                        return {value.key: value.value for value in status.values}
        return {}

    def raw(self, topic: str | None = None) -> Iterator[tuple[str, Nanoseconds, Nanoseconds, bytes]]:
        """Yield (topic, log time, publish time, CDR bytes) of the messages of a topic, None for all topics."""
        return self.take(self.index if topic is None else self.rows(topic))

    def take(self, rows: Records) -> Iterator[tuple[str, Nanoseconds, Nanoseconds, bytes]]:
        """Yield (topic, log time, publish time, CDR bytes) of any rows of `index`, in their order."""
        names, take = self._channels, self._bytes
        for begin in range(0, len(rows), INDEX_BLOCK_ROWS):
            for channel, _, log, publish, _, _, *place in rows[begin:begin + INDEX_BLOCK_ROWS].tolist():
                yield names[channel], log, publish, take(*place)

    def messages(self, topic: str | None = None) -> Iterator[tuple[str, Nanoseconds, Nanoseconds, Message]]:
        """Yield (topic, log time, publish time, message object) of a topic, None for all topics. Raises BagError."""
        for name, log, publish, data in self.raw(topic):
            try:
                message = messages.deserialize(data, self.topics[name])
            except ValueError as error:
                raise BagError(f'{self.path}: {name} at {log / 1e9:.6f} s: {error}') from None
            yield name, log, publish, message

    def table(self, topic: str) -> Table:
        """Return the columns of a topic, one row per message; for the names see columns.table. Raises BagError."""
        rows = self.rows(topic)
        try:
            return columns.table([data for _, _, _, data in self.raw(topic)], self.topics[topic.lstrip('/')], rows.log,
                                 self.start)
        except ValueError as error:
            raise BagError(f'{self.path}: {topic}: {error}') from None
