"""A night as numbers: the metrics of a pass, as JSON and as CSV."""
import csv
import io
import math
from collections.abc import Callable
from typing import NamedTuple

from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Json, SingleRow
from pedestal_station.night import Line, Night
from pedestal_station.outputs import words

LOSS_REASONS = 'keyhole', 'blockage', 'sun', 'travel', 'limit of the elevation', 'rate of the elevation'
NUMBER_DIGITS = 6  # digits after the point of a number in a file


class Metric(NamedTuple):
    """A number of a pass."""
    name: str
    unit: str
    value: Callable[[Line], float]  # NaN if it does not exist


def _seconds(reason: str) -> Callable[[Line], float]:
    return lambda line: math.fsum(loss.seconds for loss in line.each.prediction.losses if loss.reason == reason)


def _degrees(name: str, axis: int) -> Callable[[Line], float]:
    return lambda line: math.degrees(getattr(line.each.prediction, name)[axis])


METRICS = (
    Metric('rise_s', 's', lambda line: line.each.window.rise),
    Metric('culmination_s', 's', lambda line: line.each.window.culmination),
    Metric('set_s', 's', lambda line: line.each.window.set),
    Metric('max_elevation_deg', 'deg', lambda line: math.degrees(line.each.window.max_elevation)),
    Metric('peak_azimuth_rate_deg_s', 'deg/s', _degrees('peak_rate', 0)),
    Metric('loss_s', 's', lambda line: line.each.prediction.loss),
    Metric('taken', '', lambda line: line.share.taken),
    Metric('begin_s', 's', lambda line: line.share.begin),
    Metric('end_s', 's', lambda line: line.share.end),
    Metric('greedy_begin_s', 's', lambda line: line.greedy.begin),
    Metric('greedy_end_s', 's', lambda line: line.greedy.end),
    Metric('priority', '', lambda line: line.each.object.priority),
    Metric('elements_age_d', 'd', lambda line: line.each.prediction.age / SECONDS_PER_DAY),
    Metric('culminations', '', lambda line: len(line.each.window.culminations)),
    Metric('peak_elevation_rate_deg_s', 'deg/s', _degrees('peak_rate', 1)),
    Metric('peak_azimuth_acceleration_deg_s2', 'deg/s2', _degrees('peak_acceleration', 0)),
    Metric('peak_elevation_acceleration_deg_s2', 'deg/s2', _degrees('peak_acceleration', 1)),
    Metric('rise_azimuth_deg', 'deg', _degrees('azimuth', 0)),
    Metric('set_azimuth_deg', 'deg', _degrees('azimuth', 1)),
    Metric('turn_deg', 'deg', lambda line: math.degrees(line.each.prediction.turn)),
    Metric('travel_left_before_deg', 'deg', _degrees('travel_left', 0)),
    Metric('travel_left_after_deg', 'deg', _degrees('travel_left', 1)),
    Metric('early_turn', '', lambda line: line.each.prediction.early_turn),
    *(Metric(f'{reason.replace(" ", "_")}_loss_s', 's', _seconds(reason)) for reason in LOSS_REASONS),
    Metric('loss_db', 'dB', lambda line: line.each.prediction.loss_db),
    Metric('min_range_km', 'km', lambda line: 1e-3 * line.each.prediction.min_range),
    Metric('min_cn0_dbhz', 'dB-Hz', lambda line: line.each.prediction.cn0[0]),
    Metric('max_cn0_dbhz', 'dB-Hz', lambda line: line.each.prediction.cn0[1]))


def number(value: float) -> float | None:
    """Return a number of a file: rounded, None for NaN."""
    return round(value, NUMBER_DIGITS) if math.isfinite(value) else None


def json_content(night: Night) -> dict[str, Json]:
    """Return the content of --json."""
    found = [SingleRow(case=line.each.case, metric=metric.name, value=number(metric.value(line)), unit=metric.unit,
                       paper=None, target=None) for line in night.lines for metric in METRICS]
    plan = {name: number(getattr(night.exact, name)) for name in ('value', 'bound')}
    return {'name': 'plan', 'rows': found,
            'plan': {**plan, 'optimal': night.exact.optimal, 'greedy_value': number(night.greedy.value)},
            'refused': [{'file': str(each.path), 'line': each.line, 'name': each.name, 'reason': each.reason}
                        for each in night.refusals]}


def csv_text(night: Night) -> str:
    """Return the content of --csv: a row for each pass, with its times as UTC before its metrics."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator='\n')
    writer.writerow(['case', 'catalogue_number', 'rise_utc', 'set_utc', 'plan', 'lost_to', 'losses',
                     *(metric.name for metric in METRICS)])
    for line in night.lines:
        writer.writerow([line.each.case, line.each.object.number, words.iso(night, line.each.window.rise),
                         words.iso(night, line.each.window.set), words.state(line.share),
                         '; '.join(line.share.lost_to), words.losses(line.each.prediction),
                         *(number(metric.value(line)) for metric in METRICS)])
    return stream.getvalue()
