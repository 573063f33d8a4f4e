"""Scenarios: the description of a run as a ROS 2 parameter file, with one section per node and the header `scenario`.
This module reads, checks and completes a scenario for `pedestal run`, the launch file and the closed loop.

A single node also loads the file unchanged: `ros2 run PACKAGE EXECUTABLE --ros-args --params-file SCENARIO.yaml`. For
a node in a namespace, name the sections /**/NODE. The node then lacks the parameters that it shares with other nodes
(_share_parameters). The file parameters.yaml, which `pedestal run` writes beside the bag, contains these too.
"""
import contextlib
import dataclasses
import functools
import itertools
import json
import math
import pathlib
import typing
from collections.abc import Iterable, Iterator, Mapping

import numpy as np
import yaml

from pedestal_bringup.scenario import shipped
from pedestal_common import parameters
from pedestal_common.graph import nodes, topics
from pedestal_common.graph.graph_parameters import GraphParameters
from pedestal_common.graph.nodes import Node
from pedestal_common.quantities import Seconds, Value
from pedestal_common.text_files import files, parameter_file, plain_yaml

if typing.TYPE_CHECKING:
    from pedestal_common.node.unit import Unit
    from pedestal_hardware.monopulse.params import MonopulseParameters
    from tracking_receiver_sim.params import TargetParameters

AnyParameters: typing.TypeAlias = typing.Any        # instance of the parameter class of a node
Sections: typing.TypeAlias = dict[str, dict[str, Value]]    # {node or `scenario`: {dotted name: value}}


_P = typing.TypeVar('_P', bound=parameters.Parameters)


@dataclasses.dataclass(frozen=True)
class ProgramParameters(parameters.Parameters):
    """Parameters of the program track that the operator sends to the control unit (ACU) before the run: the predicted
    target with the errors of the prediction."""
    source: str = parameters.choice('target', ('target', 'none'), 'source of the program track; none: no track')
    interval: float = parameters.parameter(1.0, 0.002, 60.0, 's', 'time between two points')
    time_offset: float = parameters.parameter(0.0, -60.0, 60.0, 's', 'delay of the prediction')
    azimuth_offset: float = parameters.parameter(0.0, -0.2, 0.2, 'rad', 'error of the predicted azimuth')
    elevation_offset: float = parameters.parameter(0.0, -0.2, 0.2, 'rad', 'error of the predicted elevation')
    refractivity: float = parameters.parameter(0.0, 0.0, 500.0, 'N', 'measured refractivity of the air, whose '
                                               'refraction is added to the prediction; 0: no refraction; only for an '
                                               'ACU with refraction.kind none or refraction.program apparent')
    light_time: bool = parameters.flag(False, 'travel time of the wave is part of the prediction')


PROGRAM_ERRORS = {'program.time_offset': 's', 'program.azimuth_offset': 'rad', 'program.elevation_offset': 'rad'}
"""{error of the prediction in the header of a scenario: its unit}."""


@dataclasses.dataclass(frozen=True)
class RestartParameters(parameters.Parameters):
    """Parameters of the restarts of nodes whose process dies in a realtime `pedestal run`. In lockstep a dead node
    ends the run."""
    attempts: int = parameters.parameter(5, 0, 1_000_000, '', 'largest number of restarts of a node in the time '
                                         '`within`; 0: no restart')
    within: float = parameters.parameter(60.0, 1.0, 86400.0, 's', 'time in which the restarts of a node are counted')
    delay: float = parameters.parameter(0.5, 0.0, 60.0, 's', 'delay that each further restart in `within` adds; the '
                                        'first restart has none')
    silence: float = parameters.parameter(30.0, 0.0, 3600.0, 's', 'time without diagnostics after which a node is '
                                          'killed and started again; 0: never')


def _of_graph(name: str) -> Value:
    """Return a field of the header for the parameter graph.NAME, which the header gives to every node."""
    field = GraphParameters.__dataclass_fields__[name]
    return dataclasses.field(default=field.default, metadata=field.metadata)


@dataclasses.dataclass(frozen=True)
class ScenarioParameters(parameters.Parameters):
    """Header of a scenario: its section `scenario`, the parameters that belong to no single node."""
    title: str = parameters.text('', 'description in one line')
    duration: float = parameters.parameter(60.0, 0.1, 86400.0, 's', "length of the run in the drive's time")
    pacing: str = parameters.choice('lockstep', ('lockstep', 'realtime'), 'pacing of the steps: by the '
                                    'messages of the nodes, or by the clock')
    seed: int = parameters.parameter(1, 0, 2**31 - 1, '', 'seed of every noise stream')
    ship: bool = parameters.flag(False, 'the pedestal is on a ship: the nodes ship_motion and ins take part')
    beam: bool = parameters.flag(False, 'the drive is an electronically steered array: beam_steering_node')
    drives: str = parameters.choice('adu', ('adu', 'simulated'), 'adu: the drive unit with its simulated mechanics; '
                                    'simulated: drive_node with four simulated CiA 402 drives on a CAN bus')
    receiver: str = parameters.choice('simulated', ('simulated', 'simulated-iq'), 'simulated: the receiver with its '
                                      'simulated target; simulated-iq: monopulse_receiver_node with simulated I/Q '
                                      'samples')
    beams: int = parameters.parameter(1, 1, nodes.MAX_BEAMS, '', 'number of beams of the array; with several beams, '
                                      'each has receiver and ACU in a namespace beam_1 ...')
    deadline: float = _of_graph('deadline')
    priority: int = _of_graph('priority')
    program: ProgramParameters = parameters.group(ProgramParameters)
    restart: RestartParameters = parameters.group(RestartParameters)

    def check(self) -> None:
        """Raise ParameterError for several beams of a drive with motors, and for servo drives or I/Q of an array."""
        if self.servo and self.beam:
            raise parameters.ParameterError(f'drives = {self.drives}: must be adu with beam = true')
        if self.iq and self.beam:
            raise parameters.ParameterError(f'receiver = {self.receiver}: must be simulated with beam = true')
        if self.beams > 1 and not self.beam:
            raise parameters.ParameterError(f'beams = {self.beams}: must be 1 unless beam = true')

    @property
    def servo(self) -> bool:
        """True if drive_node takes the place of the drive unit."""
        return self.drives != 'adu'

    @property
    def iq(self) -> bool:
        """True if monopulse_receiver_node takes the place of the simulated receiver."""
        return self.receiver != 'simulated'

    @property
    def simulated_parts(self) -> tuple[str, ...]:
        """Nodes that simulate a part of the equipment for a node that is made for real equipment."""
        return ((nodes.SIMULATED_DRIVES.name,) if self.servo else ()) + ((nodes.SIMULATED_IQ.name,) if self.iq else ())

    @property
    def graph_beams(self) -> int:
        """Number of beams of an electronically steered array, 0 for a drive with motors (the convention of
        nodes.links)."""
        return self.beams if self.beam else 0


SECTION_NODES = tuple(node.name for node in nodes.NODES if node.module)  # nodes that can have a section in a scenario
OPTIONAL_NODES = tuple(node.name for node in nodes.NODES if node.optional)  # nodes that take part only on a ship

BEAM_NODES = tuple(node.name for node in nodes.NODES if node.of_beam)
"""Nodes of which each beam of an array has its own."""

SHARED_PARAMETERS = (
    ('adu', 'period', 'acu', 'tracker.receiver.integration'),
    ('adu', 'transport_delay', 'acu', 'command_delay'),
    ('tracking_receiver', 'receiver.latency', 'acu', 'receiver_latency'),
    ('tracking_receiver', 'antenna.beamwidth', 'acu', 'tracker.receiver.beamwidth'),
    ('tracking_receiver', 'antenna.slope', 'acu', 'tracker.receiver.slope'),
    ('tracking_receiver', 'antenna.beamwidth', 'recorder', 'beamwidth'),
    ('tracking_receiver', 'receiver.cn0_time_constant', 'acu', 'acquisition.time_constant'),
    ('ins', 'latency', 'acu', 'attitude_latency'),
    ('ship_motion', 'imu.output', 'ins', 'imu_output'),
    *(('tracking_receiver', f'lever_arm.{axis}', 'acu', f'lever_arm.{axis}') for axis in 'xyz'),
    ('tracking_receiver', 'blockage', 'acu', 'blockage'),
    ('tracking_receiver', 'target.leo_pass.start_time', 'acu', 'prediction.start_time'),
    *(('tracking_receiver', f'target.station.{name}', 'acu', f'prediction.station.{name}')
      for name in ('latitude_deg', 'longitude_deg', 'height')),
)
"""(node, parameter, second node, parameter): the second parameter takes the value of the first where the scenario does
not set it."""


MEASUREMENT_FLAGS = tuple((node.name, topic.measured, topic.flag) for node in nodes.NODES if node.name != 'acu'
                          for topic in map(topics.TOPIC_BY_NAME.__getitem__, node.writes) if topic.measured)
"""(publisher, its parameter `measured`, the subscribers' parameter `flag`) of each optional topic. `measured` and
`flag` stand for the names of two parameters. Both parameters are true if the topic exists (topics.Topic)."""


SCANS_BEFORE_COAST = 2.5  # number of errors of a feed with one output that must be missing before autotrack coasts

SIMULATED_BUS = {'bus.interface': 'socketcand', 'bus.host': '127.0.0.1'}
"""{parameter of drive_node: its only value with simulated drives}, because their bus is a server on this machine."""

IQ_LATENCY_STEPS = 2  # latency of a receiver of I/Q samples for the control unit, in steps of the drive


class ScenarioError(ValueError):
    """Error of a scenario that is unknown or has an invalid value. Its text is one line with file, node, key and
    value."""


@dataclasses.dataclass(frozen=True)
class Scenario:
    """Checked scenario: its header and, for each node that takes part, the values that differ from the defaults.

    With several beams the section `acu` applies to the control unit of every beam. The section of one beam, such as
    `beam_2/acu`, replaces its values. The receivers have sections of the same form.

    values: {node: {dotted name: value}}; notes: lines on limits that `checked` has changed.
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
    def prefixes(self) -> tuple[str, ...]:
        """Prefix of the names of each beam's nodes, ('beam_1/', 'beam_2/', ...); ('',) for a single beam."""
        return nodes.prefixes(self.header.graph_beams)

    def row(self, node: str) -> Node:
        """Return the nodes.Node of one of its nodes."""
        return _row(node, self.header)

    def given(self, node: str) -> dict[str, Value]:
        """Return {dotted name: value} of the values of this scenario for a node."""
        return _values_of(self.values, node)

    def node_parameters(self, node: str) -> AnyParameters:
        """Return the parameter dataclass of one node with the values of this scenario."""
        return _built(self.row(node).parameters_type(), parameters.without_ros(self.given(node)))

    def unit(self, node: str, parameters: parameters.Parameters | None = None) -> 'Unit':
        """Return the unit of one of its nodes. parameters: parameter dataclass in place of that of the scenario."""
        row, chosen = self.row(node), parameters or self.node_parameters(node)
        flags = [flag for flag in topics.TOPIC_FLAGS if getattr(chosen, flag, False)]
        return row.unit_type()(chosen, nodes.reads(row, self.nodes, flags))

    def as_yaml(self) -> str:
        """Return the scenario as a ROS 2 parameter file."""
        sections = {'scenario': parameters.as_dict(self.header), **self.values}
        return plain_yaml.dump({node: {'ros__parameters': values} for node, values in sections.items()})


def _row(node: str, header: ScenarioParameters) -> Node:
    """Return the nodes.Node of a node in the graph of a header."""
    return nodes.row(node, header.beam, header.servo, header.iq)


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
        names = list(shipped.available())
        raise ScenarioError(f'unknown scenario {name!r};{parameters.did_you_mean(name, names)} there are '
                            f'{", ".join(names)} (or give a path that ends in .yaml)')
    return name, entry.read_text()


def _values_of(sections: Sections, node: str) -> dict[str, Value]:
    """Return the values of a node such as beam_2/acu: those of the section `acu` for every beam, replaced by those of
    its own section. A simulated part of equipment has the values of its node, replaced by those of its own section."""
    general = nodes.SIMULATED_PARTS.get(node) or nodes.plain(node)
    return {**sections.get(general, {}), **sections.get(node, {})}


def _is_node(name: str) -> bool:
    """Return True if a name is that of a node with a section in a scenario, such as acu or beam_2/acu."""
    return nodes.plain(name) in (BEAM_NODES if nodes.beam_of(name) else (*SECTION_NODES, *nodes.SIMULATED_PARTS))


def _sections(name: str, content: str) -> Sections:
    with _errors_named(f'scenario {name}'):
        sections = by_node(parameter_file.parse(content))
        if 'scenario' not in sections:
            raise ScenarioError('the section `scenario` is missing')
        return sections


def by_node(sections: Sections, namespace: str = '') -> Sections:
    """Return {node or `scenario`: {dotted name: value}} of the sections of a parameter file, for a graph in a
    namespace such as '/ship_1'. Raises ScenarioError for a section that is for no node of the graph; the caller adds
    the name of the file."""
    found: Sections = {}
    for section, values in sections.items():
        node = parameter_file.node_of(section, namespace)
        for name in _every_node(section, values) if node == parameter_file.EVERY_NODE else [node or '']:
            if name != 'scenario' and not _is_node(name):
                raise ScenarioError(f'section {section!r} {_not_of_the_graph(section, namespace)}')
            found[name] = {**found.get(name, {}), **values}
    return found


def _not_of_the_graph(section: str, namespace: str) -> str:
    """Return a text that states why a section is for no node of a graph, and which name of the section would be
    correct."""
    _, name = parameter_file.divided(section)
    if name == 'scenario' or _is_node(name):
        graph = f'in the namespace {namespace}' if namespace else 'without a namespace'
        return f'is for no node of a graph {graph}; write {parameter_file.ANY_NAMESPACE}{name} or {name}'
    return f'is no node; there are {", ".join(SECTION_NODES)}'


def _every_node(section: str, values: Mapping[str, Value]) -> tuple[str, ...]:
    """Return the nodes of a section for every node, such as /**. Raises ScenarioError if the section has any parameter
    other than those that every ROS 2 node has."""
    for key in parameters.without_ros(values):
        owners = [node for node in SECTION_NODES if key in parameters.defaults(nodes.row(node).parameters_type())]
        sections = ' or '.join(parameter_file.ANY_NAMESPACE + node for node in owners)
        cure = f'write it in the section {sections}' if owners else 'it is a parameter of none'
        raise ScenarioError(f'section {section!r} is for every node: {key}: {cure}')
    return SECTION_NODES


def parameters_of(node: str) -> type[parameters.Parameters]:
    """Return the parameter dataclass of a node, of the header `scenario`, or of the array `beam_steering`. Raises
    ScenarioError for any other name."""
    if node in ('scenario', 'beam_steering'):
        return ScenarioParameters if node == 'scenario' else nodes.ARRAY_DRIVE.parameters_type()
    if not _is_node(node):
        raise ScenarioError(f'{node!r} is no node; there are {", ".join(SECTION_NODES)}, beam_steering, scenario')
    return nodes.row(node).parameters_type()


def parse_override(text: str) -> tuple[str, str, Value]:
    """Return (node, key, value) of a text 'node.key=value' of the option --param; the value is read as YAML. Raises
    ScenarioError."""
    left, equals, right = text.partition('=')
    node, dot, key = left.partition('.')
    if not (equals and dot and key):
        raise ScenarioError(f'--param {text!r}: must be node.key=value, as in '
                            'acu.azimuth.feedforward.bandwidth=12')
    parameters_of(node)
    try:
        return node, key, plain_yaml.parse(right)
    except yaml.YAMLError as error:
        raise ScenarioError(f'--param {text!r}: {plain_yaml.problem(error)}') from None


def override(name: str, value: Value) -> str:
    """Return the text 'name=value', the inverse of parse_override; name: 'node.key'. A text stands without quotes if
    YAML reads the same text from it."""
    with contextlib.suppress(yaml.YAMLError):
        if isinstance(value, str) and plain_yaml.parse(value) == value:
            return f'{name}={value}'
    return f'{name}={json.dumps(value, ensure_ascii=False)}'


def file_sections(path: str | pathlib.Path, namespace: str = '') -> Sections:
    """Return {node or `scenario`: {dotted name: value}} of a ROS 2 parameter file, for a graph in a namespace. Raises
    ParameterFileError, ScenarioError."""
    sections = parameter_file.read(path)
    with _errors_named(f'--params-file {path}'):
        return by_node(sections, f'/{namespace.strip("/")}'.rstrip('/'))


def file_overrides(path: str | pathlib.Path, namespace: str = '') -> list[str]:
    """Return texts 'node.key=value' of a ROS 2 parameter file, for a graph in a namespace. Raises ParameterFileError,
    ScenarioError."""
    sections = file_sections(path, namespace)
    for node, values in sections.items():
        with _errors_named(f'--params-file {path}, {node}'):
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
    """Raise ParameterError for the first value that is neither of an array nor of servo drives."""
    with contextlib.suppress(parameters.ParameterError):
        parameters.check_each(parameters_of(nodes.SIMULATED_DRIVES.name), values)
        return
    parameters.check_each(parameters_of('beam_steering'), values)


@dataclasses.dataclass(frozen=True)
class Draft:
    """Scenario whose values were read but not yet checked together; `checked` makes a Scenario of it.

    sections: {node or `scenario`: {dotted name: value}}.
    """
    name: str
    sections: Sections

    def changed(self, overrides: Iterable[str]) -> 'Draft':
        """Return a new Draft with the values of texts 'node.key=value'. Raises ScenarioError, also for a node that
        takes no part."""
        sections = {node: dict(values) for node, values in self.sections.items()}
        changes = [parse_override(override) for override in overrides]
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
        return _checked(self.name, 'scenario', ScenarioParameters, self.sections['scenario'])

    @property
    def target(self) -> 'TargetParameters':
        """Target parameters of the section `tracking_receiver`."""
        return _target(self.name, self.sections.get('tracking_receiver', {}), self.sections['scenario'])


def draft(name_or_path: str | pathlib.Path) -> Draft:
    """Return the Draft of a scenario, from its name or the path of its .yaml file. Raises ScenarioError."""
    name, content = text(name_or_path)
    return Draft(name, _sections(name, content))


def load(name_or_path: str | pathlib.Path, overrides: Iterable[str] = (), seed: int | None = None,
         duration: Seconds | None = None, pacing: str | None = None) -> Scenario:
    """Return the Scenario of a name or of the path of a .yaml file. overrides: texts 'node.key=value'; for the other
    arguments see `checked`."""
    return checked(draft(name_or_path).changed(overrides), seed, duration, pacing)


def parse(name: str, content: str, overrides: Iterable[str] = (), seed: int | None = None,
          duration: Seconds | None = None, pacing: str | None = None) -> Scenario:
    """Return the Scenario of a YAML text; parse(name, Scenario.as_yaml()) returns the same scenario.

    overrides: texts 'node.key=value'; for the other arguments see `checked`.
    """
    return checked(Draft(name, _sections(name, content)).changed(overrides), seed, duration, pacing)


def checked(new_draft: Draft, seed: int | None = None, duration: Seconds | None = None,
            pacing: str | None = None) -> Scenario:
    """Return the Scenario of a Draft: check each value, and add the parameters that follow from others. This call
    changes the Draft, so use the Draft only once.

    seed, duration [s], pacing: values that replace those of the header; None: no change. A given seed also replaces
    the seeds of the nodes.

    Raises ScenarioError for an unknown name or a value out of range.
    """
    name, sections = new_draft.name, dict(new_draft.sections)
    header_values = sections.pop('scenario')
    for key, value in (('seed', seed), ('duration', duration), ('pacing', pacing)):
        if value is not None:
            header_values[key] = value
    _derive_from_flight(name, sections.get('tracking_receiver', {}), header_values)
    header = _checked(name, 'scenario', ScenarioParameters, header_values)
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
        _checked(name, node, _row(node, header).parameters_type(), _values_of(sections, node))
    _share_parameters(name, sections, header, seed)
    for node in of_beams:
        _share_with_beam(name, node, sections, header, seed)
    notes = _narrow(sections, header)
    for node, values in sections.items():
        try:
            node_parameters = _checked(name, node, _row(node, header).parameters_type(), _values_of(sections, node))
        except ScenarioError as error:
            raise ScenarioError('; '.join((str(error), *notes))) from None
        with _errors_named(f'scenario {name}, {node}'):
            node_parameters.check_graph(header.graph_beams, header.pacing == 'lockstep')
        typed = parameters.as_dict(node_parameters)
        sections[node] = {key: typed.get(key, value) for key, value in values.items()}
    return Scenario(name, header, sections, notes)


LIMIT_ENDS = (('low', 'lower', 1.0), ('high', 'upper', -1.0))
"""The two ends of the travel of an axis: (name of the limit in the control unit, its name in the drive, sign of the
direction into the travel)."""


def _narrow(sections: Sections, header: ScenarioParameters) -> tuple[str, ...]:
    """Set each limit of travel of a control unit to that of the drive if the drive's limit is narrower. Return a line
    for each limit changed.

    Control unit and drive have equal default limits, so a scenario that sets no limit is not changed.
    """
    if header.beam:
        return ()
    drive, notes = nodes.row('adu').parameters_type(), []
    acu_defaults, drive_defaults = parameters.defaults(nodes.row('acu').parameters_type()), parameters.defaults(drive)
    for section in [section for section in sections if nodes.plain(section) == 'acu']:
        for axis, (end, drive_end, inward) in itertools.product(topics.AXES, LIMIT_ENDS):
            own, of_drive = f'{axis}.limits.{end}', f'{axis}.limits.{drive_end}'
            wide: Value = _values_of(sections, section).get(own, acu_defaults[own])
            narrow: Value = sections['adu'].get(of_drive, drive_defaults[of_drive])
            if inward * (narrow - wide) > 0.0:
                sections[section][own] = narrow
                notes.append(f'{section}.{own} = {wide:g} rad is wider than the travel of the drive: '
                             f'adu.{of_drive} = {narrow:g} rad ({math.degrees(narrow):.1f} deg) holds')
    return tuple(notes)


def _target(name: str, receiver_values: Mapping[str, Value],
            header_values: Mapping[str, Value]) -> 'TargetParameters':
    """Return the target parameters of the section `tracking_receiver`."""
    iq = header_values.get('receiver', 'simulated') != 'simulated'
    receiver: AnyParameters = _checked(name, 'tracking_receiver',
                                       nodes.row('tracking_receiver', iq=iq).parameters_type(), receiver_values)
    return receiver.target


def _derive_from_flight(name: str, receiver_values: dict[str, Value],
                        header_values: dict[str, Value]) -> None:
    """Set the parameters that the scenario lacks, from the file of a target's path: station, reference range,
    duration, and for the file of an orbit also the start time. Raises ScenarioError, TableError."""
    target = _target(name, receiver_values, header_values)
    if target.track_file.path and target.kind != 'track_file':
        raise ScenarioError(f'scenario {name}, tracking_receiver: target.track_file.path = '
                            f'{target.track_file.path!r:.60}: has no effect with target.kind = {target.kind}; take '
                            'target.kind = track_file')
    if not target.track_file.path:
        return
    from tracking_receiver_sim import track_files  # imported late, because only a flight needs scipy
    given = {*receiver_values, *({'duration'} & set(header_values))}
    if not given.issuperset(track_files.DERIVED_PARAMETERS):
        for key, value in track_files.derived_parameters(target, given).items():
            (header_values if key == 'duration' else receiver_values).setdefault(key, value)


def _share_parameters(name: str, sections: Sections, header: ScenarioParameters, seed: int | None) -> None:
    """Give every node the parameters that several nodes share: duration of the run, period of a step, seeds, ship,
    latencies, beam.

    name: of the scenario; seed: as of `checked`. Raises ScenarioError if the section of a node has another value.
    """
    def share(node: str, key: str, value: Value) -> None:
        sections[node].setdefault(key, value)
        for section in [section for section in sections if nodes.plain(section) == node]:
            own = sections[section].get(key, value)
            if own != value:
                raise ScenarioError(f'scenario {name}, {section}: {key} = {own}: must be {value}, as for the other '
                                    'nodes; leave it out here')

    for node in ('adu', 'recorder', 'tracking_receiver'):
        share(node, 'duration', header.duration)
    share('recorder', 'scenario', name)
    share('recorder', 'seed', header.seed)
    for node, key in (('ship_motion', 'ship.seed'), ('ship_motion', 'imu.seed'), ('ins', 'seed'),
                      ('tracking_receiver', 'seed')):
        if seed is not None or key not in sections[node]:
            sections[node][key] = header.seed
    for key, value in sections['ship_motion'].items():
        if key.startswith('ship.'):
            share('ins', key, value)

    def value_of(node: str, key: str, otherwise: Value = None) -> Value:
        default = parameters.defaults(_row(node, header).parameters_type()).get(key, otherwise)
        return sections[node].get(key, default)

    for node in ('acu', 'tracking_receiver'):
        share(node, 'period', value_of('adu', 'period'))
    # A flag is given to the subscribers if its topic exists. It is also checked if the scenario itself sets it.
    for owner, key, flag in MEASUREMENT_FLAGS:
        measured = (header.ship or not nodes.row(owner).optional) and value_of(owner, key, False)
        for node in ('acu', 'recorder'):
            if measured or any(flag in values for section, values in sections.items()
                               if nodes.plain(section) == node):
                share(node, flag, measured)
    # With the flag ins_error the control unit takes the errors of the attitude from the INS, so its own parameters
    # tracker.attitude have no effect.
    modelled = [(section, key) for section in sections for key in sections[section]
                if key.startswith('tracker.attitude.')]
    if modelled and sections['acu'].get('ins_error'):
        section, key = modelled[0]
        raise ScenarioError(f'scenario {name}, {section}: {key}: the INS publishes its errors; this parameter needs '
                            'ins.error_told = false')
    if header.iq:
        # The error of a block of samples has the stamp of its middle, and arrives one step after its end.
        of_iq: AnyParameters = _checked(name, 'tracking_receiver', nodes.MONOPULSE_RECEIVER.parameters_type(),
                                        _values_of(sections, 'tracking_receiver'))
        latency = (IQ_LATENCY_STEPS + 0.5 * (of_iq.steps_per_error - 1)) * of_iq.period
        sections['acu'].setdefault('receiver_latency', latency)
        if of_iq.feed.scanned:
            _share_scan(name, of_iq, latency, sections['acu'])
    if header.servo:
        for key, value in SIMULATED_BUS.items():
            if sections['adu'].get(key, value) != value:
                raise ScenarioError(f'scenario {name}, adu: {key} = {sections["adu"][key]}: must be {value} with '
                                    f'drives = {header.drives}')
        # A command acts with the synchronisation after the one that its joint states belong to.
        sections['acu'].setdefault('command_delay', value_of('adu', 'period'))
    for owner, key, node, known_as in SHARED_PARAMETERS:
        if key in sections[owner]:
            sections[node].setdefault(known_as, sections[owner][key])
    if header.beam:
        # Imported late, because its laws take half a second to import.
        from tracking_receiver_sim import receiver
        sections['tracking_receiver'].setdefault('receiver.beam', 'held')
        for prefix in nodes.prefixes(header.graph_beams):
            tracking: AnyParameters = _checked(
                name, f'{prefix}tracking_receiver', nodes.row('tracking_receiver').parameters_type(),
                _values_of(sections, f'{prefix}tracking_receiver'))
            for key, value in (('age', receiver.age(tracking, tracking.period)),
                               ('beam_age', receiver.beam_age(tracking, tracking.period))):
                if f'tracker.receiver.{key}' not in sections['acu']:
                    sections[f'{prefix}acu'].setdefault(f'tracker.receiver.{key}', value)


def _share_scan(name: str, receiver: 'MonopulseParameters', latency: Seconds, values: dict[str, Value]) -> None:
    """Give the section `acu` the parameters that follow from a feed with one output: the noise of its errors, and the
    time between them.

    latency: of the errors. Raises ScenarioError for a scan that is too slow.
    """
    # Imported late, because their laws take half a second to import.
    from acu_tracker.geometry.history import MAX_DELAY_STEPS
    from pedestal_hardware.monopulse import feed
    oldest = MAX_DELAY_STEPS * receiver.period
    if latency > oldest:
        raise ScenarioError(f'scenario {name}, tracking_receiver: feed.scan_rate = {receiver.feed.scan_rate:g} Hz: '
                            f'its errors are up to {latency:g} s old, must be at most {oldest:g} s')
    values.setdefault('tracker.receiver.integration', feed.effective_integration(receiver))
    coast_after = SCANS_BEFORE_COAST * receiver.steps_per_error * receiver.period
    if coast_after > parameters.defaults(nodes.row('acu').parameters_type())['tracker.coast_after']:
        values.setdefault('tracker.coast_after', coast_after)


def _share_with_beam(name: str, node: str, sections: Sections, header: ScenarioParameters, seed: int | None) -> None:
    """Give a node of one beam, such as beam_2/acu, the parameters that it shares with the other nodes of this beam.
    The receiver of the beam gets a seed of its own for its noise."""
    values, beam = sections[node], nodes.beam_of(node)
    own_receiver = f'{beam}/tracking_receiver'
    if node == own_receiver and (seed is not None or 'seed' not in values):
        spread = np.random.SeedSequence((header.seed, int(beam.removeprefix('beam_'))))
        # Seeds are below 2^31.
        values['seed'] = int(spread.generate_state(1)[0] >> 1)
    for owner, key, other, known_as in SHARED_PARAMETERS:
        own = sections.get(f'{beam}/{owner}', {})
        if nodes.plain(node) == other and key in own:
            values.setdefault(known_as, own[key])
    for _, key, _ in MEASUREMENT_FLAGS:
        if key in sections[own_receiver]:
            raise ScenarioError(f'scenario {name}, {own_receiver}: {key}: must be equal for every beam; set it in '
                                'tracking_receiver')


def _checked(name: str, section: str, parameters_type: type[_P], values: Mapping[str, Value]) -> _P:
    """Return the parameter dataclass of a section of the scenario `name`. Raises ScenarioError."""
    with _errors_named(f'scenario {name}, {section}'):
        return _built(parameters_type, values if section == 'scenario' else parameters.without_ros(values))


def _built(parameters_type: type[_P], values: Mapping[str, Value]) -> _P:
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
def _errors_named(origin: str) -> Iterator[None]:
    """Turn the errors of a check into a ScenarioError that begins with their origin: the scenario or file, and the
    section."""
    try:
        yield
    except (ScenarioError, parameters.ParameterError, parameter_file.ParameterFileError) as error:
        raise ScenarioError(f'{origin}: {error}') from None
