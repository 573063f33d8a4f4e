import pytest

from pedestal_common import parameters
from ship_motion_sim.params import InsParameters, ShipMotionParameters


@pytest.mark.parametrize('values, message', [
    ({'ship.sea_state': 2}, 'sea_state = 2'),
    ({'ship.sea_state': 7}, 'sea_state = 7'),
    ({'ship.significant_height': 3.0}, 'significant_height = 3: must be 0 unless sea_state = 0'),
    ({'ship.sea_state': 0, 'ship.significant_height': 3.0}, 'peak_period = 0'),
    ({'ship.heading_deg': -1.0}, 'heading_deg = -1'),
    ({'ship.hull.lenght': 100.0}, "did you mean 'ship.hull.length'"),
    ({'ship.speed': float('nan')}, 'speed = nan'),
])
@pytest.mark.parametrize('cls', [ShipMotionParameters, InsParameters])
def test_bad_values_are_named(cls, values, message):
    with pytest.raises(parameters.ParameterError, match=message):
        parameters.build(cls, values)


def test_plain_motion_needs_no_sea():
    assert parameters.build(ShipMotionParameters, {'ship.motion': 'plain', 'ship.sea_state': 0}).ship.motion == 'plain'
