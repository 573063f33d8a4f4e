"""The verb `pedestal recompute`: what it prints, writes and answers."""
import math

import numpy as np

from pedestal_bringup.again import comparison, recompute, what_if
from pedestal_bringup.bags.writer import Writer
from pedestal_common import messages, records, topics
from pedestal_common.steps import SECOND


def main(options):
    """(lines to print, rows, whether all is well) of the verb's options. Raises ValueError for what fits nothing."""
    recording = recompute.Recording(options.bag, {None: None, 'lockstep': True}.get(options.pacing, False),
                                    options.beam)
    given = recompute.file_parameters(options.params_file, recording.bag.beam) if options.params_file else None
    nodes = recompute.chosen(recording, options.node, given)
    changes = recompute.overrides(options.param, nodes)
    if changes:
        nodes = list(changes)
    tolerance = comparison.Tolerance(options.absolute, options.relative, tuple(options.ignore))
    if changes and options.live:
        raise recompute.RecomputeError('--live compares with what was recorded; --param does not go with it')
    if options.output and options.output.exists():
        raise recompute.RecomputeError(f'--output {options.output} exists already; a recording is never overwritten')
    origin = _origin(recording, options.params_file)
    lines, rows, well, outputs = [], [], True, {}
    for node in nodes:
        params = recompute.parameters_of(recording, node, given)
        done = recompute.recompute(recording, node, params)
        why = '' if options.allow_idle else recompute.idle(recording, done)
        lines += ['' if lines else None, _title(recording, done, origin), *_remarks(recording, done)]
        if changes:
            new = recompute.recompute(recording, node, recompute.parameters_of(recording, node, given, changes[node]),
                                      {step: [service for service, _ in made] for step, made in
                                       done.requests.items()})
            more, found = _old_against_new(recording, done, new, tolerance, changes[node])
            outputs.update(new.outputs)
        else:
            heard = done.outputs
            if options.live:
                from pedestal_bringup.again import live
                heard = live.outputs(recording, done, params)
                lines.append(f'compared is what the process of {node} published, fed in lockstep')
            more, found, equal = _against_recorded(recording, heard, done, tolerance)
            well = well and equal and not done.feed.problem
            outputs.update(heard)
        lines += more
        rows += found
        if why:
            lines.append(f'{node}: NOT exercised: {why} (--allow-idle lets it pass)')
            well = False
    if options.output:
        write(options.output, recording, outputs, done.unit.messages if len(nodes) == 1 else
              _messages(recording, nodes, given), changes)
        lines.append(f'written: {options.output}')
    return [line for line in lines if line is not None], rows, well


def _origin(recording, file):
    if file:
        return f'parameters of {file}'
    if recording.bag.configuration['parameters']:
        return 'parameters as recorded'
    return 'DEFAULT parameters, for the recording does not say how it was made (--params-file)'


def _title(recording, done, origin):
    stamps = done.feed.stamps / SECOND
    span = f'{stamps[0]:g} to {stamps[-1]:g} s' if len(stamps) else 'no step'
    pacing = 'lockstep' if recording.lockstep else 'realtime'
    return f'{recording.bag.path}: {recording.bag.beam}{done.node}: {len(stamps)} steps, {span}, {pacing}; {origin}'


def _remarks(recording, done):
    """What is to be known about the inputs."""
    said = []
    if done.feed.problem:
        said.append(f'NOT recomputed to the end: {done.feed.problem}')
    if done.feed.refused:
        said.append(f'{done.feed.refused} inputs refused: their stamps go back')
    for step, made in done.requests.items():
        said += [f'{service} asked for at {done.feed.stamps[step] / SECOND:.6f} s{"" if granted else ", and refused"}'
                 for service, granted in made]
    if done.requests:
        said.append(f'{sum(map(len, done.requests.values()))} requests fed')
    return said


def _row(node, metric, value, unit=''):
    return {'case': node, 'metric': metric, 'value': value if math.isfinite(value) else None, 'unit': unit,
            'paper': None, 'target': None}


def _against_recorded(recording, outputs, done, tolerance):
    """(lines, rows, whether equal) of what a node says now against what it said."""
    compared = recompute.compare(recording, outputs, done.unit, tolerance)
    if not compared:
        return _new_numbers(recording, done)
    lines, rows = comparison.lines(compared), []
    for topic in compared:
        rows += [_row(done.node, f'{topic.name} recorded', topic.recorded),
                 _row(done.node, f'{topic.name} recomputed', topic.recomputed),
                 _row(done.node, f'{topic.name} problems', len(topic.problems))]
        rows.append(_row(done.node, f'{topic.name} differences', sum(field.different for field in topic.fields)))
        for field in topic.fields:
            name = f'{topic.name} {field.name}'
            rows += [_row(done.node, f'{name} different', field.different),
                     _row(done.node, f'{name} beyond tolerance', field.beyond),
                     _row(done.node, f'{name} largest', field.largest),
                     _row(done.node, f'{name} first', field.first, 's')]
    equal = all(topic.equal for topic in compared)
    if all(topic.identical for topic in compared):
        lines.append(f'{done.node}: identical')
    else:
        lines.append(f'{done.node}: {"equal within tolerance" if equal else "DIFFERS"}')
    return lines, rows, equal


def _new_numbers(recording, done):
    lines = [f'{done.node}: none of its outputs is in the recording: nothing to compare']
    lines += [f'{name:34} {len(output.stamps):9} messages' for name, output in done.outputs.items()]
    rows = [_row(done.node, f'{name} recomputed', len(output.stamps)) for name, output in done.outputs.items()]
    if done.node == 'acu' and len(done.feed.stamps):
        numbers = what_if.numbers(recording.bag, [done.outputs])
        lines += [f'{name:42} {_text(value):>12} {unit}' for name, ((value,), unit) in numbers.items()]
        rows += [_row(done.node, name, value, unit) for name, ((value,), unit) in numbers.items()]
    return lines, rows, True


def _text(value):
    return f'{value:.6g}' if math.isfinite(value) else 'not measured'


def _old_against_new(recording, old, new, tolerance, changes):
    """(lines, rows) of a node recomputed with changed parameters: numbers of both, and how far its messages moved."""
    before = {name: recording.output(name) if recording.has(name) else output for name, output in old.outputs.items()}
    whose = 'recorded' if any(map(recording.has, old.outputs)) else 'recomputed with the parameters unchanged'
    lines = [f'changed: {", ".join(f"{key} = {value}" for key, value in changes.items())}; old is {whose}']
    lines += [line for line in _remarks(recording, new) if 'asked for' in line]
    rows = []
    if new.node == 'acu' and len(new.feed.stamps):
        lines += [f'note: {what_if.NOTE}', f'{"metric":42} {"old":>12} {"new":>12} {"new/old":>9}']
        for name, ((a, b), unit) in what_if.numbers(recording.bag, [before, new.outputs]).items():
            ratio = f'{b / a:9.4g}' if a and math.isfinite(b / a) else f'{"":9}'
            lines.append(f'{name:42} {_text(a):>12} {_text(b):>12} {ratio} {unit}'.rstrip())
            rows += [_row(new.node, f'{name} old', a, unit), _row(new.node, f'{name} new', b, unit)]
    return lines + comparison.lines([comparison.compare(name, before[name], output, tolerance)
                                     for name, output in new.outputs.items() if not tolerance.ignores(name)]), rows


def _messages(recording, nodes, given):
    found = {}
    for node in nodes:
        kind = recompute.kind_of(recording, node)
        params = recompute.parameters_of(recording, node, given)
        found.update(kind.unit(params, recording.has(kind.ship)).messages)
    return found


def write(path, recording, outputs, templates, changes):
    """Write a bag: the recording with some topics replaced. A message is logged at its stamp in lockstep; else a new
    one is logged with the newest recorded message whose stamp is not after its own."""
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
    said = ', '.join(f'{node}.{key}={value}' for node, values in changes.items() for key, value in values.items())
    writer = Writer(path, named, {**recording.bag.metadata, 'recomputed': ' '.join(outputs), 'changed': said},
                    {name: content for name, content in recording.bag.metadata_records.items() if name != 'pedestal'})
    for log, index, published, data in rows:
        writer.write(index, log, published, data)
    writer.close()


def _logged(recording, stamps):
    """When messages of these stamps would have been logged: with the recorded joint states."""
    rows, output = recording.rows('joint_states'), recording.output('joint_states')
    return rows.log[np.clip(np.searchsorted(output.stamps, stamps, side='right') - 1, 0, None)]


def _bytes(topic, output, templates):
    """The CDR messages of an Output."""
    if output.texts is not None:
        return [messages.serialize(messages.String(data=text)) for text in output.texts]
    message, made = templates[topic], []
    for stamp, values in zip(output.stamps.reshape(-1, 1), output.values):
        records.put(message, records.Slot(stamp, values))
        made.append(messages.serialize(message))
    return made
