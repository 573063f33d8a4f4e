"""Files that other programs have written: safe opening, and recognition of the content by the first bytes. A pipe, a
device or a file of enormous length is refused, because it would block the process or fill its memory."""
import codecs
import errno
import fcntl
import hashlib
import os
import stat
from typing import IO, BinaryIO, TypeAlias
from xml.parsers import expat

FilePath: TypeAlias = str | os.PathLike[str]

SPARSE_FILE_LIMITS = 16_000_000, 100
"""Limits above which a file is refused as sparse, if it exceeds both: its length [bytes], and the ratio of its length
to the bytes that it has on the disk."""

ENCODINGS_BY_MARK = ((codecs.BOM_UTF8, 'utf-8-sig'), (codecs.BOM_UTF32_LE, 'utf-32'), (codecs.BOM_UTF32_BE, 'utf-32'),
                     (codecs.BOM_UTF16_LE, 'utf-16'), (codecs.BOM_UTF16_BE, 'utf-16'))
"""(byte order mark, encoding). UTF-32 comes before UTF-16, because one mark of UTF-32 begins with a mark of UTF-16."""
FALLBACK_ENCODING = 'cp1252'
"""Encoding of a text without a mark that is not UTF-8: Windows-1252, with all letters of latin-1."""

PACKED_FORMATS = (
    (b'\x1f\x8b', 'compressed by gzip: unpack it with gunzip'),
    (b'PK\x03\x04', 'a zip archive, as are .kmz and .xlsx: unpack it with unzip, or export a workbook as CSV'),
    (b'BZh', 'compressed by bzip2: unpack it with bunzip2'),
    (b'\xfd7zXZ\x00', 'compressed by xz: unpack it with unxz'),
    (b'\x28\xb5\x2f\xfd', 'compressed by zstd: unpack it with zstd -d'),
    (b'\x04\x22\x4d\x18', 'compressed by lz4: unpack it with unlz4'),
    (b'\x1f\x9d', 'compressed by compress: unpack it with uncompress'),
    (b'Rar!', 'a rar archive: unpack it with unrar'),
    (b'PAR1', 'a Parquet file: export it as CSV'),
    (b'%PDF', 'a PDF document: save its table as CSV'),
    (b'7z\xbc\xaf\x27\x1c', 'a 7z archive: unpack it with 7z x'),
    (b'\xd0\xcf\x11\xe0', 'an Excel workbook (.xls): export it as CSV'))
"""(first bytes, name of the format and remedy) of files that are no plain text but may contain a table."""
MAX_MARK_BYTES = 6  # largest number of bytes that name a format


def open_regular(path: FilePath, largest: int | None = None) -> BinaryIO:
    """Return a regular file (no device, pipe or directory) of at most `largest` bytes as an open binary stream. Raises
    OSError, whose strerror is the reason."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    try:
        info = os.fstat(descriptor)
        if not stat.S_ISREG(info.st_mode):
            raise OSError(errno.EINVAL, 'not a regular file', str(path))
        if largest is not None and info.st_size > largest:
            raise OSError(errno.EFBIG, f'{info.st_size} bytes, must be at most {largest}', str(path))
        if info.st_size > SPARSE_FILE_LIMITS[0] and info.st_blocks * 512 * SPARSE_FILE_LIMITS[1] < info.st_size:
            raise OSError(errno.EINVAL, f'{info.st_size} bytes long, of which the disk holds {info.st_blocks * 512}',
                          str(path))
        return os.fdopen(descriptor, 'rb')
    except BaseException:
        os.close(descriptor)
        raise


def lock(stream: IO[bytes] | IO[str], user: str) -> None:
    """Lock an open file until it is closed. Raises ValueError with the words `user` while another process has it."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ValueError(user) from None


def read_text(path: FilePath, largest: int) -> str:
    """Return the text of a regular UTF-8 file of at most `largest` bytes. Raises OSError, UnicodeDecodeError."""
    with open_regular(path, largest) as stream:
        return stream.read(largest + 1).decode()


def replace_text(path: FilePath, text: str) -> None:
    """Replace a file by one with a text, in one operation. After a loss of power the file is the old or the new one.
    Raises OSError."""
    new = f'{os.fspath(path)}.new'
    with open(new, 'w', encoding='utf-8') as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(new, path)
    folder = os.open(os.path.dirname(os.path.abspath(path)), os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def sha256(path: FilePath) -> str:
    """Return the SHA-256 of a file, read in pieces. Raises OSError."""
    digest = hashlib.sha256()
    with open(path, 'rb') as stream:
        while piece := stream.read(1 << 20):
            digest.update(piece)
    return digest.hexdigest()


def packed(beginning: bytes) -> str:
    """Return the name and the remedy of a packed file by its first bytes; '' for another file."""
    return next((name for mark, name in PACKED_FORMATS if beginning.startswith(mark)), '')


def marked_encoding(beginning: bytes) -> str:
    """Return the encoding that the byte order mark of a file names; '' without a mark."""
    return next((encoding for mark, encoding in ENCODINGS_BY_MARK if beginning.startswith(mark)), '')


def xml_parser(stream: BinaryIO) -> expat.XMLParserType:
    """Return an expat parser for a seekable stream, in the encoding of the byte order mark or of the declaration."""
    marked = marked_encoding(stream.read(MAX_MARK_BYTES))
    stream.seek(0)
    return expat.ParserCreate({'utf-8-sig': 'UTF-8', 'utf-16': 'UTF-16'}.get(marked))


def beginning(content: bytes) -> str:
    """Return the text of the first bytes of a file; bytes that are no text become replacement characters."""
    return content.decode(marked_encoding(content) or 'utf-8', 'replace')


def decode(content: bytes) -> str:
    """Return the text of the bytes of a file, in the encoding of the byte order mark, else UTF-8, else
    FALLBACK_ENCODING. Bytes with a 0 and without a mark are no text. Raises UnicodeDecodeError."""
    encoding = marked_encoding(content)
    if encoding:
        return content.decode(encoding)
    zero = content.find(b'\0')
    if zero >= 0:
        raise UnicodeDecodeError('text', content, zero, zero + 1, 'no character')
    try:
        return content.decode()
    except UnicodeDecodeError:
        return content.decode(FALLBACK_ENCODING)
