"""Generated tables of README.md and docs/, which `make docs` (`python -m tools.reference`) writes again.

A table stands between <!-- table NAME --> and <!-- end --> in a file. It comes from a table of the code or from
docs/rows.json. A test compares the files with the code.
"""
import pathlib
import re
import sys
from collections.abc import Callable, Sequence

from tools.numbers import published

import pedestal_studies
from acu_tracker import modes
from acu_tracker.alarms import table as alarms
from acu_tracker.estimation.filters.kinds import FILTER_KINDS
from drive_law import faults
from pedestal import console
from pedestal_bringup.scenario import shipped
from pedestal_bringup.scenario.sections import parameters_of
from pedestal_common import parameters
from pedestal_common.graph import nodes, topics
from pedestal_common.injection.table import INJECTED_FAULTS
from pedestal_common.text_files.text_table import TextTable
from pedestal_common.wire.commands import Argument
from pedestal_results import results
from pedestal_studies.system.faults import FAULT_EXPECTATIONS
from pedestal_workbench.again import what_if

GENERATED_PAGES = ('README.md', *(f'docs/{name}.md' for name in (  # files with generated tables
    'acquisition', 'budget', 'faults', 'graph', 'measured', 'operating', 'papers', 'parameters', 'studies', 'tools',
    'troubleshooting')))

TABLE_PARAMETERS = (  # the parameters in the table of docs/parameters.md
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

RATE_TEXTS = {'step': 'every step', 'once': 'once, latched or not', 'second': '1 Hz', 'change': 'on change, latched',
              'reply': 'after each request', 'command': 'on request', 'sample': 'at any time, in realtime only'}
"""{rate of a topic, as in topics.Topic: its text in the table of topics}."""


def node_table() -> TextTable:
    """Return the table of the nodes and of the real equipment that they stand for."""
    rows = [(f'`{node.name}`', f'`{node.executable}` ({node.package})' if node.program else '', node.doc,
             node.stands_for) for node in (*nodes.NODES, *nodes.HARDWARE_ROWS)]
    return TextTable(('node', 'executable (package)', 'function', 'stands for'), rows)


def topic_table() -> TextTable:
    """Return the table of the topics."""
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
    """Return the table of the commands of each node, except injected faults, which have a table of their own."""
    rows = [(f'`{node.obeys}`', f'`{verb.name}`', ', '.join(map(_argument, verb.arguments)), verb.doc)
            for node in nodes.UNIT_NODES if node.obeys and node.name not in INJECTED_FAULTS
            for verb in node.unit_type().VERBS]
    return TextTable(('topic', 'command', 'arguments', 'effect'), rows)


def injection_table() -> TextTable:
    """Return the table of the faults that can be injected into each simulated node."""
    rows = [(f'`{node}`', f'`{fault.name}`', ', '.join(map(_defaulted, fault.arguments[:-1])), fault.doc,
             '' if fault.lockstep else 'no') for node, faults in INJECTED_FAULTS.items() for fault in faults]
    return TextTable(('node', 'fault', 'arguments', 'effect', 'in lockstep'), rows)


def _defaulted(argument: Argument) -> str:
    text = f'{argument.name} = {argument.default}' if argument.options else f'{argument.name} = {argument.default:g}'
    return f'`{text}` ({argument.range} {argument.unit}; {argument.doc})'.replace(' ;', ';')


def expectation_table() -> TextTable:
    """Return the table of the expected reactions to each injected fault. Modes with equal reactions share a line."""
    rows = []
    for fault, of_modes in FAULT_EXPECTATIONS.items():
        alike: dict[tuple[str, str, str], list[str]] = {}
        for mode, expected in of_modes.items():
            alike.setdefault(expected.texts(mode), []).append(mode)
        rows += [(f'`{fault}`', ', '.join(modes), *texts) for texts, modes in alike.items()]
    return TextTable(('fault', 'in', 'report', 'largest error', 'ends in'), rows)


def _argument(argument: Argument) -> str:
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
    """Return the table of the alarms. An alarm that each axis has takes one line, with AXIS as its name."""
    def both(text: str) -> str:
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


def parameter_table() -> TextTable:
    """Return the table of TABLE_PARAMETERS."""
    rows = []
    for name in TABLE_PARAMETERS:
        node, _, key = name.partition('.')
        kind = parameters_of(node)
        field, value = dict(parameters.flatten(kind))[key], parameters.defaults(kind)[key]
        meta = field.metadata
        allowed = (f'{meta["low"]:g} to {meta["high"]:g}' if 'low' in meta else ', '.join(meta.get('options', ())))
        text = f'{value:g}' if isinstance(value, float) else str(value)
        rows.append((f'`{name}`', text, allowed, meta.get('unit', ''), meta['doc']))
    return TextTable(('parameter', 'default', 'range', 'unit', 'meaning'), rows)


def result_table(table: Sequence[results.Result] = results.RESULTS) -> TextTable:
    """Return a table of results; table: by default that of a run."""
    return TextTable(('result', 'unit', 'meaning', 'target'),
                     [(f'`{name}`', unit, sentence, target) for name, unit, sentence, target in
                      results.documented(table)])


def exit_code_table() -> TextTable:
    """Return the table of the exit codes of `pedestal run`."""
    return TextTable(('exit code', 'meaning'), [(str(code), meaning) for code, meaning in console.EXIT_CODES.items()])


REFERENCE_TABLES: dict[str, Callable[[], TextTable]] = {
    'nodes': node_table, 'studies': study_table, 'scenarios': scenario_table, 'topics': topic_table,
    'services': service_table, 'modes': mode_table, 'commands': command_table,
    'faults that can be injected': injection_table, 'expected of faults': expectation_table,
    'filter kinds': filter_table, 'drive faults': fault_table, 'alarms': alarm_table, 'results': result_table,
    'exit codes': exit_code_table, 'recomputed results': lambda: result_table(what_if.COMPARISON_RESULTS),
    'first parameters': parameter_table}
"""{name of a table: function that returns it}."""


def with_tables(text: str, rows: published.Rows) -> str:
    """Return a text with the present content of every generated table and number.

    A number of prose is the value of a row times a factor. It stands between two marks:

        <!-- number scenarios leo_pass pointing_rms_deg 1000 .2f -->2.38<!-- end -->

    The words are study, case, metric, factor and format.

    Raises KeyError for an unknown table.
    """
    def table(match: re.Match[str]) -> str:
        name = match[1]
        found = TextTable(*published.TABLES[name](rows)) if name in published.TABLES else REFERENCE_TABLES[name]()
        return '\n'.join((f'<!-- table {name} -->', *found.markdown(), '<!-- end -->'))

    def number(match: re.Match[str]) -> str:
        study, case, metric, factor, form = match[1].split()
        value = rows[study, case, metric]['value']
        return f'<!-- number {match[1]} -->{float(factor) * value:{form}}<!-- end -->'

    text = re.sub(r'<!-- number ([^>]+?) -->.*?<!-- end -->', number, text)
    return re.sub(r'<!-- table ([\w ]+) -->\n.*?<!-- end -->', table, text, flags=re.DOTALL)


def main(root: str | pathlib.Path = '.') -> int:
    """Write the generated tables of a checkout again and print the names of the changed files. Return exit code 0."""
    rows = published.read(root)
    for name in GENERATED_PAGES:
        file = pathlib.Path(root, name)
        old = file.read_text()
        new = with_tables(old, rows)
        if new != old:
            file.write_text(new)
            print(f'{name}: tables written')
    return 0


if __name__ == '__main__':
    sys.exit(main())
