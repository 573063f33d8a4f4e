"""Workers of the studies: the same numbers whoever works, and an end that leaves nothing behind."""
import sys

import numpy as np
import pytest

from pedestal_bringup import monte_carlo


def test_batches_hold_every_run_once():
    assert list(monte_carlo.batches(10, 4)) == [(0, 4), (4, 4), (8, 2)]
    assert list(monte_carlo.batches(3, 4)) == [(0, 3)]


def numbers(pool, count=5):
    def drawn(seed):
        return np.random.default_rng(seed).standard_normal(3)

    shares = []
    found = list(pool.map(drawn, range(count), lambda share, text: shares.append(share)))
    assert shares == [(i + 1) / count for i in range(count)]
    return np.array(found)


def test_results_come_in_order_from_every_number_of_workers():
    expected = np.array([np.random.default_rng(seed).standard_normal(3) for seed in range(5)])
    for workers in (1, 2):
        with monte_carlo.Pool(workers) as pool:
            assert np.array_equal(numbers(pool), expected)


def test_a_failing_batch_says_what_failed():
    def refuse(item):
        raise ValueError(f'item {item}')

    for workers in (1, 2):
        with pytest.raises(ValueError, match=r'item \d'), monte_carlo.Pool(workers) as pool:
            list(pool.map(refuse, range(3)))


def test_a_dask_cluster_gives_the_same_numbers():
    distributed = pytest.importorskip('distributed')
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with monte_carlo.Pool(scheduler=cluster.scheduler_address) as pool:
            found = numbers(pool)
    assert np.array_equal(found, numbers(monte_carlo.Pool(1)))


@pytest.mark.parametrize('options, message', [
    ({'workers': 0}, '--workers 0: must be at least 1'),
    ({'scheduler': 'nobody'}, '--scheduler nobody: must be an address'),
    ({'scheduler': 'tcp://127.0.0.1:9'}, '--scheduler tcp://127.0.0.1:9: nobody answers as a Dask scheduler')])
def test_a_pool_that_cannot_work_says_why(monkeypatch, options, message):
    monkeypatch.setattr(monte_carlo, 'TIMEOUT', 0.5)
    with pytest.raises((ValueError, RuntimeError), match=message), monte_carlo.Pool(**options):
        pass


def test_without_dask_a_scheduler_is_refused(monkeypatch):
    monkeypatch.setitem(sys.modules, 'distributed', None)
    with pytest.raises(RuntimeError, match='Dask is not installed'), monte_carlo.Pool(scheduler='tcp://127.0.0.1:9'):
        pass
