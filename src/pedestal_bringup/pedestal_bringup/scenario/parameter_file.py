"""ROS 2 parameter files. The files of a graph name its nodes /**/acu, which is acu in any namespace, because a bare
/** would give the values of one node to all nodes."""
import yaml

from pedestal_common.text_files import plain_yaml

ANY_NAMESPACE = '/**/'


class ParameterFileError(ValueError):
    """Error of a parameter file that cannot be read; one line with the file and the section."""


def text(sections):
    """Return the file of {node: {name: value}}; a node of a beam is named as 'beam_2/acu'."""
    return yaml.safe_dump({ANY_NAMESPACE + node: {'ros__parameters': values} for node, values in sections.items()},
                          sort_keys=False)


def node_of(section):
    """Return the node of a section acu, /acu or /**/acu."""
    return str(section).removeprefix(ANY_NAMESPACE).removeprefix('/')


def dotted(tree, prefix=''):
    """Return {dotted name: value} of nested values."""
    flat = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            flat.update(dotted(value, f'{prefix}{key}.'))
        else:
            flat[f'{prefix}{key}'] = value
    return flat


def read(path):
    """Return {node: {dotted name: value}} of a file. Raises ParameterFileError."""
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
