"""Execution of trials: run each trial of a plan, and write its row of results to a table.

The numbers do not depend on the number of workers, nor on an interruption. A trial runs in the closed loop without
ROS, which has the same data as the lockstep recording of the trial's command. Trials ashore run side by side
(pedestal_bringup.loop.side_by_side), trials on a ship or with an array one after the other.
"""
import contextlib
import functools
import pathlib
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from pedestal_bringup.loop import closed_loop, memory_recording, side_by_side
from pedestal_common.quantities import Json, Records
from pedestal_common.wire import records
from pedestal_results import results
from pedestal_results.recorded_run import RecordedRun
from pedestal_workbench.trials import monte_carlo
from pedestal_workbench.trials.plan import Plan
from pedestal_workbench.trials.statistics import WHY
from pedestal_workbench.trials.table import Table

MAX_SERIAL_TRIALS = 4  # largest number of trials in a batch, the work of one worker, that run one after the other

MAX_PARALLEL_BATCH_S, MAX_SERIAL_BATCH_S = 1500.0, 150.0
"""Largest simulated time of a batch, in both cases [s]. The rows of a batch are written at its end. These times take
about 5 s of a core, so that a stop loses no more."""

TRIAL_RESULTS = tuple(result.name for result in results.RESULTS if result.part not in ('run', 'supervised'))
"""Names of the results of a trial: all results of `pedestal run`, except those on its processes."""

MEASURED_TOPICS = ('joint_states', 'adu/truth', 'tracking_receiver/angle_error', 'target/truth', 'acu/rate_command',
                   'acu/estimate', 'acu/reference', 'acu/filter', 'acu/mode', 'acu/pointing', 'adu/state')
"""Topics that the results and verdicts of trials ashore need. No result reads the numbers of acu/rate_command, but a
change of acu/mode has the stamp of the acu/rate_command of its step (pedestal_common.node.unit.announced)."""


def open_table(plan: Plan, folder: str | pathlib.Path, name: str = 'trials') -> Table:
    """Return the table of the trials of a plan in a folder; `with` opens its files. name: of the files, without
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


def _batch_size(plan: Plan) -> int:
    chosen = plan.scenario(0)
    parallel, duration = side_by_side.max_parallel_trials(chosen, MEASURED_TOPICS), chosen.header.duration
    if parallel < side_by_side.MIN_PARALLEL_LOOPS:
        return max(1, min(MAX_SERIAL_TRIALS, int(MAX_SERIAL_BATCH_S / duration)))
    return max(side_by_side.MIN_PARALLEL_LOOPS, min(parallel, int(MAX_PARALLEL_BATCH_S / duration)))


def run_missing_trials(plans: Sequence[Plan], tables: Sequence[Table], pool: monte_carlo.Pool,
                       progress: Callable[[int, int], object] = lambda done, total: None) -> None:
    """Run the trials of plans that are missing in their tables, and append their rows to the tables. The batches of
    several plans alternate, so all plans advance together. progress(trials done, all trials) is called after each
    batch. Raises ValueError that names a trial."""
    pieces = []
    size = min(map(_batch_size, plans))
    for first in range(0, max(plan.runs for plan in plans), size):
        for plan, table in zip(plans, tables):
            numbers = range(max(first, len(table.rows)), min(first + size, plan.runs))
            if numbers:
                pieces.append((plan, table, numbers))
    total = sum(plan.runs for plan in plans)
    done = total - sum(len(numbers) for *_, numbers in pieces)
    progress(done, total)
    found = pool.map(_batch, [plan.part(numbers) for plan, _, numbers in pieces])
    for (plan, table, numbers), values in zip(pieces, found):
        table.append([[i, plan.seed + i, *(column[i] for column in plan.varied.values()), *own]
                      for i, own in zip(numbers, values)])
        done += len(numbers)
        progress(done, total)
    # An earlier, longer call may have left more rows in the file than this plan has trials.
    for plan, table in zip(plans, tables):
        table.rows = table.rows[:plan.runs]
