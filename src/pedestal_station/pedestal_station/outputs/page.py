"""Page of a night: one self-contained HTML file with the plan, its Gantt chart, and the sky plot of each pass. The
charts are inline SVG, in the colours of the page, dark or light."""
import html
import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from pedestal_common.quantities import Degrees, Seconds, Times
from pedestal_common.text_files.text_table import TextTable
from pedestal_results.report import elements
from pedestal_station import windows
from pedestal_station.night import Night, Pass, Share
from pedestal_station.outputs import words

CSS = """
.chart text { fill: var(--soft); font: 11px system-ui, sans-serif; } .chart .name { fill: var(--ink); }
.chart .grid { stroke: var(--soft); stroke-opacity: .45; fill: none; }
.chart .pass { fill: none; stroke: var(--soft); }
.chart .top { fill: var(--ink); } .chart .taken { fill: #1f6fd1; } .chart .lost { fill: #e57a00; }
.chart polyline { fill: none; stroke-width: 1.5; }
.chart polyline.pass { stroke-dasharray: 3 2; } .chart polyline.taken { fill: none; stroke: #1f6fd1; stroke-width: 3; }
.chart polyline.lost { fill: none; stroke: #e57a00; stroke-width: 3; }
table.plan { font-size: .8rem; } .plan th, .plan td { padding-right: .6rem; } .plan td { white-space: nowrap; }
@media print { table.plan { font-size: .6rem; } }
.sky { display: grid; grid-template-columns: repeat(auto-fill, minmax(13rem, 1fr)); gap: 1rem; }
.sky figure { margin: 0; } .sky figure svg { min-width: 0; }
"""
WIDTH, NAME_WIDTH, ROW_HEIGHT = 920, 170, 20  # of the Gantt chart, of its names, of a row [px]
MAX_NAME_CHARS = 24  # length to which the name of an object is cut
MIN_BAR_WIDTH = 1.5  # smallest width of a bar [px]
TICK_STEPS_S = 300, 900, 1800, 3600, 2 * 3600, 3 * 3600, 6 * 3600, 12 * 3600, 24 * 3600, 7 * 24 * 3600
MAX_TICKS = 13  # largest number of marks of the time
RADIUS = 100.0  # of the horizon in a sky plot [px]
POINT_PERIOD_S, MIN_POINTS, MAX_POINTS = 10.0, 24, 120
"""Time between two points of a path, and the numbers of points that it has."""


def text(night: Night, command: str) -> str:
    """Return the page; command: command line that makes it."""
    title = f'Plan from {night.begin:%Y-%m-%d %H:%M:%S} UTC'
    parts = [f'<h1>{html.escape(title)}</h1>', f'<p class="verdict">{html.escape(words.verdict(night))}.</p>',
             *(f'<p class="bad">{html.escape(warning)}.</p>' for warning in words.warnings(night)),
             *(f'<p class="soft">{html.escape(remark)}.</p>' for remark in words.remarks(night)),
             TextTable(('', ''), [['night', words.title(night)], ['made by', command]]).html('meta'),
             '<h2 id="night">Night</h2>',
             '<p class="soft">Frame: a pass. Blue: the part that the plan takes. Orange: a time of loss. All times '
             f'are UTC.</p><div class="wide">{_gantt(night)}</div>',
             '<h2 id="passes">Passes</h2>', TextTable(words.COLUMNS, words.cells(night)).html('plan'),
             '<p class="soft">Highest elevation [deg], largest rate of the azimuth, expected loss [s], largest C/N0 '
             '[dB-Hz], age of the elements [days].</p>',
             '<h2 id="sky">Sky</h2>',
             '<p class="soft">North is up, east is right, the zenith is in the middle. A dot is the culmination.</p>',
             '<div class="sky">',
             *(f'<figure>{_sky(night, each, share)}<figcaption>{html.escape(_caption(night, each, share))}'
               '</figcaption></figure>' for each, share, _ in night.lines), '</div>']
    if night.refusals:
        parts += ['<h2 id="refused">Refused</h2>', TextTable(('file', 'line', 'object', 'reason'), [
            [str(each.path), str(each.line), each.name, each.reason] for each in night.refusals]).html()]
    return elements.page(title, parts, CSS)


def _gantt(night: Night) -> str:
    """Return the Gantt chart: a row for the antenna, then one for each object in the order of its first rise. A frame
    is a pass, a blue bar is the part that the plan takes, an orange bar a time of loss."""
    names = list(dict.fromkeys(each.object.name for each in night.passes))
    scale = (WIDTH - NAME_WIDTH) / night.duration
    height = ROW_HEIGHT * (len(names) + 2)
    parts = [_rectangle('grid', NAME_WIDTH, ROW_HEIGHT, WIDTH - NAME_WIDTH, height - ROW_HEIGHT),
             *_time(night, height), _text(0, 2 * ROW_HEIGHT - 6, 'antenna', 'name')]
    for i, name in enumerate(names):
        cut = name if len(name) <= MAX_NAME_CHARS else f'{name[:MAX_NAME_CHARS - 1]}\N{HORIZONTAL ELLIPSIS}'
        parts.append(_text(0, (i + 3) * ROW_HEIGHT - 6, cut, 'name'))

    def bar(kind: str, row: int, begin: Seconds, end: Seconds, inset: float, title: str = '') -> str:
        left, right = (NAME_WIDTH + scale * min(max(t, 0.0), night.duration) for t in (begin, end))
        return _rectangle(kind, left, (row + 1) * ROW_HEIGHT + inset, max(right - left, MIN_BAR_WIDTH),
                          ROW_HEIGHT - 2.0 * inset, title)
    for each, share, _ in night.lines:
        row = names.index(each.object.name) + 1
        if share.taken:
            parts += [bar('taken', place, share.begin, share.end, 4.0) for place in (0, row)]
        parts += [bar('lost', row, loss.begin, loss.end, 7.0) for loss in each.prediction.losses]
        parts.append(bar('pass', row, each.window.rise, each.window.set, 2.0, _title(night, each, share)))
    return _svg((0, 0, WIDTH, height), f'Gantt chart of {len(night.passes)} passes', parts)


def _caption(night: Night, each: Pass, share: Share) -> str:
    return '; '.join(filter(None, (f'{each.case}: {words.decision(night, share)}', words.losses(each.prediction))))


def _title(night: Night, each: Pass, share: Share) -> str:
    rise, set_ = (f'{words.utc(night, t):%H:%M:%S}' for t in (each.window.rise, each.window.set))
    return (f'{each.case}: {rise} to {set_} UTC, highest {math.degrees(each.window.max_elevation):.1f} deg; '
            f'{words.decision(night, share)}')


def _time(night: Night, height: float) -> Iterator[str]:
    """Yield the marks of the whole hours, or of other steps of a day."""
    step = next((step for step in TICK_STEPS_S if night.duration / step <= MAX_TICKS - 1), TICK_STEPS_S[-1])
    midnight = night.begin.replace(hour=0, minute=0, second=0, microsecond=0)
    into_day = (night.begin - midnight).total_seconds()
    form = '%d %b' if step >= TICK_STEPS_S[-2] else '%H:%M'
    for t in np.arange(-into_day % step, night.duration, step).tolist():
        x = NAME_WIDTH + (WIDTH - NAME_WIDTH) * t / night.duration
        yield f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{ROW_HEIGHT}" y2="{height}"/>'
        yield _text(x, ROW_HEIGHT - 6, f'{words.utc(night, t):{form}}', anchor='middle')


def _sky(night: Night, each: Pass, share: Share) -> str:
    """Return the sky plot of a pass: north up, east right, the zenith in the middle. A dot is the culmination."""
    parts = [f'<circle class="grid" r="{RADIUS * (90.0 - elevation) / 90.0:.1f}"/>' for elevation in (0, 30, 60)]
    parts += [f'<path class="grid" d="M{-RADIUS:g} 0H{RADIUS:g}M0 {-RADIUS:g}V{RADIUS:g}"/>']
    parts += [_text(*_place(azimuth, 6.0, 4.0), name, anchor='middle')
              for name, azimuth in (('N', 0.0), ('E', 90.0), ('S', 180.0), ('W', 270.0))]
    parts.append(_path('pass', each, each.window.rise, each.window.set))
    if share.taken:
        parts.append(_path('taken', each, share.begin, share.end))
    parts += [_path('lost', each, loss.begin, loss.end) for loss in each.prediction.losses]
    ends = each.window.rise, each.window.set
    (rise, _), (set_, _), highest = _angles(each, [*ends, each.window.culmination])
    parts.append('<circle class="top" r="3" cx="{:.1f}" cy="{:.1f}"/>'.format(*_place(*highest)))
    parts += [_text(*_place(azimuth, -14.0, 4.0), f'{words.utc(night, t):%H:%M}', anchor='middle')
              for azimuth, t in zip((rise, set_), ends)]
    return _svg((-135, -125, 270, 250), f'Sky plot of {_title(night, each, share)}', parts)


def _angles(each: Pass, times: Sequence[Seconds] | Times) -> list[list[Degrees]]:
    angles: list[list[Degrees]] = np.degrees(windows.angles(each.object.orbit, np.array(times))).tolist()
    return angles


def _path(kind: str, each: Pass, begin: Seconds, end: Seconds) -> str:
    count = min(max(int((end - begin) / POINT_PERIOD_S), MIN_POINTS), MAX_POINTS)
    places = (_place(*angles) for angles in _angles(each, np.linspace(begin, end, count)))
    points = ' '.join(f'{x:.1f},{y:.1f}' for x, y in places if math.isfinite(x))    # an ephemeris may have gaps
    return f'<polyline class="{kind}" points="{points}"/>'


def _place(azimuth: Degrees, elevation: Degrees, below: float = 0.0) -> tuple[float, float]:
    r, angle = RADIUS * (90.0 - elevation) / 90.0, math.radians(azimuth)
    return r * math.sin(angle), below - r * math.cos(angle)


def _rectangle(kind: str, x: float, y: float, width: float, height: float, title: str = '') -> str:
    inside = f'<title>{html.escape(title)}</title>' if title else ''
    return (f'<rect class="{kind}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"'
            f' pointer-events="all">{inside}</rect>')


def _text(x: float, y: float, content: str, kind: str = '', anchor: str = 'start') -> str:
    return (f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{html.escape(content)}</text>')


def _svg(box: tuple[int, int, int, int], label: str, parts: Iterable[str]) -> str:
    return (f'<svg class="chart" viewBox="{" ".join(map(str, box))}" role="img" aria-label="{html.escape(label)}">'
            f'{"".join(parts)}</svg>')
