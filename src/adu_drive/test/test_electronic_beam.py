"""The electronically steered beam against a look-up in the list of all commands."""
import math

import numpy as np
import pytest

from adu_drive.array import electronic_beam
from adu_drive.array.params import BEAM_RING_SIZE
from pedestal_common.parameters import ParameterError

MS = 1_000_000


class Beam:
    """A beam stepped every `period` [s] from Python."""

    def __init__(self, period=1e-3, delay=0.0, timeout=0.05):
        self.period_ns, self.k = round(period * 1e9), 0
        self.constants = electronic_beam.constants(period, delay, timeout)
        self.state = electronic_beam.initial_state(0.1, 0.2)
        (self.inputs, self.outputs) = (electronic_beam.Inputs.zeros(),
                                       electronic_beam.Outputs.zeros())
        electronic_beam.read(self.state[0], self.outputs[0])

    def step(self, command=None, stamp_ns=None):
        u, t = self.inputs, self.k * self.period_ns
        u['stamp_ns'], u['due'] = t, command is not None
        if command is not None:
            u['position'], u['command_stamp_ns'] = command, t if stamp_ns is None else stamp_ns
        electronic_beam.step(self.state[0], self.constants[0], u[0], self.outputs[0])
        self.k += 1
        return self.outputs[0]


@pytest.mark.parametrize('delay', [0.0, 1e-3, 2.4e-3, 0.02, 0.511 - 1e-3])
def test_beam_in_force_is_the_newest_command_whose_delay_is_over(delay):
    """Commands at random steps, with stamps of this step or up to two before it."""
    rng, beam, given = np.random.default_rng(2), Beam(delay=delay), []
    for k in range(1500):
        stamp = (k - int(rng.integers(0, 3))) * MS
        wanted = rng.uniform(-3.0, 3.0, 2) if rng.random() < 0.6 else None
        o = beam.step(wanted, stamp)
        if wanted is not None:
            fresh = not given or stamp > given[-1][0]
            assert o['invalid_command'] == (not fresh)
            if fresh:
                given.append((stamp, k, wanted))
        there = [(max(-(-(s + round(delay * 1e9)) // MS), came), w) for s, came, w in given]
        there = [w for since, w in there if since <= k]
        assert o['position'].tolist() == list(there[-1] if there else [0.1, 0.2])


def test_without_delay_a_command_is_in_force_in_the_interval_that_follows_its_stamp():
    beam = Beam()
    assert beam.outputs['position'][0].tolist() == [0.1, 0.2]
    o = beam.step((0.5, 0.6))
    assert o['position'].tolist() == [0.5, 0.6]


@pytest.mark.parametrize('command', [(math.nan, 0.1), (0.1, math.inf), (1e9, 0.0)])
def test_what_is_no_angle_leaves_the_beam_where_it_is_and_is_named(command):
    beam = Beam()
    beam.step((0.5, 0.6))
    o = beam.step(command)
    assert o['invalid_command'] == 1 and o['position'].tolist() == [0.5, 0.6]
    o = beam.step((0.7, 0.6))
    assert o['invalid_command'] == 0 and o['position'].tolist() == [0.7, 0.6]


def test_silence_is_named_after_the_timeout_and_the_beam_stays():
    beam = Beam(timeout=0.005)
    assert beam.step()['stale'] == 1
    beam.step((0.5, 0.6))
    stale = [int(beam.step()['stale']) for _ in range(8)]
    assert stale == [0] * 5 + [1] * 3
    assert beam.outputs['position'][0].tolist() == [0.5, 0.6]
    assert beam.step((0.7, 0.6))['stale'] == 0


def test_delay_that_does_not_fit_the_ring_is_refused():
    with pytest.raises(ParameterError,
                       match=f'transport_delay = 0.6 s: must be below {BEAM_RING_SIZE - 1} periods of 0.001 s'):
        electronic_beam.constants(1e-3, 0.6, 1.0)
