"""Safe opening of files that other programs have written.

A pipe, a device or a file of enormous length is refused, because it would block the process or fill its memory.
"""
import errno
import hashlib
import os
import stat
from typing import BinaryIO, TypeAlias

FilePath: TypeAlias = str | os.PathLike[str]

SPARSE_FILE_LIMITS = 16_000_000, 100
"""Limits above which a file is refused as sparse, if it exceeds both: its length [bytes], and the ratio of its length
to the bytes that it has on the disk."""


def open_regular(path: FilePath, largest: int | None = None) -> BinaryIO:
    """Return a regular file (no device, pipe or directory) as an open binary stream.

    largest: largest accepted length [bytes], None for any. Raises OSError, whose strerror is the reason.
    """
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


def read_text(path: FilePath, largest: int) -> str:
    """Return the text of a regular UTF-8 file of at most `largest` bytes. Raises OSError, UnicodeDecodeError."""
    with open_regular(path, largest) as stream:
        return stream.read(largest + 1).decode()


def sha256(path: FilePath) -> str:
    """Return the SHA-256 of a file, read in pieces. Raises OSError."""
    digest = hashlib.sha256()
    with open(path, 'rb') as stream:
        while piece := stream.read(1 << 20):
            digest.update(piece)
    return digest.hexdigest()
