"""Report of `pedestal recompute`: its printed lines and verdicts, the rows of --json, and the bag of --output."""
import dataclasses
import math
import pathlib
import shlex
from collections.abc import Mapping, Sequence

import numpy as np

from pedestal_bringup.scenario import files, shipped
from pedestal_common import parameters
from pedestal_common.graph import topics
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.quantities import Json, Message, Row, Stamps
from pedestal_common.text_files.text_table import TextTable
from pedestal_common.wire import commands, messages, records
from pedestal_recording.verify import steps_before
from pedestal_recording.writer import Writer
from pedestal_results import intervals, tracking
from pedestal_results.intervals import single
from pedestal_workbench.again import difference, recompute, what_if
from pedestal_workbench.again.difference import Output
from pedestal_workbench.again.feed import FedRecording
from pedestal_workbench.again.recompute import Recomputed


@dataclasses.dataclass
class NodeReport:
    """Report on one recomputed node."""
    lines: list[str]    # to print
    rows: list[Row]
    outputs: Mapping[str, Output]   # the recomputed outputs, by topic
    templates: Mapping[str, Message]    # {topic: message that the node makes}, from which `write` makes the messages
    well: bool = True   # True if the outputs are as required
    first: Sequence[str] = ()   # lines above all others


@dataclasses.dataclass(frozen=True)
class RecomputeOptions:
    """Recording, what is recomputed of it, and how the outputs are compared."""
    bag: pathlib.Path
    beam: str               # name of the beam, '' for the first
    node: list[str]         # nodes to recompute; empty: every node
    param: list[str]        # changes, texts [NODE.]KEY=VALUE
    params_file: pathlib.Path | None        # parameters of the recorded nodes, for a bag without them
    pacing: str | None      # lockstep or realtime; None: as the bag states
    absolute: float | None  # tolerance of every field, in its unit; None: that of the field
    relative: float | None  # tolerance [-]; None: the default
    ignore: list[str]       # patterns of topics and fields that are not compared
    allow_idle: bool        # True to accept a node that did nothing
    output: pathlib.Path | None             # new bag with the recomputed outputs
    fields: bool            # True to print the differences of each field beside changed parameters


def main(options: RecomputeOptions) -> tuple[list[str], list[Row], bool]:
    """Return (lines to print, rows of --json, True if the outputs of all nodes are as required). Raises ValueError."""
    lockstep = None if options.pacing is None else options.pacing == 'lockstep'     # None: as the bag states
    recording = FedRecording(options.bag, lockstep, options.beam)
    given = recompute.file_parameters(options.params_file, recording.bag.beam) if options.params_file else None
    nodes = recompute.chosen(recording, options.node, given)
    changes = recompute.overrides(options.param, nodes)
    if changes:
        unchanged = [name for name in nodes if options.node and name not in changes]
        if unchanged:
            raise ValueError(f'--node {unchanged[0]}: has no effect, because no --param is of it')
        nodes = list(changes)
    if options.output and options.output.exists():
        raise ValueError(f'--output {options.output} exists already; a recording is never overwritten')
    reports = [_node_report(recording, node, given, changes.get(node), options) for node in nodes]
    lines: list[str] = []
    for report in reports:
        lines += [*([''] if lines else []), *report.lines]
    if options.output:
        outputs = {topic: output for report in reports for topic, output in report.outputs.items()}
        templates = {topic: message for report in reports for topic, message in report.templates.items()}
        write(options.output, recording, outputs, templates, changes)
        lines.append(f'written: {options.output}')
    return lines, [row for report in reports for row in report.rows], all(report.well for report in reports)


def _node_report(recording: FedRecording, node: str, given: recompute.Values | None,
                 changes: Mapping[str, Json] | None, options: RecomputeOptions) -> NodeReport:
    """Return the report on a node; given: parameters of --params-file. Without changes of --param, new outputs are
    compared with recorded outputs."""
    params = recompute.parameters_of(recording, node, given)
    done = recompute.recompute(recording, node, params)
    tolerance = difference.Tolerance(options.absolute, options.relative, tuple(options.ignore))
    if changes:
        new = recompute.recompute(recording, node, recompute.parameters_of(recording, node, given, changes),
                                  {step: [command for command, _ in made] for step, made in done.requests.items()})
        report = _old_against_new(recording, done, new, tolerance if options.fields else None,
                                  _changed(params, changes, options.params_file), changes)
    else:
        report = _against_recorded(recording, done, tolerance)
    report.lines[:0] = [*report.first, _title(recording, done, options.params_file), *_substitutes(recording, done),
                         *_input_problems(done), *_requests(done)]
    if not (changes or recording.lockstep or report.well):
        report.lines.append(f'{node}: the recording is realtime: a step differs if one of its messages was in '
                            'transit, and so do the steps after it; `pedestal verify` states the lost steps')
    part = steps_before(recording.bag) > 0
    if part:
        report.lines.append(f'{node}: the recording begins during its run; the recomputation begins with the initial '
                            'state, so it may differ until its filter has converged')
    idle = '' if options.allow_idle or part else recompute.idle(recording, done)
    if idle:
        report.lines.append(f'{node}: NOT exercised: {idle} (allowed with --allow-idle)')
        report.well = False
    return report


def _title(recording: FedRecording, done: Recomputed, params_file: pathlib.Path | None) -> str:
    stamps = done.feed.stamps / NS_PER_SECOND
    span = f'{stamps[0]:g} to {stamps[-1]:g} s' if len(stamps) else 'no step'
    pacing = 'lockstep' if recording.lockstep else 'realtime'
    if params_file:
        origin = f'parameters of {params_file}'
    elif recording.bag.configuration['parameters']:
        origin = 'parameters as recorded'
    else:
        origin = 'DEFAULT parameters, because the recording contains none (set --params-file)'
    return f'{recording.bag.path}: {recording.bag.beam}{done.node}: {len(stamps)} steps, {span}, {pacing}; {origin}'


def _substitutes(recording: FedRecording, done: Recomputed) -> list[str]:
    return [f'no {topic} in the recording: {source} replaces it' for topic in done.feed.rows
            if (source := recording.source(topic)) != topic]


def _input_problems(done: Recomputed) -> list[str]:
    lines = []
    if done.feed.problem:
        lines.append(f'NOT recomputed to the end: {done.feed.problem}')
    if done.feed.refused:
        lines.append(f'{done.feed.refused} inputs refused: their stamps go back')
    return lines


def _requests(done: Recomputed) -> list[str]:
    lines = [line for step, made in done.requests.items() for line in _requests_of_step(done, step, made)]
    return lines + ([f'{len(lines)} requests repeated'] if lines else [])


def _requests_of_step(done: Recomputed, step: int, made: Sequence[tuple[commands.Command, bool]]) -> list[str]:
    return [f'{command} requested at {done.feed.stamps[step] / NS_PER_SECOND:.6f} s{"" if granted else ", refused"}'
            for command, granted in made]


def _against_recorded(recording: FedRecording, done: Recomputed, tolerance: difference.Tolerance) -> NodeReport:
    compared = recompute.compare(recording, done.outputs, done.unit, tolerance)
    if not compared:
        return _new_numbers(recording, done)
    rows = []
    for topic in compared:
        rows += [single(done.node, f'{topic.name} recorded', topic.was),
                 single(done.node, f'{topic.name} recomputed', topic.now),
                 single(done.node, f'{topic.name} problems', len(topic.problems)),
                 single(done.node, f'{topic.name} differences', sum(field.different for field in topic.fields))]
        for field in topic.fields:
            name = f'{topic.name} {field.name}'
            rows += [single(done.node, f'{name} different', field.different),
                     single(done.node, f'{name} beyond tolerance', field.beyond),
                     single(done.node, f'{name} largest', field.largest),
                     single(done.node, f'{name} first', field.first, 's')]
    equal = all(topic.equal for topic in compared)
    verdict = 'identical' if all(topic.identical for topic in compared) else \
        'equal within tolerance' if equal else 'DIFFERS'
    return NodeReport([*difference.lines(compared), f'{done.node}: {verdict}'], rows, done.outputs, done.unit.messages,
                      equal and not done.feed.problem)


def _new_numbers(recording: FedRecording, done: Recomputed) -> NodeReport:
    """Return the report on a node without recorded outputs: numbers of messages and, for the ACU, results."""
    lines = [f'{done.node}: the recording has no output of the node, so there is no comparison']
    lines += [f'{name:34} {len(output.stamps):9} messages' for name, output in done.outputs.items()]
    rows = [single(done.node, f'{name} recomputed', len(output.stamps)) for name, output in done.outputs.items()]
    if done.node == 'acu' and len(done.feed.stamps):
        numbers = what_if.numbers(what_if.evaluated(recording.bag, [done.outputs]))
        lines += _encoder_note(recording)
        lines += TextTable((('', '<42'), ('', '>12'), ''), [(name, intervals.measured(value), unit)
                                                           for name, ((value,), unit) in numbers.items()]).lines()
        rows += [single(done.node, name, value, unit) for name, ((value,), unit) in numbers.items()]
    return NodeReport(lines, rows, done.outputs, done.unit.messages, not done.feed.problem)


def _encoder_note(recording: FedRecording) -> list[str]:
    """Return the note on a recording without the true direction of the dish."""
    return [f'note: {tracking.ENCODER_BEAM_NOTE}'] if tracking.by_encoders(recording.bag) else []


def _changed(params: parameters.Parameters, changes: Mapping[str, Json], params_file: pathlib.Path | None) -> str:
    """Return the line on the changes of parameters: which differ from the old values and which do not."""
    values, origin = parameters.as_dict(params), params_file or 'the recording'
    same = ', '.join(f'{key} = {value}' for key, value in changes.items() if value == values[key])
    different = ', '.join(f'{key} = {value}' for key, value in changes.items() if value != values[key])
    if not different:
        return f'nothing is changed: {origin} has the same values ({same})'
    return f'changed: {different}' + (f'; the same as in {origin}: {same}' if same else '')


def _old_against_new(recording: FedRecording, old: Recomputed, new: Recomputed, tolerance: difference.Tolerance | None,
                     changed: str, changes: Mapping[str, Json]) -> NodeReport:
    """Return the report on a node with changed parameters: whether the difference is significant, old and new results,
    and with a tolerance the differences of the fields."""
    before = {name: recording.output(name) if recording.has(name) else output for name, output in old.outputs.items()}
    origin = 'recorded' if any(map(recording.has, old.outputs)) else 'recomputed with unchanged parameters'
    lines = [f'{changed}; old: {origin}']
    lines += [line for step, made in new.requests.items() for line in _requests_of_step(new, step, made)]
    rows, first = [], []
    if new.node == 'acu' and len(new.feed.stamps):
        cells = []
        versions = what_if.evaluated(recording.bag, [before, new.outputs])
        first = [what_if.significance(versions)]
        for name, ((a, b), unit) in what_if.numbers(versions).items():
            ratio = b / a if a and math.isfinite(b / a) else None
            cells.append((name, intervals.measured(a), intervals.measured(b), ratio, unit))
            rows += [single(new.node, f'{name} old', a, unit), single(new.node, f'{name} new', b, unit)]
        table = TextTable((('metric', '<42'), ('old', '>12'), ('new', '>12'), ('new/old', '>9.4g'), ''), cells)
        lines += [f'note: {what_if.COMPARISON_NOTE}', *_encoder_note(recording), *table.lines(),
                  *_trials_of(recording, changes)]
    if tolerance is not None:
        lines += difference.lines([difference.compare(name, before[name], output, tolerance)
                                   for name, output in new.outputs.items() if not tolerance.ignores(name)])
    return NodeReport(lines, rows, new.outputs, new.unit.messages, first=first)


def _trials_of(recording: FedRecording, changes: Mapping[str, Json]) -> list[str]:
    """Return the line with the command that compares the pointing of both settings over many runs."""
    name = recording.bag.metadata.get('scenario', '')
    if name not in shipped.available():
        return []
    given = [('--against-param', files.override(f'acu.{key}', value)) for key, value in changes.items()]
    command = shlex.join(['pedestal', 'trials', name, *(part for pair in given for part in pair)])
    return [f'the pointing with both settings, over many seeds: {command}']


def write(path: pathlib.Path, recording: FedRecording, outputs: Mapping[str, Output], templates: Mapping[str, Message],
          changes: recompute.Values) -> None:
    """Write the recording as a new bag, with the recomputed topics in place of the recorded ones.

    In lockstep the log time of a message is its stamp. In realtime a recomputed message gets the log time of the
    newest recorded joint state whose stamp is not later than its own.
    """
    named = [topic for topic in topics.TOPICS if topic.name in outputs or topic.name in recording.bag.topics]
    rows = []
    for index, topic in enumerate(named):
        if topic.name not in outputs:
            rows += [(log, index, published, data) for _, log, published, data in recording.bag.raw(topic.name)]
            continue
        output = outputs[topic.name]
        logs = output.stamps if recording.lockstep else _logged(recording, output.stamps)
        rows += [(log, index, log, data) for log, data in zip(logs.tolist(), _bytes(topic.name, output, templates))]
    rows.sort(key=lambda row: row[:2])
    changed = ', '.join(f'{node}.{key}={value}' for node, values in changes.items() for key, value in values.items())
    writer = Writer(path, named, {**recording.bag.metadata, 'recomputed': ' '.join(outputs), 'changed': changed},
                    {name: content for name, content in recording.bag.metadata_records.items() if name != 'pedestal'})
    for log, index, published, data in rows:
        writer.write(index, log, published, data)
    writer.close()


def _logged(recording: FedRecording, stamps: Stamps) -> Stamps:
    """Return the log times of the joint states that are the newest at the stamps."""
    rows, output = recording.rows('joint_states'), recording.output('joint_states')
    return rows.log[np.clip(np.searchsorted(output.stamps, stamps, side='right') - 1, 0, None)]


def _bytes(topic: str, output: Output, templates: Mapping[str, Message]) -> list[bytes]:
    if output.texts is not None:
        return [messages.serialize(messages.String(data=text)) for text in output.texts]
    encoder = records.Encoder(topic, templates[topic])
    return [encoder.bytes_of(stamp, values) for stamp, values in zip(output.stamps.tolist(), output.values)]
