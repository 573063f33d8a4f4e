"""Patterns against the Fourier integrals of their illuminations; S-curve, cross-coupling."""
import cmath
import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import argrelmax

from receiver_law import monopulse

POINTS = [0.0, 0.2, 0.5 * math.pi / monopulse.U_PER_BEAMWIDTH, 0.5, -0.7, math.pi / monopulse.U_PER_BEAMWIDTH, -1.0,
          1.3, 2.6, 6.0]
"""Offsets in beamwidths; the third and sixth are the removable singularities u = pi/2 and u = pi."""


@pytest.mark.parametrize('v', POINTS)
def test_patterns_are_the_transforms_of_their_illuminations(v):
    u = monopulse.U_PER_BEAMWIDTH * v
    total = quad(lambda x: math.cos(0.5 * math.pi * x), -1.0, 1.0)[0]
    even = quad(lambda x: math.cos(0.5 * math.pi * x) * math.cos(u * x), -1.0, 1.0)[0]
    odd = quad(lambda x: math.sin(math.pi * x) * math.sin(u * x), -1.0, 1.0)[0]
    assert monopulse.sum_pattern(v) == pytest.approx(even / total, abs=1e-9)
    # Both illuminations have the same power over the aperture: that is the lossless comparator.
    assert monopulse.difference_pattern(v, 0.5 * monopulse.U_PER_BEAMWIDTH) == pytest.approx(odd / total, abs=1e-9)


def test_half_power_and_slope():
    assert monopulse.sum_pattern(0.5)**2 == pytest.approx(0.5, abs=1e-12)
    assert monopulse.difference_pattern(1e-5, 1.6) / 1e-5 == pytest.approx(1.6, rel=1e-6)


def test_s_curve():
    v = np.linspace(-3.0, 3.0, 6001)
    S = np.array([monopulse.sum_pattern(x) for x in v])
    D = np.array([monopulse.difference_pattern(x, 1.6) for x in v])
    assert np.allclose(D, -D[::-1], atol=1e-12) and np.allclose(S, S[::-1], atol=1e-12)
    assert v[np.argmax(D)] == pytest.approx(0.71, abs=0.01)
    detected = D * S
    changes = v[1:][(v[1:] > 0.0) & (detected[1:] * detected[:-1] < 0.0)]
    assert changes[:2] == pytest.approx([1.26, 1.68], abs=0.01)
    assert np.interp([1.0, 1.5, 1.8], v, np.sign(detected)).tolist() == [1.0, -1.0, 1.0]
    assert np.interp(0.33, v, D / S / 1.6) == pytest.approx(0.33 * 1.05, rel=0.003)
    sidelobe = sorted(np.abs(S[argrelmax(np.abs(S))]))[-2]
    assert 20.0 * math.log10(sidelobe) == pytest.approx(-23.0, abs=0.1)


@pytest.mark.parametrize('beta', [-0.4, 0.3, math.pi / 2])
def test_cross_coupling_rotates_the_error(beta):
    plain = monopulse.channels(0.1, -0.25, 1.6, 1.0, 0.0)
    turned = monopulse.channels(0.1, -0.25, 1.6, math.cos(beta), math.sin(beta))
    expected = complex(plain[1], plain[2]) * cmath.exp(1j * beta)
    assert turned[0] == plain[0]
    assert complex(turned[1], turned[2]) == pytest.approx(expected, abs=1e-12)
    assert plain[1] / plain[0] == pytest.approx(1.6 * 0.1, rel=0.01)
    assert plain[2] / plain[0] == pytest.approx(-1.6 * 0.25, rel=0.04)


def test_detector_is_the_real_part_of_difference_times_conjugate_sum():
    difference, total = 0.9 * cmath.exp(0.7j) + 0.2 + 0.5j, 1.3 - 0.4j
    got = monopulse.detect(difference.real, difference.imag, total.real, total.imag)
    assert got == pytest.approx((difference * total.conjugate()).real, abs=1e-12)


@pytest.mark.parametrize('v_x, v_e', [(0.0, 0.0), (0.3, -0.2), (-0.9, 0.4), (1.3, 0.0)])
@pytest.mark.parametrize('radius', [0.2, 0.75, 1.0])
def test_a_disk_of_noise_against_an_integral_over_it(v_x, v_e, radius):
    """Power of the sum, and its product with a difference, against 40 000 equal parts of the disk."""
    r, angle = np.meshgrid(radius * np.sqrt((np.arange(200) + 0.5) / 200), 2.0 * math.pi * np.arange(200) / 200)
    points = np.column_stack(((v_x + r * np.cos(angle)).ravel(), (v_e + r * np.sin(angle)).ravel()))
    parts = np.array([monopulse.channels(x, e, 1.6, 0.9, math.sqrt(0.19)) for x, e in points])
    S, D_x, D_e = monopulse.disk_channels(v_x, v_e, radius, 1.6, 0.9, math.sqrt(0.19))
    assert S * S == pytest.approx((parts[:, 0]**2).mean(), rel=2e-3, abs=1e-5)
    assert S * D_x == pytest.approx((parts[:, 0] * parts[:, 1]).mean(), abs=2e-4)
    assert S * D_e == pytest.approx((parts[:, 0] * parts[:, 2]).mean(), abs=2e-4)
