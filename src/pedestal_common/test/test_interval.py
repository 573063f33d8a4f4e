import numpy as np
import pytest

from pedestal_common.geometry.interval import interval


@pytest.mark.parametrize('rows', [2, 3, 4, 17, 100])
def test_interval_against_searchsorted(rows):
    rng = np.random.default_rng(rows)
    breaks = np.cumsum(rng.uniform(0.1, 2.0, rows))
    instants = np.concatenate([breaks, np.nextafter(breaks, -np.inf), rng.uniform(breaks[0], breaks[-1], 200),
                               [breaks[0] - 5.0, breaks[-1] + 5.0]])
    expected = np.clip(np.searchsorted(breaks, instants, side='right') - 1, 0, rows - 2)
    assert [interval(breaks, t) for t in instants] == expected.tolist()
