"""Generated tables of README.md and docs/, which `make docs` (`python -m tools.reference`) writes again.

A reference table comes from the tables of the code. A table of measured numbers comes from docs/rows.json. A table
stands between <!-- table NAME --> and <!-- end --> in a file, a number between <!-- number ... --> and <!-- end -->.
Every file with such a mark is written (pages.marked). A test compares the files with the code.
"""
import functools
import pathlib
import re
import sys
from collections.abc import Callable, Mapping, Sequence

from tools import pages
from tools.numbers import published

import pedestal_studies
from acu_tracker import modes
from acu_tracker.alarms import table as alarms
from acu_tracker.estimation.filters.kinds import FILTER_KINDS
from drive_law import faults
from pedestal import cli, console
from pedestal_bringup.scenario import shipped
from pedestal_bringup.scenario.sections import parameters_of
from pedestal_common import parameters
from pedestal_common.graph import nodes, topics
from pedestal_common.graph.graph_parameters import GraphParameters
from pedestal_common.injection.table import INJECTED_FAULTS
from pedestal_common.quantities import Value
from pedestal_common.text_files.text_table import TextTable
from pedestal_common.wire.commands import Argument
from pedestal_results import results
from pedestal_station.station.requests import STATION_COMMANDS
from pedestal_studies.system.faults import FAULT_EXPECTATIONS
from pedestal_workbench.acceptance.methods import METHODS
from pedestal_workbench.again import what_if
from tracking_receiver_sim.tracks import files as track_files
from tracking_receiver_sim.tracks import tables as flight_tables

TABLE_PARAMETERS = (
    'scenario.pacing', 'scenario.seed', 'adu.period', 'adu.transport_delay', 'adu.command_timeout',
    'adu.azimuth.speed_loop.proportional', 'adu.azimuth.bias.schedule',
    'adu.azimuth.speed_loop.disturbance_observer', 'adu.azimuth.structure.inertia_share', 'adu.wind.gust.kind',
    'adu.wind.field.speed', 'adu.mount.collimation', 'adu.azimuth.encoder.error.zero',
    'adu.azimuth.gear_train.lash', 'acu.azimuth.filter.kind', 'acu.azimuth.filter.current_statistical.a_max',
    'acu.azimuth.filter.current_statistical.alpha', 'acu.tracker.ukf.cv_noise',
    'acu.azimuth.feedforward.acceleration_feedforward', 'acu.azimuth.filter.imm.models', 'acu.tracker.gate',
    'acu.azimuth.controller', 'acu.azimuth.feedforward.bandwidth', 'acu.azimuth.notch.frequency',
    'acu.azimuth.shaper.acceleration', 'acu.initial_mode', 'acu.refraction.kind',
    'acu.refraction.pressure_hpa', 'acu.prediction.earth_orientation.file', 'tracking_receiver.receiver.cn0_dbhz',
    'tracking_receiver.antenna.beamwidth', 'tracking_receiver.path.refractivity',
    'tracking_receiver.receiver.latency', 'ship_motion.ship.motion', 'ship_motion.ship.sea_state',
    'ship_motion.ship.spectrum', 'ship_motion.nmea.port', 'ins.method', 'ins.latency')
"""The parameters in the first table of docs/reference/parameters.md."""

PARAMETER_KINDS = {node: parameters_of(node) for node in (
    'scenario', *(node.name for node in nodes.NODES if node.program), 'beam_steering')}
"""{node: dataclass of its parameters} of the other tables of that page."""

VERB_GROUPS = {
    'see what exists': ('scenarios', 'samples', 'parameters'),
    'run a scenario': ('run',),
    'operate a running antenna': ('status', 'mode', 'stop', 'drive', 'ask', 'operate', 'program', 'live', 'simulate'),
    'accept an antenna': ('acceptance',),
    'plan a night of passes': ('plan', 'station'),
    'use a recording': ('verify', 'recover', 'rerun', 'report', 'replay', 'export', 'filter'),
    'compare settings': ('trials', 'recompute'),
    'design an antenna': ('new', 'tune'),
    'calibrate an antenna': ('calibrate',),
    'measure the laws and this machine': ('study', 'bench')}
"""{what a user wants: the verbs for it}, the sections of docs/reference/commands.md."""

RATE_TEXTS = {'step': 'every step', 'once': 'once, latched or not', 'second': '1 Hz', 'change': 'on change, latched',
              'reply': 'after each request', 'command': 'on request', 'sample': 'at any time, in realtime only',
              'station': 'on change, latched, in realtime only'}
"""{rate of a topic, as in topics.Topic: its text in the table of topics}."""


def node_table() -> TextTable:
    """Return the table of the nodes: executable, function, and the equipment of a real antenna that the node stands
    for."""
    rows = [(f'`{node.name}`', f'`{node.executable}` ({node.package})' if node.program else '', node.doc,
             node.stands_for) for node in (*nodes.NODES, *nodes.HARDWARE_ROWS)]
    return TextTable(('node', 'executable (package)', 'function', 'stands for'), rows)


def topic_table() -> TextTable:
    """Return the table of the topics: type, publishers, subscribers, rate, content."""
    links = nodes.links()
    rows = []
    for topic in topics.TOPICS:
        link, kind = links[topic.name], topic.type.replace('/msg/', '/')
        writers = 'every node' if len(link.writers) > 1 else ''.join(link.writers)
        when = RATE_TEXTS[topic.rate] + (f'; with `{topic.flag}`' if topic.flag else '')
        rows.append((f'`{topic.name}`', kind, writers, ', '.join(link.readers), when, topic.doc))
    return TextTable(('topic', 'type', 'from', 'to', 'rate', 'content'), rows)


def service_table() -> TextTable:
    """Return the table of the services of each node that has services."""
    rows = [(f'`{node.name}` ({node.executable})', ', '.join(f'`{name}`' for name in node.unit_type().REQUESTS))
            for node in nodes.UNIT_NODES if node.unit_type().REQUESTS]
    return TextTable(('node', 'services (std_srvs/Trigger)'), rows)


def command_table() -> TextTable:
    """Return the table of the commands of each node on its topic of commands. Injected faults have a table of their
    own."""
    rows = [(f'`{node.obeys}`', f'`{verb.name}`', ', '.join(map(_argument, verb.arguments)), verb.doc)
            for node in nodes.UNIT_NODES if node.obeys and node.name not in INJECTED_FAULTS
            for verb in node.unit_type().VERBS]
    rows += [(f'`{nodes.row("station").obeys}`', f'`{verb.name}`', ', '.join(map(_argument, verb.arguments)), verb.doc)
             for verb in STATION_COMMANDS]
    return TextTable(('topic', 'command', 'arguments', 'effect'), rows)


def verb_table() -> TextTable:
    """Return the table of the verbs of the command line."""
    return TextTable(('you want to', 'verb', 'it does this'), [
        ('' if i else f'[{group}](#{group.replace(" ", "-")})', f'`{verb}`', cli.VERBS[verb][1])
        for group, verbs in VERB_GROUPS.items() for i, verb in enumerate(verbs)])


def injection_table() -> TextTable:
    """Return the table of the faults that can be injected into each simulated node."""
    rows = [(f'`{node}`', f'`{fault.name}`', ', '.join(map(_defaulted, fault.arguments[:-1])), fault.doc,
             '' if fault.lockstep else 'no') for node, faults in INJECTED_FAULTS.items() for fault in faults]
    return TextTable(('node', 'fault', 'arguments', 'effect', 'in lockstep'), rows)


def _defaulted(argument: Argument) -> str:
    """Return the text of an argument of a fault or of a method: its name, default, range, unit and meaning."""
    text = f'{argument.name} = {argument.default}' if argument.options else f'{argument.name} = {argument.default:g}'
    return f'`{text}` ({argument.range} {argument.unit}; {argument.doc})'.replace(' ;', ';')


def method_table() -> TextTable:
    """Return the table of the methods of acceptance."""
    rows = [(f'`{method.name}`', method.doc, method.unit, method.better, ', '.join(map(_defaulted, method.arguments)))
            for method in METHODS]
    return TextTable(('method', 'exercise and measured value', 'unit', 'limit', 'arguments'), rows)


def expectation_table(node: str) -> TextTable:
    """Return the table of the expected reactions to each fault that is injected into a node, by mode of the control
    unit. Modes with equal expectations share a line."""
    rows: list[tuple[str, ...]] = []
    for fault, of_modes in FAULT_EXPECTATIONS.items():
        alike: dict[tuple[str, str, str], list[str]] = {}
        for mode, expected in of_modes.items():
            alike.setdefault(expected.texts(mode), []).append(mode)
        if fault.startswith(f'{node}.'):
            rows += [(f'`{fault}`', ', '.join(modes), *texts) for texts, modes in alike.items()]
    return TextTable(('fault', 'in the modes', 'report', 'largest error', 'ends in'), rows)


def _argument(argument: Argument) -> str:
    """Return the text of an argument of a command with its range and unit, in brackets if it is optional."""
    text = f'{argument.name} = {argument.range} {argument.unit}'.rstrip()
    return f'`{text}`' if argument.default is None else f'[`{text}`]'


def mode_table() -> TextTable:
    """Return the table of the modes of the control unit."""
    return TextTable(('mode', 'motion of the axes', 'condition for entry', 'automatic exit'),
                     [(f'`{mode.name}`', mode.doc, mode.entry, mode.exit) for mode in modes.MODE_ROWS])


def filter_table() -> TextTable:
    """Return the table of the kinds of target filter."""
    return TextTable(('`filter.kind`', 'model'), [(f'`{name}`', kind.doc) for name, kind in FILTER_KINDS.items()])


def fault_table() -> TextTable:
    """Return the table of the faults on which the drive trips."""
    return TextTable(('fault, per axis', 'condition', 'parameter'),
                     [(f'`{fault.name}`', fault.doc, ', '.join(f'`{name}`' for name in fault.parameters))
                      for fault in faults.AXIS_FAULTS])


def alarm_table() -> TextTable:
    """Return the table of the alarms of the control unit. An alarm that each axis has takes one line, with AXIS as the
    name of the axis."""
    def both(text):
        return text.replace(f'{topics.AXES[0]} ', 'AXIS ')
    return TextTable(('alarm', 'priority', 'delay on, off [s]', 'latched', 'consequence of', 'meaning',
                      'action of the operator'),
                     [(f'`{both(alarm.name)}`', alarm.priority, f'{alarm.on_delay:g}, {alarm.off_delay:g}',
                       'yes' if alarm.latched else '', ', '.join(both(name) for name in alarm.cause
                                                                 if not name.startswith(topics.AXES[1])),
                       alarm.meaning, alarm.action)
                      for alarm in alarms.ALARMS if not alarm.name.startswith(topics.AXES[1])])


def scenario_table() -> TextTable:
    """Return the table of the scenarios that come with the product."""
    return TextTable(('scenario', 'events'), [(f'`{name}`', title) for name, title in shipped.available().items()])


def study_table() -> TextTable:
    """Return the table of the studies."""
    return TextTable(('study', 'measurement'),
                     [(f'`{name}`', line) for name, line in pedestal_studies.descriptions().items()])


def first_parameter_table() -> TextTable:
    """Return the table of TABLE_PARAMETERS: default, range, unit, meaning."""
    rows = []
    for name in TABLE_PARAMETERS:
        node, _, key = name.partition('.')
        kind = parameters_of(node)
        rows.append(_parameter_row(name, dict(parameters.flatten(kind))[key], parameters.defaults(kind)[key]))
    return TextTable(PARAMETER_HEADS, rows)


PARAMETER_HEADS = ('parameter', 'default', 'range', 'unit', 'meaning')


def _parameter_row(name: str, field: parameters.Field, value: Value) -> tuple[str, ...]:
    """Return the line of a parameter: a field of a dataclass, and its default."""
    meta = field.metadata
    allowed = f'{meta["low"]:g} to {meta["high"]:g}' if 'low' in meta else ', '.join(meta.get('options', ()))
    cells = f'`{name}`', parameters.value_text(value), allowed, meta.get('unit', ''), meta['doc']
    return tuple(cell.replace('|', '\\|') for cell in cells)


def parameter_table(kind: type) -> TextTable:
    """Return the table of all parameters of a dataclass: default, range, unit, meaning."""
    values = parameters.defaults(kind)
    return TextTable(PARAMETER_HEADS, [_parameter_row(name, field, values[name])
                                       for name, field in parameters.flatten(kind)])


def track_format_table() -> TextTable:
    """Return the table of the formats of track files."""
    return TextTable(('format', 'content', 'a file of this format begins with', 'what is read'), [
        (form.name, form.kind.doc, form.beginning, form.doc) for form in track_files.FILE_FORMATS])


def flight_column_table() -> TextTable:
    """Return the table of the columns by which a CSV file of a flight is known."""
    def names(quantity) -> str:
        return ', '.join(f'`{name}`' for name in quantity.names)
    rows = []
    for layout in flight_tables.CSV_LAYOUTS:
        place = (names(layout.latitude) if layout.latitude == layout.longitude
                 else f'{names(layout.latitude)}; {names(layout.longitude)}')
        altitudes = '; '.join(f'{names(one)} in {"the unit of its name" if "" in one.names.values() else unit}'
                              for one in layout.altitudes for unit in (next(iter(one.names.values())),))
        rows.append((layout.name, names(layout.time), place, altitudes))
    return TextTable(('kind', 'time', 'latitude; longitude', 'altitude, the best first'), rows)


def result_table(table: Sequence[results.Result] = results.RESULTS) -> TextTable:
    """Return the table of results: name, unit, meaning, target. table: rows of results.RESULTS, by default those of a
    run."""
    return TextTable(('result', 'unit', 'meaning', 'target'),
                     [(f'`{name}`', unit, sentence, target) for name, unit, sentence, target in
                      results.documented(table)])


def exit_code_table() -> TextTable:
    """Return the table of the exit codes of `pedestal run`."""
    return TextTable(('exit code', 'meaning'), [(str(code), meaning) for code, meaning in console.EXIT_CODES.items()])


Maker = Callable[[], TextTable]

REFERENCE_TABLES: Mapping[str, Maker] = {
    'verbs': verb_table, 'nodes': node_table, 'studies': study_table, 'scenarios': scenario_table,
    'topics': topic_table, 'services': service_table, 'modes': mode_table, 'commands': command_table,
    'faults that can be injected': injection_table, 'methods of acceptance': method_table,
    **{f'expected of faults of {node}': functools.partial(expectation_table, node) for node in INJECTED_FAULTS},
    'filter kinds': filter_table, 'drive faults': fault_table, 'alarms': alarm_table, 'results': result_table,
    'exit codes': exit_code_table, 'recomputed results': lambda: result_table(what_if.COMPARISON_RESULTS),
    'first parameters': first_parameter_table,
    **{f'parameters of {node}': functools.partial(parameter_table, kind) for node, kind in PARAMETER_KINDS.items()},
    'parameters of every node': functools.partial(parameter_table, GraphParameters),
    'formats of track files': track_format_table, 'columns of flights': flight_column_table}
"""{name of a table: function that returns it}."""


def with_tables(text: str, rows: published.Rows) -> str:
    """Return the text of a file in which every generated table and number is replaced by its present content.

    A number of prose is the value of a row times a factor. It stands between two marks:

        <!-- number scenarios leo_pass pointing_rms_deg 1000 .2f -->2.38<!-- end -->

    The words are study, case, metric, factor and format.

    rows: the measured numbers of docs/rows.json. Raises KeyError for an unknown table.
    """
    def table(match: re.Match[str]) -> str:
        name = match[1]
        found = TextTable(*published.TABLES[name](rows)) if name in published.TABLES else REFERENCE_TABLES[name]()
        return '\n'.join((f'<!-- table {name} -->', *found.markdown(), '<!-- end -->'))

    def number(match: re.Match[str]) -> str:
        return f'<!-- number {match[1]} -->{published.number_of_prose(rows, match[1])}<!-- end -->'
    return pages.TABLE_PATTERN.sub(table, pages.NUMBER_PATTERN.sub(number, text))


def main(root: str | pathlib.Path = '.') -> int:
    """Write the generated tables of a checkout (root) again, and print the names of the changed files. Return the exit
    code 0."""
    rows = published.read(root)
    for name in pages.marked(root):
        file = pathlib.Path(root, name)
        old = file.read_text()
        new = with_tables(old, rows)
        if new != old:
            file.write_text(new)
            print(f'{name}: tables written')
    return 0


if __name__ == '__main__':
    sys.exit(main())
