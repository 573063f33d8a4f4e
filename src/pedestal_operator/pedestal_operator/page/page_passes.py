"""Search for the next passes of the satellite that the antenna follows, in a thread of its own: the page does not
wait."""
import datetime
import math
from concurrent import futures
from typing import NamedTuple

from pedestal_common.geometry import orbit, passes
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Degrees, Seconds
from pedestal_operator.page import page_state

MAX_PASSES = 4  # largest number of passes shown
SEARCH_SPAN_DAYS, SEARCH_VALIDITY_DAYS = 2.0, 1.0  # searched ahead, and until the next search [days]
MIN_UTC_S = 1e8  # smallest time that is UTC [s]; a smaller time counts from the start of a run


class PassQuery(NamedTuple):
    """Satellite, station and day of a search."""
    line_1: str         # elements of the satellite
    line_2: str
    omm: str
    station: StationParameters
    ahead: Seconds      # UTC for which the satellite is computed, minus the time of the graph; 0 except in a
                        # simulation of another day
    least: Degrees      # elevation of rise and set: the horizon mask of a simulated receiver, else 0
    day: int            # number of the interval of SEARCH_VALIDITY_DAYS since 1970


def pass_query(antenna: page_state.PageAntenna) -> PassQuery | None:
    """Return the query of an antenna, None without elements, station or UTC. The elements are those of mode tle, else
    those of a simulated satellite on the day of its scenario."""
    p, acu = antenna.configuration, antenna.diagnostics_of('acu')
    target = p if p.get('target.kind') == 'leo_pass' else {}
    simulated = [target.get(f'target.leo_pass.{name}', '') for name in page_state.ELEMENT_PARAMETERS]
    lines = [acu.get(name, '') for name in page_state.ELEMENT_PARAMETERS]
    lines = lines if any(lines) else simulated
    station = page_state.station(antenna)
    if not any(lines) or station.absent:
        return None
    start = p.get('prediction.start_time')
    if not start and lines == simulated:
        start = antenna.diagnostics_of('tracking_receiver').get('stamp_0_utc')
    ahead = _seconds(orbit.instant('start_time', start)) - page_state.epoch(antenna) if start else 0.0
    utc = antenna.now + ahead
    line_1, line_2, omm = lines
    least = round(math.degrees(p.get('receiver.horizon_mask', 0.0)), 6)
    return PassQuery(line_1, line_2, omm, station, ahead, least,
                     int(utc / SECONDS_PER_DAY / SEARCH_VALIDITY_DAYS)) if utc > MIN_UTC_S else None


def upcoming_passes(query: PassQuery) -> list[dict[str, float]]:
    """Return the passes from the day of a query on; [] for elements that are too old, or without rise and set. Times
    are of the graph [s]; highest: elevation; from, to: azimuth at rise and set [deg]."""
    begin = datetime.datetime(1970, 1, 1) + datetime.timedelta(days=query.day * SEARCH_VALIDITY_DAYS)
    try:
        satellite = orbit.satellite(query)
        _, too_old = passes.search_start(satellite, begin)
        known = [] if too_old else passes.passes_after(satellite, query.station, begin, SEARCH_SPAN_DAYS,
                                                           query.least)
    except orbit.TargetError:
        known = []
    return [{'aos': _seconds(each.rise) - query.ahead, 'los': _seconds(each.set) - query.ahead,
             'highest': round(each.elevation, 1), 'from': round(each.rise_azimuth, 1) % 360.0,
             'to': round(each.set_azimuth, 1) % 360.0} for each in known if each.rise and each.set]


def _seconds(utc: datetime.datetime) -> Seconds:
    return (utc - datetime.datetime(1970, 1, 1)).total_seconds()


class UpcomingPasses:
    """Search for the next passes of an antenna in a thread."""
    _query: PassQuery | None
    _future: futures.Future[list[dict[str, float]]] | None

    def __init__(self) -> None:
        self._worker = futures.ThreadPoolExecutor(1, 'passes')
        self._query, self._future = None, None

    def look(self, antenna: page_state.PageAntenna) -> list[dict[str, float]]:
        """Return the next passes in the form of `upcoming_passes`, [] during the search."""
        query = pass_query(antenna)
        if query != self._query:
            self._query, self._future = query, self._worker.submit(upcoming_passes, query) if query else None
        known = self._future.result() if self._future and self._future.done() else []
        return [each for each in known if each['aos'] > antenna.now][:MAX_PASSES]

    def close(self) -> None:
        """End without waiting for a search."""
        self._worker.shutdown(wait=False, cancel_futures=True)
