"""Sample files of `pedestal samples`: a flight, the motion of a ship, a satellite and an antenna.

Closed-form expressions give the numbers. Each file has the format in which a user provides such data.
"""
import math
from collections.abc import Callable

from pedestal_common.text_files.columns import METRES_PER_FOOT
from tracking_receiver_sim.params import LeoPassParameters

FLIGHT_TIMES_S = range(91)  # times of the rows of the flight [s]

ADSB_HEADER = 'timestamp,icao24,callsign,latitude,longitude,geoaltitude'


def flight() -> str:
    """Return a climbing turn of a helicopter as CSV, rounded as ADS-B is: altitudes in steps of 25 ft.

    The circle has a radius of 2 km about 47.40 deg north, 8.50 deg east. The speed is 0.0225 rad/s x 2 km = 45 m/s.
    """
    rows = [ADSB_HEADER]
    for t in FLIGHT_TIMES_S:
        phase = 0.0225 * t
        latitude, longitude = 47.40 + 0.018 * math.sin(phase), 8.50 + 0.0266 * math.cos(phase)
        altitude = 25 * round((700.0 + 2.0 * t) / (25 * METRES_PER_FOOT))
        rows.append(f'2026-05-04 10:{t // 60:02}:{t % 60:02}+00:00,4b1812,RGA3,'
                    f'{latitude:.5f},{longitude:.5f},{altitude}')
    return '\n'.join(rows) + '\n'


def ship() -> str:
    """Return the motion of a ship as CSV: a sine in roll, pitch, yaw and heave, with a phase of its own [rad]."""
    rows = ['time_s,roll_deg,pitch_deg,heading_deg,heave_m']
    for k in range(601):
        t = 0.25 * k
        roll, pitch, yaw, heave = (a * math.sin(2.0 * math.pi * t / period + phase) for a, period, phase in (
            (6.0, 9.0, 0.0), (2.0, 7.0, 1.0), (1.0, 13.0, 2.0), (1.0, 8.0, 0.5)))
        rows.append(f'{t:.2f},{roll:.4f},{pitch:.4f},{60.0 + yaw:.4f},{heave:.4f}')
    return '\n'.join(rows) + '\n'


def tle() -> str:
    """Return the TLE of the scenario leo_pass."""
    return f'ISS (ZARYA)\n{LeoPassParameters().line_1}\n{LeoPassParameters().line_2}\n'


ANTENNA_FILE_TEXT = """\
# An antenna of your own. Other parameters have their defaults; `pedestal parameters NODE` lists them.
scenario:
  ros__parameters:
    title: the UAV through a heavier antenna with a narrower beam
    duration: 60.0
/**/tracking_receiver:
  ros__parameters:
    target:
      kind: flyby
    antenna:
      beamwidth: 0.012        # half power [rad]; also used by the control unit
    receiver:
      cn0_dbhz: 52.0          # on the beam axis at reference_range
      reference_range: 600.0  # [m]
/**/adu:
  ros__parameters:
    initial_elevation: 0.19   # [rad]
    azimuth:
      load:
        inertia: 320.0        # dish and yoke about the axis [kg m2]
      speed_loop:
        load_inertia: 320.0   # value for the speed loop [kg m2]
      gear_train:
        lash: 0.0015          # play of one mesh, on the load axis [rad]
/**/acu:
  ros__parameters:
    initial_mode: program
    azimuth:
      feedforward:
        inertia: 390.0        # load and motors together [kg m2]
      shaper:
        acceleration: 15.0    # [rad/s2]
"""

SAMPLE_FILES: dict[str, Callable[[], str]] = {'flight.csv': flight, 'ship.csv': ship, 'iss.tle': tle,
                                              'my_antenna.yaml': lambda: ANTENNA_FILE_TEXT}
"""{name of a file: function that returns its text}."""

FILE_DESCRIPTIONS = {
    'flight.csv': 'ADS-B of a helicopter as CSV, one row a second: a turn of 2 km radius at 45 m/s that climbs at 2 '
                  'm/s; rounded to 1e-5 deg and 25 ft, as ADS-B is.',
    'ship.csv': 'Motion of a ship as CSV, four rows a second for 150 s: roll 6 deg in 9 s, pitch 2 deg in 7 s, yaw 1 '
                'deg in 13 s about heading 60 deg, heave 1 m.',
    'iss.tle': 'Elements of the ISS on 2019-12-09, which the scenario leo_pass also has.',
    'my_antenna.yaml': 'A scenario: another antenna that tracks the flight of uav_flyby.',
}
"""{name of a file: its content in a sentence}."""
