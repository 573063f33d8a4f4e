"""A beam between its messages, against a delayed and held copy of the commands; its states."""
import math

import numpy as np
import pytest

from adu_drive.array.beam_unit import CLOCK_TOPIC, DRIVE_STATE_TOPIC, JOINT_STATES_TOPIC, REFERENCE_TOPIC, Beam
from adu_drive.array.params import BeamParameters
from pedestal_common.wire import records

T = 10_000_000
P = BeamParameters(period=0.01, transport_delay=0.03, initial_azimuth=0.3, initial_elevation=0.6)


class Rig:
    """A Beam fed step by step."""

    def __init__(self, params=P):
        self.unit, self.k = Beam(params, (CLOCK_TOPIC, REFERENCE_TOPIC)), 0

    def step(self, azimuth=None, elevation=0.5, late=0):
        """The beam at t_k and adu/state; then t_k is answered with a command `late` steps old, None: with none."""
        unit, command = self.unit, self.unit.inputs[REFERENCE_TOPIC]
        unit.step(np.full(1, self.k * T), unit.inputs, unit.outputs)
        command['stamp'] = records.NO_STAMP if azimuth is None else (self.k - late) * T
        if azimuth is not None:
            command['position'] = azimuth, elevation
        self.k += 1
        return unit.outputs[0][JOINT_STATES_TOPIC]['position'].copy(), unit.encode(DRIVE_STATE_TOPIC,
                                                                                   int(unit.outputs[0][DRIVE_STATE_TOPIC]))

    @property
    def outputs(self):
        return self.unit.parts['outputs']


def test_the_beam_is_the_command_of_one_delay_and_one_step_before():
    rig, commands = Rig(), np.random.default_rng(1).uniform(-1.0, 1.0, 40)
    beams = np.array([rig.step(command)[0] for command in commands])
    assert np.array_equal(beams[:4], np.tile((0.3, 0.6), (4, 1)))
    assert np.array_equal(beams[4:, 0], commands[:-4])
    assert (beams[4:, 1] == 0.5).all()


def test_many_steps_at_once_are_the_same():
    commands = np.random.default_rng(2).uniform(-1.0, 1.0, 40)
    one, unit = Rig(), Beam(P, (CLOCK_TOPIC, REFERENCE_TOPIC))
    beams = np.array([one.step(command)[0] for command in commands])
    inputs, outputs = records.empty(unit.inputs_type(), 40), records.empty(unit.outputs_type(), 40)
    inputs[REFERENCE_TOPIC]['stamp'][1:] = np.arange(39) * T
    inputs[REFERENCE_TOPIC]['position'][1:, 0], inputs[REFERENCE_TOPIC]['position'][:, 1] = commands[:-1], 0.5
    unit.step(np.arange(40) * T, inputs, outputs)
    assert np.array_equal(outputs[JOINT_STATES_TOPIC]['position'], beams)
    assert not outputs[JOINT_STATES_TOPIC]['velocity'].any() and not outputs[JOINT_STATES_TOPIC]['effort'].any()


@pytest.mark.parametrize('wrong', [math.nan, math.inf, -1e9])
def test_no_angle_leaves_the_beam_and_says_so(wrong):
    rig = Rig()
    for _ in range(6):
        rig.step(0.1)
    rig.step(wrong)
    rig.step()
    assert rig.outputs['invalid_command']
    for _ in range(5):
        beam, state = rig.step()
        assert tuple(beam) == (0.1, 0.5) and state == 'enabled'
    assert not rig.outputs['stale']
    for _ in range(6):
        rig.step()
    assert rig.outputs['stale']
    rig.step(0.2)
    rig.step(0.2)
    assert not rig.outputs['stale']


@pytest.mark.parametrize('stop, go, text', [('adu/disable', 'adu/enable', 'disabled'),
                                            ('adu/emergency_stop', 'adu/reset_faults', 'emergency stop')])
def test_a_beam_that_is_stopped_stays_and_forgets_what_is_on_its_way(stop, go, text):
    rig = Rig()
    for k in range(10):
        rig.step(0.1 * k)
    before, _ = rig.step(9.0)
    assert rig.unit.request(stop).granted and rig.unit.condition == text
    where = {tuple(rig.step(5.0)[0]) for _ in range(10)}
    assert len(where) == 1 and where.pop()[0] == before[0]
    assert rig.unit.requests_for(DRIVE_STATE_TOPIC, 'enabled')[-1] == 'adu/enable'
    if text == 'emergency stop':
        assert not rig.unit.request('adu/enable').granted
    rig.step()
    assert rig.unit.request(go).granted
    beams = [rig.step(0.7)[0][0] for _ in range(6)]
    assert beams[-1] == 0.7 and 5.0 not in beams and 9.0 not in beams
