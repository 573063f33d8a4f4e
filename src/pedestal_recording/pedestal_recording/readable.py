"""Check of recorded messages: a readable message holds the CDR bytes of the type of its topic, with a valid stamp.

An unreadable message on a topic of the graph is foreign, because another program published it. Because deserialising
each message would be slow, numpy compares the bytes outside its numbers (the shape) with those of a message known as
readable. Only a message of a new shape is deserialised.
"""
import numpy as np

from pedestal_common.graph import layouts, nodes, topics
from pedestal_common.quantities import Bools, Bytes, Ints
from pedestal_common.wire import cdr, messages
from pedestal_recording.columns import Shape

MAX_SHAPED_BYTES = 4000  # largest size of a message whose bytes are compared [bytes]; a larger message is deserialized
MAX_SHAPES = 20  # largest number of readable messages of one length with which others are compared


class Readable:
    """Check of the messages of one topic.

    ours: True in a recording of this graph. There a message of a topic of every step must also hold at least one of
    the columns of its topic, such as `azimuth.position`.
    """

    def __init__(self, topic: str, type_name: str, ours: bool) -> None:
        row = topics.TOPIC_BY_NAME.get(nodes.plain(topic))
        self._type = type_name
        self._shapes: dict[int, list[Shape]] = {}     # by the length of the messages
        self._columns: frozenset[str] = frozenset()
        if ours and row is not None and row.type == type_name and row.rate == 'step':
            self._columns = frozenset(column.name for column in layouts.columns(row.name))

    def mask(self, data: bytes, start: Ints, stop: Ints) -> Bools:
        """Return True for each readable message. Message k is at bytes [start[k], stop[k]) of data."""
        content, readable = np.frombuffer(data, np.uint8), np.zeros(len(start), bool)
        for length in np.unique(stop - start).tolist():
            rows = np.flatnonzero(stop - start == length)
            for shape in self._shapes.get(length, ()):
                rows = self._alike(content, start, rows, shape, readable)
            while rows.size:
                first, rows = rows[0], rows[1:]
                message = bytes(data[start[first]:stop[first]])
                readable[first] = not self.problem(message)
                if readable[first]:
                    rows = self._alike(content, start, rows, self._added(message), readable)
        return readable

    @staticmethod
    def _alike(content: Bytes, start: Ints, rows: Ints, shape: Shape | None, readable: Bools) -> Ints:
        """Set the mask `readable` at the rows whose messages have a shape. Return the remaining rows."""
        if shape is None or not rows.size:
            return rows
        same = shape.equals(content[start[rows, np.newaxis] + shape.places])
        readable[rows[same]] = True
        return rows[~same]

    def _added(self, message: bytes) -> Shape | None:
        """Note the shape of a readable message, and return it; None beyond MAX_SHAPED_BYTES and MAX_SHAPES."""
        shapes = self._shapes.setdefault(len(message), [])
        if len(message) > MAX_SHAPED_BYTES or len(shapes) >= MAX_SHAPES or self._type not in layouts.LAYOUTS:
            return None
        shapes.append(Shape(message, cdr.Places(message, self._type).fixed))
        return shapes[-1]

    def problem(self, message: bytes) -> str:
        """Return the reason why CDR bytes are no message of the topic, '' for a readable message."""
        try:
            messages.deserialize(message, self._type)
            if self._type in cdr.STAMPED_TYPES:
                messages.stamp_of(message)
            if self._columns:
                places = cdr.Places(message, self._type)
                if self._columns.isdisjoint(layouts.column(self._type, path, places.texts)
                                            for path, _, _ in places.numbers):
                    return f'no number of {", ".join(sorted(self._columns))}'
        except ValueError as error:
            return str(error)
        return ''
