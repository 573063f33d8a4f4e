"""Writing of a bag, the recording of a run: a rosbag2 directory (metadata.yaml version 9) with an MCAP file, without
ROS.

The Writer of the mcap library makes the records of the file. This module adds four properties:

    chunks        A chunk (a group of messages) ends after one second of log time, so a crash loses one second at most.
    full disk     The file stays readable if the disk is full.
    lock          The file is locked while it is written.
    declarations  All schemas (message types) and channels (topics) also stand before the first chunk. A broken chunk
                  therefore does not lose them.

The file does not depend on its path, the host or the wall clock, so equal messages give equal bytes.

A recorder that died in a realtime run may be started again. It continues in a new file of the bag, NAME_1.mcap and so
on, until a file reaches the planned end of the run.
"""
import collections
import contextlib
import fcntl
import io
import os
import pathlib
import struct
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from typing import IO, cast

import yaml
from mcap import records, writer
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode

from pedestal_common.graph import nodes, topics
from pedestal_common.quantities import Json, Nanoseconds
from pedestal_common.text_files import plain_yaml
from pedestal_common.wire import messages
from pedestal_recording.bag import planned_end
from pedestal_recording.bag_files import locate
from pedestal_recording.mcap_file import MESSAGE_HEAD, BagError, McapFile, frames, reason, walk

TARGET_CHUNK_BYTES = 1_000_000
TARGET_CHUNK_SPAN_NS = 1_000_000_000
TARGET_CHUNK_MESSAGES = 100_000  # size [bytes], span of log times [ns] and number of messages after which a chunk ends

COMMON_METADATA_KEYS = ('scenario', 'pacing', 'seed', 'planned_end_ns')
"""Keys of the metadata with equal values in all files of a bag."""

_DECLARED = Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA  # kinds of records that describe the messages of a file

_INFINITE = {'sec': 9223372036, 'nsec': 854775807}
"""Duration by which rosbag2 states that a quality of service has no limit."""

_PAIR, _INDEX = struct.Struct('<QQ'), struct.Struct('<HI')
"""_PAIR: first and last log time of a chunk [ns]; an entry of a message index has the size of such a pair.

_INDEX: begin of a message index, with the number of a channel and the size of all entries [bytes]. A message index
lists the messages of one channel in a chunk.
"""


def _qos(rate: str) -> list[dict[str, object]]:
    """Return the field offered_qos_profiles of rosbag2 for a topic, from its rate in the table of topics."""
    depth, latched = topics.QOS_BY_RATE[rate].lockstep, topics.QOS_BY_RATE[rate].latched
    return [{'history': 'keep_last' if depth else 'keep_all', 'depth': depth, 'reliability': 'reliable',
             'durability': 'transient_local' if latched else 'volatile',
             'deadline': dict(_INFINITE), 'lifespan': dict(_INFINITE), 'liveliness': 'automatic',
             'liveliness_lease_duration': dict(_INFINITE), 'avoid_ros_namespace_conventions': False}]


def _store(descriptor: int) -> None:
    """Let the disk store a file, and close its descriptor. The next write to the file reports an error of the disk."""
    with contextlib.suppress(OSError):
        os.fdatasync(descriptor)
    os.close(descriptor)


class _Disk:
    """Output stream of the Writer of the mcap library. The bytes between two flushes reach the file all or not at all.

    size: number of bytes at its beginning that are already written, and not written again.
    """

    def __init__(self, path: pathlib.Path, stream: io.FileIO, size: int = 0) -> None:
        self.path, self.stream, self.end = path, stream, 0
        self._size, self._pending = size, bytearray()

    def write(self, data: bytes) -> None:
        """Keep bytes for the next flush."""
        self._pending += data

    def tell(self) -> int:
        """Return the position of the next byte in the file."""
        return self.end + len(self._pending)

    def flush(self) -> None:
        """Write the kept bytes to the file. If the disk does not take them, restore the file; raises BagError."""
        data, self._pending = bytes(self._pending), bytearray()
        if self.end >= self._size:
            view = memoryview(data)
            try:
                while view:
                    view = view[self.stream.write(view):]
            except OSError as error:
                self.stream.seek(self.end)
                self.stream.truncate()
                raise BagError(f'{self.path}: {reason(error)}') from None
        self.end += len(data)


class BagFile:
    """A bag that is being written; the directory must not exist, unless the bag has earlier files.

    Raises BagError with the name of the file if the disk is full. The earlier chunks then stay readable. All later
    messages are dropped, so a bag has no gap.
    """

    def __init__(self, directory: str | pathlib.Path, earlier: Sequence[pathlib.Path] = ()) -> None:
        self.path = pathlib.Path(directory).absolute()  # of the bag
        # MCAP file that is being written
        self.file = self.path / f'{self.path.name}_{len(earlier)}.mcap'
        self._earlier = list(earlier)
        try:
            self.path.mkdir(parents=True, exist_ok=bool(earlier))
            stream = open(self.file, 'xb', buffering=0)
        except FileExistsError:
            raise BagError(f'{directory} exists already; a recording is never overwritten') from None
        except OSError as error:
            raise BagError(f'{directory}: {reason(error)}') from None
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(stream, fcntl.LOCK_EX)
        self._full = False
        self._storing: threading.Thread | None = None
        self._in_file = self._in_chunk = self._chunk_size = self._chunk_start = 0
        self._start(_Disk(self.file, stream))

    def _start(self, disk: _Disk) -> None:
        self._disk = disk
        self._mcap = writer.Writer(cast(IO[bytes], disk), chunk_size=sys.maxsize)  # flush() alone ends a chunk
        self._mcap.start('ros2', 'pedestal')

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Add a message type: its name, and its definition in an encoding such as 'ros2msg'. Return its number."""
        number = self._mcap.register_schema(name, encoding, data)
        return self._declared(records.Schema(id=number, name=name, encoding=encoding, data=data))

    def add_channel(self, topic: str, schema: int, metadata: dict[str, str]) -> int:
        """Add a topic of CDR messages: its name with '/', and the number of its schema. Return its number."""
        number = self._mcap.register_channel(topic, 'cdr', schema, metadata)
        return self._declared(records.Channel(id=number, topic=topic, message_encoding='cdr', schema_id=schema,
                                              metadata=metadata))

    def _declared(self, record: records.Schema | records.Channel) -> int:
        """Write a schema or channel before the first chunk too, and return its number."""
        builder = RecordBuilder()
        record.write(builder)
        self._disk.write(builder.end())
        return record.id

    def add_metadata(self, name: str, content: dict[str, str]) -> None:
        """Add a metadata record. close() repeats the record `pedestal` in metadata.yaml."""
        self._mcap.add_metadata(name, content)

    def add_message(self, channel: int, sequence: int, log_time: Nanoseconds, publish_time: Nanoseconds,
                    data: bytes) -> None:
        """Add the CDR bytes of a message."""
        if self._full:
            return
        if not self._in_chunk:
            self._chunk_start = log_time
        elif (log_time - self._chunk_start >= TARGET_CHUNK_SPAN_NS or self._chunk_size >= TARGET_CHUNK_BYTES
              or self._in_chunk >= TARGET_CHUNK_MESSAGES):
            self.flush()
            self._chunk_start = log_time
        self._in_chunk += 1
        self._chunk_size += len(data)
        self._mcap.add_message(channel, log_time, data, publish_time, sequence)

    def flush(self) -> None:
        """End the chunk, which writes all added messages to the file. Raises BagError if the disk is full."""
        added, self._in_chunk, self._chunk_size = self._in_chunk, 0, 0
        if self._full:
            return
        try:
            self._mcap.flush()
        except BagError:
            self._full = True
            raise
        self._in_file += added

    def synchronise(self) -> None:
        """Let the disk store what is in the file, in a thread, because this may take seconds. Without this call the
        kernel may keep it in memory for half a minute, and a power cut would lose it."""
        if self._storing is None or not self._storing.is_alive():
            self._storing = threading.Thread(target=_store, args=(os.dup(self._disk.stream.fileno()),), daemon=True)
            self._storing.start()

    @property
    def messages(self) -> int:
        """Number of added messages, without those dropped on a full disk."""
        return self._in_file + self._in_chunk

    def close(self) -> None:
        """Write the last chunk, the summary and metadata.yaml, on a full disk as far as it fits. Raises BagError."""
        with contextlib.closing(self._disk.stream):
            try:
                self.flush()
            finally:
                if self._full:
                    self._truncate_after_disk_full()
                self._mcap.finish()
                self._disk.flush()
                self._write_metadata_file()

    def _truncate_after_disk_full(self) -> None:
        """Replace the Writer of the library by a new Writer that counts only the chunks in the file.

        Because a Writer cannot take back a chunk, its summary would list the chunk that the disk did not take. The new
        Writer receives the content of the file again, and _Disk skips the bytes that are already written.
        """
        self._start(_Disk(self.file, self._disk.stream, self._disk.end))
        file = McapFile(self.file, locked=True)
        with contextlib.suppress(EOFError):
            for _, _, _, content in walk(file, (*_DECLARED, Opcode.CHUNK)):
                if isinstance(content, records.Schema):
                    self.add_schema(content.name, content.encoding, content.data)
                elif isinstance(content, records.Channel):
                    self.add_channel(content.topic, content.schema_id, content.metadata)
                elif isinstance(content, records.Metadata):
                    self.add_metadata(content.name, content.metadata)
                elif isinstance(content, bytes):
                    for kind, at, end in frames(content):
                        if kind == Opcode.MESSAGE:
                            _, channel, sequence, log, publish = MESSAGE_HEAD.unpack_from(content, at)
                            self._mcap.add_message(channel, log, content[at + MESSAGE_HEAD.size:end], publish,
                                                   sequence)
                    self._mcap.flush()
        self._mcap.flush()

    def _write_metadata_file(self) -> None:
        contents = [_Content(file) for file in (*self._earlier, self.file)]
        files = [{'path': content.path.name, **_times([content]), 'message_count': content.total}
                 for content in contents]
        described: dict[str, dict[str, Json]] = {}
        counts: collections.Counter[str] = collections.Counter()
        for content in contents:
            for channel, schema, count in content.topics():
                counts[channel.topic] += count
                described[channel.topic] = {
                    'name': channel.topic, 'type': schema, 'serialization_format': 'cdr',
                    'offered_qos_profiles': _profiles(channel),
                    'type_description_hash': channel.metadata.get('topic_type_hash', '')}
        custom, last = dict(contents[0].metadata.get('pedestal', {})), max(content.last for content in contents)
        planned = planned_end(contents[0].metadata)
        if planned is not None:
            custom['finished'] = str(last >= planned).lower()
        information = {
            'version': 9, 'storage_identifier': 'mcap', **_times(contents),
            'message_count': sum(content.total for content in contents),
            'topics_with_message_count': [{'topic_metadata': topic, 'message_count': counts[name]}
                                          for name, topic in described.items()],
            'compression_format': '', 'compression_mode': '',
            'relative_file_paths': [content.path.name for content in contents], 'files': files,
            'custom_data': custom or None, 'ros_distro': 'jazzy'}
        file = self.path / 'metadata.yaml'
        try:
            file.write_text(yaml.safe_dump({'rosbag2_bagfile_information': information}, sort_keys=False))
        except OSError as error:
            file.unlink(missing_ok=True)
            raise BagError(f'{file}: {reason(error)}') from None


class _Content:
    """Summary of an MCAP file of the recorder, which need not be whole: its recorder may have been killed.

    first, last: log times of its first and last message, 0 without a message.
    """

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self.metadata: dict[str, dict[str, str]] = {}
        self._channels: dict[int, records.Channel] = {}
        self._schemas: dict[int, str] = {}
        self._counts: collections.Counter[int] = collections.Counter()
        times: list[Nanoseconds] = []
        file = McapFile(path, locked=True)
        with contextlib.suppress(EOFError):
            for opcode, start, _, content in walk(file, _DECLARED):
                if opcode == Opcode.CHUNK:
                    times += _PAIR.unpack(file.read(start + 9, start + 9 + _PAIR.size))
                elif opcode == Opcode.MESSAGE_INDEX:
                    channel, size = _INDEX.unpack(file.read(start + 9, start + 9 + _INDEX.size))
                    self._counts[channel] += size // _PAIR.size
                elif isinstance(content, records.Metadata):
                    self.metadata[content.name] = content.metadata
                elif isinstance(content, records.Schema):
                    self._schemas[content.id] = content.name
                elif isinstance(content, records.Channel):
                    self._channels[content.id] = content
        self.first, self.last, self.total = min(times, default=0), max(times, default=0), self._counts.total()

    def topics(self) -> Iterator[tuple[records.Channel, str, int]]:
        """Yield (channel, name of its type, number of messages) of every topic."""
        for number, channel in self._channels.items():
            yield channel, self._schemas[channel.schema_id], self._counts[number]


def _times(contents: Sequence[_Content]) -> dict[str, dict[str, Nanoseconds]]:
    """Return the duration and the start of some files as fields of metadata.yaml."""
    known = [content for content in contents if content.total] or contents[:1]
    start, end = min(content.first for content in known), max(content.last for content in known)
    return {'duration': {'nanoseconds': end - start}, 'starting_time': {'nanoseconds_since_epoch': start}}


def _profiles(channel: records.Channel) -> Json:
    try:
        return plain_yaml.parse(channel.metadata.get('offered_qos_profiles', ''), aliases=True) or []
    except yaml.YAMLError:
        return []


def _earlier_files(directory: str | pathlib.Path, metadata: Mapping[str, object]) -> list[pathlib.Path]:
    """Return the files of an unfinished bag in a directory, which a restarted recorder may continue; [] without a bag.

    The bag must be of a realtime run with equal values of COMMON_METADATA_KEYS. Raises BagError for any other bag,
    and while its recorder still writes it.
    """
    path = pathlib.Path(directory)
    if metadata.get('pacing') != 'realtime' or not any(path.glob('*.mcap')):
        return []
    files = locate(path)
    if not files[-1].stat().st_size:  # the recorder died before the first byte
        files.pop().unlink()
        if not files:
            path.rmdir()
            return []
    McapFile(files[-1])
    earlier = _Content(files[0]).metadata.get('pedestal', {})
    if any(earlier.get(key) != str(metadata[key]) for key in COMMON_METADATA_KEYS if key in metadata):
        raise BagError(f'{directory} exists already and is of another run; a recording is never overwritten')
    try:
        information = plain_yaml.read(path / 'metadata.yaml')['rosbag2_bagfile_information']
        finished = information['custom_data'].get('finished') != 'false'
    except FileNotFoundError:  # the recorder was killed
        finished = False
    except (OSError, UnicodeDecodeError, yaml.YAMLError, KeyError, TypeError, AttributeError):
        finished = True
    if finished:
        raise BagError(f'{directory} exists already; a recording is never overwritten')
    return files


class Writer(BagFile):
    """A bag of topics of the graph that is being written. The messages of each topic are numbered from 1.

    The directory must not exist, or must hold an unfinished bag to continue (_earlier_files). The methods take the
    index of a topic in `rows`. metadata: those of the run, for the record `pedestal`; more: further records by name.
    """

    def __init__(self, directory: str | pathlib.Path, rows: Sequence[nodes.Link | topics.Topic],
                 metadata: Mapping[str, object], more: Mapping[str, Mapping[str, str]] | None = None) -> None:
        super().__init__(directory, _earlier_files(directory, metadata))
        schemas = {name: self.add_schema(name, 'ros2msg', messages.definition(name))
                   for name in dict.fromkeys(topic.type for topic in rows)}
        self._channels = [self.add_channel('/' + topic.name, schemas[topic.type], {
            'offered_qos_profiles': yaml.safe_dump(_qos(topic.rate), sort_keys=False),
            'topic_type_hash': messages.ROS_TYPESTORE.hash_rihs01(topic.type)}) for topic in rows]
        self._sequences = [0] * len(rows)
        for name, content in (('pedestal', metadata), *(more or {}).items()):
            self.add_metadata(name, {str(key): str(value) for key, value in content.items()})
        self.flush()

    def write(self, topic: int, log_time: Nanoseconds, publish_time: Nanoseconds, data: bytes) -> None:
        """Add a message to a topic."""
        self._sequences[topic] = sequence = self._sequences[topic] + 1
        self.add_message(self._channels[topic], sequence & 0xffffffff, log_time, publish_time, data)

    def write_foreign(self, topic: int, log_time: Nanoseconds, publish_time: Nanoseconds, data: bytes) -> None:
        """Add a message of another publisher than that of the graph, with the sequence number 0."""
        self.add_message(self._channels[topic], 0, log_time, publish_time, data)

    def skip(self, topic: int, count: int) -> None:
        """Leave a gap in the sequence numbers of a topic, for messages that did not reach the recorder."""
        self._sequences[topic] += count
