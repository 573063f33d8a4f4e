"""Readable messages of a topic: CDR bytes of its type with a valid stamp.

A message of another program on a topic of the graph is foreign. Most messages of a topic differ in their numbers only,
so numpy compares the bytes outside the numbers with those of a readable message. The other messages are deserialized.
"""
import numpy as np

from pedestal_common.graph import layouts, nodes, topics
from pedestal_common.wire import cdr, messages

MAX_SHAPED_BYTES = 4000
"""Largest size of a message whose bytes are compared [bytes]; a larger message is deserialized."""

MAX_SHAPES = 20
"""Largest number of readable messages of one length with which others are compared."""


class Readable:
    """Judge of the messages of one topic of a type. ours: True in a recording of the graph, whose messages also carry
    the joints of the topic."""

    def __init__(self, topic, type_name, ours):
        row = topics.TOPIC_BY_NAME.get(nodes.plain(topic))
        self._type, self._shapes = type_name, {}
        self._columns = ()
        if ours and row is not None and row.type == type_name and row.rate == 'step':
            self._columns = frozenset(column.name for column in layouts.columns(row.name))

    def mask(self, data, start, stop):
        """Return a mask (n,) of the readable messages at the places start, stop (n,) of bytes."""
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
    def _alike(content, start, rows, shape, readable):
        """Mark the rows that have a shape as readable, and return the remaining rows."""
        if shape is None or not rows.size:
            return rows
        places, wanted = shape
        same = (content[start[rows, np.newaxis] + places] == wanted).all(axis=1)
        readable[rows[same]] = True
        return rows[~same]

    def _added(self, message):
        """Return the shape of a readable message, None if others are not compared with it."""
        shapes = self._shapes.setdefault(len(message), [])
        if len(message) > MAX_SHAPED_BYTES or len(shapes) >= MAX_SHAPES or self._type not in layouts.LAYOUTS:
            return None
        places = np.concatenate([np.arange(start, stop) for start, stop in cdr.Places(message, self._type).fixed])
        shapes.append((places, np.frombuffer(message, np.uint8)[places]))
        return shapes[-1]

    def problem(self, message):
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
