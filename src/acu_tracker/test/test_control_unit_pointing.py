"""What the whole unit points at, on an ideal axis, ashore and on a rolling deck."""
import math

import numpy as np
import pytest

from acu_tracker.program.program_track import ProgramTrack


@pytest.mark.parametrize('delay, latency', [(0.0, 0.0), (0.01, 0.0), (0.02, 0.015)])
def test_autotrack_points_at_an_accelerating_target(Rig, delay, latency):
    rig = Rig(Rig.moving, initial_mode='autotrack', delay=delay, error_latency=latency, **Rig.QUICK,
              **Rig.LIVELY)
    errors = rig.run(12.0)[:, 2:]
    assert rig.mode == 'autotrack' and not rig.invalid
    assert np.abs(errors[-400:]).max() < 2e-6


def test_what_the_known_delay_is_worth(Rig):
    """With the delay left out of the prediction the feed-forward of a sine comes late."""
    def swinging(t):
        return 0.3 * math.sin(0.8 * t), 0.6

    worst = []
    for lead in (0.02 + 0.5 * Rig.T, 0.5 * Rig.T):
        rig = Rig(swinging, initial_mode='program', at=(0.0, 0.6), delay=0.02, **{'tracker.handover': False})
        times = 0.05 * np.arange(2000)
        rig.track = ProgramTrack(times, np.array([swinging(t) for t in times]))
        rig.constants['lead'] = lead
        worst.append(np.abs(rig.run(12.0)[1600:, 2:]).max())
    assert worst[0] < 1e-6 and worst[1] > 1e-4


@pytest.mark.parametrize('latency', [0.0, 0.02])
def test_measurement_is_the_encoder_at_the_stamp_of_the_error(Rig, latency):
    """The antenna swings by 0.3 rad/s about a fixed target: the estimate must not see it."""
    rig = Rig(error_latency=latency)
    for k in range(400):
        rig.angle = np.array([0.5 + 0.05 * math.sin(6 * k * Rig.T), 0.6 - 0.03 * math.sin(5 * k * Rig.T)])
        o = rig.step()
    np.testing.assert_allclose(o['estimate'][:, 0], [0.5, 0.6], atol=1e-9)
    assert np.abs(o['innovation']).max() < 1e-9


def test_error_between_two_encoder_stamps(Rig):
    """The receiver measures half-way between two steps of an antenna that swings by up to 0.3 rad/s."""
    rig = Rig()
    for k in range(1, 400):
        before, here = (np.array([0.5 + 0.05 * math.sin(6 * t), 0.6]) for t in ((k - 1) * Rig.T, k * Rig.T))
        rig.angle, rig.k = here, k
        dx, de = rig.error(k * Rig.T, 0.5 * (before + here))
        o = rig.step(error_stamp=(k - 0.5) * Rig.T, cross_elevation=dx, elevation=de)
        if k == 1:
            assert rig.invalid == {'error_stamp'}
    np.testing.assert_allclose(o['estimate'][:, 0], [0.5, 0.6], atol=1e-9)


def test_azimuth_is_as_much_noisier_as_cross_elevation_is_shorter(Rig):
    rig = Rig(target=lambda t: (0.5, 1.2), at=(0.5, 1.2))
    azimuth, elevation = rig.step()['covariance'][:, 0]
    assert azimuth == pytest.approx(elevation / math.cos(1.2)**2, rel=1e-9)


def test_cross_elevation_becomes_azimuth(Rig):
    rig = Rig(target=lambda t: (0.51, 1.2), at=(0.5, 1.2))
    for _ in range(50):
        o = rig.step()
    assert abs(rig.inputs['cross_elevation'][0]) < 0.0037
    np.testing.assert_allclose(o['estimate'][:, 0], [0.51, 1.2], atol=1e-9)


@pytest.mark.parametrize('delay, mode', [
    (0.0, 'program'), (0.02, 'autotrack'), pytest.param(0.0, 'autotrack', marks=pytest.mark.thorough),
    pytest.param(0.02, 'program', marks=pytest.mark.thorough)])
def test_stabilised_on_a_rolling_deck(Rig, mode, delay):
    rig = Rig(lambda t: (1.1 + 0.01 * t, 0.7 + 0.005 * t), attitude=Rig.rolling, stabilised=True, delay=delay,
              initial_mode=mode, at=(0.5, 0.7), **Rig.QUICK, **{'tracker.handover': False})
    rig.program()
    rows = rig.run(14.0)
    assert rig.mode == mode and not rig.invalid
    unstabilised = np.ptp(rows[800:, :2], axis=0) * 8 / (2 * math.pi)
    assert unstabilised.min() > 0.1
    assert np.abs(rows[800:, 2:]).max() < 4e-5
    # The estimate is that of the earth angles: no ship in it.
    o = rig.outputs[0]
    t = rig.state['stamp'][0]
    np.testing.assert_allclose(o['estimate'][:, 0], [1.1 + 0.01 * t, 0.7 + 0.005 * t], atol=1e-6)
    np.testing.assert_allclose(o['estimate'][:, 1], [0.01, 0.005], atol=1e-5)


def test_reference_is_the_deck_direction_by_brute_force(Rig):
    rig = Rig(lambda t: (1.1 + 0.01 * t, 0.7), attitude=Rig.rolling, stabilised=True, initial_mode='program',
              at=(0.5, 0.7), **{'tracker.handover': False})
    rig.program()
    rig.run(10.0)
    o, t = rig.outputs[0], rig.state['stamp'][0]
    h = 1e-3
    before, here, after = (rig.deck(t + d) for d in (-h, 0.0, h))
    np.testing.assert_allclose(o['reference'][:, 0], here, atol=2e-5)
    np.testing.assert_allclose(o['reference'][:, 1], (after - before) / (2 * h), atol=2e-4)
    np.testing.assert_allclose(o['reference'][:, 2], (after - 2 * here + before) / h**2, atol=2e-2)


def test_late_attitude_is_predicted_with_rate_and_acceleration(Rig):
    """In mode program no loop through the receiver hides an error of the attitude."""
    rig = Rig(attitude=Rig.rolling, stabilised=True, initial_mode='program', at=(0.5, 0.6),
              **{'tracker.handover': False})
    rig.program()
    worst = 0.0
    for k in range(2400):
        late = max(k - 8, 0) * Rig.T
        error = rig.error(k * Rig.T, rig.angle)
        rig.step(attitude_stamp=late, quaternion=Rig.rolling(late).as_quat(),
                 deck_rate=Rig.body_rate(Rig.rolling, late))
        worst = max(worst, *np.abs(error)) if k > 1200 else 0.0
    assert rig.mode == 'program' and not rig.invalid
    print(f'attitude 40 ms late: worst pointing error {worst:.2e} rad')
    assert worst < 6e-5


def test_noise_in_is_less_noise_out(Rig):
    rig = Rig(Rig.moving, initial_mode='autotrack', sigma=5e-4, **Rig.QUICK)
    rig.constants['p']['tracker']['receiver']['sigma_floor'] = 5e-4
    errors = rig.run(20.0)[1000:, 2:]
    assert np.sqrt(np.mean(errors**2)) < 0.4 * 5e-4
    assert np.abs(rig.outputs['nis']).max() < 25.0


def test_filter_is_changed_while_it_tracks(Rig):
    """The step of a change is like any other: its rate command moves by no more than the noise has moved it before."""
    rig = Rig(Rig.moving, initial_mode='autotrack', sigma=5e-4, **Rig.QUICK, **{'tracker.receiver.sigma_floor': 5e-4})
    rows = rig.run(10.0)
    for kind in ('current_statistical', 'alpha_beta', 'singer', 'imm'):
        steps = np.abs(np.diff(rows[-400:, :2], axis=0))
        rig.put(**{'azimuth.filter.kind': kind, 'elevation.filter.kind': kind})
        assert (np.abs(rig.step()['rate'] - rows[-1, :2]) <= steps.max(axis=0)).all()
        rows = rig.run(3.0)
        assert np.abs(rows[:, 2:]).max() < 2 * 5e-4
        assert rig.mode == 'autotrack' and rig.outputs['gated'] == 0
    probability = rig.outputs['probability'][0]
    models = rig.constants['target']['filter']['axis']['count'].sum()
    assert np.isfinite(probability).sum() == models and np.nansum(probability) == pytest.approx(2.0)


def test_program_takes_the_turn_that_holds_the_whole_pass(Rig):
    """From 170 deg clockwise by 220 deg: on the near turn it would hit +270 deg, one turn lower it fits."""
    def clockwise(t):
        return (math.radians(170.0 + 2.2 * t) + math.pi) % (2 * math.pi) - math.pi, 0.6

    rig = Rig(clockwise, at=(math.radians(160.0), 0.6), initial_mode='program')
    rig.program(rows=101)
    rig.run(8.0)
    assert rig.mode == 'autotrack'
    assert math.degrees(rig.angle[0]) == pytest.approx(170.0 - 360.0 + 2.2 * 8.0, abs=0.01)
    assert rig.outputs['angle_limited'].tolist() == [[0, 0]]


def test_azimuth_goes_round_at_the_end_of_its_travel(Rig):
    def clockwise(t):
        return 4.5 + 0.1 * t, 0.6

    rig = Rig(clockwise, at=(4.5, 0.6), initial_mode='autotrack', **Rig.QUICK)
    rows = rig.run(2.0)
    assert rig.angle[0] == pytest.approx(4.7, abs=1e-3)
    rig.run(6.0)
    assert rig.mode == 'autotrack'
    assert rig.angle[0] == pytest.approx(5.3 - 2 * math.pi, abs=1e-4)
    assert np.isfinite(rows).all()


def test_same_inputs_give_the_same_bits(Rig):
    first, second = (Rig(Rig.moving, attitude=Rig.rolling, stabilised=True, initial_mode='autotrack', sigma=1e-4,
                         **Rig.QUICK) for _ in range(2))
    first.run(1.0), second.run(1.0)
    assert first.state.tobytes() == second.state.tobytes() and first.outputs.tobytes() == second.outputs.tobytes()
