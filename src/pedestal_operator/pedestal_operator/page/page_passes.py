"""The next passes of the satellite that the antenna is for, beyond the program track that is loaded. No ROS here.

They are found by a thread of their own, for which nobody waits.
"""
import datetime
import typing
from concurrent import futures

from pedestal_common.geometry import orbit, passes
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_operator.page import page_state

MAX_PASSES = 4
"""Passes that are shown."""

SEARCH_SPAN_DAYS, SEARCH_VALIDITY_DAYS = 2.0, 1.0
"""Time ahead that is searched, and for which what was found is good [days]."""

MIN_UTC_S = 1e8
"""Time [s UTC] before which a clock counts from the beginning of a run."""


class PassQuery(typing.NamedTuple):
    """Whose passes, over what. ahead: the UTC of the elements less the time of the graph [s], other than 0 only in a
    simulation of another day; day: count of SEARCH_VALIDITY_DAYS."""
    line_1: str
    line_2: str
    station: StationParameters
    ahead: float
    day: int


def pass_query(antenna):
    """The Question of an antenna as page_state wants one, None where no elements, station or UTC are known: by the
    elements of mode tle, else by those of a simulated satellite, which flies on the day of its scenario."""
    p, told = antenna.configuration, antenna.told('acu')
    target = p if p.get('target.kind') == 'leo_pass' else {}
    simulated = [target.get(f'target.leo_pass.{name}') for name in page_state.ELEMENT_PARAMETERS]
    lines = [told.get(name) for name in page_state.ELEMENT_PARAMETERS] if 'line_1' in told else simulated
    station = [p.get(f'prediction.station.{name}') for name in page_state.STATION_PARAMETERS]
    if None in (*lines, *station):
        return None
    start = p.get('prediction.start_time')
    if not start and lines == simulated:
        start = antenna.told('tracking_receiver').get('stamp_0_utc')
    ahead = _seconds(orbit.instant('start_time', start)) - page_state.epoch(antenna) if start else 0.0
    utc = antenna.now + ahead
    return PassQuery(*lines, StationParameters(*station), ahead,
                     int(utc / SECONDS_PER_DAY / SEARCH_VALIDITY_DAYS)) if utc > MIN_UTC_S else None


def upcoming_passes(asked):
    """[{aos, los: [s] in the time of the graph, highest, from, to: [deg]}] of the passes from a Question's day on.

    Empty where the elements are too old for that day, or the satellite does not rise and set."""
    begin = datetime.datetime(1970, 1, 1) + datetime.timedelta(days=asked.day * SEARCH_VALIDITY_DAYS)
    try:
        satellite = orbit.satellite(asked)
        _, too_old = passes.search_start(satellite, begin)
        known = [] if too_old else passes.passes_after(satellite, asked.station, begin, SEARCH_SPAN_DAYS)
    except orbit.TargetError:
        known = []
    return [{'aos': _seconds(each.rise) - asked.ahead, 'los': _seconds(each.set) - asked.ahead,
             'highest': round(each.elevation, 1), 'from': round(each.rise_azimuth, 1),
             'to': round(each.set_azimuth, 1)} for each in known]


def _seconds(utc):
    """Since 1970 [s] of a datetime in UTC."""
    return (utc - datetime.datetime(1970, 1, 1)).total_seconds()


class UpcomingPasses:
    """The passes to come of an antenna, as they are known."""

    def __init__(self):
        self._worker = futures.ThreadPoolExecutor(1, 'passes')
        self._asked, self._future = None, None

    def look(self, antenna) -> list:
        """The next ones, as `found` tells them; [] until they are found."""
        asked = pass_query(antenna)
        if asked != self._asked:
            self._asked, self._future = asked, asked and self._worker.submit(upcoming_passes, asked)
        known = self._future.result() if self._future and self._future.done() else []
        return [each for each in known if each['aos'] > antenna.now][:MAX_PASSES]

    def close(self):
        """End without waiting for what is being looked for."""
        self._worker.shutdown(wait=False, cancel_futures=True)
