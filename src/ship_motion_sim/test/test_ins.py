import dataclasses
import math

import numba
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ship_motion_sim import imu, ins, motion
from ship_motion_sim.params import InsParameters, PlainParameters, ShipMotionParameters, ShipParameters

STEP = 5_000_000
PERFECT = InsParameters(tilt_wander=0.0, heading_wander=0.0, tilt_noise=0.0, heading_noise=0.0, rate_noise=0.0,
                        latency=0.0)
STILL = ShipParameters(motion='plain', plain=PlainParameters(roll_amplitude_deg=0.0), speed=0.0)


class Bench:
    """An INS with its IMU: `step(stamp)` measures, samples and steps, and gives the output record."""

    def __init__(self, params, ship=None, seed=0):
        self.params, ship = params, ship or params.ship
        self.ship = motion.constants(ship)
        self.imu = imu.constants(ShipMotionParameters(ship))
        self.constants, self.state = ins.constants(params), ins.initial_state()
        self.random = np.random.default_rng(seed)
        self.inputs, self.truth = ins.Inputs.zeros(), motion.Truth.zeros()

    def step(self, stamp, spoil=None):
        dt, raw = imu.Inputs.zeros(), imu.Outputs.zeros()
        dt['dt'] = 0.005
        motion.truth(self.ship[0], 1e-9 * stamp, self.truth[0])
        imu.step(imu.initial_state()[0], self.imu[0], self.ship[0], dt[0], self.truth[0], raw[0],
                 np.zeros(imu.IMU_NORMALS_PER_STEP))
        self.inputs['stamp_ns'] = stamp
        for field in ('angular_velocity', 'linear_acceleration'):
            self.inputs[field] = raw[field]
        if spoil:
            self.inputs[spoil][0, 1] = math.nan
        return self.run()

    def run(self):
        outputs = ins.Outputs.zeros()
        ins.step(self.state[0], self.constants[0], self.inputs[0], outputs[0],
                 self.random.standard_normal(ins.INS_NORMALS_PER_STEP))
        return outputs[0]


def euler(quaternion):
    return Rotation.from_quat(quaternion).as_euler('xyz')


def status(out):
    return ins.INS_STATUS_TEXTS[out['status']]


def test_without_errors_and_latency_it_is_the_truth():
    bench = Bench(dataclasses.replace(PERFECT, ship=ShipParameters(sea_state=6, heading_deg=200.0)))
    for k in range(200):
        out = bench.step(k * STEP)
        assert status(out) == 'ok' and out['due'] == 1 and out['stamp_ns'] == k * STEP
        np.testing.assert_array_equal(out['quaternion'], bench.truth[0]['quaternion'])
        np.testing.assert_array_equal(out['angular_velocity'], bench.truth[0]['angular_velocity'])


def test_biases_turn_roll_pitch_and_heading():
    biased = dataclasses.replace(PERFECT, roll_bias=0.01, pitch_bias=-0.02, heading_bias=0.03)
    bench = Bench(biased)
    for k in range(0, 4000, 100):
        out = bench.step(k * STEP)
        truth = euler(bench.truth[0]['quaternion'])
        np.testing.assert_allclose(euler(out['quaternion']) - truth, [0.01, -0.02, -0.03], atol=1e-12)


def test_white_noise_has_the_given_size():
    noisy = dataclasses.replace(PERFECT, tilt_noise=2e-3, heading_noise=5e-3, rate_noise=1e-3, ship=STILL)
    bench = Bench(noisy)
    outs = np.array([bench.step(k * STEP) for k in range(4000)])
    angles = np.array([euler(q) for q in outs['quaternion']])
    for sigma, signal in ((2e-3, angles[:, 0]), (2e-3, angles[:, 1]), (5e-3, angles[:, 2]),
                          *((1e-3, outs['angular_velocity'][:, i]) for i in range(3))):
        # 4000 samples: sigma to 1.1 %, correlation to 1.6 %; four of these
        assert signal.std() == pytest.approx(sigma, rel=0.045)
        assert abs(np.corrcoef(signal[1:], signal[:-1])[0, 1]) < 0.065


def test_wander_is_gauss_markov_whatever_the_step():
    slow = dataclasses.replace(PERFECT, tilt_wander=1e-3, heading_wander=4e-3, wander_time=2.0, ship=STILL)
    bench = Bench(slow)
    gaps = np.tile([0.5, 3.5], 5000)
    stamps = (np.cumsum(gaps) * 1e9).astype(np.int64)
    angles = np.array([euler(bench.step(int(stamp))['quaternion']) for stamp in stamps])
    for i, sigma in enumerate((1e-3, 1e-3, 4e-3)):
        x = angles[:, i] - angles[:, i].mean()
        assert x.std() == pytest.approx(sigma, rel=0.05)
        assert np.mean(x[1::2] * x[::2]) / x.var() == pytest.approx(math.exp(-3.5 / 2.0), abs=0.06)
        assert np.mean(x[1:-1:2] * x[2::2]) / x.var() == pytest.approx(math.exp(-0.5 / 2.0), abs=0.06)


def test_wander_has_its_size_from_the_first_sample():
    slow = dataclasses.replace(PERFECT, tilt_wander=1e-3, ship=STILL)
    first = [euler(Bench(slow, seed=seed).step(0)['quaternion'])[0] for seed in range(400)]
    assert np.std(first) == pytest.approx(1e-3, rel=0.15)       # 400 samples: 3.5 %, four of them


def test_it_says_how_its_error_changes():
    """Over a time short of its memory the error of an angle changes by 2 noise^2 + walk^2 T (200 s: 4 % of it)."""
    bench = Bench(dataclasses.replace(PERFECT, tilt_noise=1e-4, heading_noise=2e-4, tilt_wander=2e-3,
                                      heading_wander=1e-3, wander_time=20.0, ship=STILL))
    out = bench.step(0)
    angles = [euler(out['quaternion'])]
    for k in range(1, 40_000):
        bench.inputs['stamp_ns'] = k * STEP
        out = bench.run()
        angles.append(euler(out['quaternion']))
    for n in (1, 20):
        change = np.var(np.subtract(angles[n:], angles[:-n]), axis=0)
        assert change == pytest.approx(2.0 * out['noise']**2 + out['walk']**2 * n * 0.005, rel=0.15)
    assert out['noise'] == pytest.approx([1e-4, 1e-4, 2e-4])


@pytest.mark.parametrize('latency', [0.0, 0.004999999, 0.005, 0.005000001, 0.012, 0.25])
@pytest.mark.parametrize('regular', [True, False])
def test_latency_releases_the_newest_result_old_enough(latency, regular):
    late = Bench(dataclasses.replace(InsParameters(), latency=latency))
    prompt = Bench(dataclasses.replace(InsParameters(), latency=0.0))
    gaps = np.full(300, STEP) if regular else np.random.default_rng(1).integers(1_500_000, 9_000_000, 300)
    stamps, known, forces, released = [], {}, {}, None
    for stamp in np.cumsum(gaps):
        stamp = int(stamp)
        stamps.append(stamp)
        known[stamp] = prompt.step(stamp)
        forces[stamp] = prompt.inputs[0]['linear_acceleration'].copy()
        out = late.step(stamp)
        assert status(out) == 'ok'
        newest = max((s for s in stamps if s <= stamp - round(latency * 1e9)), default=None)
        assert out['due'] == (newest != released)
        if out['due']:
            released = newest
            assert out['stamp_ns'] == newest
            assert out['quaternion'].tobytes() == known[newest]['quaternion'].tobytes()
            assert out['angular_velocity'].tobytes() == known[newest]['angular_velocity'].tobytes()
            assert out['linear_acceleration'].tobytes() == forces[newest].tobytes()
    assert released is not None


def test_seeds_repeat_and_differ():
    def run(seed):
        bench = Bench(InsParameters(), seed=seed)
        return b''.join(bench.step(k * STEP).tobytes() for k in range(50))
    assert run(1) == run(1) != run(2)


@pytest.mark.parametrize('back', [0, 1, STEP])
def test_a_stamp_that_does_not_advance_changes_nothing(back):
    bench = Bench(InsParameters())
    for k in range(10):
        bench.step(k * STEP)
    before = bench.state.tobytes()
    out = bench.step(9 * STEP - back)
    assert status(out) == 'stamp does not advance' and out['due'] == 0
    assert bench.state.tobytes() == before
    assert status(bench.step(10 * STEP)) == 'ok'


@pytest.mark.parametrize('field', ['angular_velocity', 'linear_acceleration'])
def test_imu_data_that_are_not_finite_are_said_and_not_measured(field):
    bench = Bench(dataclasses.replace(PERFECT, latency=0.005))
    stamps = []
    for k in range(10):
        out = bench.step(k * STEP, spoil=field if k == 5 else None)
        assert status(out) == ('IMU data are not finite' if k == 5 else 'ok')
        if out['due']:
            stamps.append(int(out['stamp_ns']))
            assert np.isfinite(out['quaternion']).all()
    assert stamps == [k * STEP for k in (0, 1, 2, 3, 4, 6, 7, 8)]


@pytest.mark.parametrize('change', [dict(seed=7), dict(sea_state=4), dict(wave_angle_deg=100.0)])
def test_another_ship_than_the_imu_is_on_is_said(change):
    bench = Bench(InsParameters(), ship=ShipParameters(**change))
    assert 'IMU disagrees with the ship parameters of the INS' in {status(bench.step(k * STEP)) for k in range(2000)}


def test_more_samples_than_the_buffer_holds_are_said():
    bench = Bench(dataclasses.replace(PERFECT, latency=0.25))
    statuses = [status(bench.step(k * 500_000)) for k in range(600)]
    assert statuses[:ins.LATENCY_RING_SIZE] == ['ok'] * ins.LATENCY_RING_SIZE
    assert 'more samples than the latency buffer holds' in statuses


def test_compiled_callers_get_the_same_result():
    @numba.njit
    def call(state, constants, inputs, outputs, normals):
        ins.step(state[0], constants[0], inputs[0], outputs[0], normals)

    one, other = Bench(InsParameters()), Bench(InsParameters())
    for k in range(3):
        expected = one.step(k * STEP)
        outputs = ins.Outputs.zeros()
        call(other.state, other.constants, one.inputs, outputs, other.random.standard_normal(ins.INS_NORMALS_PER_STEP))
        assert outputs[0].tobytes() == expected.tobytes()
