"""A recorded flight by two options on the command line: what the scenario leaves open follows from the file, and the
antenna follows the flight."""
import math

import numpy as np
import pytest

from acu_tracker.modes import Mode
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.program import Plan
from tracking_receiver_sim.tracks import files as track_files

PATH = 'tracking_receiver.target.track_file.path'
SMOOTH = 'tracking_receiver.target.track_file.smooth=true'
SECONDS = 60


@pytest.fixture(scope='module')
def adsb(tmp_path_factory):
    """A turning helicopter as ADS-B gives it: each second, rounded to 100 ft and 1e-4 deg, two positions held."""
    lines = ['timestamp,icao24,callsign,latitude,longitude,geoaltitude']
    for k in range(SECONDS):
        t = k - (k in (20, 21, 40)) - (k == 21)
        north, east = 1500.0 * math.sin(0.02 * t), 1500.0 * math.cos(0.02 * t)
        lines.append(f'2018-07-23 10:00:{k:02}+00:00,4b1812,RGA3,{47.4 + north / 111e3:.4f},{8.5 + east / 75e3:.4f},'
                     f'{100 * round((500.0 + 3.0 * k) / 30.48)}')
    path = tmp_path_factory.mktemp('flights') / 'flight.csv'
    path.write_text('\n'.join(lines))
    return path


def test_two_options_are_enough(adsb):
    chosen = scenario.load('track_file', [f'{PATH}={adsb}', SMOOTH])
    assert chosen.header.duration == SECONDS - 1.1
    run = closed_loop.Loop(chosen).run()
    assert run['acu/mode'][-1] == Mode.AUTOTRACK
    error = run.truth['error'][run.t > 5.0]
    half_beam = 0.5 * chosen.node_parameters('tracking_receiver').antenna.beamwidth
    assert np.isfinite(error).all() and np.abs(error).max() < 0.5 * half_beam


def test_the_flight_is_told_where_the_run_begins(adsb):
    _, log, path, _ = Plan(scenario.load('track_file', [f'{PATH}={adsb}', SMOOTH])).announced()
    assert log.startswith('flight.csv: ADS-B of 4b1812 RGA3, columns timestamp in UTC, latitude in deg, longitude in '
                          'deg, geoaltitude in ft: 57 of 60 fixes, 3 held positions dropped, times in whole')
    assert 'altitudes in steps of 100 ft, smoothed: off the fixes by ' in log
    assert path.startswith('59 s, at most 3') and ' km from the station at latitude 47.' in path
    assert Plan(scenario.load('uav_flyby')).announced() == ['antenna at 47.40 N 8.50 E, 500 m: the default']


def test_the_flight_is_in_the_diagnostics_of_the_receiver(adsb):
    unit = scenario.load('track_file', [f'{PATH}={adsb}', SMOOTH]).unit('tracking_receiver')
    values = dict(unit.diagnose().values)
    assert values['stamp_0_utc'] == '2018-07-23T10:00:00.000Z'
    assert (values['track_log'], values['track_flight']) == unit.target.summary


def test_what_is_raw_and_impossible_is_refused(adsb):
    with pytest.raises(ValueError, match='flight.csv: line [0-9]+: acceleration = .* or smoothed by smooth = true'):
        scenario.load('track_file', [f'{PATH}={adsb}'])


def test_what_the_scenario_says_stands(adsb):
    given = {'target.station.latitude_deg': 47.3, 'target.station.longitude_deg': 8.6, 'target.station.height': 450.0,
             'receiver.reference_range': 5000.0}
    overrides = [f'{PATH}={adsb}', SMOOTH, *(f'tracking_receiver.{key}={value}' for key, value in given.items())]
    chosen = scenario.load('track_file', overrides, duration=20.0)
    assert {key: chosen.given('tracking_receiver')[key] for key in given} == given
    assert chosen.header.duration == 20.0


def test_a_scenario_says_all_that_followed_from_its_file(adsb):
    chosen = scenario.load('track_file', [f'{PATH}={adsb}', SMOOTH])
    assert {*track_files.DERIVED_PARAMETERS} - {'duration'} <= {*chosen.given('tracking_receiver')}
    text = chosen.as_yaml()
    content = adsb.read_text()
    adsb.write_text('moved away')
    try:
        assert scenario.parse('track_file', text) == chosen
    finally:
        adsb.write_text(content)


@pytest.fixture(scope='module')
def oem(tmp_path_factory):
    """Eight minutes of a satellite in an earth-fixed frame that climbs over the station: a circle, states of 30 s."""
    lines = ['CCSDS_OEM_VERS = 2.0', 'META_START', 'OBJECT_NAME = SAT', 'OBJECT_ID = 2026-001A', 'CENTER_NAME = EARTH',
             'REF_FRAME = ITRF', 'TIME_SYSTEM = UTC', 'META_STOP']
    w = 1.1e-3
    for k in range(17):
        phase = w * (30.0 * k - 240.0)
        across = np.array([math.cos(0.85), 0.1, math.sin(0.85)]) / math.sqrt(1.01)
        r = 6900.0 * (math.cos(phase) * across + math.sin(phase) * np.array([0.0, 1.0, 0.0]))
        v = 6900.0 * w * (-math.sin(phase) * across + math.cos(phase) * np.array([0.0, 1.0, 0.0]))
        lines.append(f'2026-11-22T05:{k // 2:02}:{30 * (k % 2):02} ' + ' '.join(f'{x:.6f}' for x in (*r, *v)))
    path = tmp_path_factory.mktemp('orbits') / 'pass.oem'
    path.write_text('\n'.join(lines) + '\n')
    return path


def test_an_orbit_from_a_file_is_tracked(oem):
    """By the same option as a flight, from where the file begins; the program track has the UTC of the file."""
    begin = 'tracking_receiver.target.track_file.start=200'
    chosen = scenario.load('track_file', [f'{PATH}={oem}', begin], duration=20.0)
    run = closed_loop.Loop(chosen).run()
    assert run['acu/mode'][-1] == Mode.AUTOTRACK
    error = run.truth['error'][run.t > 10.0]
    half_beam = 0.5 * chosen.node_parameters('tracking_receiver').antenna.beamwidth
    assert np.isfinite(error).all() and np.abs(error).max() < 0.5 * half_beam
    _, log, path, _ = Plan(chosen).announced()
    assert log == 'pass.oem: CCSDS OEM of SAT (2026-001A): 17 states in ITRF, HERMITE of degree 7'
    assert path.startswith('20 s from 2026-11-22T05:03:20.000Z, highest ')
    assert Plan(chosen).begins() == 1_795_323_800 * 10**9
    with pytest.raises(ValueError, match='--start file: the target of uav_flyby has no date'):
        Plan(scenario.load('uav_flyby')).begins()
