"""The multisine against the inverse FFT of its spectrum."""
import numpy as np
import pytest

from pedestal_common.multisine import Sweep, value

SWEEP = Sweep(period=2.0, lowest=0.5, highest=90.0, points=40, dropped=1, kept=2, peak=0.3)


def test_a_period_is_the_inverse_fft_of_equal_sines_with_schroeders_phases():
    n, bins = 400, SWEEP.bins()
    spectrum, k = np.zeros(n // 2 + 1, complex), np.arange(len(bins))
    spectrum[bins] = np.exp(-1j * np.pi * k * (k + 1) / len(k))
    one = np.fft.irfft(spectrum, n)
    assert SWEEP.once(5e-3) == pytest.approx(0.3 * one / np.abs(one).max(), abs=1e-12)
    assert np.array_equal(SWEEP.signal(5e-3), np.tile(SWEEP.once(5e-3), 3))


def test_the_phases_keep_the_peak_far_below_the_sum_of_the_amplitudes():
    bins = SWEEP.bins()
    largest = max(abs(value(bins, len(bins), share)) for share in np.linspace(0.0, 1.0, 2000))
    assert largest < 0.6 * len(bins) and value(bins, len(bins), 0.25) == pytest.approx(value(bins, len(bins), 3.25))
