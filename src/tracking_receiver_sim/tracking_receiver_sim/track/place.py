"""Parameters of a run that a recorded flight gives if the scenario does not set them.

These are the position of the station, the reference range of the C/N0 and the duration of the run.

The station stands beside the fix in the middle of the flight (by time), to the right of the line from the first fix to
the last. The station is as near to the middle fix as possible, but every fix is at least the least range away from the
station over ground. The least range is the range at which the peak speed turns the azimuth by MAX_AZIMUTH_RATE_RAD_S,
and at least MIN_RANGE_M. Because the terrain is not known, the station is lower than the lowest fix by
STATION_DEPTH_RATIO times the least range. This keeps a level flight above the horizon. The height of the station is at
most MAX_STATION_HEIGHT_M.
"""
import dataclasses
import math
from collections.abc import Collection

import numpy as np

from pedestal_common.geometry import geodesy
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.quantities import Floats, Meters
from tracking_receiver_sim.params import TargetParameters, TrackFileParameters
from tracking_receiver_sim.track import flight
from tracking_receiver_sim.track.fixes import Fixes

MAX_AZIMUTH_RATE_RAD_S = 0.05  # largest azimuth rate of a flight seen from the station [rad/s]
MIN_RANGE_M = 100.0  # lower limit of the least range over ground [m]
STATION_DEPTH_RATIO = 0.1  # depth of the station below the lowest fix, divided by the least range [-]
MIN_STATION_HEIGHT_M, MAX_STATION_HEIGHT_M = -500.0, 3000.0  # range of the height of the station [m]
MIN_DURATION_S, MAX_DURATION_S = 0.1, 86400.0  # range of the duration of a run [s]

STATION_FIELDS = {f'target.station.{field.name}': field.name for field in dataclasses.fields(StationParameters)}
"""{parameter: field of StationParameters}."""


def station_for(fixes: Fixes, track: TrackFileParameters) -> StationParameters:
    """Return a station for fixes. Raises csv_table.TableError."""
    middle = int(np.argmin(np.abs(fixes.time - 0.5 * (fixes.time[0] + fixes.time[-1]))))
    under_middle_fix = StationParameters(latitude_deg=float(fixes.latitude[middle]),
                                         longitude_deg=float(fixes.longitude[middle]))
    spline = flight.lay_out(fixes, track, under_middle_fix)
    # The constant terms of the pieces are the positions at the breaks; their first two columns are east and north.
    ground = spline.coefficients[3, :, :2]
    least_range = max(MIN_RANGE_M, spline.speed / MAX_AZIMUTH_RATE_RAD_S)
    along = ground[-1] - ground[0]
    bearing = math.atan2(along[0], along[1]) + 0.5 * math.pi
    (east, north), to_east, to_north = ground.T, math.sin(bearing), math.cos(bearing)
    distance = _clear_of(east * to_north - north * to_east, east * to_east + north * to_north, least_range)
    latitude, longitude = geodesy.destination(under_middle_fix.latitude_deg, under_middle_fix.longitude_deg, bearing,
                                              distance)
    height = float(np.clip(fixes.altitude.min() - STATION_DEPTH_RATIO * least_range, MIN_STATION_HEIGHT_M,
                           MAX_STATION_HEIGHT_M))
    return StationParameters(latitude_deg=round(latitude, 5), longitude_deg=round(longitude, 5),
                             height=round(height, 1))


def _clear_of(along: Floats, across: Floats, least_range: Meters) -> Meters:
    """Return the least s >= 0 at which the place (0, s) has the distance least_range or more from all points.

    along, across: coordinates of the points [m].
    """
    near = np.abs(along) < least_range
    half = np.sqrt(least_range**2 - along[near]**2)
    s = 0.0
    for low, high in sorted(zip(across[near] - half, across[near] + half)):
        if low > s:
            break
        s = max(s, high)
    return float(s)


def run_parameters(fixes: Fixes, target: TargetParameters, given: Collection[str]) -> dict[str, float]:
    """Return {parameter: value} that fixes give for a run. Raises csv_table.TableError.

    given: names of the parameters that the scenario sets; only those of the station matter here. The reference range
    is the greatest range of the flight, so the C/N0 of the parameter is the lowest of the run. The run ends at the
    last tenth of a second before the last fix.
    """
    derived = station_for(fixes, target.track_file)
    station = dataclasses.replace(target.station, **{
        field: getattr(derived, field) for name, field in STATION_FIELDS.items() if name not in given})
    spline = flight.lay_out(fixes, target.track_file, station)
    reference_range = max(10.0, 10.0 * math.ceil(0.1 * spline.greatest_range))
    duration = max(MIN_DURATION_S, min(MAX_DURATION_S, (math.ceil(10.0 * spline.breaks[-1]) - 1) / 10.0))
    return {**dict(zip(STATION_FIELDS, dataclasses.astuple(station))), 'receiver.reference_range': reference_range,
            'duration': duration}
