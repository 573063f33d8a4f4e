"""Scans of the level: the place of a source by the laws of the receiver, its sigma, and scans that are refused."""
import numpy as np
import pytest

from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import scenario
from pedestal_recording import recording as recordings
from pedestal_studies.system import calibration
from pedestal_workbench.calibration import collect, fit, scan
from pedestal_workbench.calibration.calibration import CalibrationError
from receiver_law import monopulse

FIVE_POINTS = np.array([(0.0, 0.0), (0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)])
RASTER = 0.4 * (np.indices((7, 7)).reshape(2, -1).T - 3.0)


def levels(offsets, place, radius):
    """Levels of a disk [beamwidths] at offsets, by the law of the receiver."""
    return np.array([monopulse.disk_channels(*(offset - place), radius, 1.6, 1.0, 0.0)[0]**2 for offset in offsets])


@pytest.mark.parametrize('radius', [1e-3, 0.3, 0.75])
@pytest.mark.parametrize('offsets, width', [(FIVE_POINTS, 0.15), (RASTER, 0.9)], ids=['five points', 'raster'])
def test_the_place_of_a_disk(offsets, width, radius):
    """The beam is no Gaussian. In a raster this costs less than 0.005 beamwidths, with five points 0.01."""
    for place in np.random.default_rng(1).uniform(-width, width, (20, 2)):
        found = scan.peak(offsets, levels(offsets, place, radius))
        assert np.abs(found.offset - place).max() < (0.005 if len(offsets) > 5 else 0.01)
        # The half level of a disk is further out than that of the beam.
        assert 0.95 < found.width / np.hypot(1.0, 1.2 * radius) < 1.12


def test_sigma_is_the_scatter_of_the_place():
    rng, place = np.random.default_rng(2), np.array((0.3, -0.2))
    level = np.exp(-4.0 * np.log(2.0) * ((RASTER - place)**2).sum(axis=1))
    found = [scan.peak(RASTER, level + 0.01 * rng.standard_normal(level.size)) for _ in range(300)]
    errors, sigma = np.array([one.offset - place for one in found]), np.array([one.sigma for one in found])
    assert errors.std() == pytest.approx(np.sqrt((sigma**2).mean()), rel=0.15)
    assert abs(errors.mean()) < 3.0 * errors.std() / np.sqrt(600)


@pytest.mark.parametrize('offsets, place, text', [
    (FIVE_POINTS[:4], (0.0, 0.0), '4 levels above 0.2 of the highest, must be at least 5'),
    (RASTER * (1.0, 0.0), (0.0, 0.0), 'on one line'),
    (RASTER, (1.5, 0.0), 'not inside the scanned area'),
    (RASTER * 4.0, (0.1, 0.1), '1 levels above')])
def test_a_scan_without_a_place_is_refused(offsets, place, text):
    with pytest.raises(CalibrationError, match=text):
        scan.peak(offsets, levels(offsets, np.array(place), 0.3))


def recorded(*overrides):
    return memory_recording.record(scenario.load('station_sun', ['adu.wind.field.speed=0', *overrides]))


def test_a_raster_of_the_sun_gives_the_errors_of_the_station():
    record, true = recorded(), calibration.truth()
    [(kind, begins, direction, offset)] = collect.every_point(record)
    expected, = fit.exact_offsets(tuple(true), list(true.values()), direction[np.newaxis])
    assert kind.startswith('scan (sigma 0.00') and begins == pytest.approx(8.0, abs=0.01)
    np.testing.assert_allclose(offset, expected, atol=0.002)
    np.testing.assert_allclose(np.hypot(*expected), 0.39, atol=0.01)


def test_a_scan_beside_the_sun_is_refused():
    beside = ' '.join(f'{8.0 + 1.6 * k:g} offset azimuth={0.008 + 0.002 * (k % 3):g} '
                      f'elevation={0.002 * (k // 3) - 0.007:g};'
                      for k in range(9))
    record = recorded(f'acu.commands={beside.rstrip(";")}', 'scenario.duration=24.0')
    with pytest.raises(CalibrationError, match='holds no autotrack; scan at 8.0 s: the highest level is not inside'):
        collect.every_point(record)


def test_a_scan_ends_before_a_pause_and_keeps_its_last_dwell():
    """Two scans of five points, with a pause of 104 s between them."""
    places = [(0.0, 0.0), (0.002, 0.0), (-0.002, 0.0), (0.0, 0.002), (0.0, -0.002)]
    commands = [f'{begins + 2.0 * k:g} offset azimuth={x:g} elevation={y:g}'
                for begins in (10.0, 122.0) for k, (x, y) in enumerate(places)]
    record = recorded(f'acu.commands={"; ".join(commands)}', 'scenario.duration=136.0')
    t = record.table('joint_states')['t']
    found = scan.scans(record, t, recordings.modes(record, t))
    assert [[(dwell.azimuth, dwell.elevation) for dwell in one] for one in found] == [places, places]
    assert [t[one[-1].last] - t[one[-1].first] for one in found] == pytest.approx([2.0, 2.0], abs=0.02)
