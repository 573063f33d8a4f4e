"""What a run says of its targets before it begins."""
import math
import re

import numpy as np
import pytest

from pedestal_bringup.scenario import scenario, shipped
from pedestal_bringup.scenario.program import Plan
from pedestal_bringup.scenario.sections import ScenarioError
from pedestal_common import parameters
from pedestal_common.graph import nodes
from tracking_receiver_sim import target

PLACE = 'antenna at 47.40 N 8.50 E, 500 m: the default'


def lines(name, duration, *changes):
    return Plan(scenario.load(name, changes, duration=duration)).announced()


def test_a_run_as_long_as_its_scenario_says_when_the_satellite_is_highest():
    place, line, link = lines('leo_pass', None)
    assert place == PLACE
    assert re.fullmatch(r'link: C/N0 46\.4 dB-Hz at 500 km; in this run 4\d\.\d to 4\d\.\d dB-Hz at 4\d\d to \d+ km; '
                        'lock at 39 dB-Hz', link)
    assert re.fullmatch(r'0 s is \S+ \S+ UTC; the satellite is highest in this run, 69\.\d deg, after [\d.]+ s, '
                        r'at \S+ UTC', line)


def test_a_run_that_is_longer_than_the_pass_says_when_it_rises_and_sets():
    _, _, rises, sets, _ = lines('leo_pass', 900.0)
    up, down = (float(re.search(r'after ([\d.]+) s', line)[1]) for line in (rises, sets))
    assert rises.startswith('the satellite rises') and sets.startswith('the satellite sets')
    assert 0.0 < up < 450.0 < down < 900.0
    assert up == pytest.approx(900.0 - down, abs=10.0)              # a pass is the same to both sides of its highest


@pytest.mark.parametrize(('latitude', 'longitude', 'place'), (
    (47.4, 8.5, PLACE), (-33.9, -18.4, 'antenna at 33.90 S 18.40 W, 500 m'),
    (-33.9, 341.6, 'antenna at 33.90 S 18.40 W, 500 m')))
def test_a_run_first_names_the_position_of_its_antenna(latitude, longitude, place):
    changes = [f'tracking_receiver.target.station.{name}_deg={value}'
               for name, value in (('latitude', latitude), ('longitude', longitude))]
    assert lines('uav_flyby', None, *changes) == [place]
    assert lines('phased_array_four', None, *changes)[0] == place
    other = lines('uav_flyby', None, *changes, 'acu.prediction.station.height=7')       # a control unit that errs
    assert other == [place.replace('500 m', '7 m').removesuffix(': the default')]


def test_a_target_without_a_date_says_nothing_of_a_sky():
    assert lines('uav_flyby', None) == [PLACE]


def test_a_track_that_rises_and_sets_within_the_run_says_so(tmp_path):
    path = tmp_path / 'a.csv'
    path.write_text('t,az,el\n' + ''.join(f'{k},{120 + k},{5 - abs(k - 10)}\n' for k in range(21)))
    _, summary, highest, rises, sets, _ = Plan(scenario.load('track_file', [
        f'tracking_receiver.target.track_file.path={path}'])).announced()
    assert 'highest 5.0 deg after 10 s' in highest and summary.startswith('a.csv')
    assert rises.startswith('the target rises after 5.') and sets.startswith('the target sets after 15.0')
    masked = Plan(scenario.load('track_file', [f'tracking_receiver.target.track_file.path={path}',
                                               'tracking_receiver.receiver.horizon_mask=0.04'])).announced()
    assert any(line.startswith('the target rises above the horizon mask of 2.29 deg after 7.') for line in masked)
    assert any(line.startswith('the target sets below the horizon mask of 2.29 deg after 12.') for line in masked)
    never = Plan(scenario.load('track_file', [f'tracking_receiver.target.track_file.path={path}',
                                              'tracking_receiver.receiver.horizon_mask=0.2'])).announced()
    assert ('the target never rises above the horizon mask of 11.5 deg, highest 5.0 deg: nothing can be '
            'tracked') in never


@pytest.mark.parametrize('before, said', [(0.8, False), (1.9, False), (2.5, True)])
def test_a_rise_is_stated_only_if_it_takes_time_from_the_run(before, said, tmp_path):
    path = tmp_path / 'a.csv'
    path.write_text('t,az,el\n' + ''.join(f'{k},{120 + k},{k - before}\n' for k in range(21)))
    found = Plan(scenario.load('track_file', [f'tracking_receiver.target.track_file.path={path}'])).announced()
    assert any('rises' in line for line in found) == said


def test_a_run_that_is_longer_than_a_track_states_its_end(tmp_path):
    path = tmp_path / 'a.csv'
    path.write_text('t,az,el\n' + ''.join(f'{k},{120 + k},{20 + k}\n' for k in range(21)))
    changes = [f'tracking_receiver.target.track_file.path={path}']
    *_, ends, _ = Plan(scenario.load('track_file', changes, duration=30.0)).announced()
    assert ends == 'the track of the target ends after 20.0 s: nothing can be tracked after'
    assert not any('ends' in line for line in Plan(scenario.load('track_file', changes)).announced())


@pytest.mark.parametrize(('given', 'held', 'line'), (
    (('acu.azimuth.limits.high=6.2832',), {'azimuth.limits.high': 1.5 * math.pi},
     'acu.azimuth.limits.high = 6.2832 rad is wider than the travel of the drive: adu.azimuth.limits.upper = 4.71239 '
     'rad (270.0 deg) holds'),
    (('adu.azimuth.limits.lower=-2',), {'azimuth.limits.low': -2.0},
     'acu.azimuth.limits.low = -4.71239 rad is wider than the travel of the drive: adu.azimuth.limits.lower = -2 rad '
     '(-114.6 deg) holds'),
    (('acu.elevation.limits.low=-0.2',), {'elevation.limits.low': math.radians(-2.0)},
     'acu.elevation.limits.low = -0.2 rad is wider than the travel of the drive: adu.elevation.limits.lower = '
     '-0.0349066 rad (-2.0 deg) holds'),
    (('acu.azimuth.limits.high=4',), {'azimuth.limits.high': 4.0}, ''),
    (('acu.azimuth.limits.high=6.3', 'adu.azimuth.limits.upper=6.4'), {'azimuth.limits.high': 6.3}, '')))
def test_the_narrower_limit_of_control_unit_and_drive_holds(given, held, line):
    chosen = scenario.load('uav_flyby', given)
    assert held.items() <= parameters.as_dict(chosen.node_parameters('acu')).items()
    assert Plan(chosen).announced() == [PLACE, *filter(None, (line,))]
    assert Plan(scenario.parse('uav_flyby', chosen.as_yaml())).announced() == [PLACE]


def test_the_default_limits_of_the_control_unit_are_those_of_the_drive():
    acu, drive = (parameters.defaults(nodes.row(node).parameters_type()) for node in ('acu', 'adu'))
    for axis in ('azimuth', 'elevation'):
        for own, of_drive in (('low', 'lower'), ('high', 'upper')):
            assert acu[f'{axis}.limits.{own}'] == drive[f'{axis}.limits.{of_drive}']


def test_every_scenario_keeps_its_limits():
    assert [name for name in shipped.available() if scenario.load(name).notes] == []


def test_a_stow_angle_that_the_drive_does_not_reach_is_refused_with_both_limits():
    with pytest.raises(ScenarioError) as error:
        scenario.load('uav_flyby', ['adu.elevation.limits.upper=1.5'])
    assert 'elevation.stow = 1.5708 rad: must be limits.low to limits.high' in str(error.value)
    assert 'adu.elevation.limits.upper = 1.5 rad (85.9 deg) holds' in str(error.value)


def test_a_program_with_light_time_leads_to_where_the_wave_left():
    """The direction of a table with light time is that of the table without it, earlier by range / speed of light."""
    def table(light_time):
        plan = Plan(scenario.load('leo_pass', [f'scenario.program.light_time={light_time}'], duration=20.0))
        return plan.targets[''], *plan.tables['']
    built, times, plain = table('false')
    _, _, seen = table('true')
    delay = scenario.load('leo_pass').header.program.time_offset
    *_, distance = target.look_angles(built, times - delay)
    azimuth, elevation, _ = target.look_angles(built, times - delay - distance / 299792458.0)
    inside = times - delay > 1.0
    assert seen[inside, 1] == pytest.approx(elevation[inside], abs=1e-12)
    assert np.abs(seen - plain)[inside].max() > 1e-6


GEO = [f'tracking_receiver.target.leo_pass.{key}={value}' for key, value in scenario.load('geo_station').given(
    'tracking_receiver').items() for key in key.split('target.leo_pass.')[1:]]


def test_the_link_of_a_run_follows_the_range():
    """A geostationary satellite from the ship of ship_pass; an EIRP gives its C/N0 by the link budget."""
    *_, link = lines('ship_pass', 4.0, *GEO)
    assert link == ('link: C/N0 46.4 dB-Hz at 500 km; in this run 8.7 dB-Hz at 38195 km; lock at 39 dB-Hz: the '
                    'receiver cannot lock; state the target by scenario.link.eirp, or by '
                    'tracking_receiver.receiver.cn0_dbhz at reference_range')
    *_, replaced, _, link = lines('ship_pass', 4.0, *GEO, 'scenario.link.eirp=8', 'scenario.link.g_over_t=20',
                                  'scenario.dish.frequency=2.3', 'tracking_receiver.receiver.cn0_dbhz=40')
    loss = 20.0 * math.log10(4.0 * math.pi * 38.194e6 / (0.299792458 / 2.3))
    assert float(re.search(r'this run ([\d.]+) dB-Hz', link)[1]) == pytest.approx(8.0 + 20.0 - loss + 228.6, abs=0.1)
    assert replaced.startswith('scenario.link.eirp = 8 dBW: ')
    assert replaced.endswith(' in place of tracking_receiver.receiver.cn0_dbhz = 40')


def test_the_diameter_of_the_dish_is_one_parameter():
    """Twice the diameter: half the beam, 6 dB, and the wind acts on it. What overrides it is said."""
    chosen = scenario.load('leo_pass', ('scenario.dish.diameter=6', 'adu.wind.field.speed=15'))
    known = scenario.load('leo_pass')
    receiver, before = (each.node_parameters('tracking_receiver') for each in (chosen, known))
    assert receiver.antenna.beamwidth == pytest.approx(0.5 * before.antenna.beamwidth, rel=1e-3)
    assert chosen.node_parameters('acu').tracker.receiver.beamwidth == receiver.antenna.beamwidth
    assert receiver.receiver.cn0_dbhz == pytest.approx(before.receiver.cn0_dbhz + 6.02, abs=0.01)
    assert chosen.node_parameters('adu').wind.field.diameter == 6.0 and not chosen.notes
    assert known.node_parameters('adu').wind.field.diameter == 3.0
    assert Plan(chosen).announced()[-1] == 'wind: 15 m/s on a dish of 6 m'
    assert Plan(scenario.parse('leo_pass', chosen.as_yaml())).announced() == Plan(chosen).announced()
    other = scenario.load('leo_pass', ('scenario.dish.diameter=6', 'adu.wind.field.diameter=7'))
    assert other.notes == ('adu.wind.field.diameter = 7 overrides 6 of the dish of 6 m',)
