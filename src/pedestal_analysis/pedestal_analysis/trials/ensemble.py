"""Makes the trials of plans and writes their rows: the same numbers whoever works, and however often it was stopped.

The row of a trial holds the results of `pedestal run` for each beam, measured on the closed loop without ROS, which
holds what the lockstep recording of the trial's command does. Trials ashore run side by side (run/side_by_side).
"""
import contextlib
import functools

import numpy as np

from pedestal_analysis.results import results
from pedestal_analysis.trials import monte_carlo
from pedestal_analysis.trials.table import Table
from pedestal_bringup.loop import closed_loop, memory_recording, side_by_side
from pedestal_common.wire import records

MIN_BATCH_TRIALS = 4
"""Trials that one worker makes at a time, unless they run side by side: so many at most are lost for each worker when
it is killed."""

TRIAL_RESULTS = tuple(result.name for result in results.RESULTS if result.part not in ('run', 'supervised'))
"""Results of a trial: those of `pedestal run` but for what it says of the processes."""

MEASURED_TOPICS = ('joint_states', 'adu/truth', 'tracking_receiver/angle_error', 'target/truth', 'acu/rate_command',
                   'acu/estimate', 'acu/reference', 'acu/filter', 'acu/mode')
"""What they are measured on ashore; the stamps of acu/mode are those of acu/rate_command."""


class TrialError(ValueError):
    """A trial cannot be run; one line naming it."""


def table(plan, folder, name='trials') -> Table:
    """The table.Table of the trials of a plan.Plan in a folder."""
    prefixes = plan.scenario(0).prefixes
    heads = [f'{prefix}{result}' for prefix in prefixes for result in TRIAL_RESULTS]
    return Table(folder, name, {**plan.identity, 'sources': monte_carlo.sources()}, plan.varied, heads)


@contextlib.contextmanager
def _trial(plan, i):
    """A ValueError becomes a TrialError that names trial i."""
    try:
        yield
    except ValueError as error:
        raise TrialError(f'{plan.command(i)}: {error}') from None


@functools.lru_cache(maxsize=1)
def _memory(trials, steps):
    """What trials side by side keep, batch after batch: new memory costs up to a tenth of their time."""
    return np.empty((trials, steps), records.of(*MEASURED_TOPICS))


def _batch(plan):
    """The results of every trial of a short Plan, each in the order of TRIAL_RESULTS for each beam, None for what it
    does
    not have; what workers do."""
    scenarios, found = [], [[] for _ in range(plan.runs)]
    for i in range(plan.runs):
        with _trial(plan, i):
            scenarios.append(plan.scenario(i))
    for beam in [prefix.rstrip('/') for prefix in scenarios[0].prefixes]:
        loops = []
        for i, chosen in enumerate(scenarios):
            with _trial(plan, i):
                loops.append(closed_loop.Loop(chosen, beam))
        runs = (iter(side_by_side.runs(loops, MEASURED_TOPICS, _memory(len(loops), loops[0].steps)))
                if side_by_side.can_run_parallel(loops) else (loop.run() for loop in loops))
        for i, chosen in enumerate(scenarios):
            with _trial(plan, i):
                values = results.measured(results.of_bag(memory_recording.MemoryRecording(chosen, next(runs))))
                found[i] += [values.get(name, (None,))[0] for name in TRIAL_RESULTS]
    return found


def _batch_size(plan):
    """How many trials of a plan a worker makes at a time."""
    return max(MIN_BATCH_TRIALS, side_by_side.max_parallel_trials(plan.scenario(0), MEASURED_TOPICS))


def make(plans, tables, pool, progress=lambda done, total: None):
    """Make the trials that tables lack of their plans, those of several side by side, and append their rows.

    pool: monte_carlo.Pool. progress(trials done, trials in all) is called as they come. Raises TrialError.
    """
    pieces, size = [], min(map(_batch_size, plans))
    for first in range(0, max(plan.runs for plan in plans), size):
        for plan, rows in zip(plans, tables):
            numbers = range(max(first, len(rows.rows)), min(first + size, plan.runs))
            if numbers:
                pieces.append((plan, rows, numbers))
    total = sum(plan.runs for plan in plans)
    done = total - sum(len(numbers) for *_, numbers in pieces)
    progress(done, total)
    found = pool.map(_batch, [plan.part(numbers) for plan, _, numbers in pieces])
    for (plan, rows, numbers), values in zip(pieces, found):
        rows.append([[i, plan.seed + i, *(column[i] for column in plan.varied.values()), *own]
                     for i, own in zip(numbers, values)])
        done += len(numbers)
        progress(done, total)
    for plan, rows in zip(plans, tables):
        rows.rows = rows.rows[:plan.runs]
