"""Reader and writer of the part of YAML that parameter files use: sections, lists, numbers, true, false and texts.

YAML 1.1 reads 1:30 as 90, 010 as 8, 1_0 as 10, 2024-01-01 as a date and `on` as true. Here they are texts, so that a
parameter which is a number refuses them. A section has each key once. Tags are refused, and aliases in a parameter
file, because rcl refuses them. Elsewhere MAX_VALUES counts an alias with all its values, so that a few lines cannot
stand for billions of values.
"""
from __future__ import annotations

import re
import typing
from collections.abc import Iterable

import yaml

from pedestal_common.text_files import files
from pedestal_common.text_files.files import FilePath

if typing.TYPE_CHECKING:    # numpy is slow to import, and `pedestal scenarios` needs none
    from pedestal_common.quantities import Json

try:
    from yaml import CSafeLoader as _Base
except ImportError:     # PyYAML without libyaml
    from yaml import SafeLoader as _Base

MAX_YAML_BYTES = 2_000_000
"""Largest size of a file [bytes]. The largest known file, all parameters of an array of 16 beams, has a tenth of
it."""

MAX_DEPTH, MAX_VALUES = 20, 200_000
"""Largest depth of sections, and largest number of values. An alias counts as all the values that it stands for."""

_TAG = 'tag:yaml.org,2002:'
_PLAIN = ('null', 'bool', 'int', 'float', 'str', 'seq', 'map')


class _Loader(_Base):
    yaml_implicit_resolvers: dict[str, object] = {}
    yaml_constructors = {tag: _Base.yaml_constructors[tag] for tag in (*(_TAG + name for name in _PLAIN), None)}

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[str, Json]:
        """Return a section {text: value}, with each of its keys once."""
        section = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.constructor.ConstructorError(None, None, 'a key must be a text', key.start_mark)
            if key.value == '<<':
                raise yaml.constructor.ConstructorError(None, None, '<< is refused; write the values themselves',
                                                        key.start_mark)
            if key.value in section:
                raise yaml.constructor.ConstructorError(None, None, f'{key.value!r} is given twice', key.start_mark)
            section[key.value] = self.construct_object(value, deep=deep)
        return section

    def construct_integer(self, node: yaml.ScalarNode) -> int:
        """Return an integer of 64 bits, the range of ROS 2."""
        if len(node.value) > 20 or not -2**63 <= int(node.value, 0) < 2**63:
            raise yaml.constructor.ConstructorError(None, None, f'{node.value[:20]}... has more than 64 bits',
                                                    node.start_mark)
        return int(node.value, 0)


_Loader.add_constructor(_TAG + 'int', _Loader.construct_integer)
for _name, _pattern, _first in (
        ('null', r'~|null|Null|NULL|', ['~', 'n', 'N', '']), ('bool', 'true|True|TRUE|false|False|FALSE', 'tTfF'),
        ('int', '[-+]?(?:0|[1-9][0-9]*|0x[0-9a-fA-F]+)', '-+0123456789'),
        ('float', r'[-+]?(?:(?:[0-9]+\.[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|(?:0|[1-9][0-9]*)[eE][-+]?[0-9]+'
         r'|\.(?:inf|Inf|INF))|\.(?:nan|NaN|NAN)',
         '-+.0123456789')):
    _Loader.add_implicit_resolver(_TAG + _name, re.compile(f'^(?:{_pattern})$'), list(_first))


class _Dumper(yaml.SafeDumper):
    """Writer that quotes each text that `parse` or rcl would take for a number or a flag."""


_Dumper.add_implicit_resolver(_TAG + 'quoted', re.compile(
    r'(?i)^(?:[-+]?(?:inf(?:inity)?|nan|0x[0-9a-f.]+(?:p[-+]?\d+)?|(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)|[yn])$'),
    list('-+.0123456789iInNyY'))


def dump(values: Json, sort_keys: bool = True) -> str:
    """Return the YAML text of values, which `parse` reads back."""
    return yaml.dump(values, Dumper=_Dumper, sort_keys=sort_keys)


def parse(text: str, aliases: bool = False) -> Json:
    """Return the values of a YAML text. aliases: accept them. Raises yaml.YAMLError."""
    try:
        _check(yaml.parse(text, Loader=_Base), aliases)
        return yaml.load(text, Loader=_Loader)
    except yaml.scanner.ScannerError as error:
        mark = error.problem_mark
        if text.splitlines()[mark.line:mark.line + 1] and text.splitlines()[mark.line][mark.column:][:1] == '\t':
            raise yaml.scanner.ScannerError(None, None, 'a tab; indent with blanks', mark) from None
        raise


def _check(events: Iterable[yaml.Event], aliases: bool) -> None:
    """Raise yaml.YAMLError where a text is too deep, has a tag or an alias, or stands for too many values."""
    count = 0
    begun: list[tuple[str | None, int]] = []     # (anchor, count before) of the open sections and lists
    sizes: dict[str | None, int] = {}            # {anchor: number of values}
    for event in events:
        if getattr(event, 'tag', None):
            problem = f'the tag {event.tag} is refused; write the value alone'
            raise yaml.composer.ComposerError(None, None, problem, event.start_mark)
        if isinstance(event, yaml.AliasEvent):
            if not aliases:
                problem = f'the alias *{event.anchor} is refused; write the values themselves'
                raise yaml.composer.ComposerError(None, None, problem, event.start_mark)
            # An anchor that is unknown, or whose value contains this alias, has no size yet.
            count += sizes.get(event.anchor, MAX_VALUES)
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


def read(path: FilePath) -> Json:
    """Return the values of a YAML file, aliases accepted. Raises OSError, UnicodeDecodeError, yaml.YAMLError."""
    return parse(files.read_text(path, MAX_YAML_BYTES), aliases=True)


def problem(error: Exception) -> str:
    """Return the reason of an error of `read` or `parse`, on one line and without the path."""
    if isinstance(error, OSError):
        return error.strerror or str(error)
    if isinstance(error, UnicodeDecodeError):
        return f'no valid UTF-8 text at byte {error.start}'
    where = str(error).replace('in "<unicode string>", ', 'at ')
    return f'no valid YAML: {" ".join(where.split())}'
