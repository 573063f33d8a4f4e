"""YAML as parameter files use it: sections, lists, numbers, true, false and texts, each as it is written.

YAML 1.1 reads 1:30 as 90, 010 as 8, 1_0 as 10, 2024-01-01 as a date and `on` as true. Here they are texts, so that a
parameter which is a number refuses them. A section has each key once. Tags are refused, and so are aliases, where a
few lines would stand for billions of values.
"""
import re
import typing

import yaml

from pedestal_common.text_files import files

MAX_YAML_BYTES = 2_000_000
"""Largest size of a file [bytes]; every parameter of an array of 16 beams is a tenth of it."""

MAX_DEPTH, MAX_VALUES = 20, 200_000
"""Largest depth of sections, and largest number of values, with those that aliases stand for."""

_TAG = 'tag:yaml.org,2002:'
_PLAIN = ('null', 'bool', 'int', 'float', 'str', 'seq', 'map')
_Base: typing.Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


class _Loader(_Base):
    """Loader of the plain values."""

    yaml_implicit_resolvers: dict = {}
    yaml_constructors = {tag: _Base.yaml_constructors[tag] for tag in (*(_TAG + name for name in _PLAIN), None)}

    def construct_mapping(self, node, deep=False):
        """Return a section {text: value}, with each of its keys once."""
        section = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.constructor.ConstructorError(None, None, 'a key must be a text', key.start_mark)
            if key.value in section:
                raise yaml.constructor.ConstructorError(None, None, f'{key.value!r} is given twice', key.start_mark)
            section[key.value] = self.construct_object(value, deep=deep)
        return section

    def construct_integer(self, node):
        """Return an integer of 64 bits, the range of ROS 2."""
        if len(node.value) > 20 or not -2**63 <= int(node.value, 0) < 2**63:
            raise yaml.constructor.ConstructorError(None, None, f'{node.value[:20]}... has more than 64 bits',
                                                    node.start_mark)
        return int(node.value, 0)


_Loader.add_constructor(_TAG + 'int', _Loader.construct_integer)
for _name, _pattern, _first in (
        ('null', r'~|null|Null|NULL|', ['~', 'n', 'N', '']), ('bool', 'true|True|TRUE|false|False|FALSE', 'tTfF'),
        ('int', '[-+]?(?:0|[1-9][0-9]*|0x[0-9a-fA-F]+)', '-+0123456789'),
        ('float', r'[-+]?(?:[0-9]+\.[0-9]*|\.[0-9]+)(?:[eE][-+][0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)',
         '-+.0123456789')):
    _Loader.add_implicit_resolver(_TAG + _name, re.compile(f'^(?:{_pattern})$'), list(_first))


def parse(text):
    """Return the values of a YAML text. Raises yaml.YAMLError."""
    _check(yaml.parse(text, Loader=_Base))
    return yaml.load(text, Loader=_Loader)


def _check(events):
    """Raise yaml.YAMLError where a text is too deep, contains a tag or stands for too many values."""
    count, begun, sizes = 0, [], {}
    for event in events:
        if getattr(event, 'tag', None):
            raise yaml.composer.ComposerError(None, None, f'tag {event.tag}', event.start_mark)
        if isinstance(event, yaml.AliasEvent):
            count += sizes.get(event.anchor, MAX_VALUES)  # an unknown anchor, or one around this alias, has no size
        elif isinstance(event, yaml.CollectionStartEvent):
            begun.append((event.anchor, count))
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = begun.pop()
            sizes[anchor] = count - before
        elif isinstance(event, yaml.ScalarEvent):
            sizes[event.anchor] = 1
        count += 1
        if len(begun) > MAX_DEPTH or count > MAX_VALUES:
            most = f'{MAX_DEPTH} sections in sections' if len(begun) > MAX_DEPTH else f'{MAX_VALUES} values'
            raise yaml.composer.ComposerError(None, None, f'more than {most}', event.start_mark)


def read(path):
    """Return the values of a YAML file of at most MAX_YAML_BYTES bytes. Raises OSError, UnicodeDecodeError,
    yaml.YAMLError."""
    return parse(files.read_text(path, MAX_YAML_BYTES))


def problem(error) -> str:
    """Return the reason of an error of `read` or `parse`, on one line and without the path."""
    if isinstance(error, OSError):
        return error.strerror or str(error)
    if isinstance(error, UnicodeDecodeError):
        return f'no valid UTF-8 text at byte {error.start}'
    where = str(error).replace('in "<unicode string>", ', 'at ')
    return f'no valid YAML: {" ".join(where.split())}'
