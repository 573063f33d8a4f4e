"""What a plan announces for a pass: the path on the pedestal against differences of the orbit, the losses against runs
of the closed loop and closed forms."""
import datetime
import math
import pathlib
from dataclasses import replace

import numpy as np
import pytest
from sgp4.io import compute_checksum

from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.sections import ScenarioError
from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_results import results
from pedestal_results.recorded_run import RecordedRun
from pedestal_station import antenna, prediction
from pedestal_station.night import Object, Window
from tracking_receiver_sim.params import LeoPassParameters

BEGIN = datetime.datetime(2026, 11, 26)
ALPS = StationParameters(47.4, 8.5, 500.0)
ISS = orbit.satellite(LeoPassParameters())
ISS_EPOCH = orbit.calendar(ISS.jdsatepoch, ISS.jdsatepochF)


class Elements:
    """Orbit by SGP4 over a station."""
    def __init__(self, satellite, station, begin):
        self.satellite, self.station, self.begin = satellite, station, orbit.julian_date(begin)

    def enu(self, times):
        return orbit.enu(self.satellite, self.station, *self.begin, times)[0]

    def elements_age(self, t):
        return t


class Path:
    """Orbit of a function of the times."""
    def __init__(self, enu):
        self.enu = enu

    def elements_age(self, t):
        return 0.0


def satellite(inclination, node, eccentricity, perigee, anomaly, motion):
    lines = ['1 90001U 00000A   26330.00000000  .00000000  00000-0  00000+0 0    1',
             f'2 90001 {inclination:8.4f} {node:8.4f} {round(1e7 * eccentricity):07d} {perigee:8.4f} {anomaly:8.4f} '
             f'{motion:11.8f}    1']
    return orbit.satellite(LeoPassParameters(*(line[:68] + str(compute_checksum(line[:68])) for line in lines)))


def of(path, begin=0.0, end=None, name='X'):
    """Return (Object, Window) of an orbit between two times."""
    times = np.linspace(begin, end, 2001)
    elevation = elevations(path, times)
    top = int(np.argmax(elevation))
    window = Window(begin, (times[top],), times[top], end, elevation[top], False)
    return Object(name, '1', pathlib.Path('x.tle'), 1, path, 1.0), window


def elevations(path, times):
    east, north, up = path.enu(times).T
    return np.arctan2(up, np.hypot(east, north))


def azimuths(path, times):
    east, north, _ = path.enu(times).T
    return np.unwrap(np.arctan2(east, north))


def base(changes=(), station=ALPS, begin=BEGIN, **more):
    return antenna.of(scenario.load('leo_pass', changes), station, begin, **more)


def overhead(t, elevation):
    """Return the StationParameters on the track of the ISS t after its epoch that see it culminate at an elevation,
    and the time of the culmination after the epoch."""
    julian, fraction = orbit.julian_date(ISS_EPOCH)
    fractions = np.array([fraction + t / 86400.0])
    _, position = ISS.sgp4_array(np.array([julian]), fractions)[:2]
    x, y, z = np.einsum('nij,nj->ni', orbit.earth_fixed(julian, fractions), np.array(position))[0]
    latitude, longitude = math.degrees(math.atan2(z, 0.9933 * math.hypot(x, y))), math.degrees(math.atan2(y, x))
    times = t + np.linspace(-40.0, 40.0, 16001)
    east = 0.0
    for step in 0.5 ** np.arange(26):       # bisection of the distance of the station from the track
        station = StationParameters(latitude, (longitude + east + step + 180.0) % 360.0 - 180.0, 500.0)
        if math.degrees(elevations(Elements(ISS, station, ISS_EPOCH), times[::40]).max()) > elevation:
            east += step
    station = StationParameters(latitude, (longitude + east + 180.0) % 360.0 - 180.0, 500.0)
    return station, times[np.argmax(elevations(Elements(ISS, station, ISS_EPOCH), times))]


def flown(t, elevation, duration, changes, name='leo_pass'):
    """Predict a pass of the ISS and run it in the closed loop. Return (Prediction, results of the run, turn [rad])."""
    station, top = overhead(t, elevation)
    start = (ISS_EPOCH + datetime.timedelta(seconds=top - 0.5 * duration)).replace(microsecond=0)
    changes = [*changes, *(f'tracking_receiver.target.station.{name}_deg={getattr(station, f"{name}_deg")}'
                           for name in ('latitude', 'longitude')),
               f'tracking_receiver.target.leo_pass.start_time={start.isoformat()}Z']
    known = antenna.of(scenario.load(name, changes), station, start)
    announced = prediction.predict(*of(Elements(ISS, station, start), 0.0, duration), known)
    run = RecordedRun(memory_recording.record(scenario.load(
        name, [*changes, f'adu.initial_azimuth={announced.azimuth[0]}',
               f'adu.initial_elevation={announced.elevation[0]}'], duration=duration)))
    return (announced, {name: value for name, (value, _) in results.measured(run.parts).items()},
            run.tracking.encoders[-1, 0] - run.tracking.encoders[0, 0])


def slow(rate_deg, agility):
    """Return the changes of a scenario for an azimuth rate, with an acceleration of agility times the rate."""
    rate = math.radians(rate_deg)
    return [f'acu.azimuth.shaper.rate={rate}', f'acu.azimuth.limits.rate={1.05 * rate}',
            f'acu.azimuth.shaper.acceleration={agility * rate}',
            f'acu.azimuth.limits.acceleration={2 * agility * rate}']


@pytest.mark.thorough
@pytest.mark.parametrize('rate, agility, t, elevation', [
    (5, 1.5, 3000.0, 84.0), (5, 5.0, 12816.0, 88.5), (5, 5.0, 24540.0, 89.5), (10, 5.0, 9110.0, 86.0),
    (20, 1.5, 21941.0, 89.9), (20, 5.0, 20108.0, 88.0)])
def test_the_announced_loss_of_a_keyhole_is_the_measured_one(rate, agility, t, elevation):
    announced, found, turn = flown(t, elevation, {5: 110.0, 10: 80.0}.get(rate, 60.0), slow(rate, agility))
    assert announced.loss == pytest.approx(found['loss_s'], rel=0.02, abs=0.1)
    assert announced.turn == pytest.approx(turn, abs=1e-3)
    assert announced.peak_rate[0] > math.radians(1.05 * rate)
    assert [loss.reason for loss in announced.losses] == ['keyhole'] * (announced.loss > 0.0)
    assert (announced.loss_db > 0.1) == (announced.loss > 0.0)


R = math.radians


@pytest.mark.thorough
def test_the_keyhole_of_a_narrow_beam():
    """The errors at the edge of the beam of 0.35 deg, at the begin of the slew, do not mislead the antenna."""
    announced, found, _ = flown(7931.0, 88.5, 90.0, [], 'leo_station_7m')
    assert announced.loss == pytest.approx(found['loss_s'], abs=0.1) and announced.loss > 10.0


@pytest.mark.thorough
@pytest.mark.parametrize('changes, elevation, reasons', [
    ([f'acu.azimuth.limits.low={R(-190)}', f'acu.azimuth.limits.high={R(190)}', 'acu.azimuth.shaper.rate=0.2'], 80.0,
     ['travel']),
    # The pass fits on no turn, but a slew against the target takes the axis to another one.
    ([f'acu.azimuth.limits.low={R(-200)}', f'acu.azimuth.limits.high={R(200)}', *slow(6, 20.0)], 87.0, ['keyhole'])])
def test_the_turn_is_the_one_that_the_control_unit_takes(changes, elevation, reasons):
    announced, found, turn = flown(6055.0, elevation, 400.0, changes)
    assert [loss.reason for loss in announced.losses] == reasons
    assert announced.loss == pytest.approx(found['loss_s'], abs=0.1) and announced.loss > 20.0
    assert announced.turn == pytest.approx(turn, abs=1e-3) and turn * announced.turn > 0.0
    if reasons == ['travel']:
        assert announced.losses[0].detail == 'no turn fits: the pass needs 173 deg, 141 are there'


@pytest.mark.every_case
@pytest.mark.parametrize('elements, station, begin, end', [
    ((51.6, 0.0, 0.001, 0.0, 0.0, 15.5), ALPS, 0.0, 600.0),
    ((55.0, 40.0, 0.001, 0.0, 0.0, 2.0056), ALPS, 10.0, 22910.0),
    ((63.4, 200.0, 0.72, 270.0, 0.0, 2.006), ALPS, 45300.0, 84230.0),
    ((7.0, 0.0, 0.73, 180.0, 0.0, 2.27), StationParameters(0.0, 10.0, 0.0), 38450.0, 74380.0),
    ((0.06, 90.0, 0.0003, 0.0, 354.1392, 1.00271), ALPS, 0.0, 86400.0)], ids=['LEO', 'MEO', 'HEO', 'GTO', 'GEO'])
def test_rates_and_turn_are_those_of_the_orbit(elements, station, begin, end):
    path = Elements(satellite(*elements), station, BEGIN)
    if end == 600.0:        # a pass of the low satellite
        search = np.arange(0.0, 86400.0, 10.0)
        top = search[np.argmax(elevations(path, search))]
        begin, end = top - 250.0, top + 250.0
    announced = prediction.predict(*of(path, begin, end), base(['acu.azimuth.limits.high=9.0'], station))
    times = np.linspace(begin, end, 40001)
    h = times[1] - times[0]
    A, E = azimuths(path, times), elevations(path, times)
    for axis, angle in enumerate((A, E)):
        rate, acceleration = np.abs(np.diff(angle)) / h, np.abs(np.diff(angle, 2)) / h**2
        assert announced.peak_rate[axis] == pytest.approx(rate.max(), rel=2e-3)
        assert announced.peak_acceleration[axis] == pytest.approx(acceleration.max(), rel=0.02, abs=1e-9)
    assert announced.turn == pytest.approx(A[-1] - A[0], abs=1e-6)
    assert announced.elevation == pytest.approx((E[0], E[-1]), abs=1e-9)
    assert (np.mod(announced.azimuth, 2 * np.pi)) == pytest.approx(np.mod([A[0], A[-1]], 2 * np.pi), abs=1e-6)
    assert announced.min_range == pytest.approx(np.linalg.norm(path.enu(times), axis=1).min(), rel=1e-4)
    assert announced.age == of(path, begin, end)[1].culmination and announced.loss == announced.loss_db == 0.0


@pytest.mark.parametrize('sweep, stow, begins', [(50.0, 0.0, -160.0), (50.0, 150.0, 200.0), (100.0, 150.0, -160.0)])
def test_the_turn_holds_the_pass_and_is_near_the_stow(sweep, stow, begins):
    """A target that rises at azimuth 200 deg and goes clockwise; the travel is 270 deg to both sides."""
    def enu(t):
        A = np.radians(200.0 + sweep * t / 300.0)
        return 1e6 * np.column_stack((np.sin(A), np.cos(A), np.full(len(t), 0.5)))
    announced = prediction.predict(*of(Path(enu), 0.0, 300.0), base([f'acu.azimuth.stow={R(stow)}']))
    assert np.degrees(announced.azimuth) == pytest.approx([begins, begins + sweep], abs=1e-3)
    assert np.degrees(announced.travel_left) == pytest.approx([270.0 - abs(begins), 270.0 - abs(begins + sweep)],
                                                              abs=1e-3)


def test_a_hidden_sector_the_sun_and_the_elevation_limit_take_each_instant_once():
    """A target that rises at 0.1 deg/s at azimuth 90 deg, from 0 to 60 deg."""
    rise = R(0.1)
    path = Path(lambda t: 1e6 * np.column_stack((np.cos(rise * t), np.zeros(len(t)), np.sin(rise * t))))
    known = of(path, 0.0, 600.0)
    hidden = prediction.predict(*known, base([f'acu.blockage={R(80)} {R(100)} {R(20)}']))
    assert [(loss.reason, loss.begin) for loss in hidden.losses] == [('blockage', 0.0)]
    assert hidden.loss == pytest.approx(200.0, abs=1e-3)
    # The beam of 1 deg stays at 40 deg, and loses the target half a degree above.
    limited = base([f'acu.elevation.limits.high={R(40)}', 'acu.elevation.stow=0.5'])
    announced = prediction.predict(*known, limited)
    half = math.degrees(0.5 * limited.acu.tracker.receiver.beamwidth)
    assert [loss.reason for loss in announced.losses] == ['limit of the elevation']
    assert announced.loss == pytest.approx(200.0 - 10.0 * half, abs=0.05) and announced.loss_db > 1.0
    both = prediction.predict(*known, base([f'acu.elevation.limits.high={R(40)}', 'acu.elevation.stow=0.5',
                                            f'acu.blockage={R(80)} {R(100)} {R(50)}']))
    assert both.loss == pytest.approx(600.0, abs=1e-3)
    assert [(loss.reason, round(loss.seconds)) for loss in both.losses] == [
        ('blockage', 500), ('limit of the elevation', 100)]


def test_the_sun_takes_a_target_within_the_avoidance_angle():
    """A target that crosses the sun at 0.02 deg/s, at noon over the alps."""
    place = base(begin=datetime.datetime(2026, 6, 21, 11, 30))

    def enu(times):
        sun = place.sun(times)
        aside = np.cross(sun, [0.0, 0.0, 1.0])
        aside /= np.linalg.norm(aside, axis=1)[:, np.newaxis]
        angle = R(0.02) * (times - 300.0)[:, np.newaxis]
        return 4e7 * (np.cos(angle) * sun + np.sin(angle) * aside)
    known = of(Path(enu), 0.0, 600.0)
    [loss] = prediction.predict(*known, replace(place, sun_avoidance=R(2.0))).losses
    assert (loss.reason, loss.begin, loss.end) == ('sun', pytest.approx(200.0, abs=0.1), pytest.approx(400.0, abs=0.1))
    assert place.sun_avoidance == pytest.approx(0.5 * place.acu.tracker.receiver.beamwidth + R(0.27))
    assert prediction.predict(*known, replace(place, sun_avoidance=0.0)).loss == 0.0


def test_carrier_to_noise_of_a_link_budget_and_of_the_receiver():
    path = Path(lambda t: np.outer(1e6 + 1e4 * t, (0.6, 0.0, 0.8)))      # from 1,000 to 2,000 km
    known = of(path, 0.0, 100.0)
    link = ['scenario.link.eirp=10', 'scenario.link.g_over_t=20', 'scenario.dish.frequency=8.2']
    # free-space loss at 1,000 km and 8.2 GHz: 170.72 dB
    least, largest = prediction.predict(*known, base(link, rain_margin=3.0)).cn0
    assert largest == pytest.approx(10.0 + 20.0 - 170.72 + 228.6 - 3.0, abs=0.02)
    assert largest - least == pytest.approx(20.0 * math.log10(2.0))
    least, largest = prediction.predict(*known, base(['tracking_receiver.receiver.cn0_dbhz=50'])).cn0
    assert largest == pytest.approx(50.0 - 20.0 * math.log10(2.0))     # its reference range is 500 km
    silent = base(['scenario.receiver=simulated-iq', 'scenario.pacing=realtime'])
    assert math.isnan(silent.cn0(1e6))


def test_an_instant_a_ship_refraction_and_a_pointing_model():
    """A target at rest at azimuth 90 deg; the radio refraction at an elevation of 10 deg is 0.097 deg."""
    def rest(elevation):
        return Path(lambda t: np.outer(np.full(len(t), 1e6), (math.cos(elevation), 0.0, math.sin(elevation))))
    path = rest(R(50.0))
    defaults = antenna.of(scenario.parse('defaults', antenna.NO_SCENARIO), ALPS, BEGIN)
    announced = prediction.predict(*of(path, 5.0, 5.0), defaults)
    assert announced.peak_rate == (0.0, 0.0) and math.degrees(announced.azimuth[0]) == pytest.approx(90.0)
    bent = prediction.predict(*of(rest(R(10.0)), 0.0, 9.0), base(['acu.refraction.kind=radio', 'acu.pointing.p1=2']))
    assert np.degrees((bent.azimuth[0], bent.elevation[0])) == pytest.approx([92.0, 10.0970], abs=1e-4)
    ship = antenna.of(scenario.load('ship_pass', ['ship_motion.ship.heading_deg=30']), ALPS, BEGIN)
    assert math.degrees(prediction.predict(*of(path, 0.0, 9.0), ship).azimuth[0]) == pytest.approx(60.0)


def test_an_array_is_refused():
    with pytest.raises(ScenarioError, match='scenario.beam = true: must be false, because a plan needs a pedestal'):
        antenna.of(scenario.load('phased_array_sway'), ALPS, BEGIN)
