"""Texts of a scenario: its file, other ROS 2 parameter files, and changes 'node.key=value' of the option --param."""
import contextlib
import difflib
import json
import pathlib
from collections.abc import Mapping

import yaml

from pedestal_bringup.scenario import shipped
from pedestal_bringup.scenario.sections import (
    SECTION_NODES,
    ScenarioError,
    Sections,
    errors_named,
    is_node,
    parameters_of,
)
from pedestal_common import parameters
from pedestal_common.graph import nodes
from pedestal_common.quantities import Value
from pedestal_common.text_files import files, parameter_file, plain_yaml

MAX_NEAREST_NAMES = 5  # largest number of names that an error lists


def text(name_or_path: str | pathlib.Path) -> tuple[str, str]:
    """Return (name, YAML text) of a scenario that comes with the product, or of a .yaml file. Raises ScenarioError."""
    path = pathlib.Path(name_or_path)
    if path.suffix in ('.yaml', '.yml'):
        try:
            return path.stem, files.read_text(path, plain_yaml.MAX_YAML_BYTES)
        except (OSError, UnicodeDecodeError) as error:
            raise ScenarioError(f'scenario file {path}: {plain_yaml.problem(error)}') from None
    name = str(name_or_path)
    entry = shipped.folder() / f'{name}.yaml'
    if not entry.is_file():
        if path.is_file():
            raise ScenarioError(f'{name!r} is no scenario, whose file ends in .yaml; a track: pedestal run track_file '
                                f'--param tracking_receiver.target.track_file.path={name}; elements: pedestal run '
                                f'leo_pass --tle {name}')
        names = list(shipped.available())
        raise ScenarioError(f'unknown scenario {name!r};{parameters.did_you_mean(name, names)} there are '
                            f'{", ".join(names)} (or give a path that ends in .yaml)')
    return name, entry.read_text()


def sections_of(name: str, content: str) -> Sections:
    """Return the sections of the YAML text of a scenario. Raises ScenarioError."""
    with errors_named(f'scenario {name}'):
        sections = by_node(parameter_file.parse(content))
        if 'scenario' not in sections:
            raise ScenarioError('the section `scenario` is missing')
        return sections


def by_node(sections: Sections, namespace: str = '') -> Sections:
    """Return {node or `scenario`: {dotted name: value}} of the sections of a parameter file, for a graph in a
    namespace such as '/ship_1'. Raises ScenarioError for a section of no node of the graph; the caller adds the name
    of the file."""
    found: Sections = {}
    for section, values in sections.items():
        node = parameter_file.node_of(section, namespace)
        for name in _every_node(section, values) if node == parameter_file.EVERY_NODE else [node or '']:
            if name != 'scenario' and not is_node(name):
                raise ScenarioError(f'section {section!r} {_not_of_the_graph(section, namespace)}')
            found[name] = {**found.get(name, {}), **values}
    return found


def _not_of_the_graph(section: str, namespace: str) -> str:
    """Return the reason why a section is for no node of a graph, with the correct name of the section."""
    _, name = parameter_file.divided(section)
    if name == 'scenario' or is_node(name):
        graph = f'in the namespace {namespace}' if namespace else 'without a namespace'
        return f'is for no node of a graph {graph}; write {parameter_file.ANY_NAMESPACE}{name} or {name}'
    return f'is no node; there are {", ".join(SECTION_NODES)}'


def _every_node(section: str, values: Mapping[str, Value]) -> tuple[str, ...]:
    """Return the nodes of a section such as /**. Raises ScenarioError if it has any parameter that not every ROS 2
    node has."""
    for key in parameters.without_ros(values):
        owners = [node for node in SECTION_NODES if key in parameters.defaults(nodes.row(node).parameters_type())]
        sections = ' or '.join(parameter_file.ANY_NAMESPACE + node for node in owners)
        cure = f'write it in the section {sections}' if owners else 'it is a parameter of none'
        raise ScenarioError(f'section {section!r} is for every node: {key}: {cure}')
    return SECTION_NODES


def parse_override(text: str) -> tuple[str, str, Value]:
    """Return (node, key, value) of a text 'node.key=value' of --param, read as YAML. Raises ScenarioError."""
    left, equals, right = text.partition('=')
    node, dot, key = left.partition('.')
    if not (equals and dot and key):
        raise ScenarioError(f'--param {text!r}: must be node.key=value, as in '
                            f'acu.azimuth.feedforward.bandwidth=12{nearest(left)}')
    try:
        parameters_of(node)
    except ScenarioError as error:
        raise ScenarioError(f'--param {text!r}: {error}{nearest(left)}') from None
    _check_key(text, node, key)
    try:
        return node, key, plain_yaml.parse(right)
    except yaml.YAMLError as error:
        raise ScenarioError(f'--param {text!r}: {plain_yaml.problem(error)}') from None


def _check_key(text: str, node: str, key: str) -> None:
    """Raise ScenarioError for a parameter that neither a node has nor the equipment in its place."""
    own = parameters.defaults(parameters_of(node))
    if key in own or not parameters.without_ros({key: True}) or any(
            key in parameters.defaults(row.parameters_type()) for row in nodes.HARDWARE_ROWS
            if row.name == nodes.plain(node)):
        return
    near = parameters.did_you_mean(key, own)
    raise ScenarioError(f'--param {text!r}: {node}: unknown parameter {key!r}{f";{near}" if near else ""}'
                        f'{nearest(f"{node}.{key}")}')


def nearest(name: str) -> str:
    """Return '; the nearest names are ...' with the parameters of all sections whose names are most like a name, whose
    node may be wrong or missing; '' without any."""
    known = [f'{section}.{key}' for section in (*SECTION_NODES, 'scenario')
             for key, _ in parameters.flatten(parameters_of(section))]
    end = name.partition('.')[2] or name
    same = [full for full in known if full.endswith(f'.{end}')]
    near = same or difflib.get_close_matches(name, known) or [
        full for full in known if full.rpartition('.')[2] in difflib.get_close_matches(
            name.rpartition('.')[2], {full.rpartition('.')[2] for full in known}, n=1)]
    return f'; the nearest names are {", ".join(near[:MAX_NEAREST_NAMES])}' if near else ''


def override(name: str, value: Value) -> str:
    """Return the text 'name=value', the inverse of parse_override. A text stands without quotes if YAML reads it so.
    """
    with contextlib.suppress(yaml.YAMLError):
        if isinstance(value, str) and plain_yaml.parse(value) == value:
            return f'{name}={value}'
    return f'{name}={json.dumps(value, ensure_ascii=False)}'


def file_sections(path: str | pathlib.Path, namespace: str = '') -> Sections:
    """Return by_node of a ROS 2 parameter file, for a graph in a namespace. Raises ParameterFileError, ScenarioError.
    """
    sections = parameter_file.read(path)
    with errors_named(f'--params-file {path}'):
        return by_node(sections, f'/{namespace.strip("/")}'.rstrip('/'))


def file_overrides(path: str | pathlib.Path, namespace: str = '') -> list[str]:
    """Return texts 'node.key=value' of a ROS 2 parameter file. Raises ParameterFileError, ScenarioError."""
    sections = file_sections(path, namespace)
    for node, values in sections.items():
        with errors_named(f'--params-file {path}, {node}'):
            _check_each(node, values)
    return [override(f'{node}.{key}', value) for node, values in sections.items() for key, value in values.items()]


def _check_each(node: str, values: Mapping[str, Value]) -> None:
    """Raise ParameterError for the first value of a node that no scenario accepts. The section `adu` accepts the
    parameters of a drive with motors and those of an array."""
    own = values if node == 'scenario' else parameters.without_ros(values)
    try:
        parameters.check_each(parameters_of(node), own)
    except parameters.ParameterError:
        with contextlib.suppress(parameters.ParameterError):
            if node == nodes.DRIVE_NODE:
                _check_each_of_other_drives(own)
                return
            if node == nodes.MONOPULSE_RECEIVER.name:
                parameters.check_each(parameters_of(nodes.SIMULATED_IQ.name), own)
                return
        raise


def _check_each_of_other_drives(values: Mapping[str, Value]) -> None:
    with contextlib.suppress(parameters.ParameterError):
        parameters.check_each(parameters_of(nodes.SIMULATED_DRIVES.name), values)
        return
    parameters.check_each(parameters_of('beam_steering'), values)
