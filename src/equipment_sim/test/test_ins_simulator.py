"""The simulated INS: its sentences give the attitude of the ship back, by UDP and on a pseudo terminal."""
import math
import os

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from equipment_sim import ins as simulator
from pedestal_common.parameters import build
from pedestal_hardware.ins.params import InsInputParameters
from pedestal_hardware.ins.unit import InsInputUnit
from ship_motion_sim import motion
from ship_motion_sim.params import ShipParameters

NOON, STEP = (20_000 * 86_400 + 43_200) * 1_000_000_000, 50_000_000


@pytest.fixture(scope='module')
def truths():
    """Truths of a ship at 20 Hz, for 15 s."""
    [constants], found = motion.constants(build(ShipParameters, {'heading_deg': 60.0})), []
    for k in range(300):
        found.append(np.zeros(1, motion.Truth.dtype)[0])
        motion.truth(constants, 0.05 * k, found[-1])
    return found


@pytest.mark.parametrize('kind', ['pashr', 'prdid'])
def test_a_unit_receives_the_attitude_of_the_ship(kind, truths):
    """Its rate of turn agrees with its heading."""
    unit, sample = InsInputUnit(build(InsInputParameters, {'nmea.sentence': kind})), None
    for k, truth in enumerate(truths):
        for line in simulator.sentences(kind, truth, NOON + k * STEP).splitlines():
            sample = unit.take_line(line, NOON + k * STEP) or sample
    error = (Rotation.from_quat(sample.q) * Rotation.from_quat(truths[-1]['quaternion']).inv()).magnitude()
    assert math.degrees(error) < 1e-3 and unit.published > 250
    assert np.degrees(sample.w - truths[-1]['angular_velocity']) == pytest.approx(np.zeros(3), abs=0.1)


def test_the_heading_alone(truths):
    unit = InsInputUnit(build(InsInputParameters, {'nmea.sentence': 'hdt'}))
    for line in simulator.sentences('hdt', truths[0], NOON).splitlines():
        unit.take_line(line, NOON)
    x, y, z, w = unit.record['outputs'][0]['q']
    assert (x, y) == pytest.approx((0.0, 0.0)) and math.atan2(2 * w * z, 1 - 2 * z * z) == pytest.approx(
        truths[0]['yaw'], abs=1e-5)


def test_the_rate_of_the_yaw_angle(truths):
    for before, now, after in zip(truths, truths[1:], truths[2:]):
        difference = (after['yaw'] - before['yaw']) / 0.1
        assert simulator.yaw_rate(now) == pytest.approx(difference, abs=1e-4)


def test_a_terminal_without_a_reader_loses_lines():
    sink = simulator.SerialSink()
    for _ in range(100):
        sink.send(b'x' * 1000)
    end = os.open(sink.name, os.O_RDONLY | os.O_NONBLOCK)
    assert os.read(end, 10) == b'x' * 10
    os.close(end)
