"""The whole unit on an ideal axis: the rate command is obeyed exactly, `delay` late."""
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from acu_tracker import control_unit, modes, signals
from acu_tracker.modes import REASONS
from acu_tracker.params import AcuParameters
from acu_tracker.program.program_track import NO_TRACK, ProgramTrack, Tables
from acu_tracker.signals import INVALID_INPUTS
from acu_tracker.unit import Acu
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight, pointing_model
from pedestal_common.graph import nodes
from pedestal_common.graph.modes import MODES
from pedestal_common.parameters import as_dict, build
from pedestal_common.wire.commands import Command

ASHORE = Rotation.from_quat(line_of_sight.ASHORE_ATTITUDE)


class Rig:
    """The unit with an ideal axis, receiver and INS around it. `target(t)` gives earth azimuth, elevation."""

    T = 0.005
    QUICK = {'tracker.lock_count': 20}
    LIVELY = {f'{axis}.filter.{key}': value for axis in ('azimuth', 'elevation')
              for key, value in (('kind', 'ca'), ('ca.noise', 0.3))}
    """A filter without lag: in its frame, constant acceleration of an azimuth is none."""

    @staticmethod
    def level(t):
        return ASHORE

    @staticmethod
    def rolling(t):
        """10 deg roll in 8 s, 5 deg pitch in 7 s, some yaw; bow about north-east."""
        return Rotation.from_euler('ZYX', [0.8 + 0.03 * math.sin(0.5 * t), 0.087 * math.sin(2 * math.pi * t / 7 + 1),
                                           0.1745 * math.sin(2 * math.pi * t / 8)])

    @staticmethod
    def body_rate(attitude, t, h=1e-4):
        return (attitude(t - h).inv() * attitude(t + h)).as_rotvec() / (2 * h)

    @staticmethod
    def moving(t):
        """A target that accelerates: earth azimuth, elevation."""
        return 0.5 + 0.05 * t + 0.002 * t * t, 0.6 + 0.02 * t

    def __init__(self, target=lambda t: (0.5, 0.6), at=(0.4, 0.5), attitude=None, stabilised=False, delay=0.0,
                 error_latency=0.0, sigma=0.0, **parameters):
        params = build(AcuParameters, {'command_delay': delay, 'receiver_latency': error_latency, **parameters})
        self.params, self.target, self.attitude = params, target, attitude or self.level
        self.delay, self.latency = delay, error_latency
        self.constants, self.state = control_unit.constants(params), control_unit.initial_state(params)
        self.inputs, self.outputs = signals.Inputs.zeros(), signals.Outputs.zeros()
        self.track = NO_TRACK
        self.angle, self.velocity = np.array(at, float), np.zeros(2)
        self.commands, self.passed, self.k = [(0.0, 0.0)] * (round(delay / self.T) + 1), [], 0
        self.receiver_on, self.sigma, self.rng = True, sigma, np.random.default_rng(7)
        self.inputs['encoder_valid'] = self.inputs['drive_ready'] = 1
        self.inputs['stabilised'] = stabilised

    def put(self, **parameters):
        """Change live parameters."""
        self.params = build(AcuParameters, {**as_dict(self.params), **parameters})
        self.constants = control_unit.constants(self.params)

    def deck(self, t):
        """The target's deck angles near the encoder."""
        A, E = self.target(t)
        x, y, z = self.attitude(t).inv().apply([math.cos(E) * math.sin(A), math.cos(E) * math.cos(A), math.sin(E)])
        return np.array([math.atan2(-y, x), math.asin(z)])

    def error(self, t, angle):
        return line_of_sight.offsets(*angle, *line_of_sight.direction(*self.deck(t)))

    def step(self, **changes):
        u, t = self.inputs, self.k * self.T
        u['stamp'], u['position'], u['velocity'] = t, self.angle, self.velocity
        u['encoder_valid'], u['cn0_dbhz'] = 1, 70.0
        self.passed.append((t, *self.error(t, self.angle)))
        late = 1 + round(self.latency / self.T)
        u['error_valid'] = self.receiver_on and late <= len(self.passed)
        u['error_stamp'], dx, de = self.passed[-min(late, len(self.passed))]
        u['cross_elevation'], u['elevation'] = np.array([dx, de]) + self.sigma * self.rng.standard_normal(2)
        u['attitude_stamp'], u['attitude_valid'] = t, 1
        u['quaternion'], u['deck_rate'] = self.attitude(t).as_quat(), self.body_rate(self.attitude, t)
        for name, value in changes.items():
            u[name] = value
        control_unit.step(self.state[0], self.constants[0], u[0], self.outputs[0], self.tables)
        self.commands.append(tuple(self.outputs['rate'][0]))
        self.velocity = np.array(self.commands[-1 - round(self.delay / self.T)])
        self.angle = self.angle + self.T * self.velocity
        self.k += 1
        return self.outputs[0]

    def ask(self, mode):
        return control_unit.request(self.state[0], self.constants[0], self.inputs[0], self.outputs[0], self.tables,
                                    mode)

    @property
    def tables(self):
        return Tables(self.track, NO_TRACK, NO_TRACK)

    def run(self, seconds, **changes):
        """Steps of this many seconds; columns: rates (2), pointing error (2)."""
        rows = []
        for _ in range(round(seconds / self.T)):
            error = self.error(self.k * self.T, self.angle)
            o = self.step(**changes)
            rows.append((*o['rate'], *error))
        return np.array(rows)

    def program(self, start=0.0, rows=100, target=None):
        times = start + np.arange(rows, dtype=float)
        self.track = ProgramTrack(times, np.array([(target or self.target)(t) for t in times]))

    @property
    def mode(self):
        return MODES[self.outputs['mode'][0]]

    @property
    def reason(self):
        return REASONS[self.outputs['reason'][0]]

    @property
    def invalid(self):
        return {name for i, name in enumerate(INVALID_INPUTS) if self.outputs['invalid_input'][0] >> i & 1}


@compiled
def _direction_of(m, A, E):
    return pointing_model.direction_of(m[0], A, E)


class Leaning(Rig):
    """A Rig on a pedestal with the errors `terms` [deg]; `model`: terms of the control unit, None: the same."""

    def __init__(self, terms, *args, model=None, **changes):
        values = {f'pointing.{name}': value for name, value in terms.items()}
        pedestal = build(AcuParameters, values).pointing.terms
        self.pedestal = pointing_model.model(dict(zip(pointing_model.TERMS, pedestal)))
        super().__init__(*args, **changes, **(values if model is None else {
            f'pointing.{name}': value for name, value in model.items()}))

    def beam(self, angle=None):
        """The direction of the beam on the sky, as deck angles."""
        return np.array(_direction_of(self.pedestal, *(self.angle if angle is None else angle)))

    def error(self, t, angle):
        """The receiver measures from the beam."""
        return super().error(t, self.beam(angle))


class Axes:
    """An Acu on ideal axes, without a target: the unit as a node runs it."""

    def __init__(self, **parameters):
        self.unit = Acu(build(AcuParameters, parameters), nodes.row('acu').reads[:2])
        self.k, self.angle, self.rate = 0, np.array([0.3, 0.6]), np.zeros(2)
        self.angles, self.rates = [], []

    def ask(self, verb, **arguments):
        return self.unit.command(Command(verb, 'test', '1', {name: str(value) for name, value in arguments.items()}))

    def run(self, seconds):
        for _ in range(round(seconds / Rig.T)):
            inputs, outputs = self.unit.inputs, self.unit.outputs
            inputs['joint_states']['stamp'] = self.k * 5_000_000
            inputs['joint_states']['position'], inputs['joint_states']['velocity'] = self.angle, self.rate
            self.unit.step(np.array([self.k * 5_000_000]), inputs, outputs)
            self.rate = outputs['acu/rate_command']['velocity'][0].copy()
            self.angle = self.angle + Rig.T * self.rate
            self.k += 1
            self.angles.append(self.angle)
            self.rates.append(self.rate)
        return self

    @property
    def mode(self):
        return modes.MODES[self.unit.parts['outputs']['mode']]


@pytest.fixture(name='Rig')
def rig():
    return Rig


@pytest.fixture(name='Leaning')
def leaning():
    return Leaning


@pytest.fixture(name='Axes')
def axes_of_the_unit():
    return Axes
