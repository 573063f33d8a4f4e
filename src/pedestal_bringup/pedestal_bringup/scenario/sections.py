"""Sections of a scenario: which node a section belongs to, and the checked parameters of a section."""
import contextlib
import functools
import typing
from collections.abc import Iterator, Mapping

from pedestal_bringup.scenario.header import ScenarioParameters
from pedestal_common import parameters
from pedestal_common.graph import nodes
from pedestal_common.graph.nodes import Node
from pedestal_common.quantities import Value
from pedestal_common.text_files import parameter_file

AnyParameters: typing.TypeAlias = typing.Any        # instance of the parameter class of a node

Sections: typing.TypeAlias = dict[str, dict[str, Value]]    # {node or `scenario`: {dotted name: value}}

_P = typing.TypeVar('_P', bound=parameters.Parameters)

SECTION_NODES = tuple(node.name for node in nodes.NODES if node.program)  # nodes that can have a section in a scenario

OPTIONAL_NODES = tuple(node.name for node in nodes.NODES if node.optional)  # nodes that take part only on a ship

BEAM_NODES = tuple(node.name for node in nodes.NODES if node.of_beam)  # of which each beam has its own


class ScenarioError(parameters.ParameterError):
    """Error of an unknown scenario or an invalid value. Its text is one line with file, node, key and value."""


def row_of(node: str, header: ScenarioParameters) -> Node:
    """Return the nodes.Node of a node in the graph of a header."""
    return nodes.row(node, header.beam, header.servo, header.iq)


def values_of(sections: Sections, node: str) -> dict[str, Value]:
    """Return the values of a node such as beam_2/acu: those of the section `acu` for every beam, replaced by those of
    its own section. A simulated part of equipment has the values of its node, replaced by those of its own section."""
    general = nodes.SIMULATED_PARTS.get(node) or nodes.plain(node)
    return {**sections.get(general, {}), **sections.get(node, {})}


def is_node(name: str) -> bool:
    """Return True if a name is that of a node with a section in a scenario, such as acu or beam_2/acu."""
    return nodes.plain(name) in (BEAM_NODES if nodes.beam_of(name) else (*SECTION_NODES, *nodes.SIMULATED_PARTS))


def parameters_of(node: str) -> type[parameters.Parameters]:
    """Return the parameter dataclass of a node, of the header `scenario`, or of `beam_steering`. Raises ScenarioError.
    """
    if node in ('scenario', 'beam_steering'):
        return ScenarioParameters if node == 'scenario' else nodes.ARRAY_DRIVE.parameters_type()
    if not is_node(node):
        raise ScenarioError(f'{node!r} is no node; there are {", ".join(SECTION_NODES)}, beam_steering, scenario')
    return nodes.row(node).parameters_type()


def checked_section(name: str, section: str, parameters_type: type[_P], values: Mapping[str, Value]) -> _P:
    """Return the parameter dataclass of a section of the scenario `name`. Raises ScenarioError."""
    with errors_named(f'scenario {name}, {section}'):
        return built(parameters_type, values if section == 'scenario' else parameters.without_ros(values))


def built(parameters_type: type[_P], values: Mapping[str, Value]) -> _P:
    """Return parameters.build, cached for equal values, because trials of a scenario share most of their values."""
    key = tuple((name, type(value), value) for name, value in values.items())
    hashable = all(isinstance(value, int | float | str | None) for value in values.values())
    if not hashable:
        return parameters.build(parameters_type, values)
    return _built_once(parameters_type, key)  # type: ignore[arg-type]  # mypy regards a dataclass type as unhashable


@functools.lru_cache(256)
def _built_once(parameters_type: type[_P], key: tuple[tuple[str, type, Value], ...]) -> _P:
    return parameters.build(parameters_type, {name: value for name, _, value in key})


@contextlib.contextmanager
def errors_named(origin: str) -> Iterator[None]:
    """Turn the errors of a check into a ScenarioError that begins with their origin."""
    try:
        yield
    except (ScenarioError, parameters.ParameterError, parameter_file.ParameterFileError) as error:
        raise ScenarioError(f'{origin}: {error}') from None
