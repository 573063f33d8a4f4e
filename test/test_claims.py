"""The numbers that the readings of the papers' claims state are computed again."""
import math
import pathlib

import numpy as np
import pytest
from tools.numbers import claims, published

from acu_tracker.estimation.filters import axis_filter
from acu_tracker.estimation.params import FilterParameters
from drive_law.params import AduParameters
from pedestal_bringup.loop import closed_loop
from pedestal_results.intervals import missed
from pedestal_studies.p000_ma import backlash, servo
from pedestal_studies.p001_zhou_yang_qin import aligned_runs, methods
from pedestal_studies.p001_zhou_yang_qin.aligned_runs import ARCMIN_RAD
from pedestal_studies.p003_lin_wu_zhu import feedforward_loop as loop
from ship_motion_sim import earth

ROOT = pathlib.Path(__file__).parents[1]
LATITUDE = math.radians(aligned_runs.SHIP_PARAMETERS.latitude_deg)


def reading(paper, begin):
    """The reading of the only claim of a paper that begins with a text."""
    [found] = [claim.reading for claim in claims.CLAIMS_BY_PAPER[paper] if claim.claim.startswith(begin)
               and not claim.study]
    return found


def test_the_spread_of_the_motors():
    axis = AduParameters().azimuth
    spread = [100.0 * (1.0 - getattr(axis.motor_2, name) / getattr(axis.motor_1, name))
              for name in ('resistance', 'inductance')]
    assert all(0.0 < value < 0.5 for value in spread)
    assert '{:.2f} % in resistance, {:.2f} % in inductance'.format(*spread) in reading('Ma 2023', 'the motors differ')


def stiffness(**changed):
    """Torque on the load over its deflection against the motors [Nm/rad], a step of 100 Nm on an axis at rest."""
    variant = servo.gust_case('best', **{'adu.wind.gust.azimuth': 100.0}, **changed)
    chosen = variant.load()
    record, ratio = closed_loop.Loop(chosen).run(), chosen.node_parameters('adu').azimuth.gear_train.ratio
    wound = (record['adu/truth']['position'][:, 0]
             - record['adu/motor_states']['position'][:, :2].mean(axis=1) / ratio)
    before, after = record.t < servo.GUST_START_S, record.t > record.t[-1] - 0.1
    return 100.0 / abs(wound[after].mean() - wound[before][-20:].mean())


def test_two_motors_stiffen_the_drive():
    both, slack = stiffness(), stiffness(**backlash.bias('off'))
    one = AduParameters().azimuth.gear_train.stiffness
    assert both / one == pytest.approx(2.0, rel=0.01) and slack < 0.2 * one
    text = reading('Ma 2023', 'two motors stiffen')
    assert f'{both:.2e} Nm/rad with' in text and f'{one:.0e} Nm/rad of' in text and f'{slack:.1e} Nm/rad' in text


@pytest.mark.parametrize('name, sine, shown', [('paper-all', '0p4hz', '.4f'), ('paper-r1', '0p4hz', '.4f'),
                                               ('paper-r2', '0p4rads', '.3f')])
def test_the_output_has_the_period_of_the_input(name, sine, shown):
    run = closed_loop.Loop(servo.sine_case(name, sine).load()).run()
    period = servo.sine_metrics(run, sine)[f'sine_{sine}_period_s']
    assert period == pytest.approx(2.0 * math.pi / servo.SINE_FREQUENCIES_RAD_S[sine], rel=1e-5)
    assert f'{period:{shown}} s of' in reading('Ma 2023', 'figure 6: the output')


def test_longitude_and_height_of_the_alignment():
    """The free-air gradient is 2 g / R."""
    gravity = earth.gravity(LATITUDE)
    lessened = gravity * 2.0 * 450.0 / 6.371e6
    assert (f'{gravity:.4f} m/s2, and 450 m lessen it by {lessened:.4f} m/s2, or {100.0 * lessened / gravity:.3f} %'
            in reading('Zhou, Yang, Qin 2011', 'longitude'))


def test_without_noise_an_alignment_reaches_the_limits_of_the_paper(monkeypatch):
    """grad / g and eps / w_N: sway, biases and scale errors of the paper, one run."""
    for name in ('VELOCITY_NOISE_M_S', 'GYRO_NOISE_DENSITY', 'ACCELEROMETER_NOISE_DENSITY'):
        monkeypatch.setattr(aligned_runs, name, 0.0)
    (angle, force, attitude), start = aligned_runs.simulated_run(aligned_runs.Batch('', 0, 1), 0)
    every = round(aligned_runs.EVALUATION_PERIOD_S / aligned_runs.IMU_PERIOD_S)
    found = {}
    for method in ('classical', 'adrc'):
        constants = methods.constants(aligned_runs.INS_PARAMETERS, method, LATITUDE)
        estimates = np.zeros(len(angle) // every, aligned_runs.AlignmentEstimate.dtype)
        aligned_runs.align(methods.initial_state(constants, start), constants, angle, force,
                           aligned_runs.IMU_PERIOD_S, every, estimates)
        errors = aligned_runs.errors(estimates['quaternion'], attitude[every - 1::every])[550:] / ARCMIN_RAD
        found[method] = np.abs(errors.mean(axis=0))
    level = aligned_runs.ACCELEROMETER_BIAS_M_S2 / earth.gravity(LATITUDE) / ARCMIN_RAD
    azimuth = aligned_runs.GYRO_BIAS_RAD_S / earth.rate(LATITUDE)[1] / ARCMIN_RAD
    for east, north, up in found.values():
        assert (east, north) == pytest.approx((level, level), rel=0.06) and up == pytest.approx(azimuth, rel=0.05)
    text = reading('Zhou, Yang, Qin 2011', 'limit of the level')
    assert f': {level:.3f} arcmin;' in text and all(f' {error[0]:.3f} arcmin, classical method and ADRC' in text
                                                    for error in found.values())
    text = reading('Zhou, Yang, Qin 2011', 'limit of the azimuth')
    assert f': {azimuth:.3f} arcmin;' in text and f'{found["classical"][2]:.2f} arcmin, classical method' in text
    assert f'{found["adrc"][2]:.2f} arcmin, ADRC' in text


@pytest.mark.parametrize('rate, acceleration, late, shown', [
    (3.5, 0.0, 0.0, 'forward: 0 deg at 3.5 deg/s'), (0.0, 11.0, 0.0, 'and at 11 deg/s2;'),
    (0.0, 11.0, 0.045, '{:.3f} deg at 11 deg/s2 if the state is 45 ms late')])
def test_constant_rate_and_acceleration_leave_no_error(rate, acceleration, late, shown):
    t, T = loop.T * np.arange(800), loop.T
    v, a = np.radians((rate, acceleration))
    target = np.column_stack([v * t + 0.5 * a * t * t, v + a * t, np.full(len(t), a)])
    known = np.column_stack([v + a * (t + 0.5 * T - late), np.full(len(t), a)])
    out = np.zeros((1, len(t)), loop.Step.dtype)
    loop._follow(target, known, axis_filter.Filter.zeros(), axis_filter.constants(FilterParameters()), 0.0,
                 loop.rate_loop_step(*loop.RATE_LOOP_CONSTANTS), np.zeros((1, len(t))), out)
    miss = math.degrees(out['miss'][0, -1])
    assert miss == pytest.approx(acceleration * late / loop.K_P, rel=1e-4, abs=1e-7)
    assert shown.format(miss) in reading('Lin, Wu, Zhu 2020', '(17)')


VERDICTS = 'reproduced', 'not reproduced', 'holds', 'without effect', 'our IMM'


@pytest.mark.parametrize('paper', claims.CLAIMS_BY_PAPER)
def test_a_verdict_agrees_with_the_target_of_its_row(paper):
    rows = published.read(ROOT)
    for claim in claims.CLAIMS_BY_PAPER[paper]:
        assert claim.verdict.startswith(VERDICTS) or not claim.verdict, claim
        if claim.study and missed(rows[claim.study, claim.case, claim.metric]):
            assert claim.verdict.startswith('not reproduced'), claim
    judged = {claim.claim for claim in claims.CLAIMS_BY_PAPER[paper] if claim.verdict}
    measured = {claim.claim for claim in claims.CLAIMS_BY_PAPER[paper] if claim.study}
    assert measured - judged <= {'figure 11: azimuth of the flight (no number)',
                                 'figure 9: sway 10 deg in 8 s (no number)'}
