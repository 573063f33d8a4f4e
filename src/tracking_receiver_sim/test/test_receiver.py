"""The receiver as a whole: noise law, geometry, lock, latency, smoothing, what it does with bad input."""
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pedestal_common.parameters import ParameterError, build
from receiver_law import detector, monopulse, smoothing
from tracking_receiver_sim import receiver, target
from tracking_receiver_sim.params import TrackingReceiverParameters

PERIOD = 0.005
BEAMWIDTH = 0.0175
FIXED = {'target.kind': 'step', 'target.angle.azimuth': 0.3, 'target.angle.elevation': 0.6,
         'target.angle.start': 1e6, 'receiver.range_exponent': 0.0}
QUIET = FIXED | {'receiver.cn0_dbhz': 110.0}
MEASURED = {'receiver.rate.measured': True, 'receiver.ranging.measured': True}


def errors(out):
    return np.stack([out['cross_elevation'], out['elevation']], axis=1)


@pytest.mark.parametrize('cn0_dbhz', [45.0, 52.0, 65.0])
@pytest.mark.parametrize('samples', [1, 5])
def test_noise_law(Bench, cn0_dbhz, samples):
    bench = Bench(FIXED | {'receiver.cn0_dbhz': cn0_dbhz, 'receiver.samples_per_step': samples})
    out = bench.run(8000, np.random.default_rng(3))[200:]
    law = BEAMWIDTH / (1.6 * math.sqrt(2.0 * 10.0**(cn0_dbhz / 10.0) * PERIOD))
    assert errors(out).std(axis=0) == pytest.approx([law, law], rel=0.05)
    predicted = detector.angle_noise(bench.params.antenna, bench.params.receiver, cn0_dbhz, PERIOD)
    assert predicted == pytest.approx(law, rel=1e-12)
    assert np.abs(errors(out).mean(axis=0)).max() < 5.0 * law / math.sqrt(len(out))
    assert 10.0 * np.log10(np.mean(10.0**(out['cn0_dbhz'] / 10.0))) == pytest.approx(cn0_dbhz, abs=0.1)


def test_default_noise_is_about_30_millidegrees():
    params = TrackingReceiverParameters()
    sigma = detector.angle_noise(params.antenna, params.receiver, params.receiver.cn0_dbhz, PERIOD)
    assert math.degrees(sigma) == pytest.approx(0.03, abs=5e-4)


def test_noise_grows_off_axis(Bench):
    bench = Bench(FIXED | {'receiver.cn0_dbhz': 60.0})
    v = 0.45
    bench.point(0.3, 0.6 - v * BEAMWIDTH)
    out = bench.run(8000, np.random.default_rng(4))[200:]
    S, D = monopulse.sum_pattern(v), monopulse.difference_pattern(v, 1.6)
    on_axis = BEAMWIDTH / (1.6 * math.sqrt(2.0 * 1e6 * PERIOD))
    across, along = errors(out).std(axis=0)
    assert across == pytest.approx(on_axis / S, rel=0.05)
    assert along == pytest.approx(on_axis / S * math.sqrt(1.0 + (D / S)**2), rel=0.05)
    assert along > 1.15 * across > 1.15 * 1.2 * on_axis


def test_noise_in_the_sum_channel_does_not_lower_the_slope(Bench):
    bench = Bench(FIXED | {'receiver.cn0_dbhz': 40.0, 'receiver.acquire_level_dbhz': 30.0,
                           'receiver.lose_level_dbhz': 30.0})
    bench.point(0.3, 0.6 - 0.2 * BEAMWIDTH)
    error = bench.run(20000, np.random.default_rng(11))[200:]['elevation'].mean() / BEAMWIDTH
    assert error == pytest.approx(monopulse.difference_pattern(0.2, 1.6) / monopulse.sum_pattern(0.2) / 1.6, rel=0.03)


def test_recursion_noise_as_predicted(Bench):
    bench = Bench(FIXED | {'receiver.cn0_dbhz': 55.0, 'receiver.smoothing': 'recursion'})
    out = bench.run(12000, np.random.default_rng(5))[200:]
    predicted = detector.angle_noise(bench.params.antenna, bench.params.receiver, 55.0, PERIOD)
    assert errors(out).std(axis=0) == pytest.approx([predicted, predicted], rel=0.05)


@pytest.mark.parametrize('elevation', [0.0, 1.0, 1.4])
def test_azimuth_error_is_seen_as_cross_elevation(Bench, elevation):
    bench = Bench(QUIET | {'target.angle.elevation': elevation})
    offset = 2e-3
    bench.point(0.3 - offset, elevation)
    out = bench.run(300)[-1]
    assert out['true_cross_elevation'] == pytest.approx(offset * math.cos(elevation), rel=1e-4)
    assert out['cross_elevation'] == pytest.approx(offset * math.cos(elevation), rel=0.01)


def test_error_signs_and_slope_factor(Bench):
    bench = Bench(QUIET | {'antenna.slope_factor': 1.5})
    bench.point(0.3, 0.6 - 1e-3)
    out = bench.run(300)[-1]
    assert out['true_elevation'] == pytest.approx(1e-3, rel=1e-6)
    assert out['elevation'] == pytest.approx(1.5e-3, rel=0.01)


def test_phase_error_and_cross_coupling(Bench):
    bench = Bench(QUIET | {'antenna.phase_error': 0.5, 'antenna.cross_coupling': 0.2})
    bench.point(0.3, 0.6 - 1e-3)
    out = bench.run(300)[-1]
    assert out['elevation'] == pytest.approx(1e-3 * math.cos(0.5) * math.cos(0.2), rel=0.01)
    assert out['cross_elevation'] == pytest.approx(-1e-3 * math.cos(0.5) * math.sin(0.2), rel=0.01)


@pytest.mark.parametrize('v, sense', [(0.2, 1), (-0.3, -1), (0.9, 1), (-1.2, -1), (1.3, -1), (1.5, -1), (1.66, -1),
                                      (1.7, 1), (1.9, 1)])
def test_s_curve_saturates_reverses_and_has_a_false_null(Bench, v, sense):
    u = 3.735243 * v
    S, D = math.cos(u) / (1.0 - (2.0 * u / math.pi)**2), math.sin(u) / (1.0 - (u / math.pi)**2)
    expected = max(-0.7, min(D / S / 3.735243, 0.7))
    bench = Bench(QUIET)
    bench.point(0.3, 0.6 - v * BEAMWIDTH)
    out = bench.run(600)[-1]
    assert out['locked'] == 1
    assert out['true_elevation'] == pytest.approx(v * BEAMWIDTH)
    assert out['elevation'] / BEAMWIDTH == pytest.approx(expected, abs=1e-5)
    assert out['elevation'] * sense > 0.0
    assert abs(out['cross_elevation']) < 1e-12


def test_geometry_on_a_tilted_moving_deck(Bench):
    bench = Bench(QUIET)
    rotation = Rotation.from_euler('ZYX', [0.7, -0.2, 0.3])
    antenna = np.array([30.0, -20.0, 12.0])
    position = 10e3 * np.array([math.cos(0.6) * math.sin(0.3), math.cos(0.6) * math.cos(0.3), math.sin(0.6)])
    x, y, z = rotation.inv().apply(position - antenna)
    bench.inputs['mat_ed'], bench.inputs['position'] = rotation.as_matrix(), antenna
    bench.point(math.atan2(-y, x), math.atan2(z, math.hypot(x, y)) - 1e-3)
    out = bench.run(300)[-1]
    assert (out['true_cross_elevation'], out['true_elevation']) == pytest.approx((0.0, 1e-3), abs=1e-9)
    assert out['target_position'] == pytest.approx(position, abs=1e-6)
    assert out['elevation'] == pytest.approx(1e-3, rel=0.01)


def test_lock_has_two_levels_and_two_times(Bench):
    bench = Bench(FIXED | {'receiver.cn0_dbhz': 60.0, 'receiver.acquire_level_dbhz': 50.0,
                           'receiver.lose_level_dbhz': 45.0, 'receiver.cn0_time_constant': 1e-3,
                           'receiver.acquire_time': 0.1, 'receiver.lose_time': 0.05})
    v = np.linspace(0.0, 1.2, 2000)
    level = [60.0 + 20.0 * math.log10(monopulse.sum_pattern(x)) for x in v]

    def point_to_level(dbhz):
        bench.point(0.3, 0.6 - BEAMWIDTH * v[np.argmax(np.array(level) < dbhz)])

    def locked(steps):
        return bench.run(steps)['locked'].tolist()

    assert locked(30) == [0] * 19 + [1] * 11
    point_to_level(47.0)
    assert locked(100) == [1] * 100
    point_to_level(40.0)
    lost = locked(30)
    assert lost[:9] == [1] * 9 and lost[12:] == [0] * 18
    point_to_level(47.0)
    assert locked(100) == [0] * 100
    out = bench.run(1)[0]
    assert math.isnan(out['cross_elevation']) and math.isnan(out['elevation'])
    assert out['status'] == receiver.Status.NO_LOCK and out['cn0_dbhz'] == pytest.approx(47.0, abs=0.3)
    bench.point(0.3, 0.6)
    regained = locked(40)
    assert sum(regained[:19]) == 0 and sum(regained[22:]) == 18


@pytest.mark.parametrize('latency', [0.0, 0.005, 0.012, 0.1])
def test_latency_is_exact(Bench, latency):
    rng = np.random.default_rng(6)
    stamps = np.cumsum(rng.integers(1, 9_000_000, 400))
    prompt = Bench(FIXED | MEASURED).run(stamps=stamps, rng=np.random.default_rng(7))
    late = Bench(FIXED | MEASURED | {'receiver.latency': latency}).run(stamps=stamps, rng=np.random.default_rng(7))
    assert np.array_equal(prompt['stamp_ns'], stamps) and np.all(prompt['due'] == 1)
    given = -1
    for k, now in enumerate(stamps):
        due = np.flatnonzero(stamps <= now - round(latency * 1e9))
        newest = due[-1] if len(due) else -1
        assert late['due'][k] == (newest > given)
        if newest > given:
            given = newest
            assert late['stamp_ns'][k] == stamps[newest]
            for name in ('cross_elevation', 'elevation', 'cn0_dbhz', 'locked', 'rate', 'range'):
                assert np.array_equal(late[name][k], prompt[name][newest], equal_nan=True)
        else:
            assert math.isnan(late['elevation'][k])
    assert given >= 0 and late['locked'].any()


def smoothing_bench(Bench, **changes):
    return Bench(QUIET | {'receiver.smoothing': 'recursion', 'receiver.samples_per_step': 1} | changes, period=1e-3)


def test_smoothing_minus_3_db_is_at_8_17_hz(Bench):
    bench = smoothing_bench(Bench, **{'target.kind': 'sine', 'target.angle.start': 0.0, 'target.angle.frequency': 8.17,
                                      'target.angle.azimuth_amplitude': 0.0, 'target.angle.elevation_amplitude': 1e-4})
    out = bench.run(3000)[1000:]
    phase = 2.0 * math.pi * 8.17 * 1e-9 * out['stamp_ns']
    basis = np.stack([np.sin(phase), np.cos(phase)], axis=1)
    amplitude = np.hypot(*np.linalg.lstsq(basis, out['elevation'], rcond=None)[0])
    assert amplitude / 1e-4 == pytest.approx(math.sqrt(0.5), abs=0.002)


def test_smoothing_step_response(Bench):
    bench = smoothing_bench(Bench, **{'target.angle.start': 1.0, 'target.angle.azimuth_amplitude': 0.0,
                                      'target.angle.elevation_amplitude': 1e-4})
    out = bench.run(1100)[1000:]
    assert out['elevation'] == pytest.approx(1e-4 * (1.0 - (1.0 - 1.0 / 20.0)**np.arange(1, 101)), abs=2e-8)


def test_moving_average_step_response(Bench):
    """A ramp of n samples, where the recursion is a low-pass; n - 1 over 2 of delay."""
    bench = smoothing_bench(Bench, **{'receiver.smoothing': 'moving_average', 'target.angle.start': 1.0,
                                      'target.angle.azimuth_amplitude': 0.0, 'target.angle.elevation_amplitude': 1e-4})
    out = bench.run(1100)[1000:]
    assert out['elevation'] == pytest.approx(1e-4 * np.minimum(np.arange(1, 101) / 20.0, 1.0), abs=2e-8)


def test_moving_average_over_several_steps_is_the_mean_of_their_samples(Bench):
    """Also while it is not yet full, and once its ring has gone round."""
    values = FIXED | {'receiver.cn0_dbhz': 60.0, 'receiver.samples_per_step': 4, 'receiver.acquire_time': 0.0}
    steps = Bench(values).run(400, np.random.default_rng(4))
    bench = Bench(values | {'receiver.smoothing': 'moving_average', 'receiver.smoothing_samples': 40})
    out = bench.run(400, np.random.default_rng(4))
    kept = out['locked'] == 1
    expected = [errors(steps)[max(k - 9, 0):k + 1].mean(axis=0) for k in range(400)]
    first = np.flatnonzero(kept)[0]
    assert np.all(kept[first:]) and first < 50
    assert errors(out)[first + 10:] == pytest.approx(np.array(expected)[first + 10:], abs=1e-15)
    noise = Bench(values | {'receiver.smoothing': 'moving_average', 'receiver.cn0_dbhz': 55.0})
    out = noise.run(12000, np.random.default_rng(5))[200:]
    predicted = detector.angle_noise(noise.params.antenna, noise.params.receiver, 55.0, PERIOD)
    assert errors(out).std(axis=0) == pytest.approx([predicted, predicted], rel=0.05)


@pytest.mark.parametrize('samples', [1, 4])
def test_a_held_beam_jumps_at_the_step_and_only_the_target_moves(Bench, samples):
    """The mean of a step is the error of the target in the middle of its samples off the beam that stood."""
    bench = Bench(QUIET | {'target.kind': 'ramp', 'target.angle.start': 1.0, 'target.angle.azimuth_rate': 0.0,
                           'target.angle.elevation_rate': 0.02, 'receiver.beam': 'held',
                           'receiver.samples_per_step': samples})
    bench.run(201)
    age = receiver.age(bench.params, PERIOD)
    assert age == pytest.approx((samples - 1) / (2 * samples) * PERIOD)
    for k in range(201, 207):
        there = 0.6 + 0.02 * (k * PERIOD - 1.0)
        beam = there + (5e-5 if k % 2 else -5e-5)
        bench.point(0.3, beam)
        out = bench.run(1)[0]
        assert out['elevation'] == pytest.approx(there - 0.02 * age - beam, abs=1e-8)
        assert out['true_elevation'] == pytest.approx(there - beam, abs=1e-9)


@pytest.mark.parametrize('values, age', [
    ({}, 0.0), ({'receiver.smoothing': 'recursion'}, 0.0),
    ({'receiver.beam': 'held', 'receiver.smoothing': 'recursion'}, 0.019),
    ({'receiver.beam': 'held', 'receiver.smoothing': 'moving_average'}, 0.0095)])
def test_age_of_an_error(values, age):
    params = build(TrackingReceiverParameters, {**values, 'receiver.samples_per_step': 5})
    assert receiver.age(params, PERIOD) == pytest.approx(age)


@pytest.mark.parametrize('kind, n', [('none', 20), ('recursion', 20), ('recursion', 7), ('moving_average', 20),
                                     ('moving_average', 13), ('moving_average', 3)])
@pytest.mark.parametrize('beam', ['held', 'moving'])
def test_age_of_the_beam_is_that_of_the_steps_its_samples_were_taken_in(kind, n, beam):
    """What the smoothing makes of samples that are the number of their step."""
    samples, steps, state = 5, 300, smoothing.Smoother.zeros().view(np.recarray)[0]
    for step in range(steps):
        smoothing.begin(state)
        for _ in range(samples):
            smoothing.put(state, float(step), 1.0 / n)
    smoothed = smoothing.smoothed(state, smoothing.SMOOTHING_KINDS.index(kind), samples, n)
    expected = (steps - 1 - smoothed) * PERIOD if beam == 'held' else 0.0
    params = build(TrackingReceiverParameters, {'receiver.beam': beam, 'receiver.smoothing': kind,
                                                'receiver.smoothing_samples': n, 'receiver.samples_per_step': samples})
    assert receiver.beam_age(params, PERIOD) == pytest.approx(expected, abs=1e-12)


def test_samples_follow_the_error_between_steps(Bench):
    bench = Bench(QUIET | {'receiver.samples_per_step': 4})
    bench.run(200)
    bench.point(0.3, 0.6 - 1e-3)
    assert bench.run(1)[0]['elevation'] == pytest.approx(1e-3 * (0.25 + 0.5 + 0.75 + 1.0) / 4.0, rel=0.01)


def test_level_falls_with_range(Bench):
    bench = Bench({'target.kind': 'flyby', 'target.flyby.speed': 200.0, 'target.flyby.closest_time': 0.0,
                   'receiver.reference_range': 1000.0, 'receiver.cn0_dbhz': 60.0}, duration=20.0)
    levels = []
    for _ in range(3):
        out = bench.run(1)[0]
        for _ in range(1000):
            e, n, u = out['target_position']
            bench.point(math.atan2(e, n), math.atan2(u, math.hypot(e, n)))
            out = bench.run(1)[0]
        levels.append((math.sqrt(e * e + n * n + u * u), out['cn0_dbhz']))
    for distance, cn0_dbhz in levels:
        assert cn0_dbhz == pytest.approx(60.0 - 20.0 * math.log10(distance / 1000.0), abs=0.3)
    assert levels[2][0] > 2.5 * levels[0][0] > 2500.0


def test_target_below_the_horizon_gives_no_signal(Bench):
    bench = Bench(FIXED | {'target.kind': 'ramp', 'target.angle.start': 1.0, 'target.angle.elevation': 0.01,
                           'target.angle.azimuth_rate': 0.0, 'target.angle.elevation_rate': -0.01})
    rng = np.random.default_rng(8)
    bench.point(0.3, 0.005)
    out = bench.run(1000, rng)
    t = 1e-9 * out['stamp_ns']
    assert np.all((out['status'] == receiver.Status.BELOW_HORIZON) == (t > 2.0))
    assert np.all(out['locked'][t > 2.5] == 0) and np.all(out['locked'][(t > 0.5) & (t < 1.9)] == 1)
    assert np.all(np.isfinite(out['true_elevation'])) and np.all(np.isfinite(out['cn0_dbhz']))


def test_past_the_track_the_target_is_not_valid(Bench):
    bench = Bench({'target.kind': 'flyby', 'receiver.reference_range': 1000.0}, duration=0.1)
    out = bench.run(2000)
    inside = 1e-9 * out['stamp_ns'] <= 0.1 + target.RUN_MARGIN_S
    assert np.array_equal(out['target_valid'], inside)
    assert np.all(out['status'][~inside] == receiver.Status.NO_TARGET)
    assert np.all(np.isnan(out['target_position'][~inside])) and np.all(np.isnan(out['true_elevation'][~inside]))
    assert np.all(np.isfinite(out['cn0_dbhz'])) and out['locked'][-1] == 0


@pytest.mark.parametrize('field, value', [('valid', 0), ('azimuth', math.nan), ('elevation', math.inf),
                                          ('mat_ed', math.nan), ('position', math.nan)])
def test_bad_inputs_unlock_and_leave_no_trace(Bench, field, value):
    bench = Bench(FIXED | {'receiver.cn0_dbhz': 60.0, 'receiver.smoothing': 'recursion'})
    assert bench.run(200)[-1]['locked'] == 1
    good = bench.inputs.copy()
    bench.inputs[field] = value
    out = bench.run(3)
    assert np.all(out['status'] == receiver.Status.NO_BEAM) and np.all(out['locked'] == 0)
    assert np.all(np.isnan(out['cross_elevation'])) and np.all(np.isnan(out['true_elevation']))
    assert np.all(out['due'] == 1) and np.all(np.isfinite(out['cn0_dbhz']))
    assert np.all(out['target_valid'] == 1)
    bench.inputs[:] = good
    out = bench.run(30)
    assert out['locked'].tolist() == [0] * 19 + [1] * 11
    assert np.abs(errors(out[19:])).max() < 1e-9


def test_stamps_that_do_not_increase_are_named_and_change_nothing(Bench):
    bench = Bench(FIXED)
    bench.run(200)
    before = bench.state.tobytes()
    out = bench.run(stamps=np.array([995_000_000, 0, -5_000_000]))
    assert np.all(out['status'] == receiver.Status.STAMP_ORDER) and np.all(out['due'] == 0)
    assert np.all(np.isnan(out['elevation'])) and bench.state.tobytes() == before
    assert bench.run(stamps=np.array([1_000_000_000]))[0]['status'] == receiver.Status.LOCKED


def test_same_normals_give_the_same_bits(Bench):
    values = {'receiver.latency': 0.02, 'receiver.smoothing': 'recursion'}
    runs = [Bench(values, duration=60.0).run(500, np.random.default_rng(9)).tobytes() for _ in range(2)]
    assert runs[0] == runs[1]
    assert runs[0] != Bench(values, duration=60.0).run(500, np.random.default_rng(10)).tobytes()


def test_rate_on_a_moving_deck_is_how_fast_the_error_changes(Bench):
    """Against the difference of the true errors two steps apart; a flyby seen from a turning, sailing deck."""
    bench = Bench(MEASURED | {'target.kind': 'flyby', 'receiver.range_exponent': 0.0, 'receiver.cn0_dbhz': 60.0},
                  period=1e-3)
    out, beam = [], (0.8, 0.1)
    for k in range(400):
        t = 1e-3 * k
        attitude = Rotation.from_euler('ZYX', [0.1 * t + 1.8, 0.2 * math.sin(t), 0.3 * math.sin(2.0 * t)])
        h = 1e-5
        ahead, behind = (Rotation.from_euler('ZYX', [0.1 * s + 1.8, 0.2 * math.sin(s), 0.3 * math.sin(2.0 * s)])
                         for s in (t + h, t - h))
        velocity = np.array([6.0, 2.0, 0.5])
        bench.inputs['mat_ed'], bench.inputs['position'] = attitude.as_matrix(), velocity * t
        bench.inputs['twist_linear'] = attitude.inv().apply(velocity)
        bench.inputs['twist_angular'] = (behind.inv() * ahead).as_rotvec() / (2.0 * h)
        if k == 0:
            x, y, z = attitude.inv().apply(bench.run(1)[0]['target_position'])
            beam = math.atan2(-y, x), math.atan2(z, math.hypot(x, y))
        bench.point(beam[0] + 0.02 * t, beam[1] - 0.01 * t)
        bench.inputs['azimuth_rate'], bench.inputs['elevation_rate'] = 0.02, -0.01
        out.append(bench.run(1)[0])
    out = np.array(out)
    true = np.stack([out['true_cross_elevation'], out['true_elevation']], axis=1)
    locked = np.flatnonzero(out['locked'][1:-1]) + 1
    assert len(locked) > 200
    assert np.ptp(true[locked], axis=0).max() > 0.005
    assert out['rate'][locked] == pytest.approx((true[locked + 1] - true[locked - 1]) / 2e-3, abs=1e-5)
    assert np.isnan(out['rate'][out['locked'] == 0]).all() and np.isnan(out['range'][out['locked'] == 0]).all()


def test_rate_and_range_have_the_noise_they_say_and_leave_the_errors_alone(Bench):
    plain = Bench(FIXED | {'receiver.cn0_dbhz': 60.0}).run(100, np.random.default_rng(5))
    assert np.isnan(plain['rate']).all() and np.isnan(plain['range']).all()
    bench = Bench(FIXED | MEASURED | {'receiver.cn0_dbhz': 60.0, 'receiver.rate.sigma': 0.002,
                                      'receiver.ranging.sigma': 3.0})
    assert receiver.normals_per_step(bench.params) == 6 * 5 + 3
    out = bench.run(4000, np.random.default_rng(5))[100:]
    assert out['rate'].std(axis=0) == pytest.approx([0.002, 0.002], rel=0.05)
    assert out['range'].std() == pytest.approx(3.0, rel=0.05)
    assert out['range'].mean() == pytest.approx(10e3, abs=0.3)
    assert np.array_equal(out['range'], out['range'].astype(np.float32))
    every = np.column_stack([out['rate'], out['range'], errors(out)])
    assert np.abs(np.corrcoef(every.T) - np.eye(5)).max() < 0.1


def test_latency_that_does_not_fit_the_ring_is_refused(Bench):
    with pytest.raises(ParameterError, match='latency = 0.5 s: must be below 511 periods of 0.0005 s'):
        Bench(FIXED | {'receiver.latency': 0.5}, period=5e-4)


@pytest.mark.parametrize('values, message', [
    ({'receiver.acquire_level_dbhz': 30.0}, 'lose_level_dbhz'),
    ({'target.leo_pass.culmination_low_deg': 80.0}, 'culmination_low_deg'),
    ({'antenna.beamwidth': math.nan}, 'beamwidth'),
    ({'receiver.smoothing': 'moving_average', 'receiver.smoothing_samples': 257}, 'smoothing_samples = 257: .* 256'),
    ({'target.kind': 'rocket'}, 'kind')])
def test_bad_parameters_are_refused(values, message):
    with pytest.raises(ParameterError, match=message):
        build(TrackingReceiverParameters, values)


def test_the_antenna_stands_at_the_end_of_its_arm(Bench):
    """Error, range and rate of a moving deck against scipy's rotation and differences of the true error."""
    arm = np.array([12.0, -4.0, 25.0])
    bench = Bench(QUIET | MEASURED | {'target.angle.range': 800.0, 'receiver.samples_per_step': 1,
                                      **{f'lever_arm.{axis}': value for axis, value in zip('xyz', arm)}})
    velocity, h = np.array([3.0, -2.0, 0.5]), 1e-4
    place = 800.0 * np.array([math.cos(0.6) * math.sin(0.3), math.cos(0.6) * math.cos(0.3), math.sin(0.6)])

    def deck(t):
        return Rotation.from_euler('ZYX', [1.4 + 0.02 * t, 0.05 * math.sin(t), 0.1 * math.cos(0.8 * t)])

    def on_deck(t):
        return deck(t).inv().apply(place - velocity * t) - arm
    x, y, z = on_deck(2.0)
    beam = math.atan2(-y, x), math.atan2(z, math.hypot(x, y)) - 0.002
    bench.point(*beam)
    bench.inputs['mat_ed'], bench.inputs['position'] = deck(2.0).as_matrix(), velocity * 2.0
    bench.inputs['twist_angular'] = (deck(2.0 - h).inv() * deck(2.0 + h)).as_rotvec() / (2 * h)
    bench.inputs['twist_linear'] = deck(2.0).inv().apply(velocity)
    out = bench.run(100)[-1]
    np.testing.assert_allclose([out['true_cross_elevation'], out['true_elevation']], [0.0, 0.002], atol=1e-9)
    assert out['range'] == pytest.approx(np.linalg.norm([x, y, z]), abs=1e-3)
    before, after = (np.array(receiver.offsets(*beam, *on_deck(2.0 + d))) for d in (-h, h))
    np.testing.assert_allclose(out['rate'], (after - before) / (2 * h), atol=1e-6)


def test_no_signal_through_the_superstructure(Bench):
    bench = Bench(QUIET | {'blockage': '0.2 0.4 0.7'})
    out = bench.run(200)[-1]
    assert out['status'] == receiver.Status.HIDDEN and not out['locked']
    assert out['true_cross_elevation'] == pytest.approx(0.0, abs=1e-12)
    bench.inputs['mat_ed'] = Rotation.from_euler('Z', math.pi / 2 - 0.2).as_matrix()
    bench.point(0.1, 0.6)
    assert bench.run(200)[-1]['status'] == receiver.Status.LOCKED


SUN = {'target.kind': 'sun', 'target.leo_pass.start_time': '2019-12-10T11:00:00Z', 'receiver.cn0_dbhz': 60.0,
       'target.noise_source.bandwidth': 1e5, 'antenna.beamwidth': 6.2e-3}


def test_the_level_of_the_sun_is_that_of_its_disk_and_fluctuates(Bench):
    """The disk is 1.5 beamwidths wide. At 30 dB above the noise the fluctuation is that of the source itself, which a
    carrier of this level does not have."""
    bench = Bench(SUN | {'path.light_time': True, 'target.polarisation.axial_ratio_db': 60.0})
    azimuth, elevation, distance = target.look_angles(bench.target, np.full(1, 4.5))
    assert distance[0] == pytest.approx(1.473e11, rel=1e-3)     # perihelion is near
    for off in (0.0, 0.5, 1.0):
        bench = Bench(SUN)
        bench.point(azimuth[0], elevation[0] + off * 6.2e-3)
        found = 10.0**(0.1 * bench.run(1400, np.random.default_rng(1))['cn0_dbhz'][400:])
        S, *_ = monopulse.disk_channels(0.0, -off, 0.5 * 9.25e-3 / 6.2e-3, 1.6, 1.0, 0.0)
        assert found.mean() == pytest.approx(1e6 * S * S, rel=0.01)
        # The level is smoothed over 0.1 s, as a mean over 0.2 s. Off the axis the motion of the sun changes it too.
        if off == 0.0:
            assert found.std() / found.mean() == pytest.approx(1.0 / math.sqrt(1e5 * 0.2), rel=0.5)


def test_a_body_needs_its_date(Bench):
    with pytest.raises(target.TargetError, match="leo_pass.start_time = '': must be the UTC of the start"):
        Bench({'target.kind': 'moon'})
