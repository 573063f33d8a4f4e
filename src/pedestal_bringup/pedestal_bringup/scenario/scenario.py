"""Scenarios: the description of a run as a ROS 2 parameter file, with one section per node and the header `scenario`,
read, checked and completed.

A single node also loads the file unchanged: `ros2 run PACKAGE EXECUTABLE --ros-args --params-file SCENARIO.yaml`. For
a node in a namespace, name the sections /**/NODE. The node then lacks the parameters that it shares with other nodes
(rules.share). The file parameters.yaml, which `pedestal run` writes beside the bag, contains these too.
"""
import dataclasses
import pathlib
import typing
from collections.abc import Iterable

from pedestal_bringup.scenario import files, link, rules
from pedestal_bringup.scenario.header import ScenarioParameters
from pedestal_bringup.scenario.sections import (
    BEAM_NODES,
    OPTIONAL_NODES,
    SECTION_NODES,
    AnyParameters,
    ScenarioError,
    Sections,
    built,
    checked_section,
    errors_named,
    row_of,
    values_of,
)
from pedestal_common import parameters
from pedestal_common.graph import nodes, topics
from pedestal_common.graph.nodes import Node
from pedestal_common.quantities import Seconds, Value
from pedestal_common.text_files import plain_yaml

if typing.TYPE_CHECKING:
    from pedestal_common.node.unit import Unit
    from tracking_receiver_sim.params import TargetParameters


@dataclasses.dataclass(frozen=True)
class Scenario:
    """Checked scenario: its header and, for each node that takes part, the values that differ from the defaults.

    With several beams the section `acu` applies to the control unit of every beam. The section of one beam, such as
    `beam_2/acu`, replaces its values. The receivers have sections of the same form. notes: lines on limits that
    `checked` has changed.
    """
    name: str
    header: ScenarioParameters
    values: Sections
    notes: tuple[str, ...] = dataclasses.field(default=(), compare=False)

    @property
    def nodes(self) -> tuple[str, ...]:
        """Nodes that take part, in the order of nodes.NODES and of the beams; the operator takes part only with a
        program track."""
        ship = ('ship_motion', 'ins') if self.header.ship else ()
        operator = ('operator',) if self.header.program.source != 'none' else ()
        return nodes.members((*ship, 'tracking_receiver', 'acu', *self.header.simulated_parts, 'adu', 'recorder',
                              *operator),
                              self.header.graph_beams)

    @property
    def own(self) -> dict[str, str]:
        """{node: program of the user in its place}."""
        return self.header.own_programs

    @property
    def prefixes(self) -> tuple[str, ...]:
        """Prefix of the names of each beam's nodes, ('beam_1/', 'beam_2/', ...); ('',) for a single beam."""
        return nodes.prefixes(self.header.graph_beams)

    def row(self, node: str) -> Node:
        """Return the nodes.Node of one of its nodes."""
        return row_of(node, self.header)

    def given(self, node: str) -> dict[str, Value]:
        """Return {dotted name: value} of the values of this scenario for a node."""
        return values_of(self.values, node)

    def node_parameters(self, node: str) -> AnyParameters:
        """Return the parameter dataclass of one node with the values of this scenario."""
        return built(self.row(node).parameters_type(), parameters.without_ros(self.given(node)))

    def unit(self, node: str, parameters: parameters.Parameters | None = None) -> 'Unit':
        """Return the unit of one of its nodes. parameters: parameter dataclass in place of that of the scenario.
        Raises ScenarioError for a program of the user."""
        if node in self.own:
            raise ScenarioError(f'scenario {self.name}: {self.own[node]} in the place of {node}: only `pedestal run` '
                                'starts a program of the user')
        row, chosen = self.row(node), parameters or self.node_parameters(node)
        flags = [flag for flag in topics.TOPIC_FLAGS if getattr(chosen, flag, False)]
        return row.unit_type()(chosen, nodes.reads(row, self.nodes, flags))

    def as_yaml(self) -> str:
        """Return the scenario as a ROS 2 parameter file."""
        header = {key: value for key, value in parameters.as_dict(self.header).items()
                  if not parameters.is_absent(value)}
        sections = {'scenario': header, **self.values}
        return plain_yaml.dump({node: {'ros__parameters': values} for node, values in sections.items()})


@dataclasses.dataclass(frozen=True)
class Draft:
    """Scenario whose values were read but not yet checked together; `checked` makes a Scenario of it."""
    name: str
    sections: Sections

    def changed(self, overrides: Iterable[str]) -> 'Draft':
        """Return a new Draft with the values of texts 'node.key=value'. Raises ScenarioError, also for a node that
        takes no part."""
        sections = {node: dict(values) for node, values in self.sections.items()}
        changes = [files.parse_override(override) for override in overrides]
        for node, key, value in changes:
            sections.setdefault(node, {})[key] = value
        given = {f'{node}.{key}': value for node, key, value in changes}
        if given.get('ship_motion.ship.motion') == 'recorded' and 'ship_motion.ship.heading_deg' not in given:
            # The recording contains the heading, so the heading of the scenario is removed.
            sections['ship_motion'].pop('ship.heading_deg', None)
        for node, key, value in changes:
            absent = node in OPTIONAL_NODES and not sections['scenario'].get('ship')
            if absent and parameters.without_ros({key: value}):
                raise ScenarioError(f'scenario {self.name}: {node}.{key}: has no effect, because {node} takes no '
                                    'part; scenario.ship = true adds it')
        return Draft(self.name, sections)

    @property
    def header(self) -> ScenarioParameters:
        """Header of the draft as ScenarioParameters."""
        return checked_section(self.name, 'scenario', ScenarioParameters, self.sections['scenario'])

    @property
    def target(self) -> 'TargetParameters':
        """Target parameters of the section `tracking_receiver`."""
        return rules.target_of(self.name, self.sections.get('tracking_receiver', {}), self.sections['scenario'])


def draft(name_or_path: str | pathlib.Path) -> Draft:
    """Return the Draft of a scenario, from its name or the path of its .yaml file. Raises ScenarioError."""
    name, content = files.text(name_or_path)
    return Draft(name, files.sections_of(name, content))


def load(name_or_path: str | pathlib.Path, overrides: Iterable[str] = (), seed: int | None = None,
         duration: Seconds | None = None, pacing: str | None = None) -> Scenario:
    """Return the Scenario of a name or of the path of a .yaml file. overrides: texts 'node.key=value'; else see
    `checked`."""
    return checked(draft(name_or_path).changed(overrides), seed, duration, pacing)


def parse(name: str, content: str, overrides: Iterable[str] = (), seed: int | None = None,
          duration: Seconds | None = None, pacing: str | None = None) -> Scenario:
    """Return the Scenario of a YAML text, such as Scenario.as_yaml(). overrides: texts 'node.key=value'; else see
    `checked`."""
    return checked(Draft(name, files.sections_of(name, content)).changed(overrides), seed, duration, pacing)


def checked(new_draft: Draft, seed: int | None = None, duration: Seconds | None = None,
            pacing: str | None = None) -> Scenario:
    """Return the Scenario of a Draft: check each value, and add the parameters that follow from others. This call
    changes the Draft, so use the Draft only once. seed, duration, pacing: replace those of the header; a given seed
    also replaces the seeds of the nodes. Raises ScenarioError."""
    name, sections = new_draft.name, dict(new_draft.sections)
    header_values = sections.pop('scenario')
    for key, value in (('seed', seed), ('duration', duration), ('pacing', pacing)):
        if value is not None:
            header_values[key] = value
    rules.derive_from_flight(name, sections.get('tracking_receiver', {}), header_values)
    header = checked_section(name, 'scenario', ScenarioParameters, header_values)
    of_beams = [name for name in nodes.members(BEAM_NODES, header.graph_beams) if nodes.beam_of(name)]
    for node in sections:
        if nodes.beam_of(node) and node not in of_beams:
            raise ScenarioError(f'scenario {name}: section {node!r}: the scenario has beams = {header.beams}')
    if header.beam:
        for axis in ('azimuth', 'elevation'):
            sections.setdefault('acu', {}).setdefault(f'{axis}.controller', 'beam')
    for part, key in ((nodes.SIMULATED_DRIVES.name, 'drives'), (nodes.SIMULATED_IQ.name, 'receiver')):
        if part in sections and part not in header.simulated_parts:
            raise ScenarioError(f'scenario {name}: section {part!r}: the scenario has {key} = {getattr(header, key)}')
    for node in (*SECTION_NODES, *of_beams, *header.simulated_parts):
        sections.setdefault(node, {})
        checked_section(name, node, row_of(node, header).parameters_type(), values_of(sections, node))
    types = {node: row_of(node, header).parameters_type() for node in ('adu', 'tracking_receiver')}
    of_link = link.derive(sections, header.dish, header.link, types)
    rules.share(name, sections, header, seed)
    for node in of_beams:
        rules.share_with_beam(name, node, sections, header, seed)
    notes = (*of_link, *rules.narrow(sections, header))
    for node, values in sections.items():
        try:
            node_parameters = checked_section(name, node, row_of(node, header).parameters_type(),
                                              values_of(sections, node))
        except ScenarioError as error:
            raise ScenarioError('; '.join((str(error), *notes))) from None
        with errors_named(f'scenario {name}, {node}'):
            node_parameters.check_graph(header.graph_beams, header.pacing == 'lockstep')
        notes += tuple(f'{node}: {line}' for line in node_parameters.remarks())
        typed = parameters.as_dict(node_parameters)
        sections[node] = {key: typed.get(key, value) for key, value in values.items()}
    return Scenario(name, header, sections, notes)
