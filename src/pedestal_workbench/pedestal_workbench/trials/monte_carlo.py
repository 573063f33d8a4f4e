"""Pool of workers that run studies and trials in parallel, on the cores of this machine or on a Dask cluster. Because
size and seeds of the batches of runs do not depend on the workers, the numbers are equal to the last bit on any pool.
To save memory, a batch returns sums and a few numbers of each run instead of records."""
import contextlib
import functools
import hashlib
import importlib.util
import logging
import multiprocessing.resource_tracker
import pathlib
import re
import signal
import threading
import types
import typing
import warnings
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator
from typing import TypeAlias, TypeVar

import joblib
import numba
import numpy as np
from joblib.externals import loky
from numpy.typing import ArrayLike

from pedestal_common.quantities import Floats

if typing.TYPE_CHECKING:
    import distributed

PACKAGES = ('pedestal_common', 'receiver_law', 'drive_law', 'ship_motion_sim', 'tracking_receiver_sim', 'acu_tracker',
            'adu_drive', 'pedestal_hardware', 'equipment_sim', 'pedestal_bringup', 'pedestal_results',
            'pedestal_workbench', 'pedestal_station', 'pedestal_studies')
"""Packages with laws, or with code that calls laws in trials and studies."""

SCHEDULER_TIMEOUT_S = 10.0  # longest wait for the Dask scheduler, and for its first worker [s]


def batches(runs: int, size: int) -> list[tuple[int, int]]:
    """Return the number of the first run and the number of runs of each batch of at most `size` runs."""
    return [(first, min(size, runs - first)) for first in range(0, runs, size)]


_Item = TypeVar('_Item')
_Result = TypeVar('_Result')
_Case = TypeVar('_Case', bound=Hashable)
Progress: TypeAlias = Callable[[float, str], object]    # progress(share of the work that is done [-], text)


class Pool:
    """Workers for `map`: local processes, one per core without a number, or the workers of a Dask cluster, with the
    address of its scheduler such as 'tcp://host:port'. Use as a context; a single local worker is this process and
    needs no context. Raises ValueError for less than one worker, RuntimeError if Dask is missing or no scheduler
    answers."""

    def __init__(self, workers: int | None = None, scheduler: str | None = None) -> None:
        if workers is not None and workers < 1:
            raise ValueError(f'--workers {workers}: must be at least 1')
        if scheduler is not None and not re.fullmatch(r'(\w+://)?.+:\d+', scheduler):
            raise ValueError(f'--scheduler {scheduler}: must be an address such as tcp://host:8786')
        self.workers = workers or joblib.cpu_count()
        self.scheduler = scheduler
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> 'Pool':
        # joblib warns of lost work, even a while after a study was stopped on purpose.
        warnings.filterwarnings('ignore', '.*tasks (which were|have been)', UserWarning, r'joblib\.parallel')
        if self.scheduler is None:
            if self.workers > 1:
                self._stack.enter_context(_manager_in_silence())
                self._stack.callback(_end_local)
        else:
            client = self._stack.enter_context(_client(self.scheduler))
            self._stack.enter_context(joblib.parallel_config(backend='dask', client=client))
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 traceback: types.TracebackType | None) -> bool | None:
        return self._stack.__exit__(kind, error, traceback)

    def map(self, function: Callable[[_Item], _Result], items: Iterable[_Item],
            progress: Progress = lambda share, text: None) -> Iterator[_Result]:
        """Yield function(item) of each item, in their order. function: a function of a module, because others cannot
        be sent to workers."""
        items = list(items)
        for done, result in enumerate(self.each(function, items, len(items)), 1):
            progress(done / len(items), f'{done} of {len(items)} batches')
            yield result

    def each(self, function: Callable[[_Item], _Result], items: Iterable[_Item], count: int) -> Iterator[_Result]:
        """Yield as `map`. The workers take the next items while earlier results are yielded; count: largest
        number of items."""
        jobs = -1 if self.scheduler else min(self.workers, count or 1)
        options = {} if self.scheduler else {'backend': 'loky'}
        with _deferred_interrupt() if jobs > 1 else contextlib.nullcontext():
            results = joblib.Parallel(jobs, return_as='generator', **options)(map(joblib.delayed(function), items))
            self._stack.callback(results.close)
        yield from results

    def of_cases(self, function: Callable[[tuple[_Case, int, int]], ArrayLike], cases: Collection[_Case], runs: int,
                 size: int, progress: Progress = lambda share, text: None) -> dict[_Case, Floats]:
        """Return {case: array (runs, ...) of the values of its runs}, for several cases of a study.

        function((case, number of the first run, number of runs)) returns the values of a batch of at most `size` runs.
        """
        pieces = batches(runs, size)
        done = self.map(function, [(case, *piece) for case in cases for piece in pieces], progress)
        return {case: np.concatenate([next(done) for _ in pieces]) for case in cases}


@contextlib.contextmanager
def _deferred_interrupt() -> Iterator[None]:
    """Protect the workers that start inside this context from Ctrl-C, whose signal reaches all processes of a
    terminal.

    The workers inherit the blocked signal, so only this process receives it, and ends the workers. The resource
    trackers of Python and loky unblock the signal when they start; therefore they start first. The signal must also
    not interrupt this process while the workers start. Because a thread of numpy may still receive it,
    KeyboardInterrupt is raised at the end of the context.
    """
    multiprocessing.resource_tracker.ensure_running()
    loky.backend.resource_tracker.ensure_running()
    received = []
    handler = signal.signal(signal.SIGINT, lambda *_: received.append(True))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        signal.signal(signal.SIGINT, handler)
    if received:
        raise KeyboardInterrupt


@contextlib.contextmanager
def _manager_in_silence() -> Iterator[None]:
    """Suppress the KeyError that a thread of loky (the process pool of joblib) prints while its workers are ended."""
    before = threading.excepthook
    threading.excepthook = lambda failure: (
        None if failure.thread and failure.thread.name == 'ExecutorManagerThread' else before(failure))
    try:
        yield
    finally:
        threading.excepthook = before


def _end_local() -> None:
    loky.get_reusable_executor(reuse=True).shutdown(kill_workers=True)


def _client(address: str) -> 'distributed.Client':
    """Return the client of a Dask scheduler, whose workers must have equal versions of the pedestal packages and of
    numba, because the numbers depend on them. Raises RuntimeError."""
    try:
        import distributed
    except ImportError:
        raise RuntimeError(f"--scheduler {address}: Dask is not installed: pip install 'pedestal_workbench[cluster]'"
                           ) from None
    for name in ('distributed', 'tornado'):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # the errors are raised as well
    try:
        client = distributed.Client(address, timeout=SCHEDULER_TIMEOUT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise RuntimeError(f'--scheduler {address}: no Dask scheduler answers: {error}') from None
    try:
        client.wait_for_workers(1, timeout=SCHEDULER_TIMEOUT_S)
        others = [worker for worker, theirs in client.run(sources).items() if theirs != sources()]
        problem = others and f'other versions of the pedestal packages or of numba on {", ".join(others)}'
    except TimeoutError:
        problem = f'no worker connected within {SCHEDULER_TIMEOUT_S:g} s'
    except Exception as error:  # Dask raises the import errors of a worker here
        problem = f'a worker failed: {error}'
    if problem:
        client.close()
        raise RuntimeError(f'--scheduler {address}: {problem}')
    return client


@functools.cache
def sources() -> str:
    """Return a digest of the sources of all packages and of the version of numba, which determine the numbers."""
    sha = hashlib.sha256(numba.__version__.encode())
    for package in PACKAGES:
        spec = importlib.util.find_spec(package)
        assert spec is not None and spec.origin is not None
        folder = pathlib.Path(spec.origin).parent
        for path in sorted(folder.rglob('*.py')):
            sha.update(f'{package}/{path.relative_to(folder)}\n'.encode() + path.read_bytes())
    return sha.hexdigest()[:16]
