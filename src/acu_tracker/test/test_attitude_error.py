"""What an INS says of its error, and what is taken for it as long as it says nothing."""
import math

import numpy as np
import pytest

from acu_tracker.estimation.params import AttitudeModelParameters
from acu_tracker.geometry import attitude
from acu_tracker.params import AcuParameters
from acu_tracker.unit import Acu
from pedestal_common.parameters import build, record
from pedestal_common.wire import records

PARAMETERS = record(AttitudeModelParameters(tilt_noise=1e-3, heading_noise=2e-3, tilt_wander=3e-3, heading_wander=4e-3,
                                            wander_time=50.0))[0]


@pytest.fixture
def error():
    return attitude.AttitudeError.zeros()[0]


def expected(error):
    return np.ravel(attitude.expected_error(error, PARAMETERS))


def test_the_parameters_hold_until_the_ins_has_said_it(error):
    """A Gauss-Markov error of sigma and tau changes within T by 2 sigma^2 (1 - exp(-T / tau))."""
    T = 1e-4
    walk = [2.0 * sigma**2 * -math.expm1(-T / 50.0) / T for sigma in (3e-3, 4e-3)]
    assert expected(error) == pytest.approx([1e-6, 4e-6, *walk], rel=1e-5)
    assert attitude.take_statistics(error, np.array([3e-5, 4e-5, 5e-5]), np.array([0.0, 2e-4, 1e-4]))
    assert expected(error) == pytest.approx([12.5e-10, 25e-10, 2e-8, 1e-8])


@pytest.mark.parametrize('wrong', [math.nan, -1e-5, math.inf, 0.6])
@pytest.mark.parametrize('place', range(6))
def test_what_cannot_be_is_not_believed(error, place, wrong):
    said = np.full(6, 1e-4)
    attitude.take_statistics(error, said[:3], said[3:])
    before = expected(error)
    said[place] = wrong
    assert not attitude.take_statistics(error, said[:3], said[3:])
    assert (expected(error) == before).all()


@pytest.mark.parametrize('noise, refused', [(1e-4, False), (math.nan, True)])
def test_the_control_unit_names_what_it_does_not_believe(noise, refused):
    unit = Acu(build(AcuParameters, {'ins_error': True}), Acu.NODE.reads)
    for topic in ('joint_states', 'ship/imu/data', 'ins/error'):
        unit.inputs[topic]['stamp'] = 0
    unit.inputs['ship/imu/data']['orientation'][0, 3] = 1.0
    unit.inputs['ins/error']['position'] = noise
    assert unit.inputs['tracking_receiver/angle_error']['stamp'] == records.NO_STAMP
    unit.step(np.zeros(1, np.int64), unit.inputs, unit.outputs)
    assert unit.parts['state']['tracking']['attitude']['error']['published'] == (not refused)
    assert ('attitude_error' in unit.diagnose().message) == refused
