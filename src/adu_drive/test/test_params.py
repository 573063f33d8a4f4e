import math

import pytest

from adu_drive import drive_unit
from adu_drive.array.params import BeamParameters
from drive_law.axis_params import (
    PLANT_PERIOD_S,
    AxisParameters,
    BiasParameters,
    EncoderParameters,
    FrictionParameters,
    LimitParameters,
    MotorParameters,
)
from drive_law.params import AduParameters
from pedestal_common.parameters import ParameterError, build


def test_table_1_of_paper_000():
    p = AduParameters().azimuth
    assert 2.0 * p.motor_1.resistance == pytest.approx(1.736) and 2.0 * p.motor_2.resistance == pytest.approx(1.731)
    assert 2e3 * p.motor_1.inductance == pytest.approx(20.199) and 2e3 * p.motor_2.inductance == pytest.approx(20.149)
    K_t = drive_unit.constants(AduParameters())[0]['azimuth']['motor_1']['K_t']
    assert K_t * math.sqrt(2.0) * 8.4 == pytest.approx(30.0, rel=0.01)     # rated torque at 8.4 A rms
    assert 30.0 * 1500.0 * math.pi / 30.0 == pytest.approx(4.7e3, rel=0.01)


@pytest.mark.parametrize('make, words', [
    (lambda: AduParameters(period=0.0052), 'period = 0.0052'),
    (lambda: AduParameters(period=0.05), '0.001 to 0.02'),
    (lambda: AduParameters(transport_delay=0.0007), 'transport_delay = 0.0007'),
    (lambda: AduParameters(initial_elevation=2.0), 'initial_elevation = 2'),
    (lambda: BiasParameters(hold=50.0), 'out = 45'),
    (lambda: LimitParameters(lower=1.0, upper=1.0), 'upper = 1'),
    (lambda: FrictionParameters(breakaway=50.0), 'breakaway = 50'),
    (lambda: AxisParameters(motor_1=MotorParameters(voltage=200.0)), 'limits.rate = 2.45'),
    (lambda: build(AduParameters, {'azimuth.gear_train.stiffness': 1e11}), 'gear_train.stiffness = 1e+11 Nm/rad'),
    (lambda: build(AduParameters, {'azimuth.gear_train.damping': 2e6}), 'gear_train.damping = 2e+06 Nms/rad'),
    (lambda: EncoderParameters(load_bits=math.nan), 'load_bits'),
    (lambda: BeamParameters(period=0.01, transport_delay=0.021), 'transport_delay = 0.021 s: must be a multiple of'),
    (lambda: BeamParameters(period=1e-4, transport_delay=0.3), 'transport_delay = 0.3 s: must be below 511 periods'),
    (lambda: BeamParameters(period=0.01, duration=0.015), 'duration = 0.015'),
    (lambda: build(AduParameters, {'wind.gust.kind': 'davenport'}), 'gust.kind = davenport'),
    (lambda: build(AduParameters, {'azimuth.gear_train.lsh': 0.0}), "did you mean 'azimuth.gear_train.lash'"),
])
def test_bad_parameters_are_named(make, words):
    with pytest.raises(ParameterError) as error:
        make()
    assert words in str(error.value)


def test_a_mesh_is_refused_where_the_simulated_plant_becomes_unstable():
    """One motor and half of the load on a spring, 2000 steps of semi-implicit Euler on both sides of the limit."""
    with pytest.raises(ParameterError) as error:
        build(AduParameters, {'azimuth.gear_train.stiffness': 1e12})
    highest = float(str(error.value).split('at most ')[1].split()[0])
    p = AduParameters().azimuth
    M, J, c = p.motor_1.inertia * p.gear_train.ratio**2, 0.5 * p.load.inertia, p.gear_train.damping
    for k, stable in ((0.99 * highest, True), (1.01 * highest, False)):
        x, v, largest = 1e-6, 0.0, 0.0
        for _ in range(2000):
            v -= PLANT_PERIOD_S * (k * x + c * v) * (1.0 / M + 1.0 / J)
            x += PLANT_PERIOD_S * v
            largest = max(largest, abs(x))
        assert (largest < 1e-4) == stable


def test_names_reach_the_constants():
    p = build(AduParameters, {'elevation.load.inertia': 160.0, 'transport_delay': 0.01})
    c = drive_unit.constants(p)[0]
    assert c['elevation']['J'] == 160.0 and c['azimuth']['J'] == 210.0 and c['delay_ticks'] == 20
