"""Workers of the studies: the same numbers on any pool, and an end that leaves no process behind."""
import os
import signal
import subprocess
import sys
import time

import distributed
import numpy as np
import pytest

from pedestal_studies.p003_lin_wu_zhu import manoeuvre
from pedestal_workbench.trials import monte_carlo


def test_batches_hold_every_run_once():
    assert list(monte_carlo.batches(10, 4)) == [(0, 4), (4, 4), (8, 2)]
    assert list(monte_carlo.batches(3, 4)) == [(0, 3)]


def numbers(pool, count=5):
    def drawn(seed):
        return np.random.default_rng(seed).standard_normal(3)

    shares = []
    results = list(pool.map(drawn, range(count), lambda share, text: shares.append(share)))
    assert shares == [(i + 1) / count for i in range(count)]
    return np.array(results)


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


@pytest.mark.thorough
def test_a_study_gives_the_same_numbers_whoever_works():
    runs = manoeuvre.BATCH_RUNS + 3
    expected = manoeuvre.run(lambda share, text: None, runs).rows
    with monte_carlo.Pool(2) as pool:
        assert manoeuvre.run(lambda share, text: None, runs, pool).rows == expected
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with monte_carlo.Pool(scheduler=cluster.scheduler_address) as pool:
            assert manoeuvre.run(lambda share, text: None, runs, pool).rows == expected


def living(group):
    """Command lines of the processes of a group that still run."""
    listed = subprocess.run(['ps', '-ww', '-eo', 'pgid=,stat=,args='], capture_output=True, text=True, check=True)
    fields = [line.split(None, 2) for line in listed.stdout.splitlines()]
    return [args for pgid, stat, args in fields if int(pgid) == group and not stat.startswith('Z')]


@pytest.mark.thorough
@pytest.mark.parametrize('whom', ['terminal', 'process'])
def test_ctrl_c_ends_a_study_and_its_workers(whom, tmp_path):
    """A terminal sends it to every process, `kill` to one."""
    process = subprocess.Popen(
        [sys.executable, '-m', 'pedestal.cli', 'study', 'manoeuvre', '--runs', '1000000', '--workers', '2'],
        cwd=tmp_path, start_new_session=True, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        deadline = time.monotonic() + 60.0
        while sum('LokyProcess' in args for args in living(process.pid)) < 2:
            assert time.monotonic() < deadline and process.poll() is None
            time.sleep(0.05)
        (os.killpg if whom == 'terminal' else os.kill)(process.pid, signal.SIGINT)
        stdout, stderr = process.communicate(timeout=60.0)
        assert (process.returncode, stdout, stderr) == (130, '', 'pedestal: stopped\n')
        while living(process.pid):
            assert time.monotonic() < deadline + 60.0
            time.sleep(0.05)
    finally:
        if living(process.pid):
            os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.parametrize('options, message', [
    ({'workers': 0}, '--workers 0: must be at least 1'),
    ({'scheduler': 'host'}, '--scheduler host: must be an address'),
    ({'scheduler': 'tcp://127.0.0.1:9'}, '--scheduler tcp://127.0.0.1:9: no Dask scheduler answers')])
def test_a_pool_that_cannot_work_says_why(monkeypatch, options, message):
    monkeypatch.setattr(monte_carlo, 'SCHEDULER_TIMEOUT_S', 0.5)
    with pytest.raises((ValueError, RuntimeError), match=message), monte_carlo.Pool(**options):
        pass


def test_without_dask_a_scheduler_is_refused(monkeypatch):
    monkeypatch.setitem(sys.modules, 'distributed', None)
    with pytest.raises(RuntimeError, match='Dask is not installed'), monte_carlo.Pool(scheduler='tcp://127.0.0.1:9'):
        pass
