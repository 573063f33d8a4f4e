"""`pedestal report`: a recording as one HTML file that needs nothing else, and its figures as PNG."""
import hashlib
import html
import io
import math
import pathlib

import numpy as np

from pedestal_bringup.analysis import consistency, isolation, known_attitude, results, tracking
from pedestal_bringup.bags import bag as bags
from pedestal_bringup.bags.verify import verify
from pedestal_bringup.report import attitude_figures, figures, filter_figures
from pedestal_common import topics

SHOWN = 200
"""Rows of the table of diagnostics at the most."""

STYLE = """
:root { color-scheme: light dark; --ink: #20242a; --soft: #626a75; --line: #d5dae0; --paper: #ffffff; --bad: #b3261e; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #dfe3e8; --soft: #9aa3ae; --line: #3a414a; --paper: #16191d; --bad: #ff8a80; } }
@media print {
  :root { color-scheme: light; --ink: #000000; --soft: #444444; --line: #bbbbbb; --paper: #ffffff; --bad: #b3261e; }
  figure { break-inside: avoid; } body { padding: 0; max-width: none; } }
body { margin: 0 auto; padding: 1.2rem; max-width: 60rem; color: var(--ink); background: var(--paper);
       font: 1rem/1.45 system-ui, sans-serif; }
h1 { font-size: 1.6rem; margin: 0 0 .2rem; }
h2 { font-size: 1.15rem; margin: 2rem 0 .4rem; padding-top: .8rem; border-top: 1px solid var(--line); }
p, figcaption { margin: .3rem 0; } .soft, figcaption { color: var(--soft); font-size: .92rem; }
.bad { color: var(--bad); font-weight: 600; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: .5rem 0; font-size: .95rem; font-variant-numeric: tabular-nums; }
th, td { padding: .22rem 1.4rem .22rem 0; text-align: left; vertical-align: top;
         border-bottom: 1px solid var(--line); }
th { font-weight: 600; } tbody th { font-weight: 400; } td.n, th.n { text-align: right; }
.n tbody th { min-width: 8rem; }
.meta th { color: var(--soft); } .meta td { overflow-wrap: anywhere; }
figure { margin: 0 0 1.4rem; } figure h3 { font-size: 1rem; margin: 1.2rem 0 .1rem; }
figure svg { display: block; width: 100%; height: auto; min-width: 26rem; }
@media (max-width: 40rem) {
  body { padding: .6rem; } th, td { padding-right: .7rem; } .n tbody th { min-width: 6rem; } }
"""


def write(bag_path, output=None, png_folder=None, beam='') -> pathlib.Path:
    """Write the report of a bag and return where: output, default report.html in the bag (beside a bare .mcap).

    beam: of several, default the first. png_folder: also each figure, and the overview, as PNG there. The same bag
    gives the same bytes.
    Raises bag.BagError when the bag cannot be read to its end, OSError when the report cannot be written.
    """
    bag = bags.read(bag_path, beam)
    output = pathlib.Path(output) if output is not None else bag.file.parent / 'report.html'
    recording = _recording(bag)
    page = _page(bag, recording)
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(page, encoding='utf-8')
    if png_folder is not None:
        folder = pathlib.Path(png_folder)
        folder.mkdir(parents=True, exist_ok=True)
        for spec in (*figures.FIGURES, *filter_figures.FIGURES, *attitude_figures.FIGURES, figures.OVERVIEW):
            if not _missing(spec, recording):
                figures.render(spec, recording, folder / f'{spec.key}.png')
    return output


def _missing(spec, recording):
    """Why a figure cannot be drawn, '' when it can."""
    return '; '.join(dict.fromkeys(filter(None, map(recording.lacks, spec.needs))))


def _table(bag, topic):
    """The columns of a topic; None without a message or when it is of another type than the graph's.

    Raises bag.BagError when the stamps of a topic of the steps go back: nothing drawn over them would be true.
    """
    if bag.topics.get(topic) != topics.BY_NAME[topic].type or not bag.rows(topic).size:
        return None
    table = bag.table(topic)
    back = np.flatnonzero(np.diff(table['t']) < 0.0) if topics.BY_NAME[topic].rate == 'step' else np.zeros(0, int)
    if back.size:
        raise bags.BagError(f'{bag.file}: the stamps of {topic} go back, the first from {table["t"][back[0]]:.6f} to '
                            f'{table["t"][back[0] + 1]:.6f} s; `pedestal verify` says what else is wrong')
    return table


def _tracking(bag):
    """(Tracking, '') or (None, why not)."""
    absent = [name for name in ('joint_states', 'target/truth') if _table(bag, name) is None]
    if absent:
        return None, f'no message of {" and ".join(absent)}'
    if bag.rows('joint_states').size < 2:
        return None, 'fewer than two steps'
    try:
        return tracking.read(bag), ''
    except KeyError as error:
        return None, f'no number {error.args[0]} where the graph would have one'


def _recording(bag):
    run, no_truth = _tracking(bag)
    raw = figures.raw_angles(run, _table(bag, 'ship/truth')) if run is not None else None
    motors = _table(bag, 'adu/motor_states')
    if motors and not {f'{axis}_motor_{i}.effort' for axis in ('azimuth', 'elevation') for i in (1, 2)} <= set(motors):
        motors = None
    statuses = [(log / 1e9, status.name, int(status.level), status.message)
                for _, log, _, array in bag.messages('diagnostics') for status in array.status
                ] if _table(bag, 'diagnostics') else []
    return figures.Recording(run, no_truth, raw, motors, _table(bag, 'tracking_receiver/angle_error'), _modes(bag),
                             statuses, tracking.beamwidth(bag), _filter(bag, run), _attitude(bag))


def _filter(bag, run):
    """The consistency.Consistency, None without truth or without its numbers."""
    try:
        return consistency.read(bag, run) if run is not None and _table(bag, 'acu/filter') is not None else None
    except KeyError:
        return None


def _attitude(bag):
    """The known_attitude.KnownAttitude, None ashore or without its numbers."""
    try:
        return known_attitude.read(bag) if _table(bag, 'ship/imu/data') is not None else None
    except KeyError:
        return None


def _modes(bag):
    """[(start, stop [s], mode)], one for each change."""
    table = _table(bag, 'acu/mode')
    if table is None:
        return []
    end = bag.index.log.max() / 1e9
    starts, names = [], []
    for start, name in zip(table['t'].tolist(), table['data']):
        if not names or names[-1] != name:
            starts.append(start)
            names.append(name)
    return list(zip(starts, [*starts[1:], end], names))


def _number(value, unit=''):
    text = f'{value:#.4g}'.rstrip('.') if math.isfinite(value) else 'not measured'
    return f'{text}\N{NO-BREAK SPACE}{unit}'.rstrip() if math.isfinite(value) else text


def _rows(head, rows, kind=''):
    """An HTML table; the first cell of a row is its name, the others right-aligned when numeric (kind 'n')."""
    def line(cells, tag):
        rest = ''.join(f'<{tag} class="{kind}">{html.escape(cell)}</{tag}>' if kind != 'meta' and kind else
                       f'<{tag}>{html.escape(cell)}</{tag}>' for cell in cells[1:])
        return f'<tr><th>{html.escape(cells[0])}</th>{rest}</tr>'
    top = f'<thead>{line(head, "th")}</thead>' if head else ''
    return (f'<div class="wide"><table class="{kind}">{top}<tbody>{"".join(line(row, "td") for row in rows)}'
            '</tbody></table></div>')


def _pointing(bag, recording, values):
    """Rows of the table of pointing and torques, per axis."""
    noise = values['single_sample_noise_deg'][0]

    def row(name, *keys, scale=1.0, unit='deg'):
        return [name, *(_number(values[key][0] / scale, unit) for key in keys)]

    rms = ('cross_elevation_rms_deg', 'elevation_rms_deg', 'pointing_rms_deg')
    largest = ('cross_elevation_max_deg', 'elevation_max_deg', 'pointing_max_deg')
    rows = [row('pointing error, rms', *rms), row('pointing error, largest', *largest),
            row("rms / receiver's single-sample noise", *rms, scale=noise, unit=''),
            row("largest / receiver's single-sample noise", *largest, scale=noise, unit=''),
            row('noise reduction by the filter', 'noise_reduction_cross_elevation', 'noise_reduction_elevation',
                'noise_reduction', unit='')]
    joints = _table(bag, 'joint_states')
    rows.append(['load torque, rms of the run',
                 *(_number(tracking.rms(joints.get(f'{axis}.effort', np.zeros(0))), 'Nm')
                   for axis in ('azimuth', 'elevation')), ''])
    return rows + _torques(recording)


def _torques(recording):
    return [[f'torque of motor {i}, rms of the run',
             *(_number(tracking.rms(recording.motors[f'{axis}_motor_{i}.effort']), 'Nm')
               for axis in ('azimuth', 'elevation')),
             ''] for i in (1, 2)] if recording.motors else []


def _labelled(parts, *names):
    """Rows [label, number] of the results of some parts: those named, else all that have a label."""
    values = results.measured(parts)
    return [[results.BY_NAME[name].label, _number(*values[name])] for name in names or values
            if results.BY_NAME[name].label]


def _honesty(found):
    """The table of the filter's consistency, and a sentence for each axis."""
    judged = [consistency.axis(found, i) for i in range(2)]

    def row(name, field, unit='', scale=1.0):
        return [name, *(_number(scale * getattr(axis, field), unit) for axis in judged), '']

    degrees = math.degrees(1.0)
    rows = [row('mean NIS', 'nis'), row('expected of an honest filter', 'nis_expected'),
            row(f'NIS inside their {100.0 * consistency.PART:g} % band', 'nis_inside', '%', 100.0),
            row('mean NEES (angle and rate)', 'nees'),
            [f'{100.0 * consistency.PART:g} % band of the mean, 2 expected',
             *(' to '.join(map(_number, axis.nees_band)) for axis in judged), ''],
            row('independent errors', 'count'),
            row('angle error, rms', 'error', 'deg', degrees), row('sigma it states', 'sigma', 'deg', degrees),
            row('rate error, rms', 'rate_error', 'deg/s', degrees),
            row('rate sigma it states', 'rate_sigma', 'deg/s', degrees)]
    said = ''.join(f'<p>{name.capitalize()}: {html.escape(axis.verdict)}.</p>'
                   for name, axis in zip(('azimuth', 'elevation'), judged))
    return _rows(['', 'azimuth', 'elevation', ''], rows, 'n') + said + (
        '<p class="soft">Over the evaluated part. NIS: innovations in units of what the filter expects of them; NEES: '
        'errors against the truth in units of what it states. On a ship the attitude error of the INS is among them, '
        'which no filter of the target knows.</p>')


def _loop(bag, check):
    """Rows on the control loop: its rate in the drive's time, in realtime also in wall time, and what was lost."""
    rows = []
    joints = _table(bag, 'joint_states')
    if joints is not None and joints['t'].size > 1:
        t = joints['t']
        rows.append(["loop rate achieved (drive's time)", _number((t.size - 1) / (t[-1] - t[0]), 'Hz')])
        if bag.metadata.get('pacing') == 'realtime':
            wall = bag.rows('joint_states').publish
            jitter = (np.diff(wall) - check.period * 1e9) / 1e6
            late = np.percentile(np.abs(jitter), 99.0)
            rows += [['loop rate achieved (wall time)', _number((t.size - 1) / (wall[-1] - wall[0]) * 1e9, 'Hz')],
                     ['jitter of the step, wall time',
                      f'{tracking.rms(jitter):.3g} ms rms, 99 % within {late:.3g} ms, '
                     f'largest {np.abs(jitter).max():.3g} ms']]
    lost = max([check.steps - topic.count for topic in check.topics
                if topic.problems and topic.name in topics.BY_NAME and topics.BY_NAME[topic.name].rate == 'step'],
               default=0)
    return [*rows, ['steps', f'{check.steps}'], ['lost steps', f'{max(lost, 0)}'],
            ['recording', 'complete, every step once and in order' if check.complete else
             'NOT complete, see below']]


def _diagnostics(statuses):
    """Rows of what was not OK: a node's repeated message is one row."""
    rows, last = [], {}
    for stamp, node, level, message in statuses:
        now = (level, message)
        row = last.get(node)
        if row is not None and row['now'] == now:
            row['stop'], row['count'] = stamp, row['count'] + 1
            continue
        last[node] = {'now': now, 'start': stamp, 'stop': stamp, 'count': 1, 'node': node}
        if level:
            rows.append(last[node])
    return [[f'{row["start"]:.1f}' if row['count'] == 1 else f'{row["start"]:.1f} to {row["stop"]:.1f}', row['node'],
             figures.LEVELS[min(row['now'][0], 3)][0], row['now'][1]] for row in rows]


def _problems(check):
    return check.problems + [f'{topic.name}: {problem}' for topic in check.topics for problem in topic.problems]


def _figure(spec, recording):
    caption = f'<h3>{html.escape(spec.title)}</h3>'
    reason = _missing(spec, recording)
    if reason:
        return f'<figure id="{spec.key}">{caption}<p class="bad">Not drawn: {html.escape(reason)}.</p></figure>'
    stream = io.StringIO()
    figures.render(spec, recording, stream)
    return (f'<figure id="{spec.key}">{caption}<figcaption>{html.escape(spec.caption)}</figcaption>'
            f'<div class="wide">{figures.inline(stream.getvalue())}</div></figure>')


def _page(bag, recording):
    check = verify(bag.path)
    name = (bag.metadata.get('scenario') or bag.file.stem) + f'/{bag.beam}'.rstrip('/')
    stamps = bag.index.log
    duration = (stamps.max() - stamps.min()) / 1e9 if stamps.size else 0.0
    data = bag.file.read_bytes()
    versions = ', '.join(f'{key.removeprefix("version.")} {value}' for key, value in bag.metadata.items()
                         if key.startswith('version.'))
    meta = [[key, value] for key, value in bag.metadata.items() if not key.startswith('version.')]
    meta += [['duration', f'{duration:g} s'], ['versions', versions or 'not in the bag'],
             ['file', f'{bag.file.name}, {len(data) / 1e6:.2f} MB, {stamps.size} messages'],
             ['sha256', hashlib.sha256(data).hexdigest()]]
    parts = [f'<h1>Tracking run: {html.escape(name)}</h1>', _rows(None, meta, 'meta'), '<h2 id="results">Results</h2>']
    run_rows = []
    if recording.run is None:
        parts.append(f'<p class="bad">Not compared with the truth: {html.escape(recording.no_truth)}.</p>')
        if recording.motors:
            parts.append(_rows(['', 'azimuth', 'elevation', ''], _torques(recording), 'n'))
    else:
        values = results.measured(results.of_tracking(recording.run))
        if not recording.run.tracking.any():
            parts.append('<p class="bad">The run was never in autotrack for longer than the settling time, so nothing '
                         'was evaluated.</p>')
        parts.append(_rows(['', 'cross-elevation (azimuth)', 'elevation', 'both axes'],
                           _pointing(bag, recording, values), 'n'))
        parts.append('<p class="soft">Pointing and noise over the evaluated part: autotrack, from '
                     f'{tracking.SETTLING:g} s after its start. Both axes: all samples of both, per axis.'
                     '</p>')
        run_rows = _labelled(results.of_tracking(recording.run), 'single_sample_noise_deg', 'lock_time_s',
                             'autotrack_time_s', 'evaluated_time_s', 'loss_s')
    parts.append(_rows(None, run_rows + _loop(bag, check), 'n'))
    if not check.complete:
        parts.append('<h2 id="gaps">What the recording lacks</h2><ul>' + ''.join(
            f'<li>{html.escape(problem)}</li>' for problem in _problems(check)) + '</ul>')
    absent = [topic for topic in bag.graph if topic not in bag.topics or not bag.rows(topic).size]
    if absent:
        parts.append(f'<p class="soft">No message in this bag of: {", ".join(absent)}.</p>')
    parts.append('<h2 id="figures">Figures</h2><p class="soft">The paper: antenna tracking with a Kalman filter and a '
                 'dual-motor anti-backlash drive, its UAV experiment. Grey: measured, blue: filtered or achieved, '
                 'orange: truth.</p>')
    parts += [_figure(spec, recording) for spec in figures.FIGURES]
    parts.append('<h2 id="filter">Is the filter honest?</h2>')
    if recording.filter is not None:
        parts.append(_honesty(recording.filter))
    parts += [_figure(spec, recording) for spec in filter_figures.FIGURES]
    if recording.attitude is not None:
        parts.append('<h2 id="attitude">The deck</h2>')
        ship = isolation.read(bag, recording.run) if recording.run is not None else None
        parts.append(_rows(None, _labelled({'attitude': recording.attitude}) + _labelled({'isolation': ship}), 'n'))
        parts += [_figure(spec, recording) for spec in attitude_figures.FIGURES]
    parts.append('<h2 id="diagnostics">Diagnostics that were not OK</h2>')
    rows = _diagnostics(recording.statuses)
    if rows:
        parts.append(_rows(['time [s]', 'node', 'level', 'message'], rows[:SHOWN]))
        if len(rows) > SHOWN:
            parts.append(f'<p class="soft">and {len(rows) - SHOWN} more.</p>')
    else:
        parts.append('<p>None.</p>' if recording.statuses else '<p class="soft">No diagnostics in the bag.</p>')
    return ('<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f'<title>Tracking run: {html.escape(name)}</title><style>{STYLE}</style></head>\n<body>\n'
            + '\n'.join(parts) + '\n</body></html>\n')
