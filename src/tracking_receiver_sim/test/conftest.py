"""A receiver with a beam to point, for the tests of its laws."""
import numpy as np
import pytest

from pedestal_common.geometry.line_of_sight import ashore_matrix
from pedestal_common.parameters import build
from tracking_receiver_sim import receiver, target
from tracking_receiver_sim.params import TrackingReceiverParameters

PERIOD = 0.005


class Bench:
    """A receiver with a beam to point; `run` takes steps and gives the outputs as an array."""

    def __init__(self, values, period=PERIOD, duration=1000.0):
        self.params = build(TrackingReceiverParameters, values)
        self.target = target.build(self.params.target, duration)
        self.constants = receiver.constants(self.params, period, self.target)
        self.state = receiver.initial_state()
        self.inputs = receiver.Inputs.zeros()
        self.inputs['mat_ed'], self.inputs['valid'], self.inputs['stamp_ns'] = ashore_matrix(), 1, -1
        self.period_ns, self.next_ns = round(period * 1e9), 0
        self.point(0.3, 0.6)

    def point(self, azimuth, elevation):
        self.inputs['azimuth'], self.inputs['elevation'] = azimuth, elevation

    def run(self, steps=1, rng=None, stamps=None):
        stamps = self.next_ns + self.period_ns * np.arange(steps) if stamps is None else stamps
        count = receiver.normals_per_step(self.params)
        outputs, out = receiver.Outputs.zeros(), np.zeros(len(stamps), receiver.Outputs.dtype)
        for k, stamp in enumerate(stamps):
            self.inputs['stamp_ns'] = stamp
            normals = np.zeros(count) if rng is None else rng.standard_normal(count)
            receiver.step(self.state[0], self.constants[0], self.inputs[0], outputs[0], self.target.breaks,
                          self.target.coefficients, normals)
            out[k] = outputs[0]
        self.next_ns = int(stamps[-1]) + self.period_ns
        return out


@pytest.fixture(name='Bench')
def bench():
    return Bench
