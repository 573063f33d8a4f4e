"""A bag in the making: one MCAP file, record by record, its summary and metadata.yaml (version 9). No ROS here.

Built from the records of the `mcap` library. Its Writer class is not used: it costs 4 to 6 us a message where
bag.Writer, on top of this, costs 1 (a dataclass, eight packs and three seeks per message against one pack), and at 11
topics the recorder shares two cores with the loop it records.

Nothing in the MCAP file depends on its path, the host or the wall clock: equal records give equal bytes.
"""
import collections
import contextlib
import fcntl
import pathlib
import struct
import zlib

import yaml
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode

MAGIC = b'\x89MCAP0\r\n'
MESSAGE = struct.Struct('<BQHIQQ')
"""Opcode, length, channel, sequence, log and publish time: the head of a message record, its bytes follow."""


class BagError(ValueError):
    """A bag cannot be written or read; one line that names the file and what is wrong with it."""


def reason(error):
    """An OSError without the path."""
    return error.strerror or str(error)


def compressed(raw, first, last):
    """The Chunk record of message records (and declarations) with log times from first to last [ns]."""
    return records.Chunk(compression='zstd', data=zstandard.ZstdCompressor(level=1).compress(raw),
                         message_start_time=first, message_end_time=last, uncompressed_crc=zlib.crc32(raw),
                         uncompressed_size=len(raw))


class Container:
    """A directory, which must not exist, with the MCAP file in it. While it is open the file is locked (flock).

    Raises BagError, naming the file, when the disk does not take a record. What was written by then stays readable;
    no chunk is written after it, so that a bag has no hole.
    """

    def __init__(self, directory):
        self.path = pathlib.Path(directory).absolute()
        self.file = self.path / f'{self.path.name}_0.mcap'
        try:
            self.path.mkdir(parents=True)
            self._stream = open(self.file, 'xb', buffering=0)
        except FileExistsError:
            raise BagError(f'{directory} exists already; a recording is never overwritten') from None
        except OSError as error:
            raise BagError(f'{directory}: {reason(error)}') from None
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(self._stream, fcntl.LOCK_EX)
        self.schemas, self.channels = {}, {}
        self.counts = collections.Counter()
        self._metadata_indexes, self._chunk_indexes = [], []
        self._custom_data = None
        self._first, self._last = None, 0
        self._end = 0
        self._full = False
        head = RecordBuilder()
        head.write(MAGIC)
        records.Header(profile='ros2', library='pedestal').write(head)
        self._put(head.end())

    def _put(self, data):
        """Append, or leave the file as it was."""
        view = memoryview(data)
        try:
            while view:
                view = view[self._stream.write(view):]
        except OSError as error:
            self._stream.seek(self._end)
            self._stream.truncate()
            raise BagError(f'{self.file}: {reason(error)}') from None
        self._end += len(data)

    def know(self, record):
        """A Schema or Channel that a chunk declares; it is repeated in the summary."""
        (self.schemas if isinstance(record, records.Schema) else self.channels)[record.id] = record

    def add(self, *new):
        """Append Schema, Channel and Metadata records. The one named `pedestal` is custom_data of metadata.yaml."""
        builder = RecordBuilder()
        for record in new:
            at = builder.count
            record.write(builder)
            if not isinstance(record, records.Metadata):
                self.know(record)
                continue
            self._metadata_indexes.append(records.MetadataIndex(offset=self._end + at, length=builder.count - at,
                                                                name=record.name))
            if record.name == 'pedestal':
                self._custom_data = record.metadata
        self._put(builder.end())

    def add_chunk(self, chunk, index):
        """Append a Chunk record. index: {channel id: [log time, offset in the chunk, and so on]}."""
        if self._full:
            return
        builder = RecordBuilder()
        chunk.write(builder)
        length = builder.count
        offsets = {}
        for channel, places in index.items():
            offsets[channel] = self._end + builder.count
            builder.write(struct.pack(f'<BQHI{len(places)}Q', Opcode.MESSAGE_INDEX, 6 + 8 * len(places), channel,
                                      8 * len(places), *places))
        chunk_index = records.ChunkIndex(
            chunk_start_offset=self._end, chunk_length=length, message_start_time=chunk.message_start_time,
            message_end_time=chunk.message_end_time, message_index_offsets=offsets,
            message_index_length=builder.count - length, compression=chunk.compression,
            compressed_size=len(chunk.data), uncompressed_size=chunk.uncompressed_size)
        self._full = True
        self._put(builder.end())
        self._full = False
        self._chunk_indexes.append(chunk_index)
        if index:
            self.counts.update({channel: len(places) // 2 for channel, places in index.items()})
            first, last = chunk.message_start_time, chunk.message_end_time
            self._first = first if self._first is None else min(self._first, first)
            self._last = max(self._last, last)

    def close(self):
        """Write the summary and metadata.yaml; on a full disk whatever of it fits, then BagError."""
        error = None
        for put in (self._put_summary, self._put_metadata_file):
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
            (Opcode.SCHEMA, self.schemas.values()), (Opcode.CHANNEL, self.channels.values()),
            (Opcode.STATISTICS, [records.Statistics(
                attachment_count=0, channel_count=len(self.channels), chunk_count=len(self._chunk_indexes),
                channel_message_counts={channel: self.counts[channel] for channel in self.channels
                                        if self.counts[channel]},
                message_count=self.counts.total(), message_start_time=self._first or 0, message_end_time=self._last,
                metadata_count=len(self._metadata_indexes), schema_count=len(self.schemas))]),
            (Opcode.CHUNK_INDEX, self._chunk_indexes),
            (Opcode.METADATA_INDEX, self._metadata_indexes))
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
        total = self.counts.total()
        times = {'duration': {'nanoseconds': duration}, 'starting_time': {'nanoseconds_since_epoch': start}}
        information = {
            'version': 9, 'storage_identifier': 'mcap', **times, 'message_count': total,
            'topics_with_message_count': [
                {'topic_metadata': {'name': channel.topic, 'type': self.schemas[channel.schema_id].name,
                                    'serialization_format': 'cdr',
                                    'offered_qos_profiles': _profiles(channel),
                                    'type_description_hash': channel.metadata.get('topic_type_hash', '')},
                 'message_count': self.counts[channel.id]}
                for channel in self.channels.values()],
            'compression_format': '', 'compression_mode': '', 'relative_file_paths': [self.file.name],
            'files': [{'path': self.file.name, **times, 'message_count': total}],
            'custom_data': self._custom_data or None, 'ros_distro': 'jazzy'}
        file = self.path / 'metadata.yaml'
        try:
            file.write_text(yaml.safe_dump({'rosbag2_bagfile_information': information}, sort_keys=False))
        except OSError as error:
            file.unlink(missing_ok=True)
            raise BagError(f'{file}: {reason(error)}') from None


def _profiles(channel):
    try:
        return yaml.safe_load(channel.metadata.get('offered_qos_profiles', '')) or []
    except yaml.YAMLError:
        return []
