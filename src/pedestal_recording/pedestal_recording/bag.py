"""Reads a bag: a rosbag2 directory with its MCAP files, or one file. No ROS here."""
import contextlib
import copy
import functools
import pathlib
import re

import numpy as np
import yaml
from mcap.opcode import Opcode

from pedestal_common.graph import nodes
from pedestal_common.parameters import did_you_mean
from pedestal_common.text_files import plain_yaml
from pedestal_common.wire import messages
from pedestal_common.wire.cdr import STAMPED_TYPES
from pedestal_recording import columns, mcap_file
from pedestal_recording.mcap_file import MESSAGE_HEAD, BagError, McapFile

MAX_CACHE_BYTES = 64_000_000
"""Bytes of unpacked chunks that are kept."""

MAX_SEARCHED_DIAGNOSTICS = 100
"""Diagnostics at the end of a bag among which the last of a node is looked for."""

MAX_CHANNELS = 2000
"""Channels of a file at the most."""

INDEX_BLOCK_ROWS = 65_536
"""Rows of the index that are made at once."""

INDEX_FIELDS = [(name, 'i8') for name in ('channel', 'sequence', 'log', 'publish', 'stamp', 'chunk', 'start', 'stop')]
_DECLARED = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.METADATA)
_NUMBERED = re.compile(r'(.+)_(\d+)\.mcap')


def read(path, beam=None):
    """The Bag in a directory or an .mcap file; of several beams the view of one, '' for the first; None: all.

    Raises BagError when it is missing, empty, damaged or foreign, or has no such beam.
    """
    bag = load(path)
    if bag.damage:
        where = bag.file if len(bag.files) == 1 else bag.path
        raise BagError(f'{where}: {bag.damage}; `pedestal recover` makes a bag of what is there')
    return bag if beam is None else bag.view(beam)


def chosen_topics(bag, names):
    """The topics of a Bag with these names, without the leading '/', each once.

    Raises BagError, with the most similar name, for a topic that is not in it.
    """
    chosen = list(dict.fromkeys(name.lstrip('/') for name in names))
    for name in chosen:
        if name not in bag.topics:
            raise BagError(f'{bag.path}: no topic {name} in it;{did_you_mean(name, bag.topics)} '
                           f'there are {", ".join(bag.topics)}')
    return chosen


def load(path):
    """The Bag in a directory or an .mcap file as far as it can be read: `damage` is a line on where and why it ends,
    '' if it is whole. Raises BagError when there is nothing to read."""
    opened = [McapFile(file) for file in locate(path)]
    try:
        return Bag(pathlib.Path(path), opened)
    except OSError as error:
        raise BagError(f'{path}: {mcap_file.reason(error)}') from None


def locate(path) -> list:
    """The MCAP files of a bag in their order, a directory or a file itself.

    A bag that was recorded on by several recorders, one after the other, has NAME_0.mcap, NAME_1.mcap and so on.
    Raises BagError when there is none, or when there are several that are not numbered so.
    """
    path = pathlib.Path(path)
    try:
        if not path.is_dir():
            return [path]
        files = list(path.glob('*.mcap')) or list(path.glob('*.db3'))
    except OSError as error:
        raise BagError(f'{path}: {mcap_file.reason(error)}') from None
    if len(files) == 1:
        return files
    numbered = {file: _NUMBERED.fullmatch(file.name) for file in files}
    if not files or not all(numbered.values()) or len({match[1] for match in numbered.values()}) > 1:
        raise BagError(f'{path}: {len(files)} .mcap files in it where one belongs, or NAME_0.mcap, NAME_1.mcap ...')
    return sorted(files, key=lambda file: int(numbered[file][2]))


def start(metadata_records) -> int:
    """Where the time of the scenario is 0 in the stamps [ns] of a bag, by its metadata records: UTC in realtime."""
    return _nanoseconds(metadata_records.get('pedestal', {}).get('start')) or 0


def planned_end(metadata_records):
    """When a run was to end, a stamp [ns], by the metadata records of its bag; None where they do not say."""
    planned = _nanoseconds(metadata_records.get('pedestal', {}).get('planned_end_ns'))
    if planned is None:  # recordings made before that was noted
        with contextlib.suppress(KeyError, TypeError, ValueError, OverflowError, yaml.YAMLError):
            planned = round(plain_yaml.parse(metadata_records['parameters']['recorder'])['duration'] * 1e9) or None
    return None if planned is None else start(metadata_records) + planned


def _nanoseconds(text):
    """The time in a text of a bag's metadata, None where it is none."""
    return int(text) if text and text.isdecimal() and len(text) < 20 else None


def foreign_encoding(file, channel):
    """The BagError for a channel that is not encoded as ROS 2 messages are."""
    return BagError(f'{file}: {channel.topic} is encoded as {channel.message_encoding!r}: not a ROS 2 recording')


class Bag:
    """A recording.

    files: its MCAP files in their order, paths; file: the first of them; topics: {name without the leading '/': type};
    metadata_records: {name: {text: text}} of the first file;
    index: record array (n,) in the order of the files, one row per message: channel (its number, plus 65536 times that
    of its file), sequence, log, publish, stamp [ns] (of its header; its log time where it has none), chunk, start,
    stop (where its bytes are);
    statistics: {name: count} in the summaries, None where a file has none;
    breaks: lines on files that end without a summary while another follows: their recorder was killed, and one was
    started again; damage: the file that is broken or ends before its end, where and why, ''; beam: the prefix of the
    beam that it is a view of, ''.
    """

    def __init__(self, path, opened):
        self.path, self.beam = path, ''
        self.files = [file.path for file in opened]
        self.file = self.files[0]
        self.topics, self.metadata_records, self.statistics = {}, {}, {}
        self.breaks, self.damage = [], ''
        self._opened, self._cache, self._chunks = opened, {}, []
        self._schemas, self._channels, self._stamped = {}, {}, []
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
        self.statistics = self.statistics if ended and self.statistics else None
        self.index = np.concatenate(blocks).view(np.recarray)

    def _scan(self, number, file, blocks):
        """Add the messages of a file to the blocks of the index. Raises EOFError where it ends before its end."""
        for opcode, start, stop in file.pieces():
            try:
                if opcode == Opcode.CHUNK:
                    data = file.chunk(start, stop)
                    self._chunks.append((file, start, stop))
                    blocks += self._walk(number, data, 0, len(self._chunks) - 1)
                elif opcode == Opcode.MESSAGE:
                    blocks += self._walk(number, file.read(start, stop), start, -1 - number)
                elif opcode in _DECLARED:
                    self._declare(number, opcode, file.read(start + 9, stop))
            except BagError:
                raise
            except Exception as error:  # whatever a decoder makes of broken bytes
                raise EOFError(f'broken record at byte {start}: {error}') from None

    def _walk(self, number, data, offset, chunk):
        """Iterator of blocks of the index: the messages in the records `data`, which begin at this offset."""
        unpack, base, at, rows = MESSAGE_HEAD.unpack_from, number << 16, 0, []
        add, file = rows.append, self._opened[number]
        while at < len(data):
            if data[at] == Opcode.MESSAGE:
                length, channel, sequence, log, publish = unpack(data, at)
                add((base | channel, sequence, log, publish, log, chunk, at + MESSAGE_HEAD.size, at + 9 + length))
                if len(rows) == INDEX_BLOCK_ROWS:
                    yield self._block(file, rows, data, offset)
                    rows.clear()
                at += 9 + length
            else:
                opcode, stop = mcap_file.frame(data, at)
                self._declare(number, opcode, data[at + 9:stop])
                at = stop
        if at > len(data):
            raise ValueError('a message longer than its chunk')
        if rows:
            yield self._block(file, rows, data, offset)

    def _block(self, file, rows, data, offset):
        """Rows as a block of the index, each stamped where its header says when."""
        file.count(len(rows))
        block = np.array(rows, INDEX_FIELDS)
        unknown = set(np.unique(block['channel']).tolist()) - set(self._channels)
        if unknown:
            raise ValueError(f'channel {min(unknown) & 0xffff} is declared nowhere')
        if (block['stop'] < block['start']).any():
            raise ValueError('a message that is shorter than its head')
        stamped = np.isin(block['channel'], self._stamped) & (block['stop'] - block['start'] >= 12)
        places = block['start'][stamped, np.newaxis] + np.arange(4, 12)
        pairs = np.frombuffer(data, np.uint8)[places].view('<u4').astype(np.int64)
        block['stamp'][stamped] = pairs[:, 0].astype(np.int32) * np.int64(1_000_000_000) + pairs[:, 1]
        block['start'] += offset
        block['stop'] += offset
        return block

    def _declare(self, number, opcode, content):
        record, base = mcap_file.parsed(opcode, content), number << 16
        if opcode == Opcode.SCHEMA:
            self._schemas[base | record.id] = record.name
        elif opcode == Opcode.CHANNEL:
            if record.message_encoding != 'cdr':
                raise foreign_encoding(self.files[number], record)
            name = record.topic.lstrip('/')
            if not name.isprintable() or not name:
                raise ValueError(f'a topic of the name {record.topic!r}')
            if len(self._channels) >= MAX_CHANNELS * len(self.files):
                raise ValueError(f'more than {MAX_CHANNELS} channels')
            self._channels[base | record.id] = name
            self.topics[name] = self._schemas[base | record.schema_id]
            if self.topics[name] in STAMPED_TYPES:
                self._stamped.append(base | record.id)
        elif opcode == Opcode.METADATA:
            self.metadata_records.setdefault(record.name, record.metadata)
        elif opcode == Opcode.STATISTICS:
            for channel, name in self._channels.items():
                if channel >> 16 == number:
                    count = record.channel_message_counts.get(channel & 0xffff, 0)
                    self.statistics[name] = self.statistics.get(name, 0) + count

    def _bytes(self, chunk, start, stop):
        """The bytes of a message, of a row of the index."""
        if chunk < 0:
            return self._opened[-1 - chunk].read(start, stop)
        if chunk not in self._cache:
            file, *place = self._chunks[chunk]
            data = file.chunk(*place, again=True)
            while self._cache and sum(map(len, self._cache.values())) + len(data) > MAX_CACHE_BYTES:
                del self._cache[next(iter(self._cache))]
            self._cache[chunk] = data
        return self._cache[chunk][start:stop]

    @property
    def metadata(self):
        """{text: text} of the run (the record `pedestal`); empty in a foreign bag."""
        return self.metadata_records.get('pedestal', {})

    @property
    def beams(self):
        """Beams of the array that was recorded; 0: a drive with motors."""
        several = sum(1 for name in self.topics if nodes.plain(name) == 'joint_states' != name)
        beams = self.metadata.get('beams', '0')
        if not (beams.isdecimal() and max(several, int(beams[:9])) <= nodes.MAX_BEAMS):
            raise BagError(f'{self.file}: beams = {beams}: must be 0 to {nodes.MAX_BEAMS}')
        return several or int(beams)

    @property
    def start(self):
        """Where the time of the scenario is 0 in the stamps [ns]: UTC in realtime, else 0."""
        return start(self.metadata_records)

    @property
    def end(self):
        """Log time of its last message [s]."""
        return self.index.log.max() / 1e9

    @property
    def planned_end(self):
        """When the run was to end, a stamp [ns]; None when the bag does not say."""
        return planned_end(self.metadata_records)

    @property
    def graph(self):
        """{name: Link} of the graph that was recorded."""
        return nodes.links(self.beams)

    def view(self, beam=''):
        """The Bag of one beam of several, '' for the first: the beam's own topics under their plain names and those
        that all beams share. A Bag of one beam is its own view. Raises BagError for a beam that is not in it."""
        prefixes = nodes.prefixes(self.beams)
        if prefixes == ('',) and beam:
            raise BagError(f'{self.path}: beam {beam!r}: there is only one in it')
        prefix = f'{beam}/' if beam else prefixes[0]
        if prefix not in prefixes:
            raise BagError(f'{self.path}: beam {beam!r}: must be one of {", ".join(name[:-1] for name in prefixes)}')
        if not prefix:
            return self

        def own(content):
            return {nodes.plain(name): value for name, value in content.items()
                    if nodes.beam_of(name) in ('', prefix[:-1])}

        view = copy.copy(self)
        view.beam = prefix
        view.topics = own(self.topics)
        view._channels = {channel: nodes.plain(name) for channel, name in self._channels.items()
                          if nodes.beam_of(name) in ('', prefix[:-1])}
        view.index = self.index[np.isin(self.index.channel, list(view._channels))]
        view.statistics = None if self.statistics is None else own(self.statistics)
        view.metadata_records = {**self.metadata_records, 'pedestal': {**self.metadata, 'beams': '1'}}
        if 'parameters' in self.metadata_records:
            view.metadata_records['parameters'] = own(self.metadata_records['parameters'])
        view.__dict__.pop('configuration', None)
        receiver = view.configuration['parameters'].get('tracking_receiver', {})
        if 'antenna.beamwidth' in receiver:
            view.metadata['beamwidth'] = str(receiver['antenna.beamwidth'])
        return view

    @functools.cached_property
    def configuration(self):
        """How the run was made: {'scenario': its YAML, 'parameters': {node: {dotted name: value}}}; '' and {} in a bag
        without a configuration. Raises BagError where that is no YAML, or no section of parameters."""
        parameters = {}
        for node, text in self.metadata_records.get('parameters', {}).items():
            try:
                parameters[node] = plain_yaml.parse(text)
            except yaml.YAMLError as error:
                raise BagError(f'{self.file}: its record `parameters`: {plain_yaml.problem(error)}') from None
            if not isinstance(parameters[node], dict):
                raise BagError(f'{self.file}: its record `parameters`: {node} must hold a value for each parameter')
        return {'scenario': self.metadata_records.get('scenario', {}).get('yaml', ''), 'parameters': parameters}

    def where(self, topic):
        """Where in `index` the rows (m,) of one topic are. Raises BagError for a topic that is not in the bag."""
        name = topic.lstrip('/')
        if name not in self.topics:
            raise BagError(f'{self.path}: no topic {name} in it; there are {", ".join(self.topics)}')
        channels = [channel for channel, channel_name in self._channels.items() if channel_name == name]
        return np.flatnonzero(np.isin(self.index.channel, channels))

    def rows(self, topic):
        """The rows of `index` of one topic."""
        return self.index[self.where(topic)]

    def last_values(self, node):
        """{key: value} of the last diagnostics of a node; {} where there is none that can be read."""
        rows = self.rows('diagnostics') if 'diagnostics' in self.topics else self.index[:0]
        for _, _, _, data in self.take(rows[:-MAX_SEARCHED_DIAGNOSTICS - 1:-1]):
            with contextlib.suppress(ValueError):
                for status in messages.deserialize(data, 'diagnostic_msgs/msg/DiagnosticArray').status:
                    if status.name == node:
                        return {value.key: value.value for value in status.values}
        return {}

    def raw(self, topic=None):
        """Iterator of (topic, log time, publish time [ns], CDR bytes) in the order of the file."""
        return self.take(self.index if topic is None else self.rows(topic))

    def take(self, rows):
        """Iterator of (topic, log time, publish time [ns], CDR bytes) of any rows of `index`, in their order."""
        names, take = self._channels, self._bytes
        for begin in range(0, len(rows), INDEX_BLOCK_ROWS):
            for channel, _, log, publish, _, *place in rows[begin:begin + INDEX_BLOCK_ROWS].tolist():
                yield names[channel], log, publish, take(*place)

    def messages(self, topic=None):
        """Iterator of (topic, log time, publish time [ns], message) in the order of the file.

        Raises BagError for bytes that are no message of the topic's type.
        """
        for name, log, publish, data in self.raw(topic):
            try:
                message = messages.deserialize(data, self.topics[name])
            except ValueError as error:
                raise BagError(f'{self.path}: {name} at {log / 1e9:.6f} s: {error}') from None
            yield name, log, publish, message

    def table(self, topic):
        """{column: array (n,)} of a topic, one row per message; columns.table says their names.

        Raises BagError for bytes that are no message of the topic's type.
        """
        rows = self.rows(topic)
        try:
            return columns.table([data for _, _, _, data in self.raw(topic)], self.topics[topic.lstrip('/')], rows.log,
                                 self.start)
        except ValueError as error:
            raise BagError(f'{self.path}: {topic}: {error}') from None
