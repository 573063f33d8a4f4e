"""Search for the next passes of the satellite that the antenna follows, for the sky plot of the page. No ROS here.

A separate thread finds the passes, so the page does not wait for them.
"""
import datetime
import typing
from concurrent import futures

from pedestal_common.geometry import orbit, passes
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_operator.page import page_state

MAX_PASSES = 4  # largest number of passes shown

SEARCH_SPAN_DAYS, SEARCH_VALIDITY_DAYS = 2.0, 1.0
"""Time searched ahead, and the time after which the search is repeated [days]."""

MIN_UTC_S = 1e8  # smallest time that is UTC [s]; a smaller time counts from the start of a run


class PassQuery(typing.NamedTuple):
    """Satellite, station and day of a search.

    line_1, line_2, omm   elements of the satellite
    ahead                 UTC for which the satellite is computed, minus the time of the graph [s]; 0 except in a
                          simulation of another day
    day                   number of the interval of SEARCH_VALIDITY_DAYS since 1970
    """
    line_1: str
    line_2: str
    omm: str
    station: StationParameters
    ahead: float
    day: int


def pass_query(antenna):
    """Return the PassQuery of an antenna (see page_state), None without elements, station or UTC.

    The elements are those of mode tle, else those of a simulated satellite on the day of its scenario.
    """
    p, acu = antenna.configuration, antenna.diagnostics_of('acu')
    target = p if p.get('target.kind') == 'leo_pass' else {}
    simulated = [target.get(f'target.leo_pass.{name}', '') for name in page_state.ELEMENT_PARAMETERS]
    lines = [acu.get(name, '') for name in page_state.ELEMENT_PARAMETERS]
    lines = lines if any(lines) else simulated
    station = [p.get(f'prediction.station.{name}') for name in page_state.STATION_PARAMETERS]
    if not any(lines) or None in station:
        return None
    start = p.get('prediction.start_time')
    if not start and lines == simulated:
        start = antenna.diagnostics_of('tracking_receiver').get('stamp_0_utc')
    ahead = _seconds(orbit.instant('start_time', start)) - page_state.epoch(antenna) if start else 0.0
    utc = antenna.now + ahead
    return PassQuery(*lines, StationParameters(*station), ahead,
                     int(utc / SECONDS_PER_DAY / SEARCH_VALIDITY_DAYS)) if utc > MIN_UTC_S else None


def upcoming_passes(query):
    """Return a list of the passes from the day of a PassQuery on, each a dict.

    aos, los: rise and set [s], in the time of the graph; highest: elevation, from, to: azimuth at rise and set [deg].
    The list is empty if the elements are too old for the day, or if the satellite does not rise and set.
    """
    begin = datetime.datetime(1970, 1, 1) + datetime.timedelta(days=query.day * SEARCH_VALIDITY_DAYS)
    try:
        satellite = orbit.satellite(query)
        _, too_old = passes.search_start(satellite, begin)
        known = [] if too_old else passes.passes_after(satellite, query.station, begin, SEARCH_SPAN_DAYS)
    except orbit.TargetError:
        known = []
    return [{'aos': _seconds(each.rise) - query.ahead, 'los': _seconds(each.set) - query.ahead,
             'highest': round(each.elevation, 1), 'from': round(each.rise_azimuth, 1) % 360.0,
             'to': round(each.set_azimuth, 1) % 360.0} for each in known if each.rise and each.set]


def _seconds(utc):
    """Return the time since 1970 [s] of a datetime in UTC."""
    return (utc - datetime.datetime(1970, 1, 1)).total_seconds()


class UpcomingPasses:
    """Search for the next passes of an antenna in a thread."""

    def __init__(self):
        self._worker = futures.ThreadPoolExecutor(1, 'passes')
        self._query, self._future = None, None

    def look(self, antenna) -> list:
        """Return the next passes in the form of `upcoming_passes`, [] during the search."""
        query = pass_query(antenna)
        if query != self._query:
            self._query, self._future = query, query and self._worker.submit(upcoming_passes, query)
        known = self._future.result() if self._future and self._future.done() else []
        return [each for each in known if each['aos'] > antenna.now][:MAX_PASSES]

    def close(self):
        """End without waiting for a search."""
        self._worker.shutdown(wait=False, cancel_futures=True)
