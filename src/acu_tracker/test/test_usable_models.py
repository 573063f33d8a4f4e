"""Models of the filter on a flexible structure: the loop through a model against an exact two-mass model of scipy."""
import dataclasses
import math

import numpy as np
import pytest
from scipy import linalg

from acu_tracker import control_unit, structure
from acu_tracker.params import AcuParameters
from pedestal_common.parameters import build

FAST = {'period': 1e-4, 'step_gap': 0.05}  # steps so short that their delay does not count


def parameters(frequency, share, **changes):
    own = {f'{axis}.structure.{key}': value for axis in ('azimuth', 'elevation')
           for key, value in (('frequency', frequency), ('inertia_share', share))}
    return build(AcuParameters, {**own, **changes})


def exact(params, q, r):
    """Open loop (A, B, C) of the azimuth: two masses of 1 kg m2 together, PI speed loop with torque feed-forward, PI
    position loop, shaper at rest in fhan's linear zone, and the steady Kalman filter of Riccati's equation. Input:
    measured angle of the target. Output: twist."""
    a = params.azimuth
    w, zeta, share, h0 = (2.0 * math.pi * a.structure.frequency, a.structure.damping, a.structure.inertia_share,
                          a.shaper.h0)
    w_s, K_p, K_i = a.adrc.rate_bandwidth, a.feedforward.bandwidth, a.feedforward.integral * a.feedforward.bandwidth**2
    chain = np.eye(3, k=1)
    P = linalg.solve_continuous_are(chain.T, np.eye(3)[:, :1], np.diag([0.0, 0.0, q * q]), np.array([[r * r]]))
    K = P[:, 0] / r**2
    # 0, 1 base; 2, 3 dish; 4 integral of the rate error; 5 integral of the angle error; 6, 7 shaper; 8 to 10 filter
    A, B = np.zeros((11, 11)), np.zeros(11)
    A[8:, 8:], A[8:, 8], B[8:] = chain, chain[:, 0] - K, K
    A[6, 7] = 1.0
    A[7, [6, 7, 8, 9, 10]] = -1.0 / h0**2, -2.0 / h0, 1.0 / h0**2, 2.0 / h0, 1.0
    A[5, [6, 0]] = 1.0, -1.0
    command = np.zeros(11)
    command[[7, 6, 0, 5]] = 1.0, K_p, -K_p, K_i
    A[4], A[4, 1] = command, command[1] - 1.0
    torque = w_s * A[4] + A[7]
    torque[4] += w_s**2 / 5.0
    spring = np.zeros(11)
    spring[[2, 3, 0, 1]] = w * w, 2.0 * zeta * w, -w * w, -2.0 * zeta * w
    A[0, 1] = A[2, 3] = 1.0
    A[3], A[1] = -spring, (torque + share * spring) / (1.0 - share)
    C = np.zeros((1, 11))
    C[0, [2, 0]] = 1.0, -1.0
    return A, B[:, np.newaxis], C


PLANTS = [(3.0, 0.5), (6.0, 0.1), (8.0, 0.5), (8.0, 0.1), (10.0, 0.3), (12.0, 0.7), (20.0, 0.3)]


@pytest.mark.parametrize('frequency, share', PLANTS)
def test_open_loop_and_stability_are_those_of_two_masses(frequency, share):
    """The response agrees at every frequency. The eigenvalues of the closed loop, with the whole gain or a part of it,
    are stable if the margin is above 0, and not for a part of it if the margin is 0."""
    params = parameters(frequency, share, **FAST)
    receiver = params.tracker.receiver
    r = receiver.beamwidth / (receiver.slope * math.sqrt(2.0 * 10.0**(0.1 * receiver.cn0_dbhz)))
    w = 2.0 * math.pi * np.geomspace(0.2, 60.0, 50)
    for rung, b in enumerate(structure.bandwidths(params.azimuth.filter, receiver)):
        q = params.azimuth.filter.imm.ca.noise * params.azimuth.filter.imm.rung_ratio**rung
        assert b == pytest.approx((q / r)**(1.0 / 3.0), rel=2e-3)
        A, B, C = exact(params, q, r)
        expected = np.array([(C @ linalg.solve(1j * x * np.eye(11) - A, B)).item() for x in w])
        np.testing.assert_allclose(structure.open_loop(params, 'azimuth', b, 1j * w), expected, rtol=0.03,
                                   atol=0.03 * np.abs(expected).max() * 1e-3)
        stable = all(linalg.eigvals(A - k * B @ C).real.max() < 1e-9 for k in np.linspace(0.02, 1.0, 50))
        margin = structure.margin(params, 'azimuth', b)
        assert stable if margin > 0.05 else not stable or margin > 0.01
        # The nearest approach of k L to -1 for any k is at most that of the whole loop.
        assert margin <= np.abs(1.0 + expected).min() + 0.03


@pytest.mark.parametrize('frequency, share', PLANTS)
def test_the_usable_models_amplify_no_disturbance_above_1_5(frequency, share):
    """The largest |1 / (1 + k L)| of two masses, for any weight k of the model. The first model that is not usable
    amplifies more, or is too fast for the structure."""
    params = parameters(frequency, share, **FAST)
    imm, receiver = params.azimuth.filter.imm, params.tracker.receiver
    r = receiver.beamwidth / (receiver.slope * math.sqrt(2.0 * 10.0**(0.1 * receiver.cn0_dbhz)))
    w = 2.0 * math.pi * frequency * np.geomspace(0.3, 3.0, 1500)
    usable = structure.rungs_with_margin(params, 'azimuth')
    for rung, b in enumerate(structure.bandwidths(params.azimuth.filter, receiver)[:usable + 1]):
        A, B, C = exact(params, imm.ca.noise * imm.rung_ratio**rung, r)
        L = (C @ np.linalg.solve(1j * w[:, np.newaxis, np.newaxis] * np.eye(11) - A, B))[:, 0, 0]
        peak = (1.0 / np.abs(1.0 + np.linspace(0.0, 1.0, 101)[:, np.newaxis] * L)).max()
        if rung < usable:
            assert peak < 1.5 * 1.03
        else:
            assert peak > 1.5 * 0.97 or b > 2.0 * math.pi * frequency / structure.MIN_FREQUENCY_RATIO


def rungs(*given, **changes):
    return structure.rungs_with_margin(parameters(*given, **changes), 'azimuth')


def test_models_of_an_axis():
    """More models the stiffer the dish is; all of a rigid axis, of an array, of a filter without a ladder."""
    ladder = parameters(8.0, 0.5).azimuth.filter.imm
    assert rungs(8.0, 0.0) == ladder.rungs
    counts = [rungs(f, 0.5) for f in (2.0, 6.0, 8.0, 10.0, 14.0, 30.0)]
    assert counts == sorted(counts) and counts[0] == 0 and counts[-1] == ladder.rungs and 3 <= counts[2] <= 6
    assert rungs(8.0, 0.5, **{'azimuth.filter.imm.rungs': 2}) == 2
    assert rungs(8.0, 0.5, **{'azimuth.filter.kind': 'ca'}) == ladder.rungs
    # A strong signal makes each model faster: the ratio of two rungs, as a ratio of voltages, is one rung.
    strong = 46.4 + 20.0 * math.log10(ladder.rung_ratio)
    assert rungs(8.0, 0.5, **{'tracker.receiver.cn0_dbhz': strong}) == counts[2] - 1
    # A smoother shaper, a notch in a fast loop, a slow answer of the receiver: the loop itself decides.
    assert rungs(8.0, 0.5, **{'azimuth.shaper.h0': 0.1}) > counts[2]
    fast = {'azimuth.feedforward.bandwidth': 60.0}
    assert rungs(8.0, 0.5, **fast, **{'azimuth.notch.frequency': 8.0}) >= rungs(8.0, 0.5, **fast)


@pytest.mark.parametrize('controller', ['pid', 'feedforward', 'adrc'])
def test_every_controller_has_its_loop(controller):
    """A rigid base under any controller follows a slow reference: B / r is 1, and the twist is (s / w)^2."""
    params = parameters(8.0, 0.5, **{'azimuth.controller': controller})
    s = 2j * math.pi * np.array([0.01, 0.02])
    np.testing.assert_allclose(structure.axis_response(params.azimuth, 0.0025, s), 1.0, atol=0.01)
    np.testing.assert_allclose(structure.twist(params.azimuth, s), (s.imag / (16.0 * math.pi))**2, rtol=1e-3)
    assert 1 <= structure.rungs_with_margin(params, 'azimuth') <= params.azimuth.filter.imm.rungs


def test_the_control_unit_begins_and_goes_on_with_these_models():
    for params in (parameters(8.0, 0.5), dataclasses.replace(parameters(4.0, 0.3), command_delay=0.01)):
        filters = control_unit.constants(params)['target']['filter']['axis'][0]
        for axis, name in zip(filters, ('azimuth', 'elevation')):
            assert axis['count'] == 1 + max(1, structure.rungs_with_margin(params, name))


def test_one_line_says_what_is_limited():
    assert parameters(8.0, 0.0).remarks() == parameters(30.0, 0.5).remarks() == []
    [line] = parameters(8.0, 0.5).remarks()
    assert line == (f'the filter uses {rungs(8.0, 0.5)} of its 8 models ca in azimuth (structure of 8 Hz) and '
                    f'{rungs(8.0, 0.5)} of its 8 models ca in elevation (structure of 8 Hz); a faster model would '
                    'swing the structure')
    [line] = parameters(3.0, 0.5).remarks()
    assert line.endswith('azimuth and elevation may swing with any of them; run `pedestal tune --loops`')
