"""Bags: a rosbag2 directory (metadata.yaml version 9) with one MCAP file, written and read. No ROS here."""
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

from pedestal_bringup.bags import columns
from pedestal_bringup.bags.container import MAGIC, MESSAGE, BagError, Container, compressed, reason
from pedestal_common import messages, nodes, topics

CHUNK_SIZE = 1_000_000
CHUNK_SPAN = 1_000_000_000
"""A chunk ends after this many bytes or ns of log time, so that a crash loses at most the last second."""

SQLITE = b'SQLite format 3'
_RECORD = struct.Struct('<BQ')
_INFINITE = {'sec': 9223372036, 'nsec': 854775807}


def _qos(rate):
    """The offered_qos_profiles of a topic of a rate."""
    depth, latched = topics.QOS[rate].lockstep, topics.QOS[rate].latched
    return [{'history': 'keep_last' if depth else 'keep_all', 'depth': depth, 'reliability': 'reliable',
             'durability': 'transient_local' if latched else 'volatile',
             'deadline': dict(_INFINITE), 'lifespan': dict(_INFINITE), 'liveliness': 'automatic',
             'liveliness_lease_duration': dict(_INFINITE), 'avoid_ros_namespace_conventions': False}]


class Writer:
    """Writes a bag.

    directory: must not exist. rows: of topics.TOPICS, or nodes.Links; a message names its topic by the index in them.
    metadata: {text: text} of the run, kept as the MCAP metadata record `pedestal` and custom_data of metadata.yaml.
    more: {name: {text: text}} of further metadata records.
    Raises BagError, naming the file, when the disk does not take a chunk. What was written by then stays readable;
    nothing is written after it but the summary, so that a bag has no hole.
    """

    def __init__(self, directory, rows, metadata, more=()):
        self._container = Container(directory)
        self.path, self.file = self._container.path, self._container.file
        self._chunk = bytearray()
        self._chunk_start = 0
        self._index = [[] for _ in rows]
        self._sequences = [0] * len(rows)
        schema_ids = {}
        for topic in rows:
            schema_ids.setdefault(topic.type, len(schema_ids) + 1)
        self._container.add(
            *(records.Schema(id=number, name=name, encoding='ros2msg',
                             data=messages.TYPESTORE.generate_msgdef(name, ros_version=2)[0].encode())
              for name, number in schema_ids.items()),
            *(records.Channel(id=number, topic='/' + topic.name, message_encoding='cdr',
                              schema_id=schema_ids[topic.type],
                              metadata={'offered_qos_profiles': yaml.safe_dump(_qos(topic.rate), sort_keys=False),
                                        'topic_type_hash': messages.TYPESTORE.hash_rihs01(topic.type)})
              for number, topic in enumerate(rows, 1)),
            *(records.Metadata(name=name, metadata={str(key): str(value) for key, value in content.items()})
              for name, content in (('pedestal', metadata), *dict(more).items())))

    def write(self, topic, log_time, publish_time, data):
        """Add one message: index of its topic, times [ns], CDR bytes."""
        chunk = self._chunk
        if not chunk:
            self._chunk_start = log_time
        elif log_time - self._chunk_start >= CHUNK_SPAN or len(chunk) >= CHUNK_SIZE:
            self.flush()
            chunk = self._chunk
            self._chunk_start = log_time
        self._sequences[topic] = sequence = self._sequences[topic] + 1
        self._index[topic] += (log_time, len(chunk))
        chunk += MESSAGE.pack(5, 22 + len(data), topic + 1, sequence & 0xffffffff, log_time, publish_time)
        chunk += data

    def skip(self, topic, count):
        """Leave a gap in the topic's sequence numbers: messages that were lost before they came here."""
        self._sequences[topic] += count

    def flush(self):
        """End the chunk: everything written is in the file when this returns."""
        if not self._chunk:
            return
        raw, self._chunk = bytes(self._chunk), bytearray()
        index = {channel: places for channel, places in enumerate(self._index, 1) if places}
        self._index = [[] for _ in self._index]
        times = [time for places in index.values() for time in places[::2]]
        self._container.add_chunk(compressed(raw, min(times), max(times)), index)

    @property
    def messages(self):
        """How many messages were written."""
        return self._container.counts.total() + sum(map(len, self._index)) // 2

    def close(self):
        """Write what is left, the summary and metadata.yaml; on a full disk whatever of it fits, then BagError."""
        try:
            self.flush()
        finally:
            self._container.close()


def read(path, beam=None):
    """The Bag in a directory or an .mcap file; beam: as that beam of an array sees it, '' for the first.

    Raises BagError when it is missing, empty, damaged or foreign, or has no such beam.
    """
    bag = load(path)
    if bag.damage:
        raise BagError(f'{bag.file}: {bag.damage}; `pedestal recover` makes a bag of what is there')
    return bag if beam is None else bag.view(beam)


def chosen_topics(bag, names):
    """The topics of these names, without the leading '/', each once; BagError with the nearest for one it has not."""
    chosen = list(dict.fromkeys(name.lstrip('/') for name in names))
    for name in chosen:
        if name not in bag.topics:
            near = difflib.get_close_matches(name, bag.topics, n=1)
            hint = f'did you mean {near[0]}? ' if near else ''
            raise BagError(f'{bag.path}: no topic {name} in it; {hint}there are {", ".join(bag.topics)}')
    return chosen


def load(path):
    """The Bag as far as it can be read; its `damage` says in one line where and why it ends, '' if it is whole."""
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
    return BagError(f'{file}: {channel.topic} is encoded as {channel.message_encoding!r}: not a ROS 2 recording')


def _only_file(path):
    files = sorted(path.glob('*.mcap')) or sorted(path.glob('*.db3'))
    if len(files) != 1:
        raise BagError(f'{path}: {len(files)} .mcap files in it where one belongs')
    return files[0]


class Bag:
    """A recording.

    topics: {name without the leading '/': type}; metadata_records: {name: {text: text}};
    index: record array in the order of the file, one row per message: channel, sequence, log, publish [ns], chunk,
    start, stop (where its bytes are); statistics: {name: count} as the file's summary says, None without one;
    beam: the prefix of the beam of several that it is a view of, ''.
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
                _, length, channel, sequence, log, publish = unpack(data, at)
                add((channel, sequence, log, publish, chunk, at + 31, at + 9 + length))
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
        """The Bag as one beam of several sees it, '' for the first: what is its own under the plain names, what is
        shared, and nothing of the others. A Bag of one beam is its own view. Raises BagError for no beam of it."""
        known = nodes.prefixes(self.beams)
        if known == ('',) and beam:
            raise BagError(f'{self.path}: beam {beam!r}: there is only one in it')
        prefix = f'{beam}/' if beam else known[0]
        if prefix not in known:
            raise BagError(f'{self.path}: beam {beam!r}: must be one of {", ".join(name[:-1] for name in known)}')
        if not prefix:
            return self
        seen = copy.copy(self)
        seen.beam = prefix

        def own(content):
            return {nodes.plain(name): value for name, value in content.items()
                    if nodes.beam_of(name) in ('', prefix[:-1])}
        seen.topics = own(self.topics)
        seen._channels = {channel: nodes.plain(name) for channel, name in self._channels.items()
                          if nodes.beam_of(name) in ('', prefix[:-1])}
        seen.index = self.index[np.isin(self.index.channel, list(seen._channels))]
        seen.statistics = None if self.statistics is None else own(self.statistics)
        seen.metadata_records = {**self.metadata_records, 'pedestal': {**self.metadata, 'beams': '1'}}
        if 'parameters' in self.metadata_records:
            seen.metadata_records['parameters'] = own(self.metadata_records['parameters'])
        seen.__dict__.pop('configuration', None)
        tracking = seen.configuration['parameters'].get('tracking_receiver', {})
        if 'antenna.beamwidth' in tracking:
            seen.metadata['beamwidth'] = str(tracking['antenna.beamwidth'])
        return seen

    @functools.cached_property
    def configuration(self):
        """How the run was made: {'scenario': its YAML, 'parameters': {node: {dotted name: value}}}; '' and {} in a bag
        that does not say."""
        try:
            return {'scenario': self.metadata_records.get('scenario', {}).get('yaml', ''),
                    'parameters': {node: yaml.safe_load(text)
                                   for node, text in self.metadata_records.get('parameters', {}).items()}}
        except yaml.YAMLError as error:
            reason = ' '.join(str(error).split())
            raise BagError(f'{self.file}: its record `parameters` is no YAML: {reason}') from None

    def where(self, topic):
        """Where in `index` the rows of one topic are."""
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
        """The same of any rows of `index`, in their order."""
        names = self._channels
        for channel, _, log, publish, chunk, start, stop in rows.tolist():
            data = self._data if chunk < 0 else self._chunk(chunk)
            yield names[channel], log, publish, data[start:stop]

    def messages(self, topic=None):
        """Iterator of (topic, log time, publish time [ns], message) in the order of the file."""
        for name, log, publish, data in self.raw(topic):
            try:
                message = messages.deserialize(data, self.topics[name])
            except ValueError as error:
                raise BagError(f'{self.path}: {name} at {log / 1e9:.6f} s: {error}') from None
            yield name, log, publish, message

    def table(self, topic):
        """{column: array (n,)} of a topic, one row per message; see columns.table for their names."""
        rows = self.rows(topic)
        try:
            return columns.table([data for _, _, _, data in self.raw(topic)], self.topics[topic.lstrip('/')], rows.log,
                                 self.start)
        except ValueError as error:
            raise BagError(f'{self.path}: {topic}: {error}') from None
