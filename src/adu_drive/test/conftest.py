import numpy as np
import pytest

from adu_drive import drive_unit
from drive_law.params import AduParameters

PARAMS = AduParameters(initial_elevation=0.7)


class Drive:
    """A drive stepped from Python; `log` keeps a copy of the outputs of every step."""

    def __init__(self, params=PARAMS, substeps=2):
        self.params = params
        self.constants = drive_unit.constants(params, substeps)
        self.state = drive_unit.initial_state(params)
        self.inputs = drive_unit.Inputs.zeros()
        self.outputs = drive_unit.Outputs.zeros()
        self.inputs['enable'] = 1
        self.steps = []

    def step(self, azimuth=None, elevation=None, enable=None, **axis_inputs):
        """One period; rates [rad/s] of the axes, azimuth's other inputs by name. Inputs persist."""
        if azimuth is not None:
            self.inputs['azimuth']['rate'] = azimuth
        if elevation is not None:
            self.inputs['elevation']['rate'] = elevation
        if enable is not None:
            self.inputs['enable'] = enable
        for name, value in axis_inputs.items():
            self.inputs['azimuth'][name] = value
        drive_unit.step(self.state[0], self.constants[0], self.inputs[0], self.outputs[0])
        self.steps.append(self.outputs.copy())
        return self.outputs[0]

    def run(self, seconds, **inputs):
        for _ in range(round(seconds / self.params.period)):
            self.step(**inputs)
        return self

    @property
    def log(self):
        return np.concatenate(self.steps)

    @property
    def times(self):
        return self.params.period * np.arange(1, len(self.steps) + 1)


@pytest.fixture
def drive():
    return Drive
