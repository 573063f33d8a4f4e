import pytest

from pedestal_common import parameters
from ship_motion_sim.ins_unit import Ins
from ship_motion_sim.params import InsParameters, ShipMotionParameters


@pytest.mark.parametrize('values, message', [
    ({'ship.sea_state': 2}, 'sea_state = 2'),
    ({'ship.sea_state': 7}, 'sea_state = 7'),
    ({'ship.significant_height': 3.0}, 'significant_height = 3: must be 0 unless sea_state = 0'),
    ({'ship.sea_state': 0, 'ship.significant_height': 3.0}, 'peak_period = 0'),
    ({'ship.heading_deg': -1.0}, 'heading_deg = -1'),
    ({'ship.spectrum': 'file'}, "^ship.spectrum_file = ''"),
    ({'ship.motion': 'recorded'}, "^ship.recorded.path = ''"),
    ({'ship.hull.lenght': 100.0}, "did you mean 'ship.hull.length'"),
    ({'ship.speed': float('nan')}, 'speed = nan'),
])
@pytest.mark.parametrize('cls', [ShipMotionParameters, InsParameters])
def test_bad_values_are_named(cls, values, message):
    with pytest.raises(parameters.ParameterError, match=message):
        parameters.build(cls, values)


@pytest.mark.parametrize('values, message', [
    ({'method': 'oba'}, "method = 'oba': must be one of model, riccati_eso"),
    ({'alignment.step': 2.0}, 'alignment.step = 2 s: must be 0.001 to 1'),
    ({'ship.latitude_deg': 90.0}, 'ship.latitude_deg = 90 deg: must be -89 to 89'),
])
def test_bad_values_of_the_ins_are_named(values, message):
    with pytest.raises(parameters.ParameterError, match=message):
        parameters.build(InsParameters, values)


@pytest.mark.parametrize('values, least', [
    ({'ship.latitude_deg': 89.0}, '0.0381'), ({'ship.latitude_deg': -85.0}, ''),
    ({'alignment.gyro_bias': 1e-6}, '0.0201')])
def test_an_alignment_that_could_never_end_is_named(values, least):
    with pytest.raises(parameters.ParameterError, match=f'aligned_sigma = 0.0035 rad: must be above {least}'):
        Ins(parameters.build(InsParameters, {'method': 'riccati_eso', **values}), ())


def test_plain_motion_needs_no_sea():
    assert parameters.build(ShipMotionParameters, {'ship.motion': 'plain', 'ship.sea_state': 0}).ship.motion == 'plain'
