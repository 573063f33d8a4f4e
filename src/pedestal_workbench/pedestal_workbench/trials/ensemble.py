"""Execution of trials: run each trial of a plan, and write its row of results to a table.

The numbers do not depend on the number of workers, nor on an interruption. A trial runs in the closed loop without
ROS, which has the same data as the lockstep recording of the trial's command. Trials ashore run side by side
(pedestal_bringup.loop.side_by_side), trials on a ship or with an array one after the other.
"""
import collections
import contextlib
import functools
import math
import pathlib
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from pedestal_bringup.loop import closed_loop, memory_recording, side_by_side
from pedestal_common.quantities import Json, Records, Seconds
from pedestal_common.wire import records
from pedestal_results import results
from pedestal_results.recorded_run import RecordedRun
from pedestal_workbench.trials import monte_carlo
from pedestal_workbench.trials.plan import Plan
from pedestal_workbench.trials.statistics import WHY
from pedestal_workbench.trials.table import Table

MAX_SERIAL_TRIALS = 4  # largest number of trials in a batch, the work of one worker, that run one after the other

BATCH_S = 3.0
"""Time for which a batch should run [s], by the measured time of the batches before. The rows of a batch are written
at its end, so that a stop loses little, also on a busy machine."""

TRIAL_RESULTS = tuple(result.name for result in results.RESULTS if result.part not in ('run', 'supervised'))
"""Names of the results of a trial: all results of `pedestal run`, except those on its processes."""

MEASURED_TOPICS = ('joint_states', 'adu/truth', 'tracking_receiver/angle_error', 'target/truth', 'acu/rate_command',
                   'acu/estimate', 'acu/reference', 'acu/filter', 'acu/mode', 'acu/pointing', 'adu/state')
"""Topics that the results and verdicts of trials ashore need. No result reads the numbers of acu/rate_command, but a
change of acu/mode has the stamp of the acu/rate_command of its step (pedestal_common.node.unit.announced)."""


def open_table(plan: Plan, folder: str | pathlib.Path, name: str = 'trials') -> Table:
    """Return the table of the trials of a plan in a folder; `with` opens its files. name: name of the files, without
    extension."""
    prefixes = plan.scenario(0).prefixes
    heads = [f'{prefix}{result}' for prefix in prefixes for result in TRIAL_RESULTS]
    return Table(folder, name, {**plan.identity, 'sources': monte_carlo.sources()}, plan.varied, heads,
                 [f'{prefix}{WHY}' for prefix in prefixes],
                 [[plan.seed + i, *(values[i] for values in plan.varied.values())] for i in range(plan.runs)])


@contextlib.contextmanager
def _trial(plan: Plan, i: int) -> Iterator[None]:
    try:
        yield
    except ValueError as error:
        raise ValueError(f'{plan.command(i)}: {error}') from None


@functools.lru_cache(maxsize=1)
def _memory(trials: int, steps: int) -> Records:
    """Return the memory (trials, steps) of the records of trials that run side by side. Because new memory costs up to
    a tenth of the time of the trials, all batches use it again."""
    return np.empty((trials, steps), records.of(*MEASURED_TOPICS))


def _batch(plan: Plan) -> list[list[Json]]:
    """Return the TRIAL_RESULTS of each beam, None for a missing result, then the text of WHY of each beam, for each
    trial. The plan is the part of a plan that one worker receives."""
    scenarios = []
    found: list[list[Json]] = [[] for _ in range(plan.runs)]
    whys: list[list[str]] = [[] for _ in range(plan.runs)]
    for i in range(plan.runs):
        with _trial(plan, i):
            scenarios.append(plan.scenario(i))
    for beam in [prefix.rstrip('/') for prefix in scenarios[0].prefixes]:
        loops = []
        for i, chosen in enumerate(scenarios):
            with _trial(plan, i):
                loops.append(closed_loop.Loop(chosen, beam))
        # The loops that run one after the other are lazy: each runs at its `next`, so only one Run is in memory.
        runs = (iter(side_by_side.runs(loops, MEASURED_TOPICS, _memory(len(loops), loops[0].steps)))
                if side_by_side.can_run_parallel(loops) else (loop.run() for loop in loops))
        for i, chosen in enumerate(scenarios):
            with _trial(plan, i):
                recording = memory_recording.MemoryRecording(chosen, next(runs))
                run = RecordedRun(recording)
                values = results.measured(run.parts)
                found[i] += [values.get(name, (None,))[0] for name in TRIAL_RESULTS]
                whys[i].append(run.verdict.why)
    return [values + why for values, why in zip(found, whys)]


def _timed(plan: Plan) -> tuple[Seconds, list[list[Json]]]:
    """Return the time that a batch took, and its rows."""
    begun = time.monotonic()
    rows = _batch(plan)
    return time.monotonic() - begun, rows


class _Batches:
    """Iterator over the parts of plans that their tables lack: the next batch of the plan with the fewest trials, so
    that all plans advance together."""

    def __init__(self, plans: Sequence[Plan], tables: Sequence[Table]) -> None:
        self._plans, self._next = plans, [min(len(table.rows), plan.runs) for plan, table in zip(plans, tables)]
        most = min(side_by_side.max_parallel_trials(plan.scenario(0), MEASURED_TOPICS) for plan in plans)
        parallel = most >= side_by_side.MIN_PARALLEL_LOOPS
        self._least, self._most = (side_by_side.MIN_PARALLEL_LOOPS, most) if parallel else (1, MAX_SERIAL_TRIALS)
        self._size = self._least
        self.begun: collections.deque[tuple[int, range]] = collections.deque()     # (plan, trials) of batches at work
        self.missing = sum(plan.runs - first for plan, first in zip(plans, self._next))

    @property
    def count(self) -> int:
        """Largest number of batches."""
        return -(-self.missing // self._least)

    def __iter__(self) -> Iterator[Plan]:
        while left := [i for i, plan in enumerate(self._plans) if self._next[i] < plan.runs]:
            i = min(left, key=self._next.__getitem__)
            numbers = range(self._next[i], min(self._next[i] + self._size, self._plans[i].runs))
            self._next[i] = numbers.stop
            self.begun.append((i, numbers))
            yield self._plans[i].part(numbers)

    def ended(self, seconds: Seconds) -> tuple[int, range]:
        """Return the (plan, trials) of the oldest batch, and take the time for which it ran. A size is the least one
        times a power of two, because the memory of a batch is used again by the next one of its size."""
        i, numbers = self.begun.popleft()
        fitting = min(BATCH_S / max(seconds, 1e-3) * len(numbers), self._most)
        self._size = self._least * 2**max(int(math.log2(max(fitting, self._least) / self._least)), 0)
        return i, numbers


def run_missing_trials(plans: Sequence[Plan], tables: Sequence[Table], pool: monte_carlo.Pool,
                       progress: Callable[[int, int], object] = lambda done, total: None) -> None:
    """Run the trials of plans that are missing in their tables, and append their rows to the tables. The batches of
    several plans alternate, so all plans advance together. progress(trials done, all trials) is called after each
    batch. Raises ValueError that names a trial."""
    batches, total = _Batches(plans, tables), sum(plan.runs for plan in plans)
    done = total - batches.missing
    progress(done, total)
    for seconds, values in pool.each(_timed, batches, batches.count):
        number, numbers = batches.ended(seconds)
        plan = plans[number]
        tables[number].append([[i, plan.seed + i, *(column[i] for column in plan.varied.values()), *own]
                               for i, own in zip(numbers, values)])
        done += len(numbers)
        progress(done, total)
    # An earlier, longer call may have left more rows in the file than this plan has trials.
    for plan, table in zip(plans, tables):
        table.rows = table.rows[:plan.runs]
