"""Every scenario that comes with the product loads, and the closed loop of one with a receiver to follow ends in
autotrack; the servo scenarios are in test_servo_graph.py."""
import numpy as np
import pytest

from acu_tracker.modes import Mode
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario, shipped

pytestmark = pytest.mark.every_case

DURATION = 6.0


OF_THEIR_WHOLE_LENGTH = ('ship_overhead', 'ship_align_and_track', 'late_tle', 'sidelobe', 'steptrack_geo',
                         'leo_station_7m', 'station_new', 'station_sun', 'receiver_phasing')
"""Runs of seconds say nothing about these; test_ship, test_acquisition, test_data_sheet, test_pointing_collect,
test_pointing_scan and test_receiver_calibration make them."""

TRACKED = [name for name in shipped.available()
           if not name.startswith('servo_') and name not in OF_THEIR_WHOLE_LENGTH]


@pytest.mark.parametrize('name', TRACKED)
def test_a_scenario_tracks(name, tmp_path):
    overrides = []
    if name == 'track_file':
        file = tmp_path / 'flight.csv'
        rows = [f'{t},{47.41 + 4e-4 * t:.6f},8.51,1500' for t in range(12)]
        file.write_text('time_s,latitude_deg,longitude_deg,altitude_m\n' + '\n'.join(rows) + '\n')
        overrides = [f'tracking_receiver.target.track_file.path={file}']
    chosen = scenario.load(name, overrides, duration=DURATION)
    run = closed_loop.Loop(chosen).run()
    assert len(run.steps) == round(DURATION / chosen.node_parameters('adu').period) + 1
    assert run['acu/mode'][-1] == Mode.AUTOTRACK
    error = run.truth['error'][run.t > DURATION - 0.5]
    assert np.isfinite(error).all()
    half_beam = 0.5 * chosen.node_parameters('tracking_receiver').antenna.beamwidth
    assert np.abs(error).max() < 0.5 * half_beam
