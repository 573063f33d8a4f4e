"""Recognition of the content of a file by its first bytes: the encoding of a text, or a format that is no text."""
import codecs
from typing import BinaryIO
from xml.parsers import expat

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
    """Return the text of the bytes of a file. Raises UnicodeDecodeError.

    The encoding is that of the byte order mark. Without a mark it is UTF-8, or FALLBACK_ENCODING if the bytes are not
    UTF-8. Bytes with a 0 and without a mark are no text.
    """
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
