"""Reads a bag: a rosbag2 directory with one MCAP file, or the file. No ROS here."""
import copy
import difflib
import fcntl
import functools
import io
import pathlib
import struct

import numpy as np
import yaml
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC as MAGIC

from pedestal_bringup.bags import columns
from pedestal_common import messages, nodes

SQLITE = b'SQLite format 3'
_RECORD = struct.Struct('<BQ')
MESSAGE = struct.Struct('<xQHIQQ')
"""Length, channel, sequence, log and publish time: the head of a message record after its opcode."""


class BagError(ValueError):
    """A bag cannot be written or read; one line that names the file and what is wrong with it."""


def reason(error):
    """What an OSError says, without the path."""
    return error.strerror or str(error)


def read(path, beam=None):
    """The Bag in a directory or an .mcap file; of several beams the view of one, '' for the first; None: all.

    Raises BagError when it is missing, empty, damaged or foreign, or has no such beam.
    """
    bag = load(path)
    if bag.damage:
        raise BagError(f'{bag.file}: {bag.damage}; `pedestal recover` makes a bag of what is there')
    return bag if beam is None else bag.view(beam)


def chosen_topics(bag, names):
    """The topics of a Bag with these names, without the leading '/', each once.

    Raises BagError, with the most similar name, for a topic that is not in it.
    """
    chosen = list(dict.fromkeys(name.lstrip('/') for name in names))
    for name in chosen:
        if name not in bag.topics:
            near = difflib.get_close_matches(name, bag.topics, n=1)
            hint = f'did you mean {near[0]}? ' if near else ''
            raise BagError(f'{bag.path}: no topic {name} in it; {hint}there are {", ".join(bag.topics)}')
    return chosen


def load(path):
    """The Bag in a directory or an .mcap file as far as it can be read: `damage` is a line on where and why it ends,
    '' if it is whole. Raises BagError when there is nothing to read."""
    file = locate(path)
    try:
        return Bag(pathlib.Path(path), file, file.read_bytes())
    except OSError as error:
        raise BagError(f'{path}: {reason(error)}') from None


def locate(path):
    """The MCAP file of a bag, a directory or the file itself.

    Raises BagError when there is none, when it is foreign or empty, or while its recorder still writes it.
    """
    path = pathlib.Path(path)
    try:
        file = _only_file(path) if path.is_dir() else path
        with open(file, 'rb') as stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                raise BagError(f'{file}: is being written; wait until its recorder has ended') from None
            except OSError:  # a file system without locks
                pass
            head = stream.read(len(SQLITE))
    except OSError as error:
        raise BagError(f'{path}: {reason(error)}') from None
    if head.startswith(MAGIC):
        return file
    if not head:
        raise BagError(f'{file}: empty file')
    if head == SQLITE:
        raise BagError(f'{file}: an SQLite bag, not an MCAP file; `ros2 bag convert` makes one of it')
    raise BagError(f'{file}: not an MCAP file')


def foreign_encoding(file, channel):
    """The BagError for a channel that is not encoded as ROS 2 messages are."""
    return BagError(f'{file}: {channel.topic} is encoded as {channel.message_encoding!r}: not a ROS 2 recording')


def _only_file(path):
    files = sorted(path.glob('*.mcap')) or sorted(path.glob('*.db3'))
    if len(files) != 1:
        raise BagError(f'{path}: {len(files)} .mcap files in it where one belongs')
    return files[0]


class Bag:
    """A recording.

    topics: {name without the leading '/': type}; metadata_records: {name: {text: text}};
    index: record array (n,) in the order of the file, one row per message: channel, sequence, log, publish [ns],
    chunk, start, stop (where its bytes are); statistics: {name: count} in the file's summary, None without one;
    damage: why it ends before its end, ''; beam: the prefix of the beam that it is a view of, ''.
    """

    def __init__(self, path, file, data):
        self.path, self.file, self.beam = path, file, ''
        self.topics, self.metadata_records, self.statistics, self.damage = {}, {}, None, ''
        self._data = data
        self._schemas, self._channels, self._chunks = {}, {}, []
        self._chunk = functools.lru_cache(maxsize=256)(self._decompress)
        rows = []
        try:
            self._scan(rows)
        except EOFError as error:
            self.damage = str(error)
        self.index = np.array(rows, [(name, 'i8') for name in
                                     ('channel', 'sequence', 'log', 'publish', 'chunk', 'start', 'stop')])
        self.index = self.index.view(np.recarray)

    def _scan(self, rows):
        data, at = self._data, 8
        closed = False
        while not closed:
            if at + 9 > len(data):
                raise EOFError(f'the file ends at byte {len(data)} without a summary (recorder killed, or disk full)')
            opcode, length = _RECORD.unpack_from(data, at)
            at += 9
            if at + length > len(data):
                raise EOFError(f'the file ends at byte {len(data)} inside a record that goes on to {at + length}')
            try:
                closed = self._take(opcode, at, length, rows)
            except (BagError, EOFError):
                raise
            except Exception as error:
                raise EOFError(f'broken record at byte {at - 9}: {error}') from None
            at += length
        if data[at:] != MAGIC:
            raise EOFError(f'the file does not end where its footer does, at byte {at}')

    def _take(self, opcode, at, length, rows):
        if opcode == Opcode.CHUNK:
            self._chunks.append((at, length))
            chunk = self._chunk(len(self._chunks) - 1)
            self._walk(chunk, 0, len(chunk), len(self._chunks) - 1, rows)
        elif opcode == Opcode.MESSAGE:
            self._walk(self._data, at - 9, at + length, -1, rows)
        elif opcode in (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.METADATA):
            self._declare(opcode, self._data[at:at + length])
        return opcode == Opcode.FOOTER

    def _walk(self, data, at, end, chunk, rows):
        unpack, add = MESSAGE.unpack_from, rows.append
        while at < end:
            if data[at] == Opcode.MESSAGE:
                length, channel, sequence, log, publish = unpack(data, at)
                add((channel, sequence, log, publish, chunk, at + MESSAGE.size, at + 9 + length))
            else:
                opcode, length = _RECORD.unpack_from(data, at)
                self._declare(opcode, data[at + 9:at + 9 + length])
            at += 9 + length

    def _declare(self, opcode, data):
        stream = ReadDataStream(io.BytesIO(data))
        if opcode == Opcode.HEADER:
            records.Header.read(stream)
        elif opcode == Opcode.SCHEMA:
            schema = records.Schema.read(stream)
            self._schemas[schema.id] = schema.name
        elif opcode == Opcode.CHANNEL:
            channel = records.Channel.read(stream)
            if channel.message_encoding != 'cdr':
                raise foreign_encoding(self.file, channel)
            self._channels[channel.id] = channel.topic.lstrip('/')
            self.topics[channel.topic.lstrip('/')] = self._schemas[channel.schema_id]
        elif opcode == Opcode.METADATA:
            record = records.Metadata.read(stream)
            self.metadata_records[record.name] = record.metadata
        elif opcode == Opcode.STATISTICS:
            counts = records.Statistics.read(stream).channel_message_counts
            self.statistics = {name: counts.get(channel, 0) for channel, name in self._channels.items()}

    def _decompress(self, number):
        at, length = self._chunks[number]
        chunk = records.Chunk.read(ReadDataStream(io.BytesIO(self._data[at:at + length])))
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        return stream.read(size)

    @property
    def metadata(self):
        """{text: text} of the run (the record `pedestal`); empty in a foreign bag."""
        return self.metadata_records.get('pedestal', {})

    @property
    def start(self):
        """Where the time of the scenario is 0 in the stamps [ns]: UTC in realtime, else 0."""
        return int(self.metadata.get('start', 0))

    @property
    def beams(self):
        """Beams of the array that was recorded; 0: a drive with motors."""
        several = sum(1 for name in self.topics if nodes.plain(name) == 'joint_states' != name)
        return several or int(self.metadata.get('beams', 0))

    @property
    def graph(self):
        """{name: Topic} of the graph that was recorded."""
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
        without a configuration. Raises BagError where that is no YAML."""
        try:
            return {'scenario': self.metadata_records.get('scenario', {}).get('yaml', ''),
                    'parameters': {node: yaml.safe_load(text)
                                   for node, text in self.metadata_records.get('parameters', {}).items()}}
        except yaml.YAMLError as error:
            reason = ' '.join(str(error).split())
            raise BagError(f'{self.file}: its record `parameters` is no YAML: {reason}') from None

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

    def raw(self, topic=None):
        """Iterator of (topic, log time, publish time [ns], CDR bytes) in the order of the file."""
        return self.take(self.index if topic is None else self.rows(topic))

    def take(self, rows):
        """Iterator of (topic, log time, publish time [ns], CDR bytes) of any rows of `index`, in their order."""
        names = self._channels
        heads, places = rows[['channel', 'log', 'publish']].tolist(), rows[['chunk', 'start', 'stop']].tolist()
        for (channel, log, publish), (chunk, start, stop) in zip(heads, places):
            data = self._data if chunk < 0 else self._chunk(chunk)
            yield names[channel], log, publish, data[start:stop]

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
