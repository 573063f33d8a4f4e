import itertools

import pytest

from pedestal_common import parameters
from ship_motion_sim.ins_unit import Ins
from ship_motion_sim.navigation import navigator
from ship_motion_sim.params import (
    INS_METHODS,
    AdrcParameters,
    AlignmentParameters,
    InsParameters,
    ShipMotionParameters,
)


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
    ({'alignment.step': 0.1, 'alignment.adrc.control': 20.0},
     'alignment.adrc.control = 20 rad/s: must be at most 1 / step = 10 rad/s'),
    ({'alignment.step': 2.0}, 'alignment.step = 2 s: must be 0.001 to 1'),
    ({'ship.latitude_deg': 90.0}, 'ship.latitude_deg = 90 deg: must be -89 to 89'),
])
def test_bad_values_of_the_ins_are_named(values, message):
    with pytest.raises(parameters.ParameterError, match=message):
        parameters.build(InsParameters, values)


@pytest.mark.parametrize('step', [0.001, 0.02, 0.1, 1.0])
def test_what_is_allowed_is_stable(step):
    for observer, control, s0 in itertools.product((0.01, 0.3, 20.0), (0.01, 20.0), (0.005, 0.2)):
        p = AlignmentParameters(step=step, adrc=AdrcParameters(observer, min(control, 1.0 / step)),
                                classical_bandwidth=s0)
        for method in INS_METHODS[1:]:
            c = navigator.constants(p, method, 'none', 0.8)[0]
            sigmas = [float(c[name][field]) for name, field in (
                ('adrc', 'level'), ('adrc', 'velocity_variance'), ('classical', 'level_sigma'),
                ('classical', 'azimuth_sigma'))]
            assert all(0.0 < sigma < 10.0 for sigma in sigmas), (p, sigmas)


@pytest.mark.parametrize('values, least', [
    ({'method': 'oba', 'ship.latitude_deg': 89.0}, '0.0381'),
    ({'method': 'classical', 'ship.latitude_deg': -85.0}, ''),
    ({'method': 'adrc', 'alignment.gyro_bias': 1e-6}, '0.0201')])
def test_an_alignment_that_could_never_end_is_named(values, least):
    with pytest.raises(parameters.ParameterError, match=f'aligned_sigma = 0.0035 rad: must be above {least}'):
        Ins(parameters.build(InsParameters, values), ())


def test_plain_motion_needs_no_sea():
    assert parameters.build(ShipMotionParameters, {'ship.motion': 'plain', 'ship.sea_state': 0}).ship.motion == 'plain'
