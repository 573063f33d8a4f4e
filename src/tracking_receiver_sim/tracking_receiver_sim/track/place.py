"""What a scenario leaves open about a recorded flight: where the station stands, at which range its C/N0 holds, how
long the run is.

The station stands beside the fix in the middle of the flight (by time), to the right of the line from the first fix
to the last, just so far that no fix comes nearer over ground than the least range. That is the range at which the
peak speed turns the azimuth by MAX_AZIMUTH_RATE_RAD_S, and at least MIN_RANGE_M. No terrain is known: the station is
lower than
the lowest fix by STATION_DEPTH_RATIO of the least range, so that a level flight is above its horizon, and not above
MAX_STATION_HEIGHT_M.
"""
import dataclasses
import math

import numpy as np

from pedestal_common.geometry import geodesy
from pedestal_common.geometry.geodesy import StationParameters
from tracking_receiver_sim.track import flight

MAX_AZIMUTH_RATE_RAD_S = 0.05
"""[rad/s], at most."""
MIN_RANGE_M = 100.0
"""[m], over ground."""
STATION_DEPTH_RATIO = 0.1
"""Of the least range."""
MIN_STATION_HEIGHT_M, MAX_STATION_HEIGHT_M = -500.0, 3000.0
"""Of the station [m]."""
MIN_DURATION_S, MAX_DURATION_S = 0.1, 86400.0
"""Run [s]."""

STATION_FIELDS = {f'target.station.{field.name}': field.name for field in dataclasses.fields(StationParameters)}


def station_for(fixes, track) -> StationParameters:
    """A station for Fixes; raises csv_table.TableError."""
    middle = int(np.argmin(np.abs(fixes.time - 0.5 * (fixes.time[0] + fixes.time[-1]))))
    below = StationParameters(latitude_deg=float(fixes.latitude[middle]),
                              longitude_deg=float(fixes.longitude[middle]))
    laid = flight.lay_out(fixes, track, below)
    ground = laid.coefficients[3, :, :2]
    clearance = max(MIN_RANGE_M, laid.speed / MAX_AZIMUTH_RATE_RAD_S)
    along = ground[-1] - ground[0]
    bearing = math.atan2(along[0], along[1]) + 0.5 * math.pi
    (east, north), to_east, to_north = ground.T, math.sin(bearing), math.cos(bearing)
    distance = _clear_of(east * to_north - north * to_east, east * to_east + north * to_north, clearance)
    latitude, longitude = geodesy.destination(below.latitude_deg, below.longitude_deg, bearing, distance)
    height = float(np.clip(fixes.altitude.min() - STATION_DEPTH_RATIO * clearance, MIN_STATION_HEIGHT_M,
                           MAX_STATION_HEIGHT_M))
    return StationParameters(latitude_deg=round(latitude, 5), longitude_deg=round(longitude, 5),
                             height=round(height, 1))


def _clear_of(along, across, clearance):
    """The least s >= 0 whose place (0, s) is no nearer than the clearance to any of the points (along, across)."""
    near = np.abs(along) < clearance
    half = np.sqrt(clearance**2 - along[near]**2)
    s = 0.0
    for low, high in sorted(zip(across[near] - half, across[near] + half)):
        if low > s:
            break
        s = max(s, high)
    return float(s)


def run(fixes, target, given):
    """{parameter: value} that follow from Fixes for a TargetParameters; given: the names that are, of which only those
    of the station matter here. Raises csv_table.TableError.

    The C/N0 holds at the greatest range, so that it is nowhere less; the run ends at the last tenth of a second before
    the last fix.
    """
    derived = station_for(fixes, target.track_file)
    station = dataclasses.replace(target.station, **{field: getattr(derived, field) for name,
                                                     field in STATION_FIELDS.items()
                                                     if name not in given})
    laid = flight.lay_out(fixes, target.track_file, station)
    reference_range = max(10.0, 10.0 * math.ceil(0.1 * laid.greatest_range))
    duration = max(MIN_DURATION_S, min(MAX_DURATION_S, (math.ceil(10.0 * laid.breaks[-1]) - 1) / 10.0))
    return {**dict(zip(STATION_FIELDS, dataclasses.astuple(station))), 'receiver.reference_range': reference_range,
            'duration': duration}
