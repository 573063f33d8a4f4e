"""A night in words: its times, what a plan does with a pass, warnings, and the table for a terminal."""
import datetime
import math
import textwrap

from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Seconds
from pedestal_common.text_files.text_table import Cell, Column
from pedestal_station import objects
from pedestal_station.night import Night, Prediction, Share

WHOLE, TRIMMED, DROPPED = 'whole', 'trimmed', 'dropped'
NO_END = 'does not set; choose its times with --window NAME=UTC/UTC'
COLUMNS: tuple[Column, ...] = ('pass', 'rises', 'sets', ('highest', '>.1f'), ('deg/s', '>.2f'), ('loss', '>.1f'),
                               ('C/N0', '>.1f'), ('age', '>.1f'), 'greedy', 'plan', 'lost to')
"""Columns of the table; times in UTC, highest elevation [deg], peak rate of the azimuth, loss [s], largest C/N0
[dB-Hz], age of the elements [days]."""
OPTIONAL_COLUMNS = 'sets', 'loss', 'deg/s', 'age', 'greedy', 'C/N0'
"""Columns that a narrow terminal leaves out, the last ones first."""
MAX_REASON_CHARS = 25  # length to which the reason of a share is cut


def utc(night: Night, t: Seconds) -> datetime.datetime:
    """Return a time of the night as UTC, to the second."""
    return night.begin + datetime.timedelta(seconds=round(t))


def iso(night: Night, t: Seconds) -> str:
    """Return a time of the night as text, to the millisecond."""
    when = night.begin + datetime.timedelta(milliseconds=round(1e3 * t))
    return f'{when.isoformat(timespec="milliseconds")}Z'


def place(night: Night) -> str:
    """Return the position of the station."""
    return night.station.text.partition(':')[0]     # without the remark on the default of a simulation


def state(share: Share) -> str:
    """Return what a plan does with a pass, in one word."""
    return DROPPED if not share.taken else TRIMMED if share.reason else WHOLE


def part(night: Night, share: Share) -> str:
    """Return the part of a pass that a plan takes: a word, or the times of a trimmed pass."""
    text = state(share)
    return f'{utc(night, share.begin):%H:%M:%S}-{utc(night, share.end):%H:%M:%S}' if text == TRIMMED else text


def decision(night: Night, share: Share) -> str:
    """Return what a plan does with a pass, and the passes to which its time is lost."""
    return ': '.join(filter(None, (part(night, share), ', '.join(share.lost_to) or share.reason)))


def losses(prediction: Prediction) -> str:
    """Return the losses of a pass, added up by reason; '' without a loss."""
    seconds: dict[str, Seconds] = {}
    for loss in prediction.losses:
        seconds[loss.reason] = seconds.get(loss.reason, 0.0) + loss.seconds
    details = {loss.reason: f' ({loss.detail})' for loss in prediction.losses if loss.detail}
    return '; '.join(f'{reason} {lost:.1f} s{details.get(reason, "")}' for reason, lost in seconds.items())


def verdict(night: Night) -> str:
    """Return the plan as a sentence, with the greedy plan and, without a proof, the bound."""
    if not night.passes:
        return 'No object has a pass in this time'
    counts = {name: sum(state(share) == name for share in night.exact.shares) for name in (WHOLE, TRIMMED, DROPPED)}
    shares = ', '.join(f'{count} {name}' for name, count in counts.items())
    proof = 'which is the optimum' if night.exact.optimal else (
        f'not proven to be the optimum, which is at most {night.exact.bound:.0f} s')
    passes, objects = len(night.passes), len({each.object.name for each in night.passes})
    return (f'{passes} pass{"es" * (passes > 1)} of {objects} object{"s" * (objects > 1)}: {shares}. '
            f'Weighted contact time {night.exact.value:.0f} s, {proof}; the greedy plan has '
            f'{night.greedy.value:.0f} s')


def warnings(night: Night) -> list[str]:
    """Return a line for each object in a low orbit whose elements are old at a pass, of its worst pass, and for each
    object that does not set."""
    worst = {each.object.name: each for each in sorted(night.passes, key=lambda each: abs(each.prediction.age))}
    texts = [(each, NO_END if each.window.endless else
              objects.age_warning(each.object.orbit, each.window.culmination)) for each in worst.values()]
    return [f'{each.object.path}: line {each.object.line}: {each.case}: {text}' for each, text in texts if text]


def remarks(night: Night) -> list[str]:
    """Return the remarks on the elements of the objects."""
    return list(dict.fromkeys(f'{each.object.path}: line {each.object.line}: {each.object.name}: {each.object.remark}'
                              for each in night.passes if each.object.remark))


def cells(night: Night) -> list[list[Cell]]:
    """Return the rows of the table."""
    times = [t for each in night.passes for t in (each.window.rise, each.window.set)]
    day = '%d ' if max(times, default=0.0) - min(times, default=0.0) > SECONDS_PER_DAY else ''
    found: list[list[Cell]] = []
    for each, share, greedy in night.lines:
        window, prediction = each.window, each.prediction
        cn0 = prediction.cn0[1]
        found.append([each.case, f'{utc(night, window.rise):{day}%H:%M:%S}',
                      f'{utc(night, window.set):{day}%H:%M:%S}', math.degrees(window.max_elevation),
                      math.degrees(prediction.peak_rate[0]), prediction.loss, '' if math.isnan(cn0) else cn0,
                      prediction.age / SECONDS_PER_DAY, state(greedy), part(night, share), _cause(share)])
    return found


def _cause(share: Share) -> str:
    """Return the first pass to which a share lost its time, and the number of the others; without one, the reason."""
    first, *others = share.lost_to or (textwrap.shorten(share.reason, MAX_REASON_CHARS, placeholder=' ...'),)
    return first + (f' +{len(others)}' if others else '')


def title(night: Night) -> str:
    """Return the line above the table."""
    horizon = 'horizon: mask of the antenna' if night.horizon is None else f'horizon {night.horizon:g} deg'
    return (f'{night.duration / 3600.0:g} h from {night.begin:%Y-%m-%d %H:%M:%S} UTC at {place(night)}; '
            f'{horizon}; antenna: {night.scenario}')
