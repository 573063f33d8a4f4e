"""Methods of acceptance for tracking, in the closed loop, against values that are known in another way."""
import math

import numpy as np
import pytest

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario.variant import Variant
from pedestal_workbench.acceptance import tracking
from pedestal_workbench.acceptance.in_loop import InLoop

METHODS = {method.name: method for method in tracking.METHODS}
UAV, STATION = 'uav_tracker_3m', 'station_real'


def arguments(name, **given):
    return {**{argument.name: argument.default for argument in METHODS[name].arguments}, **given}


def exercise(performer, name, **given):
    return METHODS[name].exercise(performer.antenna, arguments(name, **given))


def performed(variant, name, seed=1, **given):
    performer = InLoop(variant)
    return performer.perform(name, exercise(performer, name, **given), seed)


def measured(variant, name, seed=1, **given):
    return METHODS[name].measure(performed(variant, name, seed, **given), arguments(name, **given))


@pytest.mark.parametrize('target', ['beacon', 'pass', 'manoeuvre', 'own'])
def test_rms_in_autotrack_is_that_of_the_true_error_of_the_beam(target):
    made = exercise(InLoop(Variant(UAV)), 'autotrack_rms', target=target, duration=15.0)
    run = closed_loop.Loop(Variant(UAV).with_(made.changes, seed=1, duration=15.0).load()).run()
    modes = run['acu/mode']
    first = int(np.argmax(modes == modes[-1])) + round(2.0 / 0.005)     # settled autotrack
    expected = math.degrees(np.sqrt(np.mean(run.truth['error'][first:]**2)))
    found = measured(Variant(UAV), 'autotrack_rms', target=target, duration=15.0)
    assert found.value == pytest.approx(expected, rel=0.02)
    assert 0.0 < found.uncertainty < found.value


@pytest.mark.thorough
@pytest.mark.parametrize('scenario', [UAV, STATION])
def test_uncertainty_of_the_rms_covers_the_spread_over_seeds(scenario):
    found = [measured(Variant(scenario), 'autotrack_rms', seed, target='manoeuvre') for seed in range(1, 21)]
    values, halves = np.array(found).T
    assert np.mean(np.abs(values - values.mean()) <= halves) >= 0.9
    assert halves.mean() < 4.0 * 1.96 * values.std(ddof=1)


@pytest.mark.parametrize(('changes', 'cross_elevation', 'cross_talk'), [
    ({}, 1.0, 0.0), ({'antenna.slope_factor': 0.6}, 0.6, 0.0),
    ({'antenna.cross_coupling': 0.3}, math.cos(0.3), -math.sin(0.3)),
    ({'inject': '0 wrong_slope axis=cross_elevation factor=1.5'}, 1.5, 0.0)])
def test_slope_of_the_receiver_is_the_simulated_one(changes, cross_elevation, cross_talk):
    variant = Variant(UAV).with_({f'tracking_receiver.{key}': value for key, value in changes.items()})
    done = performed(variant, 'receiver_slope')
    for channel, expected in (('cross-elevation', cross_elevation), ('cross-talk', cross_talk)):
        found = METHODS['receiver_slope'].measure(done, {'channel': channel})
        assert abs(found.value - expected) < found.uncertainty + 0.02, channel  # 0.02: the slope is not quite straight
        assert found.uncertainty < 0.06


def test_slope_is_that_after_the_calibration():
    variant = Variant(UAV).with_({'tracking_receiver.antenna.slope_factor': 0.6, 'acu.tracker.matrix.xx': 1.0 / 0.6,
                                  'acu.tracker.matrix.ee': 1.0 / 0.6})
    assert measured(variant, 'receiver_slope').value == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(('azimuth', 'share'), [(0.0, 1.0), (90.0, math.sin(math.radians(35.0)))])
def test_tilt_of_the_mount_is_the_offset_from_the_program(azimuth, share):
    # At the azimuth to which the axis leans, the tilt is an error of the elevation; across, of the cross-elevation.
    tilted = Variant(UAV).with_({'adu.mount.tilt_forward': 2e-3})
    expected = share * math.degrees(2e-3)
    rms = measured(tilted, 'program_rms', target='beacon', azimuth=azimuth, duration=15.0)
    assert rms.value * math.sqrt(2.0) == pytest.approx(expected, rel=0.02)      # of two axes, one has the error
    offset = measured(tilted, 'pointing_offset', target='beacon', azimuth=azimuth, duration=60.0)
    assert abs(offset.value - expected) < offset.uncertainty < 0.02
    assert measured(Variant(UAV), 'pointing_offset', target='beacon', azimuth=azimuth).value < 0.1 * expected


@pytest.mark.parametrize('offset', [0.0, 0.5, 3.0, 30.0])
def test_the_length_of_a_mean_has_no_bias_by_noise(offset):
    """offset: of the mean, over the standard deviation of the mean."""
    rng, n = np.random.default_rng(3), 20
    found = [tracking.of_mean(np.array([0.6, 0.8]) * offset + math.sqrt(n) * rng.standard_normal((n, 2)))
             for _ in range(1000)]
    assert np.mean([abs(one.value - offset) <= one.uncertainty for one in found]) >= 0.94
    plain = math.sqrt(offset**2 + 2.0)      # rms length of the mean with its noise
    assert abs(np.mean([one.value for one in found]) - offset) < max(0.7 * (plain - offset), 0.1)


def test_acquisition_takes_the_errors_of_the_lock_and_never_ends_without_a_signal():
    counted = InLoop(Variant(UAV)).antenna.acu.tracker.lock_count * 0.005
    assert measured(Variant(UAV), 'acquisition_time', target='beacon').value == pytest.approx(counted, abs=0.02)
    weak = Variant(UAV).with_({'tracking_receiver.receiver.cn0_dbhz': 30.0})
    assert measured(weak, 'acquisition_time', target='beacon', duration=15.0).value == math.inf


def test_recovery_after_a_fade_takes_the_lock_of_the_receiver_and_of_the_filter():
    # The receiver locks in 0.1 s, the control unit counts 100 errors of 5 ms.
    assert measured(Variant(UAV), 'fade_recovery').value == pytest.approx(0.6, abs=0.05)
    assert measured(Variant(UAV), 'fade_recovery', depth=0.0).value == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(('name', 'given', 'text'), [
    ('autotrack_rms', {'elevation': 89.0, 'azimuth': -300.0}, 'azimuth: azimuth -300 deg must be -270 to 270 deg'),
    ('autotrack_rms', {'target': 'manoeuvre', 'acceleration': 100.0}, 'acceleration = 100.0 deg/s2: must be at most'),
    ('autotrack_rms', {'target': 'manoeuvre', 'elevation': 0.0, 'acceleration': 1.0}, 'acceleration: elevation -10')])
def test_exercise_that_does_not_fit_is_refused(name, given, text):
    with pytest.raises(ValueError, match=text):
        exercise(InLoop(Variant(UAV)), name, **given)


def test_antenna_without_a_simulated_target_accepts_only_its_own():
    performer = InLoop(Variant(UAV))
    performer.antenna = performer.antenna._replace(simulated=())
    for name, method in METHODS.items():
        with pytest.raises(ValueError, match='target = .*: must be own|program_rms: must have a simulated receiver'):
            exercise(performer, name, target='beacon')
        if name != 'program_rms':
            assert method.exercise(performer.antenna, arguments(name, target='own')).duration > 0.0
