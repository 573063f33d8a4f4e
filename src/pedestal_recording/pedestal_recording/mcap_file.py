"""Reading of one MCAP file, the file of a recording. `walk` is the only walk over the records of a file.

An MCAP file is a series of records. A record is its opcode (1 byte, the kind of the record), the length of its content
(8 bytes) and its content. A channel is the record of a topic, and a schema is the record of a message type. A chunk is
a record that holds further records, compressed or not.

A few bytes of a compressed chunk can stand for gigabytes of zeros, or for millions of empty messages. Therefore
MAX_CHUNK_BYTES, UNPACKED_LIMITS and MESSAGE_LIMITS limit time and memory, in proportion to the length of the file.
"""
import contextlib
import fcntl
import io
import mmap
import os
import pathlib
import re
import struct
import zlib
from collections.abc import Callable, Container, Iterator
from typing import TypeAlias

import lz4.frame
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from pedestal_common.text_files import files

MAGIC = MCAP0_MAGIC     # first and last bytes of an MCAP file
MAX_CHUNK_BYTES = 32_000_000  # largest size of a chunk, compressed or unpacked [bytes]

UNPACKED_LIMITS = 32_000_000, 200
"""Largest size of all unpacked chunks of a file [bytes]: a base, and an addition for each byte of the file."""

MESSAGE_LIMITS = 500_000, 0.25
"""Largest number of messages in a file: a base, and an addition for each byte of the file."""

MESSAGE_HEAD = struct.Struct('<xQHIQQ')
"""Head of a message record: opcode (skipped), length of the content, number of the channel, sequence number, log time
and publish time [ns]. The CDR bytes of the message follow."""

END_OPCODES = Opcode.DATA_END, Opcode.FOOTER    # kinds of records that end the messages of a file

Data: TypeAlias = bytes | mmap.mmap     # of a file or of a chunk
Content: TypeAlias = records.McapRecord | bytes | None  # of a record; bytes: the records in a chunk, or messages

SQLITE_MAGIC = b'SQLite format 3'
ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'  # first bytes of an SQLite file, and of data in the compression zstd

COMPRESSED_MAGIC = {
    ZSTD_MAGIC: ('zstd', 'zstd -dc'), b'\x1f\x8b': ('gzip', 'gunzip -c'), b'\xfd7zXZ': ('xz', 'xz -dc'),
    b'BZh': ('bzip2', 'bzip2 -dc'), b'\x04\x22\x4d\x18': ('lz4', 'lz4 -dc'), b'PK\x03\x04': ('zip', 'unzip -p')}
"""{first bytes of a compressed file: (its format, the command that writes its content to the standard output)}."""

_RECORD = struct.Struct('<BQ')
"""Opcode of a record, and length of its content [bytes]. The content begins after these 9 bytes."""
_WINDOW = 1_000_000
"""Number of bytes that one access reads from the disk. It is also the largest size of messages that `walk` joins."""
_COMPRESSION = re.compile(rb'\x04\x00\x00\x00zstd|\x03\x00\x00\x00lz4')
"""Length and name of the compression in a chunk record. The search for intact chunks looks for these bytes."""
_BEFORE_COMPRESSION = 9 + 8 + 8 + 8 + 4
"""Length of a chunk record before the name of its compression [bytes].

It consists of opcode and length, first and last log time, unpacked size, checksum, and length of the name.
"""
_LENGTH = struct.Struct('<Q')  # length of the compressed data in a chunk record [bytes]
_READ: dict[int, Callable[[ReadDataStream], records.McapRecord]] = {
    Opcode.HEADER: records.Header.read, Opcode.SCHEMA: records.Schema.read, Opcode.CHANNEL: records.Channel.read,
    Opcode.METADATA: records.Metadata.read, Opcode.STATISTICS: records.Statistics.read,
    Opcode.CHUNK: records.Chunk.read, Opcode.FOOTER: records.Footer.read,
    Opcode.MESSAGE_INDEX: records.MessageIndex.read}
"""{kind of record: function of the mcap library that reads its content}."""


class BagError(ValueError):
    """Error of a bag that cannot be written or read. Its text is one line with the file and the problem."""


def reason(error: OSError) -> str:
    """Return the text of an OSError without the path."""
    return error.strerror or str(error)


def frame(data: Data, at: int) -> tuple[int, int]:
    """Return (opcode, stop) of the record at a position of data. Raises ValueError if no whole record begins there."""
    if at + 9 > len(data):
        raise ValueError('the file ends')
    opcode, length = _RECORD.unpack_from(data, at)
    if not Opcode.HEADER <= opcode <= Opcode.DATA_END:
        raise ValueError('its first byte is no opcode of MCAP')
    if at + 9 + length > len(data):
        raise ValueError('the file ends inside a record')
    return opcode, at + 9 + length


def frames(data: Data, start: int = 0, stop: int | None = None) -> Iterator[tuple[int, int, int]]:
    """Yield (opcode, start, stop) of each record in data[start:stop]. Raises ValueError for bytes without a record."""
    end = len(data) if stop is None else stop
    while start < end:
        opcode, after = frame(data, start)
        yield opcode, start, after
        start = after


def parsed(opcode: int, content: bytes) -> records.McapRecord | None:
    """Return a record from its content; None for a kind not read here."""
    return _READ[opcode](ReadDataStream(io.BytesIO(content))) if opcode in _READ else None


def unpacked(chunk: records.Chunk) -> bytes:
    """Return the records in a chunk as bytes, decompressed.

    Raises ValueError for a chunk above MAX_CHUNK_BYTES, in an unknown compression, of another length than its header
    states, or with a wrong checksum.
    """
    size = chunk.uncompressed_size
    if max(size, len(chunk.data)) > MAX_CHUNK_BYTES:
        raise ValueError(f'a chunk of {size} bytes, must be at most {MAX_CHUNK_BYTES}')
    try:
        data = _UNPACK[chunk.compression](chunk.data, size)
    except KeyError:
        raise ValueError(f'a chunk compressed by {chunk.compression!r}, must be zstd, lz4 or none') from None
    except (zstandard.ZstdError, RuntimeError, EOFError):  # lz4 raises RuntimeError
        raise ValueError('a corrupted chunk') from None
    if len(data) != size:
        raise ValueError('a chunk whose length differs from its header')
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError('a corrupted chunk')
    return data


def _zstd(data: bytes, size: int) -> bytes:
    """Return the decompressed bytes, b'' if the frame states another length than `size`.

    Memory for a frame that states a false length is therefore never allocated.
    """
    if not size or zstandard.frame_content_size(data) not in (-1, size):
        return b''
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)


_UNPACK: dict[str, Callable[[bytes, int], bytes]] = {
    '': lambda data, size: data, 'zstd': _zstd,
    'lz4': lambda data, size: lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)}
"""{name of a compression: function(compressed bytes, size of the unpacked bytes) -> unpacked bytes}."""


class McapFile:
    """An open MCAP file, which is read in pieces. locked: True if this process itself holds the lock of the file.

    Raises BagError if the file is missing, empty, not regular or not MCAP, or while its recorder still writes it.
    """

    def __init__(self, path: pathlib.Path, locked: bool = False) -> None:
        self.path = path
        try:
            self._stream = files.open_regular(path)
            self.size = os.fstat(self._stream.fileno()).st_size
            if not locked:
                self._check_lock()
            self._start, self._window = 0, b''
            head = self.read(0, len(SQLITE_MAGIC))
        except OSError as error:
            raise BagError(f'{path}: {reason(error)}') from None
        if not head:
            raise BagError(f'{path}: empty file')
        if head == SQLITE_MAGIC:
            raise BagError(f'{path}: an SQLite bag, not an MCAP file; `ros2 bag convert` converts it')
        for magic, (name, command) in COMPRESSED_MAGIC.items():
            if head.startswith(magic):
                plain = path.with_suffix('') if path.with_suffix('').suffix == '.mcap' else f'{path.stem}_plain.mcap'
                raise BagError(f'{path}: compressed as a whole ({name}); `{command} {path} > {plain}` decompresses it')
        if not head.startswith(MAGIC):
            raise BagError(f'{path}: not an MCAP file')
        self._left = UNPACKED_LIMITS[0] + UNPACKED_LIMITS[1] * self.size
        self._messages = 0

    def _check_lock(self) -> None:
        try:
            fcntl.flock(self._stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
            fcntl.flock(self._stream, fcntl.LOCK_UN)
        except BlockingIOError:
            raise BagError(f'{self.path}: is being written; wait until its recorder has ended') from None
        except OSError:  # a file system without locks
            pass

    def read(self, start: int, stop: int) -> bytes:
        """Return the bytes at [start, stop) of the file, fewer at its end."""
        if stop - start > _WINDOW:
            return os.pread(self._stream.fileno(), stop - start, start)
        if start < self._start or stop > self._start + len(self._window):
            self._start, self._window = start, os.pread(self._stream.fileno(), _WINDOW, start)
        return self._window[start - self._start:stop - self._start]

    def mapped(self) -> mmap.mmap:
        """Return the bytes of the file, as a context."""
        return mmap.mmap(self._stream.fileno(), 0, access=mmap.ACCESS_READ)

    def frame(self, at: int) -> tuple[int, int]:
        """Return (opcode, stop) of the record at a byte of the file. Raises EOFError if the file ends early there."""
        if at + 9 > self.size:
            raise EOFError(f'the file ends at byte {self.size} without a summary (recorder killed, or disk full)')
        opcode, length = _RECORD.unpack(self.read(at, at + 9))
        if not opcode:
            raise EOFError(f'broken record at byte {at}: its first byte is no opcode of MCAP')
        stop = at + 9 + length
        if stop > self.size:
            raise EOFError(f'the file ends at byte {self.size} inside a record that ends at byte {stop}')
        return opcode, stop

    def messages_end(self, start: int, stop: int) -> int:
        """Return the end of the neighbouring messages of which the first is at [start, stop) of the file."""
        with contextlib.suppress(EOFError):
            opcode, after = self.frame(stop)
            while opcode == Opcode.MESSAGE and after - start <= _WINDOW:
                stop = after
                opcode, after = self.frame(stop)
        return stop

    def content(self, opcode: int, start: int, stop: int) -> Content:
        """Return the content of the record at [start, stop) of the file; None for a kind not read here."""
        if opcode == Opcode.CHUNK:
            return self.chunk(start, stop)
        return self.read(start, stop) if opcode == Opcode.MESSAGE else parsed(opcode, self.read(start + 9, stop))

    def chunk(self, start: int, stop: int, again: bool = False) -> bytes:
        """Return the unpacked records in the chunk at [start, stop). Raises ValueError.

        again: True if the chunk was unpacked before, and so does not count again for UNPACKED_LIMITS.
        """
        if stop - start > 2 * MAX_CHUNK_BYTES:
            raise ValueError(f'a chunk of {stop - start} bytes, must be at most {MAX_CHUNK_BYTES}')
        chunk = records.Chunk.read(ReadDataStream(io.BytesIO(self.read(start + 9, stop))))
        if not again:
            self.spend(chunk)
        return unpacked(chunk)

    def spend(self, chunk: records.Chunk) -> None:
        """Count the unpacked size that a chunk states. Raises ValueError above UNPACKED_LIMITS."""
        self._left -= chunk.uncompressed_size
        if self._left < 0:
            raise ValueError(f'its chunks unpack to more than {UNPACKED_LIMITS[1]} times its length')

    def count(self, messages: int) -> None:
        """Add to the number of messages read from the file. Raises ValueError above MESSAGE_LIMITS."""
        self._messages += messages
        if self._messages > MESSAGE_LIMITS[0] + MESSAGE_LIMITS[1] * self.size:
            raise ValueError(f'more than {self._messages - messages} messages in {self.size} bytes')


def walk(file: McapFile, kinds: Container[int], on_damage: Callable[[int, int, str], None] | None = None
         ) -> Iterator[tuple[int, int, int, Content]]:
    """Yield (opcode, start, stop, content) of each record of a file, which is at its bytes [start, stop).

    kinds: opcodes of the records whose content is read; the content of all others is None.
    on_damage: function(start, stop, reason) that takes unusable bytes. Without it they raise EOFError with place and
    reason.

    Without on_damage the walk ends at the footer, and neighbouring messages outside chunks come as one record. With
    on_damage it ends at the first of END_OPCODES.
    """
    if on_damage:
        with file.mapped() as data:
            yield from _walk_damaged(file, data, kinds, on_damage)
        return
    at, opcode = len(MAGIC), None
    while opcode != Opcode.FOOTER:
        start, (opcode, at) = at, file.frame(at)
        if opcode == Opcode.MESSAGE:
            at = file.messages_end(start, at)
        try:
            content = file.content(opcode, start, at) if opcode in kinds else None
        except Exception as error:  # a decoder may raise anything on broken bytes
            raise EOFError(f'broken record at byte {start}: {error}') from None
        yield opcode, start, at, content
    if file.read(at, at + len(MAGIC) + 1) != MAGIC:
        raise EOFError(f'the file does not end with its footer at byte {at}')


def _walk_damaged(file: McapFile, data: Data, kinds: Container[int], on_damage: Callable[[int, int, str], None]
                  ) -> Iterator[tuple[int, int, int, Content]]:
    """Yield the records of a damaged file as `walk` does; data: its bytes.

    After a broken record whose stated length leads to the begin of another record, the walk continues there. Otherwise
    it continues at the next intact chunk after the last good record.
    """
    start = last_good_end = len(MAGIC)
    while start < len(data):
        stop = None
        try:
            opcode, stop = frame(data, start)
            content = file.content(opcode, start, stop) if opcode in kinds else None
        except Exception as error:  # a decoder may raise anything on broken bytes
            if stop is None or not _record_begins(data, stop):
                stop = _next_chunk(file, data, last_good_end)
            if stop > start:
                on_damage(start, stop, str(error) or type(error).__name__)
        else:
            yield opcode, start, stop, content
            if opcode in END_OPCODES:
                return
            if content is not None:
                last_good_end = stop
        start = stop


def _record_begins(data: Data, position: int) -> bool:
    try:
        return bool(frame(data, position))
    except ValueError:
        return False


def _next_chunk(file: McapFile, data: Data, start: int) -> int:
    """Return the position of the first chunk with a correct checksum from `start` on; the end of data without one."""
    for name in _COMPRESSION.finditer(data, start):
        at = name.start() - _BEFORE_COMPRESSION
        try:
            if at >= start and data[at] == Opcode.CHUNK:
                _, stop = frame(data, at)
                if name.end() + 8 + _LENGTH.unpack_from(data, name.end())[0] == stop:
                    file.chunk(at, stop)
                    return at
        except Exception:  # a decoder may raise anything on bytes that are no chunk
            continue
    return len(data)
