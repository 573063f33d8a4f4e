"""Reader and writer of ROS 2 parameter files, one for all programs, so that all accept and refuse the same files. A
section is for one node; in the files of a graph its name is /**/acu for example: the node acu in any namespace."""
import pathlib
import re
from collections.abc import Iterable, Iterator, Mapping

import yaml

from pedestal_common import parameters
from pedestal_common.quantities import Json
from pedestal_common.text_files import files, plain_yaml
from pedestal_common.text_files.files import FilePath

ANY_NAMESPACE = '/**/'

EVERY_NODE = '*'  # result of `node_of` for a section that is for every node of a namespace, such as /**


class ParameterFileError(parameters.ParameterError):
    """Error of a parameter file that cannot be read. Its text is one line with the file and the section."""


def text(sections: Mapping[str, Mapping[str, Json]]) -> str:
    """Return the text of a parameter file of {node: {name: value}}; a node of a beam is named 'beam_2/acu'."""
    return dumped({ANY_NAMESPACE + node: values for node, values in sections.items()})


def dumped(sections: Mapping[str, Mapping[str, Json]]) -> str:
    """Return the text of a parameter file of {section: {name: value}}."""
    return plain_yaml.dump({section: {'ros__parameters': values} for section, values in sections.items()},
                           sort_keys=False)


def origin(command: str, revision: str = '') -> list[str]:
    """Return the lines on the origin of a file: the command that made it, and the revision of git, '' for none."""
    return [f'made by: {" ".join(command.split())}', *([f'git {revision}'] if revision else [])]


def comment(lines: Iterable[str]) -> str:
    """Return the text of lines of comment, for the head of a file."""
    return ''.join(f'# {line}'.rstrip() + '\n' for line in lines)


def write_new(path: pathlib.Path, sections: Mapping[str, Mapping[str, Json]], head: Iterable[str]) -> None:
    """Write a new parameter file of {node: {name: value}}; head: lines of comment, such as its `origin`."""
    path.write_text(comment(head) + text(sections), encoding='utf-8')


def divided(section: str) -> tuple[str, str]:
    """Return (namespace, node) of the name of a section. A node of a beam is 'beam_2/acu' for example."""
    match = re.fullmatch(r'(.*?)/?((?:beam_[1-9]\d*/)?[^/]*)', section, re.DOTALL)
    assert match    # as any text does
    return match[1], match[2]


def node_of(section: str, namespace: str = '') -> str | None:
    """Return the node for which a section is, 'acu' or 'beam_2/acu', in a graph in a namespace such as '/ship_1'.

    Return EVERY_NODE for each node of the namespace, None for no node of it. A section without a slash is for the node
    of the graph in any namespace. For all other sections the rules are those of rcl.
    """
    place, node = divided(section)
    if node in ('*', '**'):
        place, node = (section if node == '**' else place), EVERY_NODE
    levels = {'': '', '*': r'/[^/]+', '**': r'(?:/[^/]+)*'}
    pattern = ''.join(levels.get(level, f'/{re.escape(level)}') for level in place.split('/'))
    return node if section == node or re.fullmatch(pattern, namespace) else None


def dotted(tree: Mapping[str, Json], prefix: str = '') -> dict[str, Json]:
    """Return {dotted name: value} of nested dicts. Raises ParameterFileError for a name with two values or none."""
    flat = {}
    for key, value in tree.items():
        name = f'{prefix}{key}'
        found = dotted(value, f'{name}.') if isinstance(value, dict) else {name: value}
        for name, value in found.items():
            if value is None:
                raise ParameterFileError(f'{name} has no value')
            if name in flat:
                raise ParameterFileError(f'{name!r} is set twice')
        flat.update(found)
    return flat


def _found(tree: Mapping[str, Json], place: str = '') -> Iterator[tuple[str, Json]]:
    """Yield (name of a section, its body) of a file. A namespace may contain the sections of its nodes."""
    for name, body in tree.items():
        section = f'{place.rstrip("/")}/{name.lstrip("/")}' if place else name
        if isinstance(body, dict) and body and 'ros__parameters' not in body and all(
                isinstance(part, dict) for part in body.values()):
            yield from _found(body, section)
        else:
            yield section, body


def parse(content: str) -> dict[str, dict[str, Json]]:
    """Return {section: {dotted name: value}} of the text of a file. Raises ParameterFileError without the file."""
    try:
        tree = plain_yaml.parse(content)
    except yaml.YAMLError as error:
        raise ParameterFileError(plain_yaml.problem(error)) from None
    if not isinstance(tree, dict) or not tree:
        raise ParameterFileError('must hold a section for a node')
    sections: dict[str, dict[str, Json]] = {}
    for section, body in _found(tree):
        whole = isinstance(body, dict) and list(body) == ['ros__parameters']
        values = body['ros__parameters'] or {} if whole else None
        if not isinstance(values, dict):
            raise ParameterFileError(f'section {section!r} must hold ros__parameters and nothing else')
        try:
            sections[section] = {**sections.get(section, {}), **dotted(values)}
            parameters.without_ros(sections[section])
        except (ParameterFileError, parameters.ParameterError) as error:
            raise ParameterFileError(f'section {section!r}: {error}') from None
    return sections


def read(path: FilePath) -> dict[str, dict[str, Json]]:
    """Return {section: {dotted name: value}} of a file. Raises ParameterFileError, which names the file."""
    try:
        return parse(files.read_text(path, plain_yaml.MAX_YAML_BYTES))
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterFileError(f'--params-file {path}: {plain_yaml.problem(error)}') from None
    except ParameterFileError as error:
        raise ParameterFileError(f'--params-file {path}: {error}') from None
