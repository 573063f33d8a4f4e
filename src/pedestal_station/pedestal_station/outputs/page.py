"""Page of a night: one self-contained HTML file with the plan, its Gantt chart, and the sky plot of each pass."""
import html
import math

from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.text_files.text_table import Cell, Column, TextTable
from pedestal_results.report import elements
from pedestal_station.night import Night
from pedestal_station.outputs import charts, rows
from pedestal_station.outputs.rows import Line

HEADS: tuple[Column, ...] = ('pass', 'rise', 'set', 'plan', 'greedy plan', 'highest [deg]', 'azimuth [deg]',
                             'rate [deg/s]', 'loss', 'C/N0 [dB-Hz]', 'age [d]')


def text(night: Night, command: str) -> str:
    """Return the page; command: command line that makes it."""
    title = f'Plan of {night.duration / 3600.0:g} h from {night.begin:%Y-%m-%d %H:%M:%S} UTC'
    about = [['made by', command], ['station', rows.place(night)], ['antenna', night.scenario],
             ['horizon', 'mask of the antenna' if night.horizon is None else f'{night.horizon:g} deg']]
    lines = list(rows.lines(night))
    parts = [f'<h1>{html.escape(title)}</h1>', f'<p class="verdict">{html.escape(rows.verdict(night))}.</p>',
             *(f'<p class="bad">{html.escape(warning)}.</p>' for warning in rows.warnings(night)),
             TextTable(('', ''), about).html('meta'), '<h2 id="night">Night</h2>',
             '<p class="soft">Frame: a pass. Blue: the part that the plan takes. Orange: a time of loss. All times '
             f'are UTC.</p><div class="wide">{charts.gantt(night)}</div>',
             '<h2 id="passes">Passes</h2>', TextTable(HEADS, map(_cells, lines)).html('plan'), '<h2 id="sky">Sky</h2>',
             '<p class="soft">North is up, east is right, the zenith is in the middle. A dot is the culmination.</p>',
             '<div class="sky">',
             *(f'<figure>{charts.sky(night, line.each, line.share)}<figcaption>{html.escape(line.each.case)}: '
               f'{html.escape(rows.decision(night, line.share))}</figcaption></figure>' for line in lines), '</div>']
    if night.refusals:
        parts += ['<h2 id="refused">Refused</h2>', TextTable(('file', 'line', 'object', 'reason'), [
            [str(each.path), str(each.line), each.name, each.reason] for each in night.refusals]).html()]
    return elements.page(title, parts, charts.CSS)


def _cells(line: Line) -> list[Cell]:
    """Return the row of a pass; --csv and --json have all its numbers."""
    night, each, prediction = line.night, line.each, line.each.prediction
    losses = {loss.reason: sum(other.seconds for other in prediction.losses if other.reason == loss.reason)
              for loss in prediction.losses}
    first, last = (f'{math.degrees(azimuth):.0f}' for azimuth in prediction.azimuth)
    most = prediction.cn0[1]
    return [each.case, f'{rows.utc(night, each.window.rise):%d %b %H:%M:%S}',
            f'{rows.utc(night, each.window.set):%H:%M:%S}', rows.decision(night, line.share), rows.state(line.greedy),
            f'{math.degrees(each.window.max_elevation):.1f}',
            f'{first} to {last}', f'{math.degrees(prediction.peak_rate[0]):.2f}',
            ', '.join(f'{reason} {seconds:.1f} s' for reason, seconds in losses.items()) + (
                ', early turn' if prediction.early_turn else ''),
            '' if math.isnan(most) else f'{most:.1f}', f'{prediction.age / SECONDS_PER_DAY:.1f}']
