"""`recompute --param`: a difference of two settings is significant as often as it should be, with its size."""
import types

import numpy as np
import pytest

from pedestal_workbench.again import what_if

PERIOD_S, MEMORY = 0.02, 0.9


def errors(rng, seconds):
    """Errors with the memory of a filter: of first order, 0.2 s."""
    noise = rng.normal(0.0, 1e-4, (round(seconds / PERIOD_S), 2))
    out = np.empty_like(noise)
    last = np.zeros(2)
    for k, step in enumerate(noise):
        last = out[k] = MEMORY * last + step
    return out


def versions(old, new, truth=True):
    acus = [types.SimpleNamespace(common=PERIOD_S * np.arange(len(old)), innovations=error) for error in (old, new)]
    return what_if.Versions(acus, [types.SimpleNamespace(error=error) if truth else None for error in (old, new)])


@pytest.mark.parametrize('truth, subject', [(True, 'rms error of the estimate'), (False, 'rms innovation')])
def test_the_size_is_in_the_interval(truth, subject):
    rng = np.random.default_rng(1)
    old = errors(rng, 40.0)
    said = what_if.significance(versions(old, 0.9 * old + 0.05 * errors(rng, 40.0), truth))
    assert said.startswith(f'better: with the new setting the {subject}') and '20 paired stretches of 2 s' in said
    ratio, low, high = (float(said.split(word)[1].split()[0].strip(',;')) for word in ('old ', 'interval ', ' to '))
    assert low < ratio < high < 1.0 and ratio == pytest.approx(np.hypot(0.9, 0.05), abs=0.02)
    assert 'worse' in what_if.significance(versions(old, 1.1 * old, truth))
    assert '3 times as large' in what_if.significance(versions(old, 3.0 * old, truth))


def test_chance_is_rarely_called_significant():
    """Independent errors of equal size: 5 % of the comparisons are wrong, here of 200, and at most twice as many."""
    rng = np.random.default_rng(2)
    wrong = sum('no significant difference' not in what_if.significance(versions(errors(rng, 30.0), errors(rng, 30.0)))
                for _ in range(200))
    assert 1 <= wrong <= 20


def test_a_short_recording_is_not_judged():
    old = errors(np.random.default_rng(3), 4.0)
    assert what_if.significance(versions(old, 2.0 * old)).startswith('not judged: 4 s with both settings')
    assert what_if.significance(versions(old[:0], old[:0])).startswith('not judged: 0 s')
    old = errors(np.random.default_rng(3), 6.0)
    assert what_if.significance(versions(old, old)) == 'no difference: the rms error of the estimate is the same'
