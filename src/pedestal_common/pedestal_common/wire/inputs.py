"""Inputs of the control unit, made from the table of topics: the fields of their record, and the copy into this
record.

Topic.inputs gives the name of an input for each field of the topic. A name that stands for several numbers is an
array. In addition to the fields of its layout, a message has the fields `stamp` and `came`. `stamp` is in seconds.
`came` is 1 in a step in which the message arrived, else 0. The other inputs keep the values of the last message. A
text has the field `code` only.
"""
import itertools

from numba.extending import overload

from pedestal_common.graph import layouts, topics
from pedestal_common.law_key import template
from pedestal_common.wire.records import NO_STAMP


def _numbers(topic):
    """Yield (name of an input, [source text that reads each of its numbers from the record of a topic])."""
    given, row = topics.TOPIC_BY_NAME[topic].inputs, topics.TOPIC_BY_NAME[topic]
    for field in layouts.fields(topic):
        if field.name in given:
            count = len(field.components or row.names)
            named = (given[field.name],) * count if isinstance(given[field.name], str) else given[field.name]
            for name, places in itertools.groupby(range(count), named.__getitem__):
                yield name, [f'm.{field.name}[{place}]' for place in places]


def fields(names) -> list:
    """Return the fields of a record of these topics' inputs, as numpy takes them."""
    kinds = {'came': 'i8', 'code': 'i8', 'stamp': 'f8'}
    return [field for topic in names for field in (
        *((name, kinds[key]) for key, name in topics.TOPIC_BY_NAME[topic].inputs.items() if key in kinds),
        *((name, 'f8', (len(places),)) if len(places) > 1 else (name, 'f8') for name, places in _numbers(topic)))]


def _lines(topic):
    """Yield the source lines that copy the record of one topic, `m`, into the inputs `u`."""
    given = topics.TOPIC_BY_NAME[topic].inputs
    yield f'    m = inputs[{topic!r}]'
    if 'code' in given:
        yield f'    u.{given["code"]} = m'
        return
    if 'came' in given:
        yield f'    u.{given["came"]} = m.stamp != {NO_STAMP}'
    yield f'    if m.stamp != {NO_STAMP}:'
    if 'stamp' in given:
        yield f'        u.{given["stamp"]} = m.stamp * 1e-9'
    for name, places in _numbers(topic):
        for i, place in enumerate(places):
            yield f'        u.{name}{f"[{i}]" if len(places) > 1 else ""} = {place}'


def taking(names):
    """Return the function take(u, inputs) for laws, which copies the records of these topics into the inputs u."""
    made = {}
    lines = [line for topic in names if topics.TOPIC_BY_NAME[topic].inputs for line in _lines(topic)]
    # Because numba needs the names of the fields in the source, the function is made as text.
    exec('\n'.join(('def take(u, inputs):', *lines)), made)
    overload(made['take'], inline='always')(lambda u, inputs: made['take'])
    made['take'].__module__ = __name__
    template(made['take'])
    return made['take']
