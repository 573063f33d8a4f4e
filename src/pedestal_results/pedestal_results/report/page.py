"""Page of `pedestal report`: a recording as one self-contained HTML file, its figures also as PNG, and as PDF."""
import html
import itertools
import pathlib
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from pedestal_common.graph import topics
from pedestal_common.graph.topics import AXES
from pedestal_common.text_files.files import sha256
from pedestal_common.text_files.text_table import TextTable
from pedestal_recording import bag as bags
from pedestal_recording import recording as recordings
from pedestal_recording.verify import Report, verify
from pedestal_results import consistency, events, results, tracking
from pedestal_results.recorded_run import RecordedRun, Status
from pedestal_results.report import elements, figures, filter_figures, paper, run_figures, subject
from pedestal_results.tracking import DEG_PER_RAD

MAX_DIAGNOSTICS_ROWS = 200  # largest number of rows of the table of diagnostics


PAPER_SCENARIOS = ('uav_flyby',)
"""Scenarios that repeat the experiment of the paper; only their reports name its figures."""


def write(bag_path: str | pathlib.Path, output: str | pathlib.Path | None = None,
          png_folder: str | pathlib.Path | None = None, beam: str = '', author: str = '',
          pdf: bool = False) -> pathlib.Path:
    """Write the report of a bag, by default report.html beside its first file, and return the path of the report.

    png_folder   folder for the figures and the overview as PNG, None for no such files
    beam         name of one of several beams, '' for the first
    author       text on the page, '' for none
    pdf          True to print the page as PDF too, beside the HTML file

    Equal bags give equal bytes. Raises bag.BagError if the bag cannot be read to its end, OSError if the report cannot
    be written.
    """
    whole = bags.read(bag_path)
    bag = whole.view(beam)
    output = pathlib.Path(output) if output is not None else bag.file.parent / 'report.html'
    run = RecordedRun(bag)
    run.check_stamps()
    page = _page(bag, run, verify(whole), author)
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(page, encoding='utf-8')
    if pdf:
        output.with_suffix('.pdf').write_bytes(paper.pdf(page))
    if png_folder is not None:
        folder = pathlib.Path(png_folder)
        folder.mkdir(parents=True, exist_ok=True)
        for spec in (*run_figures.FIGURES, *filter_figures.FIGURES, *run_figures.ATTITUDE_FIGURES,
                     run_figures.OVERVIEW_FIGURE):
            if not run.lacks(spec.needs):
                figures.render(spec, run, folder / f'{spec.key}.png')
    return output


def _of_axes(name: str, values: Sequence[tuple[float, str]], last: str = '') -> list[str]:
    """Return a row of a table: name, numbers (value, unit) of azimuth and elevation, and the text `last`."""
    return [name, *(elements.number(*value) for value in values), last]


def _pointing(run: RecordedRun, values: results.Values) -> list[list[str]]:
    noise = values['single_sample_noise_deg'][0]

    def row(name: str, *keys: str, scale: float = 1.0, unit: str = 'deg') -> list[str]:
        return [name, *(elements.number(values[key][0] / scale, unit) for key in keys)]

    rms = ('cross_elevation_rms_deg', 'elevation_rms_deg', 'pointing_rms_deg')
    largest = ('cross_elevation_max_deg', 'elevation_max_deg', 'pointing_max_deg')
    joints = figures.existing(run.table('joint_states'))
    by_encoders = [row(f'pointing error by the encoders, {name}', *(f'encoder_{key}' for key in keys))
                   for name, keys in (('rms', rms), ('largest', largest))] if run.tracking.has_encoders else []
    return [row('pointing error, rms', *rms), row('pointing error, largest', *largest), *by_encoders,
            row("rms / receiver's single-sample noise", *rms, scale=noise, unit=''),
            row("largest / receiver's single-sample noise", *largest, scale=noise, unit=''),
            row('noise reduction by the filter', 'noise_reduction_cross_elevation', 'noise_reduction_elevation',
                'noise_reduction', unit=''),
            _of_axes('load torque, rms of the run',
                     [(tracking.known_rms(joints.get(f'{axis}.effort', np.zeros(0))), 'Nm') for axis in AXES]),
            *_torques(run)]


def _torques(run: RecordedRun) -> list[list[str]]:
    return [_of_axes(f'torque of motor {i}, rms of the run',
                     [(tracking.known_rms(run.motors[f'{axis}_motor_{i}.effort']), 'Nm') for axis in AXES])
            for i in (1, 2)] if run.motors else []


def _labelled(parts: Mapping[str, object], *names: str) -> list[list[str]]:
    """Return rows [label, number] of the results in names or, without names, of all results with a label."""
    values = results.measured(parts)
    return [[results.RESULT_BY_NAME[name].label, elements.number(*values[name])] for name in names or values
            if results.RESULT_BY_NAME[name].label]


def _loop(bag: bags.Bag, run: RecordedRun, check: Report) -> list[list[str]]:
    """Return rows on the control loop: rates, in realtime the jitter, lost steps, and missing steps."""
    rows = []
    joints = run.table('joint_states')
    if joints is not None and joints['t'].size > 1 and joints['t'][-1] > joints['t'][0]:
        t = joints['t']
        rows.append(['loop rate achieved (time of the drive)', elements.number((t.size - 1) / (t[-1] - t[0]), 'Hz')])
        if bag.metadata.get('pacing') == 'realtime':
            wall = bag.rows('joint_states').publish
            jitter = (np.diff(wall) - check.period * 1e9) / 1e6
            late = np.percentile(np.abs(jitter), 99.0)
            rate = (t.size - 1) / max(wall[-1] - wall[0], 1) * 1e9
            rows += [['loop rate achieved (wall time)', elements.number(rate, 'Hz')],
                     ['jitter of the step, wall time',
                      f'{tracking.known_rms(jitter):.3g} ms rms, 99 % within {late:.3g} ms, '
                      f'largest {np.abs(jitter).max():.3g} ms']]
    missing = max([check.steps - topic.count for topic in check.topics
                   if topic.problems and topic.name in topics.TOPIC_BY_NAME
                   and topics.TOPIC_BY_NAME[topic.name].rate == 'step'],
                  default=0)
    return [*rows, ['steps', f'{check.steps}'],
            ['lost steps (steps of the drive without a command)', check.lost_steps or '0'],
            ['steps missing in the recording', f'{max(missing, 0)}'],
            ['recording', 'complete, each step once and in order' if check.complete else
             'NOT complete, see below']]


def _not_evaluated(run: tracking.Tracking) -> str:
    """Return the sentence that states why a run has no evaluated part."""
    unknown = run.t.size - np.sum(run.known_mode)
    if unknown == run.t.size:
        return 'The recording does not state the mode of the ACU, so nothing was evaluated.'
    part = f' (mode unknown in {unknown} of {run.t.size} steps)' if unknown else ''
    return (f'The recording holds no autotrack that is longer than the settling time{part}, so nothing was '
            'evaluated.')


def _results(bag: bags.Bag, run: RecordedRun, check: Report) -> list[str]:
    parts = ['<h2 id="results">Results</h2>']
    rows: list[list[str]] = []
    if run.no_truth:
        parts.append(f'<p class="bad">No comparison with the truth: {html.escape(run.no_truth)}.</p>')
        if run.motors:
            parts.append(TextTable(('', 'azimuth', 'elevation', ''), _torques(run)).html('n'))
        if bag.own:
            rows = _labelled(run.parts, 'measured_pointing_rms_deg', 'measured_pointing_max_deg', 'lock_time_s',
                             'autotrack_time_s', 'evaluated_time_s')
    else:
        known = run.tracking.parts
        if tracking.by_encoders(bag):
            parts.append('<p class="bad">Pointing errors are those of the encoders: '
                         f'{html.escape(tracking.ENCODER_BEAM_NOTE)}.</p>')
        if not run.tracking.tracking.any():
            parts.append(f'<p class="bad">{_not_evaluated(run.tracking)}</p>')
        parts.append(TextTable(('', 'cross-elevation (azimuth)', 'elevation', 'both axes'),
                               _pointing(run, results.measured(known))).html('n'))
        parts.append('<p class="soft">Pointing and noise are computed over the evaluated part: autotrack, from '
                     f'{tracking.HANDOVER_SETTLING_S:g} s after the first hand-over. "Both axes" pools the samples of '
                     'both axes.</p>')
        rows = _labelled(known, 'pointing_loss_mean_db', 'pointing_loss_max_db', 'single_sample_noise_deg',
                         'lock_time_s', 'autotrack_time_s', 'trackable_time_s', 'tracked_percent',
                         'evaluated_time_s', 'loss_s')
    return [*parts, TextTable(('', ''), rows + _loop(bag, run, check)).html('n')]


def _gaps(bag: bags.Bag, check: Report) -> list[str]:
    parts = []
    if not check.complete:
        problems = check.problems + [f'{topic.name}: {problem}' for topic in check.topics
                                     for problem in topic.problems]
        parts.append('<h2 id="gaps">Problems of the recording</h2><ul>' + ''.join(
            f'<li>{html.escape(problem)}</li>' for problem in problems) + '</ul>')
    absent = [topic for topic in bag.graph if not recordings.holds(bag, topic)]
    if absent:
        parts.append(f'<p class="soft">Topics without a message in this bag: {", ".join(absent)}.</p>')
    return parts


def _figures(specs: Iterable[figures.Spec], run: RecordedRun, of_paper: bool = False) -> list[str]:
    """Return some figures; of_paper: True if their titles name the figures of the paper."""
    return [elements.figure(spec._replace(title=f'{spec.title} (figure {spec.paper} of the paper)')
                            if of_paper and spec.paper else spec, run, run.lacks(spec.needs))
            for spec in specs]


def _events(run: RecordedRun) -> list[str]:
    title = '<h2 id="events">What happened</h2>'
    if not run.events:
        return [title, '<p class="soft">No event in the bag.</p>']
    return [title, TextTable(('no.', 'time [s]', 'duration [s]', 'event', 'by', 'what'),
                             events.rows(run.events, run.bag.end)).html(),
            '<p class="soft">The numbers mark these events on the curves below.</p>']


def _consistency_table(known: consistency.Consistency) -> str:
    """Return the table of the consistency of the filter, and its verdict as a sentence for each axis."""
    judged = known.axes

    def row(name: str, field: str, marks: Sequence[str] = (), unit: str = '', scale: float = 1.0) -> list[str]:
        return _of_axes(name, [(scale * getattr(axis, field), unit) for axis in judged], ', '.join(marks))

    marks = [[f'{name}: {mark}' for name, mark in zip(AXES, of_axes) if mark]
             for of_axes in zip(*((axis.nis_mark, axis.nees_mark) for axis in judged))]
    rows = [row('mean NIS', 'nis', marks[0]), row('expected mean NIS', 'nis_expected'),
            row(f'NIS inside their {100.0 * consistency.BAND_PROBABILITY:g} % band', 'nis_inside', unit='%',
                scale=100.0),
            row('mean NEES (angle and rate)', 'nees', marks[1]),
            [f'{100.0 * consistency.BAND_PROBABILITY:g} % band of the mean NEES, 2 expected',
             *(' to '.join(map(elements.number, axis.nees_band)) for axis in judged), ''],
            row('independent errors', 'count'),
            row('angle error, rms', 'error', unit='deg', scale=DEG_PER_RAD),
            row('stated sigma of the angle', 'sigma', unit='deg', scale=DEG_PER_RAD),
            row('rate error, rms', 'rate_error', unit='deg/s', scale=DEG_PER_RAD),
            row('stated sigma of the rate', 'rate_sigma', unit='deg/s', scale=DEG_PER_RAD)]
    verdicts = ''.join(f'<p>{name.capitalize()}: {html.escape(axis.verdict)}.</p>' for name, axis in zip(AXES, judged))
    return TextTable(('', 'azimuth', 'elevation', ''), rows).html('n') + verdicts + (
        '<p class="soft">Computed over the evaluated part. NIS: squared innovations over their stated variance. NEES: '
        'squared errors against the truth over the stated covariance. On a ship the errors include the attitude error '
        'of the INS, which the target filter does not model.</p>')


def _deck(run: RecordedRun) -> list[str]:
    """Return the section on the attitude of the INS and the isolation from the ship; [] for an antenna ashore."""
    if run.attitude is None:
        return []
    return ['<h2 id="attitude">Attitude of the ship</h2>',
            TextTable(('', ''), [*_labelled({'attitude': run.attitude}),
                                 *_labelled({'isolation': run.isolation})]).html('n'),
            *_figures(run_figures.ATTITUDE_FIGURES, run)]


def _diagnostics(statuses: Sequence[Status]) -> list[str]:
    """Return the section on diagnostics other than OK. A status that a node repeats is one row."""
    title = '<h2 id="diagnostics">Diagnostics other than OK</h2>'
    rows: dict[int, list[str]] = {}
    for node in dict.fromkeys(node for _, node, _, _ in statuses):
        own = [(place, status) for place, status in enumerate(statuses) if status[1] == node]
        for (level, message), group in itertools.groupby(own, lambda row: row[1][2:]):
            places, stamps = zip(*((place, stamp) for place, (stamp, *_) in group))
            if level:
                when = f'{stamps[0]:.1f}' if len(stamps) == 1 else f'{stamps[0]:.1f} to {stamps[-1]:.1f}'
                rows[places[0]] = [when, node, run_figures.LEVEL_COLOURS[min(level, 3)][0], message]
    if not rows:
        return [title, '<p>None.</p>' if statuses else '<p class="soft">No diagnostics in the bag.</p>']
    shown = [rows[place] for place in sorted(rows)][:MAX_DIAGNOSTICS_ROWS]
    hidden = len(rows) - len(shown)
    return [title, TextTable(('time [s]', 'node', 'level', 'message'), shown).html(),
            *([f'<p class="soft">and {hidden} more.</p>'] if hidden else [])]


def _provenance_table(bag: bags.Bag, run: RecordedRun, author: str) -> str:
    """Return the table at the head of the page: author, subject, configuration, versions and file of a bag."""
    stamps = bag.index.log
    duration = (stamps.max() - stamps.min()) / 1e9 if stamps.size else 0.0
    versions = ', '.join(f'{key.removeprefix("version.")} {value}' for key, value in bag.metadata.items()
                         if key.startswith('version.'))
    rows = [[key, value] for key, value in bag.metadata.items()
            if not key.startswith(('version.', 'beamwidth', 'planned_end'))]
    rows = [*([['author', author]] if author else []), ['date of the run', subject.date(bag)],
            *subject.rows(bag, run), *rows, ['duration', f'{duration:g} s'],
            ['software versions', versions or 'not in the bag'],
            ['file', f'{", ".join(file.name for file in bag.files)}, '
             f'{sum(file.stat().st_size for file in bag.files) / 1e6:.2f} MB, {stamps.size} messages'],
            ['sha256', ', '.join(map(sha256, bag.files))]]
    return TextTable(('', ''), rows).html('meta')


def _parameters(bag: bags.Bag) -> list[str]:
    title = '<h2 id="parameters">Parameters that differ from their defaults</h2>'
    if not bag.configuration['parameters']:
        return [title, '<p class="soft">The bag states no parameters.</p>']
    rows = subject.changed_parameters(bag)
    return [title, TextTable(('parameter', 'value', 'default', 'unit'), rows).html() if rows else '<p>None.</p>']


def _page(bag: bags.Bag, run: RecordedRun, check: Report, author: str) -> str:
    scenario = bag.metadata.get('scenario', '')
    name = (scenario or bag.file.stem) + f'/{bag.beam}'.rstrip('/')
    of_paper = scenario in PAPER_SCENARIOS
    found = None if run.no_truth and not bag.own else run.verdict
    paper = ('"The paper" is the one on antenna tracking with a Kalman filter and a dual-motor anti-backlash drive; '
             'its figures are from a UAV experiment. ') if of_paper else ''
    parts = [
        f'<h1>Tracking run: {html.escape(name)}</h1>',
        *([f'<p class="verdict{" bad" if found.failed else ""}">{html.escape(found.text)}</p>'] if found else []),
        *(f'<p class="bad">{html.escape(line.capitalize())}.</p>'
          for line in (check.ending, check.loss, *check.foreign) if line),
        _provenance_table(bag, run, author), *_parameters(bag), *_events(run),
        *_results(bag, run, check), *_gaps(bag, check),
        f'<h2 id="figures">Figures</h2><p class="soft">{paper}Grey: measured, blue: filtered or achieved, orange: '
        'truth. Dotted vertical lines: the numbered events of the table "What happened".</p>',
        *_figures(run_figures.FIGURES, run, of_paper),
        '<h2 id="filter">Consistency of the filter</h2>',
        *([_consistency_table(run.filter)] if run.filter is not None else []),
        *_figures(filter_figures.FIGURES, run), *_deck(run), *_diagnostics(run.statuses)]
    return elements.page(f'Tracking run: {name}', parts)
