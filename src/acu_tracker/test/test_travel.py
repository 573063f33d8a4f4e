"""Limits of the travel and the floor of the elevation, in every mode and with every controller."""
import math

import numpy as np
import pytest

from acu_tracker.alarms import machine, table
from acu_tracker.modes import REASONS, Mode
from acu_tracker.params import AcuParameters
from acu_tracker.servo import travel
from acu_tracker.servo.travel import Ends
from pedestal_common.parameters import ParameterError, build

MECHANICAL = ('pid', 'feedforward', 'adrc')
HILL = '0.5 -0.05; 0.8 0.4; 1.0 0.4; 1.3 -0.05'
"""A floor with a hill of 0.4 rad between azimuth 0.5 and 1.3."""


@pytest.mark.parametrize(('v', 'a', 't'), ((2.45, 20.0, 0.01), (0.1, 20.0, 0.0), (1.5, 3.0, 0.3)))
def test_the_stopping_rate_is_the_one_whose_braking_distance_is_left(v, a, t):
    d = travel.braking_distance(v, a, t)
    assert travel.stopping_rate(d, a, t) == pytest.approx(v, rel=1e-12)
    assert travel.stopping_rate(0.0, a, t) == travel.stopping_rate(-1.0, a, t) == 0.0


def test_behind_an_end_a_command_only_leads_back():
    span = Ends(-1.0, 1.0)
    assert travel.inside(0.5, 1.1, span, 20.0, 0.01) == 0.0 and travel.inside(-0.5, 1.1, span, 20.0, 0.01) == -0.5
    assert travel.inside(-0.5, -1.1, span, 20.0, 0.01) == 0.0 and travel.inside(0.5, -1.1, span, 20.0, 0.01) == 0.5
    assert travel.inside(0.5, 0.0, span, 20.0, 0.01) == 0.5


@pytest.mark.parametrize(('y', 'dy', 'expected'), ((0.0, 0.5, 2.0), (0.0, -0.25, 4.0), (0.5, 0.0, math.inf),
                                                   (1.5, -0.1, 0.0), (-1.5, 0.0, 0.0)))
def test_time_to_an_end(y, dy, expected):
    assert travel.time_to(y, dy, Ends(-1.0, 1.0)) == expected


@pytest.mark.parametrize('controller', MECHANICAL)
@pytest.mark.parametrize('delay', (0.0, 0.05))
def test_no_preset_beyond_the_limit_is_reached_whatever_the_controller(Rig, controller, delay):
    """A target that is set behind the limit while the axis is on its way: it stops in front of it."""
    rig = Rig(initial_mode='preset', delay=delay, at=(0.0, 0.5), **{
        'azimuth.controller': controller, 'azimuth.limits.high': 1.0, 'azimuth.preset': 0.99, 'elevation.preset': 0.5})
    rig.run(0.2)
    rig.state['guidance']['preset']['angle'][0, 0] = 5.0
    reached = []
    for _ in range(1000):
        rig.step()
        reached.append(rig.angle[0])
    assert rig.mode == 'preset' and 0.98 < reached[-1] and max(reached) < 1.0 + 2e-3
    assert rig.outputs['angle_limited'][0, 0]
    alarm = rig.state['supervision'][0]['alarms']['alarm'][table.ALARM_INDEX['azimuth at limit']]
    assert alarm['state'] == machine.State.UNACKNOWLEDGED


def test_an_axis_outside_its_limits_drives_back(Rig):
    rig = Rig(initial_mode='preset', at=(1.2, 0.5), **{'azimuth.limits.high': 1.0, 'azimuth.preset': 0.9,
                                                       'elevation.preset': 0.5})
    rig.run(0.05)
    rig.run(3.0)
    assert rig.angle[0] == pytest.approx(0.9, abs=1e-3)


def test_the_time_to_the_next_limit_is_told(Rig):
    rig = Rig(initial_mode='preset', at=(0.0, 0.5), **{'azimuth.shaper.rate': 0.1, 'azimuth.limits.high': 1.0,
                                                       'azimuth.preset': 0.9, 'elevation.preset': 0.5})
    rig.run(2.0)
    assert rig.outputs['time_to_limit'][0, 0] == pytest.approx((1.0 - rig.angle[0]) / 0.1, rel=0.02)
    rig.run(10.0)
    assert rig.outputs['time_to_limit'][0, 0] > 100.0


def heights(rig, steps):
    """How far the elevation is above the floor in each step [rad]."""
    above = []
    for _ in range(steps):
        rig.step()
        above.append(rig.angle[1] - travel.floor_at(rig.params.floor, rig.angle[0]))
    return np.array(above)


@pytest.mark.parametrize('controller', MECHANICAL)
@pytest.mark.parametrize('way', ((0.0, 2.0), (2.0, 0.0)))
def test_the_elevation_rises_over_a_hill_before_the_azimuth_goes_there(Rig, controller, way):
    rig = Rig(initial_mode='preset', at=(way[0], 0.05), floor=HILL, **{
        'azimuth.controller': controller, 'elevation.controller': controller, 'azimuth.preset': way[1],
        'elevation.preset': 0.05})
    above = heights(rig, 1600)
    assert above.min() > -1e-3
    np.testing.assert_allclose(rig.angle, (way[1], 0.05), atol=2e-3)        # and comes down behind it


def test_a_jog_does_not_go_into_the_hill(Rig):
    rig = Rig(initial_mode='stop', at=(0.0, 0.05), floor=HILL)
    rig.run(0.1)
    rig.state['guidance']['manual']['requested'], rig.state['guidance']['manual']['until'] = (1.5, -1.0), math.inf
    assert rig.ask(Mode.RATE)
    assert heights(rig, 400).min() > -1e-3
    assert rig.angle[0] > 1.3


def test_a_place_below_the_floor_is_refused(Rig):
    rig = Rig(at=(0.0, 0.5), floor=HILL)
    rig.run(0.1)
    rig.state['guidance']['preset']['angle'] = 0.9, 0.3
    assert not rig.ask(Mode.PRESET) and rig.reason == 'outside limits' and 'outside limits' in REASONS
    rig.state['guidance']['preset']['angle'] = 0.9, 0.45
    assert rig.ask(Mode.PRESET)


def test_the_floor_is_the_higher_end_of_a_cell_and_goes_round():
    cells = travel.floor_table(HILL)[0]
    for A in np.linspace(-7.0, 7.0, 1001):
        assert travel.highest(cells, A, A) >= travel.floor_at(HILL, A) - 1e-12
        assert travel.highest(cells, A, A) <= travel.floor_at(HILL, A) + 1.6 * travel.CELL_WIDTH_RAD
    assert travel.highest(cells, 0.0, 0.9) == travel.highest(cells, 2.0 * math.pi, 2.0 * math.pi + 0.9) == 0.4
    assert not travel.floor_table('')[0]['given']


@pytest.mark.parametrize(('values', 'said'), (
    ({'azimuth.limits.low': -0.1, 'azimuth.limits.high': 0.1}, 'azimuth.limits.braking = 20 rad/s2'),
    ({'elevation.limits.braking': 0.5}, 'elevation.limits.braking = 0.5 rad/s2: from shaper.rate = 1.4'),
    ({'floor': '0 0.6; 3 0.6'}, 'elevation.preset = 0.5 rad: is below the floor, 0.6 rad at azimuth.preset = 0 rad'),
    ({'floor': '0 0.1; 0 0.2'}, 'azimuths must increase'), ({'floor': '0 0.1 3'}, 'must be azimuth elevation'),
    ({'floor': '0 north'}, 'must be azimuth elevation'), ({'floor': '0 2'}, 'elevations must be -1.5708 to 1.57'),
    ({'floor': '; '.join(f'{0.01 * i} 0' for i in range(65))}, '65 points; must be at most 64')))
def test_parameters_are_checked(values, said):
    with pytest.raises(ParameterError) as error:
        build(AcuParameters, values)
    assert said in str(error.value)


def test_an_azimuth_beyond_every_travel_has_a_cell():
    """The floor between here and an infinite stop is the highest of the turn; the search for it ends."""
    table = travel.floor_table(HILL)[0]
    assert travel.highest(table, 0.0, math.inf) == travel.highest(table, -math.inf, 0.0) == 0.4
