"""The true terms of the study `calibration`, against the beam of the standing antenna, and its passes."""
import numpy as np
import pytest

from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.program import Plan
from pedestal_common.geometry.line_of_sight import wrap
from pedestal_studies.system import calibration
from pedestal_workbench.calibration import fit


@pytest.mark.parametrize('azimuth, elevation', [(-1.2, 0.2), (2.0, 1.2)])
def test_the_true_terms_give_the_direction_of_the_dish(azimuth, elevation):
    """Encoders minus dish, in calm air and without the receiver, whose null is off the beam."""
    still = ['adu.wind.field.speed=0', 'acu.initial_mode=stop', 'acu.tracker.handover=false',
             f'adu.initial_azimuth={azimuth}', f'adu.initial_elevation={elevation}']
    record = memory_recording.record(scenario.load(calibration.SCENARIO_NAME, still, duration=4.0))
    encoders, dish = (np.array([record.table(topic)[f'{axis}.position'][-100:].mean()
                                for axis in ('azimuth', 'elevation')]) for topic in ('joint_states', 'adu/truth'))
    true, antenna = calibration.truth(), scenario.load(calibration.SCENARIO_NAME).node_parameters(
        'tracking_receiver').antenna
    true['P4'] -= np.degrees(antenna.boresight_cross_elevation)
    true['P7'] += np.degrees(antenna.boresight_elevation)
    expected = fit.exact_offsets(tuple(true), list(true.values()), np.degrees(dish)[None])[0]
    measured = np.degrees((wrap(encoders[0] - dish[0]) * np.cos(dish[1]), encoders[1] - dish[1]))
    np.testing.assert_allclose(measured, expected, atol=5e-4)
    assert np.hypot(*measured) > 0.2


def test_the_passes_cover_the_sky():
    """Ten points of each pass determine all terms, and the test pass is another one."""
    directions = []
    for begin in calibration.CALIBRATION_PASSES:
        times, angles = Plan(calibration.of_pass(begin, 1)).tables['']
        inside = (times > 15.0) & (times < 285.0)
        directions.append(np.degrees(angles[inside][::27]))
    directions = np.concatenate(directions)
    fit.check_distribution(calibration.TERMS, directions)
    _, angles = Plan(calibration.of_pass(calibration.TEST_PASS, 1)).tables['']
    apart = [np.hypot((directions[:, 0] - az + 180.0) % 360.0 - 180.0, directions[:, 1] - el).min()
             for az, el in np.degrees(angles)]
    assert np.median(apart) > 3.0
