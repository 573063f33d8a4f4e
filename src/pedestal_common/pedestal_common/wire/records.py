"""Records: numpy records with the numbers of messages, one for a step of a node, many in the closed loop and a bag.

A unit reads and writes one record that has a field for each of its topics:

    stamped message     stamp [ns], then the fields of its layout; stamp NO_STAMP for a message that did not arrive or
                        that is not to be published
    text, list of texts an integer, its code; topics.NO_TEXT_CODE before the first

Decoder and Encoder use the places of the numbers in the bytes (cdr.Places), and build no message object.
"""
import struct
from collections.abc import Iterable, Sequence
from typing import TypeAlias

import numpy as np

from pedestal_common.graph import layouts, topics
from pedestal_common.quantities import DType, Floats, Message, Nanoseconds, Records
from pedestal_common.wire import cdr, messages

NO_STAMP = -2**63  # stamp [ns] of a message that did not arrive
TEXT_TYPES = ('std_msgs/msg/String', 'diagnostic_msgs/msg/DiagnosticArray')  # types of a text and of a list of texts

Decoded: TypeAlias = tuple[Nanoseconds, Sequence[float]]   # stamp and numbers of a message

_STAMP = struct.Struct('<iI')
_FORMATS = {'f8': 'd', 'f4': 'f'}


def _type(topic: str) -> str | DType:
    row = topics.TOPIC_BY_NAME[topic]
    if is_text(topic):
        return 'i8'
    sizes = [(field.name, 'f8', (len(field.components or row.names),)) for field in layouts.fields(topic)]
    return np.dtype([('stamp', 'i8'), *sizes])      # no Record, because the tables of topics and layouts determine it


def of(*names: str) -> DType:
    """Return the type of the record of these topics."""
    return np.dtype([(name, _type(name)) for name in names])


def is_text(topic: str) -> bool:
    """Return True if a topic of the table is a text or a list of texts, held in records by its code."""
    return topics.TOPIC_BY_NAME[topic].type in TEXT_TYPES and topics.TOPIC_BY_NAME[topic].rate == 'change'


def empty(record_type: DType, count: int) -> Records:
    """Return records (count,) without any message or text."""
    made = np.zeros(count, record_type)
    for name in record_type.names or ():
        if record_type[name].names is None:
            made[name] = topics.NO_TEXT_CODE
        else:
            made[name]['stamp'] = NO_STAMP
    return made


def numbers(records: Records, topic: str) -> Floats:
    """Return a view (n, columns) of the numbers of a stamped topic in records (n,)."""
    # Positions are in words of 8 bytes. The first word of the topic is its stamp.
    fields = records.dtype.fields
    assert fields
    start = fields[topic][1] // 8 + 1
    return records.view('f8').reshape(len(records), -1)[:, start:start + len(layouts.columns(topic))]


def code_of(topic: str, text: str) -> int:
    """Return the code of a text: its index in Topic.texts, or their number for any other text."""
    texts = topics.TOPIC_BY_NAME[topic].texts
    return texts.index(text) if text in texts else len(texts)


class _Shape:
    """Places of the columns of a topic in one message, valid for messages that differ only in their numbers."""

    def __init__(self, topic: str, data: bytes) -> None:
        type_name = topics.TOPIC_BY_NAME[topic].type
        places = cdr.Places(data, type_name)
        index = {column.name: i for i, column in enumerate(layouts.columns(topic))}
        self.size = places.stop
        # Bytes that another message must have too, so that its numbers are at the same places.
        self.guard = [(start, stop, bytes(data[start:stop])) for start, stop in _joined(places.fixed)]
        # (index of the column, first byte, dtype)
        self.fields = [(index[name], start, dtype) for path, start, dtype in places.numbers
                      if (name := layouts.column(type_name, path, places.texts)) in index]
        self.in_order = [column for column, _, _ in self.fields] == list(range(len(index)))
        # One format for the struct module: skip the bytes up to each number, then read the number.
        form, at = places.order, 0
        for _, start, dtype in self.fields:
            form += f'{start - at}x{_FORMATS[dtype[1:]]}'
            at = start + int(dtype[2:])
        self.reader = struct.Struct(form)       # reads these numbers at once
        # (columns, [(Struct, first byte)], function absent) of layouts.no_data
        self.marks = [([index[name] for name in names if name in index],
                       [(struct.Struct(dtype[0] + _FORMATS[dtype[1:]]), start) for start, dtype in where], absent)
                      for names, where, absent in layouts.no_data(type_name, places.numbers, places.texts)]

    def fits(self, data: bytes) -> bool:
        """Return True if the numbers of a message are at the same places."""
        return 0 <= len(data) - self.size < cdr.PADDING_LIMIT_BYTES and all([data[start:stop] == text
                                                                             for start, stop, text in self.guard])


def _joined(fixed: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return ranges (start, stop), of which adjacent ones are merged."""
    joined: list[tuple[int, int]] = []
    for start, stop in sorted(fixed):
        if joined and joined[-1][1] == start:
            joined[-1] = joined[-1][0], stop
        elif start < stop:
            joined.append((start, stop))
    return joined


def _runs(fields: Iterable[tuple[int, int, str]]) -> list[tuple[slice, np.dtype[np.generic], int, int]]:
    """Return [(columns as a slice, dtype, count, start)] of numbers [(column, start, dtype)], adjacent ones merged."""
    runs: list[tuple[int, np.dtype[np.generic], int, int]] = []
    for column, start, name in fields:
        dtype = np.dtype(name)
        if runs:
            first, kind, count, begin = runs[-1]
            if kind == dtype and column == first + count and start == begin + count * kind.itemsize:
                runs[-1] = first, kind, count + 1, begin
                continue
        runs.append((column, dtype, 1, start))
    return [(slice(first, first + count), kind, count, begin) for first, kind, count, begin in runs]


class Decoder:
    """Reader of the messages of one stamped topic. record: (1,); `put` fills its field of this topic."""

    def __init__(self, topic: str, record: Records) -> None:
        self.topic = topic
        self._columns = len(layouts.columns(topic))
        self._shape = _Shape(topic, messages.serialize(messages.template(topic)))
        self._stamp, self._numbers = record[topic]['stamp'], numbers(record, topic)[0]

    def decoded(self, data: bytes) -> Decoded:
        """Return the stamp and the numbers of CDR bytes. A number is NaN if the message lacks it or marks it as no
        data (layouts.NO_DATA_MARKS). Raises ValueError for other bytes and for an invalid stamp."""
        if not self._shape.fits(data):
            self._shape = _Shape(self.topic, data)
        seconds, nanoseconds = _STAMP.unpack_from(data, messages.CDR_HEADER_BYTES)
        if seconds < 0 or nanoseconds >= 1_000_000_000:
            raise ValueError(f'{self.topic}: {seconds} s {nanoseconds} ns is no stamp')
        values: Sequence[float] = self._shape.reader.unpack_from(data)
        if not self._shape.in_order:
            placed = [np.nan] * self._columns
            for (column, _, _), value in zip(self._shape.fields, values):
                placed[column] = value
            values = placed
        for marked, where, absent in self._shape.marks:
            if absent(*[form.unpack_from(data, start)[0] for form, start in where]):
                values = [np.nan if column in marked else value for column, value in enumerate(values)]
        return seconds * 1_000_000_000 + nanoseconds, values

    def put(self, stamp: Nanoseconds, values: Sequence[float] | None) -> None:
        """Put the result of `decoded` into the record; values None: no message arrived."""
        if values is None:
            self._stamp[0] = NO_STAMP
        else:
            self._stamp[0] = stamp
            self._numbers[:] = values


class Encoder:
    """Maker of the messages of one stamped topic. template: a message whose names, frames and constants stay; record:
    (1,) with the numbers, None where only `bytes_of` is used."""

    def __init__(self, topic: str, template: Message, record: Records | None = None) -> None:
        data = messages.serialize(template)
        shape = _Shape(topic, data)
        self._buffer = bytearray(data)
        self._views = [(columns, np.frombuffer(self._buffer, dtype, count, start))
                       for columns, dtype, count, start in _runs(shape.fields)]
        if record is not None:
            self._stamp, self._numbers = record[topic]['stamp'], numbers(record, topic)[0]

    @property
    def due(self) -> bool:
        """True if the record holds a message."""
        return self._stamp[0] != NO_STAMP

    def encoded(self, epoch: Nanoseconds = 0) -> bytes:
        """Return the CDR bytes of the message with the numbers of the record, whose stamp counts from the epoch."""
        return self.bytes_of(self._stamp.item() + epoch, self._numbers)

    def bytes_of(self, stamp: Nanoseconds, values: Floats) -> bytes:
        """Return the CDR bytes of the message with a stamp and numbers (columns,)."""
        _STAMP.pack_into(self._buffer, messages.CDR_HEADER_BYTES, *divmod(stamp, 1_000_000_000))
        for columns, view in self._views:
            view[:] = values[columns]
        return bytes(self._buffer)
