"""Places (byte positions) of the numbers of a message in its CDR bytes, for the Decoder and the Encoder of `records`.
Messages of a topic that differ only in their numbers have them at the same places: one message is parsed by the
definition of its type, and the others are read at the places found."""
import struct

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc

from pedestal_common.wire.messages import CDR_HEADER_BYTES, ROS_TYPESTORE

_SIZES = {'bool': 1, 'byte': 1, 'char': 1, 'int8': 1, 'uint8': 1, 'int16': 2, 'uint16': 2, 'int32': 4, 'uint32': 4,
          'int64': 8, 'uint64': 8, 'float32': 4, 'float64': 8}
_DTYPES = {'bool': 'u1', 'byte': 'u1', 'char': 'u1', **{name: f'{name[0]}{size}' for name, size in _SIZES.items()
                                                       if name[0] in 'iuf'}}

STAMPED_TYPES = {'rosgraph_msgs/msg/Clock'}
STAMPED_TYPES.update(name for name, (_, fields) in ROS_TYPESTORE.fielddefs.items()
                     if fields and fields[0] == ('header', (Nodetype.NAME, 'std_msgs/msg/Header')))
"""Message types that begin with their stamp."""

MAX_MESSAGE_NUMBERS = 400_000  # largest number of numbers in one message; a program track of a whole day has 350,000
PADDING_LIMIT_BYTES = 4  # the padding that DDS adds behind a message is always less than this [bytes]


class Places:
    """Places in one message, given as CDR bytes of a type. Raises ValueError when the bytes are no such message."""

    def __init__(self, data: bytes, type_name: str) -> None:
        if len(data) < CDR_HEADER_BYTES:
            raise ValueError(f'{len(data)} bytes are no {type_name}')
        self.data = data
        self.order = '<' if data[1] & 1 else '>'     # the header states the order of the bytes
        self.stop = CDR_HEADER_BYTES        # end of the message
        # (path of the number in the message, its first byte, dtype)
        self.numbers: list[tuple[str, int, str]] = []
        self.texts: dict[str, str] = {}     # {path: text}
        # (start, stop) of the bytes that must be equal in another message, so that its numbers are at these places
        self.fixed = [(0, CDR_HEADER_BYTES)]
        try:
            self._fields(type_name, '')
        except (struct.error, KeyError, UnicodeDecodeError) as error:
            raise ValueError(f'{len(data)} bytes are no {type_name}: {error}') from None

    def _fields(self, type_name: str, prefix: str) -> None:
        for name, node in ROS_TYPESTORE.fielddefs[type_name][1]:
            self._node(node, prefix + name)

    def _take(self, size: int, alignment: int, path: str) -> int:
        """Return the start of the next `size` bytes, and move `stop` behind them."""
        self.stop += -(self.stop - CDR_HEADER_BYTES) % alignment     # CDR aligns numbers from the end of the header
        start, self.stop = self.stop, self.stop + size
        if self.stop > len(self.data):
            raise struct.error(f'{path} is missing')
        return start

    def _length(self, path: str) -> int:
        start = self._take(4, 4, path)
        self.fixed.append((start, self.stop))
        return struct.unpack_from(self.order + 'I', self.data, start)[0]

    def _node(self, node: FieldDesc, path: str) -> None:
        if node[0] == Nodetype.NAME:
            self._fields(node[1], path + '.')
        elif node[0] == Nodetype.BASE and node[1][0] in ('string', 'wstring'):
            start = self._take(self._length(path), 1, path)
            self.fixed.append((start, self.stop))
            self.texts[path] = bytes(self.data[start:self.stop]).rstrip(b'\0').decode()
        elif node[0] == Nodetype.BASE:
            size = _SIZES[node[1][0]]
            self.numbers.append((path, self._take(size, size, path), self.order + _DTYPES[node[1][0]]))
            if len(self.numbers) > MAX_MESSAGE_NUMBERS:
                raise ValueError(f'message of {len(self.data)} bytes: must have at most {MAX_MESSAGE_NUMBERS} numbers')
        else:
            element, count = node[1]
            for i in range(count if node[0] == Nodetype.ARRAY else self._length(path)):
                self._node(element, f'{path}[{i}]')
