"""Benchmarks of `pedestal bench`: speed of the graph, of the compiled laws and of bags on this machine.

Each benchmark is a module with a function run() -> Measured.
"""
import time
from collections.abc import Callable
from typing import NamedTuple

from pedestal_common.quantities import Row, Seconds

BENCH_MODULES = {'graph': 'lockstep', 'core': 'core', 'bag': 'recording'}  # {name on the command line: module}


class Measured(NamedTuple):
    """Outcome of a benchmark."""
    title: str
    rows: list[Row]
    remark: str = ''    # lines that are printed below the table


def best_of(function: Callable[[], object], repeats: int = 5) -> Seconds:
    """Return the shortest wall time of several calls."""
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        function()
        times.append(time.perf_counter() - begun)
    return min(times)
