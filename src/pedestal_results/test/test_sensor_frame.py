"""Error of the estimate in the frame of the sensors, against the arrays of the closed loop."""
import math

import numpy as np
import pytest
from scipy import ndimage

from pedestal_bringup.loop import closed_loop, memory_recording
from pedestal_bringup.scenario import scenario
from pedestal_common.geometry import line_of_sight
from pedestal_recording import recording as recordings
from pedestal_results import results, sensor_frame, tracking
from pedestal_results.recorded_run import RecordedRun
from pedestal_results.tracking import known_rms as rms
from pedestal_workbench.again import what_if
from pedestal_workbench.tuning import antenna_from_data_sheet
from pedestal_workbench.tuning.data_sheet import DataSheet

EXACT_INS = [f'ins.{name}=0' for name in ('tilt_noise', 'heading_noise', 'rate_noise', 'tilt_wander',
                                          'heading_wander')]


class Without(what_if.Overlay):
    """A recording without a topic."""

    def __init__(self, bag, topic):
        super().__init__(bag, {})
        del self.topics[topic]


def error_against_the_true_direction(bag, run):
    """Estimate minus true target (n, 2), both seen from the true beam: the error of the filter of a rigid antenna."""
    estimate = recordings.at(bag, run.t, 'acu/estimate', ('azimuth.position', 'elevation.position'))
    beam, attitude = run.encoders, None
    if 'adu/truth' in bag.topics:
        beam = recordings.at(bag, run.t, 'adu/truth', ('azimuth.position', 'elevation.position'))
    if 'ship/truth' in bag.topics:
        attitude = recordings.at(bag, run.t, 'ship/imu/data', [f'orientation.{letter}' for letter in 'xyzw'])
    out, matrix = np.full((run.t.size, 2), np.nan), np.empty((3, 3))
    for k in np.flatnonzero(run.tracking):
        line_of_sight.rotation(*(line_of_sight.ASHORE_ATTITUDE if attitude is None else attitude[k]), matrix)
        deck = line_of_sight.to_deck(matrix, *line_of_sight.earth_direction(*estimate[k]))
        out[k] = line_of_sight.offsets(*beam[k], *deck)
    return (out - run.error)[run.tracking]


@pytest.fixture(scope='module')
def flexible():
    """(bag, closed_loop.Run) of a dish of 5 m on a structure of 6 Hz, whose unbalance bends the elevation."""
    sheet = DataSheet(mirror=5.0, frequency=8.2, inertia_azimuth=2000.0, inertia_elevation=1500.0, mode=6.0)
    text = antenna_from_data_sheet.text(antenna_from_data_sheet.sections(sheet, 'flexible'), [])
    chosen = scenario.parse('flexible', text, duration=60.0)
    run = closed_loop.Loop(chosen).run()
    return memory_recording.MemoryRecording(chosen, run), run


def test_the_bend_of_a_flexible_dish_is_no_error_of_the_filter(flexible):
    bag, run = flexible
    known = tracking.read(bag)
    on, error = known.tracking, run.truth['error'][:, 1]
    dish, encoder = (run[topic]['position'][:, 1] for topic in ('adu/truth', 'joint_states'))
    bend = ndimage.uniform_filter1d(dish - encoder, 201)
    estimate_error = (run['acu/estimate']['position'][:, 1] - (dish + error - bend))[on]
    noise = known.measured[on, 1] - error[on]
    found = {name: value for name, (value, _) in results.measured(known.parts).items()}
    assert found['noise_reduction_elevation'] == pytest.approx(rms(noise) / rms(estimate_error), rel=1e-3)
    # The bend is several times the error of the filter, which the error against the true direction would include.
    assert abs(bend[on].mean()) > 5.0 * rms(estimate_error)
    assert rms(error_against_the_true_direction(bag, known)[:, 1]) > 5.0 * rms(estimate_error)
    # The results by the encoders contain the bend.
    assert found['encoder_elevation_rms_deg'] == pytest.approx(math.degrees(rms(dish[on] + error[on] - encoder[on])),
                                                               rel=1e-3)
    assert found['encoder_elevation_rms_deg'] > 5.0 * found['elevation_rms_deg']
    compared = what_if.numbers(what_if.evaluated(bag, [{}]))
    assert compared['estimate_error_elevation_rms_deg'][0][0] == pytest.approx(
        math.degrees(rms(estimate_error)), rel=1e-3)
    assert compared['noise_reduction'][0][0] == pytest.approx(found['noise_reduction'], rel=1e-9)
    # As in earth azimuth and elevation, whose rates are the weights of the lag.
    true = np.column_stack([np.unwrap(angle) for angle in known.target_earth.T])
    rate = np.gradient(true, known.t, axis=0)[on] * np.column_stack((np.cos(true[on, 1]), np.ones(on.sum())))
    e = np.column_stack((known.filter_error[:, 0] / tracking.DEG_PER_RAD, estimate_error))
    assert compared['estimate_lag_s'][0][0] == pytest.approx(-np.sum(e * rate) / np.sum(rate * rate), abs=2e-5)


@pytest.mark.parametrize('name, changes', [('leo_pass', ()), ('uav_flyby', ()), ('ship_pass', EXACT_INS)])
def test_a_rigid_antenna_with_exact_sensors_has_the_error_against_the_true_direction(name, changes):
    """To rounding without the counts of the encoders; with these counts to 0.02 %."""
    bag = memory_recording.record(scenario.load(name, changes, duration=60.0))
    for recording, tolerance in ((Without(bag, 'adu/truth'), 1e-9), (bag, 2e-4)):
        run = tracking.read(recording)
        found = results.measured(run.parts)
        error = np.degrees(error_against_the_true_direction(recording, run))
        for i, axis in enumerate(('cross_elevation', 'elevation')):
            noise = np.degrees(run.measured[run.tracking, i] - run.true[:, i])
            assert found[f'noise_reduction_{axis}'][0] == pytest.approx(rms(noise) / rms(error[:, i]), rel=tolerance)


def test_the_noise_of_the_attitude_is_counted_once():
    """The error against the true direction contains the noise of the present attitude, which the dish does not
    follow: it is larger than the pointing error."""
    bag = memory_recording.record(scenario.load('ship_pass', duration=30.0))
    run = tracking.read(bag)
    assert rms(error_against_the_true_direction(bag, run)) > rms(run.true)
    assert rms(run.filter_error) < run.pointing(rms)


def test_a_boresight_offset_is_neither_noise_nor_an_error_of_the_filter():
    plain, offset = (
        results.measured(RecordedRun(memory_recording.record(scenario.load(
            'leo_pass', [f'tracking_receiver.antenna.boresight_elevation={angle}'], duration=15.0))).parts)
        for angle in (0.0, 1e-3))
    assert offset['elevation_rms_deg'][0] > 10.0 * plain['elevation_rms_deg'][0]
    for name in ('single_sample_noise_deg', 'noise_reduction', 'noise_reduction_elevation'):
        assert offset[name][0] == pytest.approx(plain[name][0], rel=0.02)


@pytest.mark.parametrize('n', [0, 1, 2, 50, 200])
def test_a_recording_shorter_than_the_average_has_a_truth(n):
    """A constant bend turns the truth by its amount."""
    target, attitude = np.tile([0.3, 0.6], (n, 1)), np.tile(line_of_sight.ASHORE_ATTITUDE, (n, 1))
    deck = line_of_sight.angles(*line_of_sight.to_deck(line_of_sight.ashore_matrix(),
                                                       *line_of_sight.earth_direction(0.3, 0.6)))
    beam = np.tile([deck[0], deck[1] + 1e-3], (n, 1))
    found = sensor_frame.truth(0.005 * np.arange(n), beam, np.zeros((n, 2)), attitude, target)
    assert found == pytest.approx(target + [0.0, 1e-3], abs=1e-12)
