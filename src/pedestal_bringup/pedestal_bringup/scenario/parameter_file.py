"""ROS 2 parameter files: those of a graph name its nodes /**/acu, which is acu in any namespace. A bare /** would give
both axes' nodes what is meant for one."""
import yaml

from pedestal_common.text_files import plain_yaml

ANY_NAMESPACE = '/**/'


class ParameterFileError(ValueError):
    """A parameter file cannot be read; one line naming the file and the section."""


def text(sections):
    """The file of {node: {name: value}}; a node of a beam is named as 'beam_2/acu'."""
    return yaml.safe_dump({ANY_NAMESPACE + node: {'ros__parameters': values} for node, values in sections.items()},
                          sort_keys=False)


def node_of(section):
    """The node that a section acu, /acu or /**/acu is of."""
    return str(section).removeprefix(ANY_NAMESPACE).removeprefix('/')


def dotted(tree, prefix=''):
    """{dotted name: value} of nested values."""
    flat = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            flat.update(dotted(value, f'{prefix}{key}.'))
        else:
            flat[f'{prefix}{key}'] = value
    return flat


def read(path):
    """{node: {dotted name: value}} of a file. Raises ParameterFileError."""
    try:
        tree = plain_yaml.read(path)
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ParameterFileError(f'--params-file {path}: {plain_yaml.problem(error)}') from None
    if not isinstance(tree, dict) or not tree:
        raise ParameterFileError(f'--params-file {path}: must hold a section for a node')
    sections = {}
    for name, body in tree.items():
        if not isinstance(body, dict) or not isinstance(body.get('ros__parameters', 0), dict | None):
            raise ParameterFileError(f'--params-file {path}: section {name} must hold ros__parameters')
        sections[node_of(name)] = {**sections.get(node_of(name), {}), **dotted(body['ros__parameters'] or {})}
    return sections
