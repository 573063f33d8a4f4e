"""ROS 2 parameter files: those of a graph name its nodes /**/acu, which is acu in any namespace.

One reader for `pedestal run`, the launch file and every node, so that all take and refuse the same files.
"""
import re

import yaml

from pedestal_common import parameters
from pedestal_common.text_files import files, plain_yaml

ANY_NAMESPACE = '/**/'

EVERY_NODE = '*'
"""`node_of` a section for every node of a namespace, such as /**."""


class ParameterFileError(ValueError):
    """Error of a parameter file that cannot be read; one line with the file and the section."""


def text(sections):
    """Return the file of {node: {name: value}}; a node of a beam is named as 'beam_2/acu'."""
    return dumped({ANY_NAMESPACE + node: values for node, values in sections.items()})


def dumped(sections):
    """Return the file of {section: {name: value}}."""
    return plain_yaml.dump({section: {'ros__parameters': values} for section, values in sections.items()},
                           sort_keys=False)


def divided(section):
    """Return (namespace, node) of a section, of a beam 'beam_2/acu'."""
    return re.fullmatch(r'(.*?)/?((?:beam_[1-9]\d*/)?[^/]*)', section, re.DOTALL).groups()


def node_of(section, namespace=''):
    """Return the node, as 'acu' or 'beam_2/acu', that a section is for in a graph in a namespace such as '/ship_1'.

    EVERY_NODE: each node of the namespace. None: no node of this namespace. A section such as acu, without a slash, is
    for the node of the graph in any namespace; rcl has the rules for the others.
    """
    place, node = divided(section)
    if node in ('*', '**'):
        place, node = (section if node == '**' else place), EVERY_NODE
    levels = {'': '', '*': r'/[^/]+', '**': r'(?:/[^/]+)*'}
    pattern = ''.join(levels.get(level, f'/{re.escape(level)}') for level in place.split('/'))
    return node if section == node or re.fullmatch(pattern, namespace) else None


def dotted(tree, prefix=''):
    """Return {dotted name: value} of nested values. Raises ParameterFileError for a name with two values or none."""
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


def _found(tree, place=''):
    """Yield (section, its body) of a file: a namespace may hold its nodes as sections."""
    for name, body in tree.items():
        section = f'{place.rstrip("/")}/{name.lstrip("/")}' if place else name
        if isinstance(body, dict) and body and 'ros__parameters' not in body and all(
                isinstance(part, dict) for part in body.values()):
            yield from _found(body, section)
        else:
            yield section, body


def parse(content):
    """Return {section: {dotted name: value}} of the text of a file. Raises ParameterFileError, without the file."""
    try:
        tree = plain_yaml.parse(content)
    except yaml.YAMLError as error:
        raise ParameterFileError(plain_yaml.problem(error)) from None
    if not isinstance(tree, dict) or not tree:
        raise ParameterFileError('must hold a section for a node')
    sections = {}
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


def read(path):
    """Return {section: {dotted name: value}} of a file. Raises ParameterFileError."""
    try:
        return parse(files.read_text(path, plain_yaml.MAX_YAML_BYTES))
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterFileError(f'--params-file {path}: {plain_yaml.problem(error)}') from None
    except ParameterFileError as error:
        raise ParameterFileError(f'--params-file {path}: {error}') from None
