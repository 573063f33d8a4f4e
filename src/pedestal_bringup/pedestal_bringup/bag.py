"""Bags: a rosbag2 directory (metadata.yaml version 9) with one MCAP file, written and read. No ROS here.

The file is built from the records of the `mcap` library. Its Writer class is not used: it costs 4 to 6 us a message
where this costs 1 (a dataclass, eight packs and three seeks per message against one pack), and at 11 topics the
recorder shares two cores with the loop it records.

Nothing in the MCAP file depends on its path, the host or the wall clock: equal messages give equal bytes.
"""
import difflib
import functools
import io
import pathlib
import struct
import zlib

import numpy as np
import yaml
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.stream_reader import get_chunk_data_stream

from pedestal_bringup import columns
from pedestal_common import messages

MAGIC = b'\x89MCAP0\r\n'
CHUNK_SIZE = 1_000_000
CHUNK_SPAN = 1_000_000_000
"""A chunk ends after this many bytes or ns of log time, so that a crash loses at most the last second."""

_MESSAGE = struct.Struct('<BQHIQQ')
_RECORD = struct.Struct('<BQ')
_INFINITE = {'sec': 9223372036, 'nsec': 854775807}
_HISTORY = {'step': ('keep_all', 0, 'volatile'), 'state': ('keep_last', 1, 'transient_local'),
            'event': ('keep_last', 10, 'volatile')}


class BagError(ValueError):
    """A bag cannot be written or read; one line that names the file and what is wrong with it."""


def _qos(name):
    history, depth, durability = _HISTORY[name]
    return [{'history': history, 'depth': depth, 'reliability': 'reliable', 'durability': durability,
             'deadline': dict(_INFINITE), 'lifespan': dict(_INFINITE), 'liveliness': 'automatic',
             'liveliness_lease_duration': dict(_INFINITE), 'avoid_ros_namespace_conventions': False}]


def _reason(error):
    return error.strerror or str(error)


class Writer:
    """Writes a bag.

    directory: must not exist. topics: rows of topics.TOPICS; a message names its topic by the index in them.
    metadata: {text: text} of the run, kept as the MCAP metadata record `pedestal` and custom_data of metadata.yaml.
    Raises BagError, naming the file, when the disk does not take a chunk. What was written by then stays readable;
    nothing is written after it but the summary, so that a bag has no hole.
    """

    def __init__(self, directory, topics, metadata):
        self.path = pathlib.Path(directory).absolute()
        self.file = self.path / f'{self.path.name}_0.mcap'
        self.topics = tuple(topics)
        self.metadata = {str(key): str(value) for key, value in metadata.items()}
        self._compress = zstandard.ZstdCompressor(level=1).compress
        self._channels = []
        self._schemas = []
        self._chunk = bytearray()
        self._chunk_start = 0
        self._index = [[] for _ in self.topics]
        self._sequences = [0] * len(self.topics)
        self.counts = [0] * len(self.topics)
        self._first, self._last = None, 0
        self._chunk_indexes = []
        try:
            self.path.mkdir(parents=True)
            self._stream = open(self.file, 'xb', buffering=0)
        except FileExistsError:
            raise BagError(f'{directory} exists already; a recording is never overwritten') from None
        except OSError as error:
            raise BagError(f'{directory}: {_reason(error)}') from None
        self._end = 0
        self._full = False
        self._put(self._head())

    def _head(self):
        builder = RecordBuilder()
        builder.write(MAGIC)
        records.Header(profile='ros2', library='pedestal').write(builder)
        schema_ids = {}
        for number, topic in enumerate(self.topics, 1):
            if topic.type not in schema_ids:
                schema_ids[topic.type] = len(schema_ids) + 1
                text, _ = messages.TYPESTORE.generate_msgdef(topic.type, ros_version=2)
                self._schemas.append(records.Schema(id=schema_ids[topic.type], name=topic.type, encoding='ros2msg',
                                                    data=text.encode()))
            self._channels.append(records.Channel(
                id=number, topic='/' + topic.name, message_encoding='cdr', schema_id=schema_ids[topic.type],
                metadata={'offered_qos_profiles': yaml.safe_dump(_qos(topic.qos), sort_keys=False),
                          'topic_type_hash': messages.TYPESTORE.hash_rihs01(topic.type)}))
        for record in (*self._schemas, *self._channels):
            record.write(builder)
        self._metadata_at = builder.count
        records.Metadata(name='pedestal', metadata=self.metadata).write(builder)
        self._metadata_length = builder.count - self._metadata_at
        return builder.end()

    def _put(self, data):
        """Append, or leave the file as it was."""
        view = memoryview(data)
        try:
            while view:
                view = view[self._stream.write(view):]
        except OSError as error:
            self._stream.seek(self._end)
            self._stream.truncate()
            raise BagError(f'{self.file}: {_reason(error)}') from None
        self._end += len(data)

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
        chunk += _MESSAGE.pack(5, 22 + len(data), topic + 1, sequence & 0xffffffff, log_time, publish_time)
        chunk += data

    def skip(self, topic, count):
        """Leave a gap in the topic's sequence numbers: messages that were lost before they came here."""
        self._sequences[topic] += count

    def flush(self):
        """End the chunk: everything written is in the file when this returns."""
        if not self._chunk:
            return
        raw = bytes(self._chunk)
        first = min(min(index[::2]) for index in self._index if index)
        last = max(max(index[::2]) for index in self._index if index)
        data = self._compress(raw)
        builder = RecordBuilder()
        records.Chunk(compression='zstd', data=data, message_start_time=first, message_end_time=last,
                      uncompressed_crc=zlib.crc32(raw), uncompressed_size=len(raw)).write(builder)
        length = builder.count
        offsets = {}
        for channel, index in enumerate(self._index, 1):
            if index:
                offsets[channel] = self._end + builder.count
                builder.write(struct.pack(f'<BQHI{len(index)}Q', Opcode.MESSAGE_INDEX, 6 + 8 * len(index), channel,
                                          8 * len(index), *index))
        chunk_index = records.ChunkIndex(
            chunk_start_offset=self._end, chunk_length=length, message_start_time=first, message_end_time=last,
            message_index_offsets=offsets, message_index_length=builder.count - length, compression='zstd',
            compressed_size=len(data), uncompressed_size=len(raw))
        chunk_lists, self._index = self._index, [[] for _ in self.topics]
        self._chunk = bytearray()
        if self._full:
            return
        self._full = True
        self._put(builder.end())
        self._full = False
        self._chunk_indexes.append(chunk_index)
        self.counts = [count + len(index) // 2 for count, index in zip(self.counts, chunk_lists)]
        self._first = first if self._first is None else min(self._first, first)
        self._last = max(self._last, last)

    @property
    def messages(self):
        """How many messages were written."""
        return sum(self.counts) + sum(map(len, self._index)) // 2

    def close(self):
        """Write what is left, the summary and metadata.yaml; on a full disk whatever of it fits, then BagError."""
        error = None
        for put in (self.flush, self._put_summary, self._put_metadata_file):
            try:
                put()
            except BagError as failed:
                error = error or failed
        self._stream.close()
        if error:
            raise error

    def _put_summary(self):
        builder = RecordBuilder()
        records.DataEnd(data_section_crc=0).write(builder)
        data_end = builder.count
        groups = (
            (Opcode.SCHEMA, self._schemas), (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [records.Statistics(
                attachment_count=0, channel_count=len(self._channels), chunk_count=len(self._chunk_indexes),
                channel_message_counts={number: count for number, count in enumerate(self.counts, 1) if count},
                message_count=sum(self.counts), message_start_time=self._first or 0, message_end_time=self._last,
                metadata_count=1, schema_count=len(self._schemas))]),
            (Opcode.CHUNK_INDEX, self._chunk_indexes),
            (Opcode.METADATA_INDEX, [records.MetadataIndex(offset=self._metadata_at, length=self._metadata_length,
                                                           name='pedestal')]))
        offsets = []
        for opcode, group in groups:
            start = builder.count
            for record in group:
                record.write(builder)
            offsets.append(records.SummaryOffset(group_opcode=opcode, group_start=self._end + start,
                                                 group_length=builder.count - start))
        offset_start = self._end + builder.count
        for offset in offsets:
            if offset.group_length:
                offset.write(builder)
        data = builder.end()
        start = self._end + data_end
        crc = zlib.crc32(struct.pack('<BQQQ', Opcode.FOOTER, 20, start, offset_start), zlib.crc32(data[data_end:]))
        footer = RecordBuilder()
        records.Footer(summary_start=start, summary_offset_start=offset_start, summary_crc=crc).write(footer)
        self._put(data + footer.end() + MAGIC)

    def _put_metadata_file(self):
        start, duration = self._first or 0, self._last - (self._first or 0)
        total = sum(self.counts)
        times = {'duration': {'nanoseconds': duration}, 'starting_time': {'nanoseconds_since_epoch': start}}
        information = {
            'version': 9, 'storage_identifier': 'mcap', **times, 'message_count': total,
            'topics_with_message_count': [
                {'topic_metadata': {'name': channel.topic, 'type': topic.type, 'serialization_format': 'cdr',
                                    'offered_qos_profiles': _qos(topic.qos),
                                    'type_description_hash': channel.metadata['topic_type_hash']},
                 'message_count': count}
                for topic, channel, count in zip(self.topics, self._channels, self.counts)],
            'compression_format': '', 'compression_mode': '', 'relative_file_paths': [self.file.name],
            'files': [{'path': self.file.name, **times, 'message_count': total}],
            'custom_data': self.metadata or None, 'ros_distro': 'jazzy'}
        file = self.path / 'metadata.yaml'
        try:
            file.write_text(yaml.safe_dump({'rosbag2_bagfile_information': information}, sort_keys=False))
        except OSError as error:
            file.unlink(missing_ok=True)
            raise BagError(f'{file}: {_reason(error)}') from None


def read(path):
    """The Bag in a directory or an .mcap file. Raises BagError when it is missing, empty, damaged or foreign."""
    bag = load(path)
    if bag.damage:
        raise BagError(f'{bag.file}: {bag.damage}')
    return bag


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
    path = pathlib.Path(path)
    try:
        files = sorted(path.glob('*.mcap')) if path.is_dir() else [path]
        if len(files) != 1:
            raise BagError(f'{path}: {len(files)} .mcap files in it where one belongs')
        data = files[0].read_bytes()
    except OSError as error:
        raise BagError(f'{path}: {_reason(error)}') from None
    return Bag(path, files[0], data)


class Bag:
    """A recording.

    topics: {name without the leading '/': type}; metadata: {text: text} of the run (the record `pedestal`);
    index: record array in the order of the file, one row per message: channel, sequence, log, publish [ns], chunk,
    start, stop (where its bytes are); statistics: {name: count} as the file's summary says, None without one.
    """

    def __init__(self, path, file, data):
        self.path, self.file = path, file
        self.topics, self.metadata, self.statistics, self.damage = {}, {}, None, ''
        self._data = data
        self._schemas, self._channels, self._chunks = {}, {}, []
        self._chunk = functools.lru_cache(maxsize=256)(self._decompress)
        rows = []
        if not data:
            raise BagError(f'{file}: empty file')
        if data[:8] != MAGIC:
            raise BagError(f'{file}: not an MCAP file')
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
            except EOFError:
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
        unpack, add = _MESSAGE.unpack_from, rows.append
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
                raise EOFError(f'{channel.topic} is encoded as {channel.message_encoding!r}: not a ROS 2 recording')
            self._channels[channel.id] = channel.topic.lstrip('/')
            self.topics[channel.topic.lstrip('/')] = self._schemas[channel.schema_id]
        elif opcode == Opcode.METADATA:
            record = records.Metadata.read(stream)
            if record.name == 'pedestal':
                self.metadata = record.metadata
        elif opcode == Opcode.STATISTICS:
            counts = records.Statistics.read(stream).channel_message_counts
            self.statistics = {name: counts.get(channel, 0) for channel, name in self._channels.items()}

    def _decompress(self, number):
        at, length = self._chunks[number]
        chunk = records.Chunk.read(ReadDataStream(io.BytesIO(self._data[at:at + length])))
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        return stream.read(size)

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
            return columns.table([data for _, _, _, data in self.raw(topic)], self.topics[topic.lstrip('/')], rows.log)
        except ValueError as error:
            raise BagError(f'{self.path}: {topic}: {error}') from None
