"""Inputs of the control unit, made from the table of topics: the fields of their record, and the copy into this
record.

Topic.inputs names an input for each field of the topic; a name that stands for several numbers is an array. A message
also has the fields `stamp` [s] and `came`, which is 1 in a step in which the message arrived. The other inputs keep
the values of the last message. A text has the field `code` only.
"""
import itertools
from collections.abc import Callable, Iterable, Iterator

from numba.extending import overload

from pedestal_common.graph import layouts, topics
from pedestal_common.law_key import template
from pedestal_common.quantities import AnyRecord
from pedestal_common.wire.records import NO_STAMP


def _numbers(topic: str) -> Iterator[tuple[str, list[str]]]:
    """Yield (name of an input, [source text that reads each of its numbers from the record of a topic])."""
    given, row = topics.TOPIC_BY_NAME[topic].inputs, topics.TOPIC_BY_NAME[topic]
    for field in layouts.fields(topic):
        if field.name in given:
            count = len(field.components or row.names)
            names = given[field.name]
            named = (names,) * count if isinstance(names, str) else names
            for name, places in itertools.groupby(range(count), named.__getitem__):
                yield name, [f'message.{field.name}[{place}]' for place in places]


def fields(names: Iterable[str]) -> list[tuple[str, str] | tuple[str, str, tuple[int, ...]]]:
    """Return the fields of a record of these topics' inputs, as numpy takes them."""
    kinds = {'came': 'i8', 'code': 'i8', 'stamp': 'f8'}
    return [field for topic in names for field in (
        *((name, kinds[key]) for key, name in topics.TOPIC_BY_NAME[topic].inputs.items()
          if key in kinds and isinstance(name, str)),
        *((name, 'f8', (len(places),)) if len(places) > 1 else (name, 'f8') for name, places in _numbers(topic)))]


def _lines(topic: str) -> Iterator[str]:
    given = topics.TOPIC_BY_NAME[topic].inputs
    yield f'    message = records[{topic!r}]'
    if 'code' in given:
        yield f'    inputs.{given["code"]} = message'
        return
    if 'came' in given:
        yield f'    inputs.{given["came"]} = message.stamp != {NO_STAMP}'
    yield f'    if message.stamp != {NO_STAMP}:'
    if 'stamp' in given:
        yield f'        inputs.{given["stamp"]} = message.stamp * 1e-9'
    for name, places in _numbers(topic):
        for i, place in enumerate(places):
            yield f'        inputs.{name}{f"[{i}]" if len(places) > 1 else ""} = {place}'


def taking(names: Iterable[str]) -> Callable[[AnyRecord, AnyRecord], None]:
    """Return the function take(inputs, records) for laws, which copies the records of these topics into the inputs."""
    made: dict[str, Callable[[AnyRecord, AnyRecord], None]] = {}
    lines = [line for topic in names if topics.TOPIC_BY_NAME[topic].inputs for line in _lines(topic)]
    # Because numba needs the names of the fields in the source, the function is made as text.
    exec('\n'.join(('def take(inputs, records):', *lines)), made)
    overload(made['take'], inline='always')(lambda inputs, records: made['take'])
    made['take'].__module__ = __name__
    template(made['take'])
    return made['take']
