"""A night as a table for a terminal."""
import math
import textwrap

from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.text_files.text_table import Cell, Column
from pedestal_station.night import Night, Share
from pedestal_station.outputs import rows

COLUMNS: tuple[Column, ...] = ('pass', 'rises', 'sets', ('highest', '>.1f'), ('deg/s', '>.2f'), ('loss', '>.1f'),
                               ('C/N0', '>.1f'), ('age', '>.1f'), 'greedy', 'plan', 'lost to')
"""Columns of the table; times in UTC, highest elevation [deg], peak rate of the azimuth, loss [s], largest C/N0
[dB-Hz], age of the elements [days]."""
OPTIONAL_COLUMNS = 'sets', 'loss', 'deg/s', 'age', 'greedy', 'C/N0'
"""Columns that a narrow terminal leaves out, the last ones first."""
MAX_REASON_CHARS = 25  # length to which the reason of a share is cut


def cells(night: Night) -> list[list[Cell]]:
    """Return the rows of the table."""
    times = [t for each in night.passes for t in (each.window.rise, each.window.set)]
    day = '%d ' if max(times, default=0.0) - min(times, default=0.0) > SECONDS_PER_DAY else ''
    found: list[list[Cell]] = []
    for _, each, share, greedy in rows.lines(night):
        window, prediction = each.window, each.prediction
        cn0 = prediction.cn0[1]
        found.append([each.case, f'{rows.utc(night, window.rise):{day}%H:%M:%S}',
                      f'{rows.utc(night, window.set):{day}%H:%M:%S}', math.degrees(window.max_elevation),
                      math.degrees(prediction.peak_rate[0]), prediction.loss, '' if math.isnan(cn0) else cn0,
                      prediction.age / SECONDS_PER_DAY, rows.state(greedy), _part(night, share), _cause(share)])
    return found


def _part(night: Night, share: Share) -> str:
    """Return the part of a pass that the plan takes."""
    if rows.state(share) != rows.TRIMMED:
        return rows.state(share)
    return f'{rows.utc(night, share.begin):%H:%M:%S}-{rows.utc(night, share.end):%H:%M:%S}'


def _cause(share: Share) -> str:
    """Return the first pass to which a share lost its time, and the number of the others; without one, the reason."""
    first, *others = share.lost_to or (textwrap.shorten(share.reason, MAX_REASON_CHARS, placeholder=' ...'),)
    return first + (f' +{len(others)}' if others else '')


def title(night: Night) -> str:
    """Return the line above the table."""
    horizon = 'mask of the antenna' if night.horizon is None else f'horizon {night.horizon:g} deg'
    return (f'{night.duration / 3600.0:g} h from {night.begin:%Y-%m-%d %H:%M:%S} UTC at {rows.place(night)}; '
            f'{horizon}; antenna of {night.scenario}')
