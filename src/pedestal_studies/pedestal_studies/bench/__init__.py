"""Benchmarks of `pedestal bench`: speed of the graph, of the compiled laws and of bags on this machine.

Each benchmark is a module. Its function run() prints a table and returns the rows of the table.
"""
import time
from collections.abc import Callable, Iterable

from pedestal_common.quantities import Row, Seconds

BENCH_MODULES = {'graph': 'lockstep', 'core': 'core', 'bag': 'recording'}  # {name on the command line: module}


def show(title: str, rows: Iterable[Row]) -> None:
    """Print rows of results.row as a table."""
    from rich.console import Console  # Not needed for the help of the command line.
    from rich.table import Table
    table = Table(title=title, title_justify='left')
    for column in ('case', 'metric', 'value', 'unit', 'target'):
        table.add_column(column, justify='right' if column in ('value', 'target') else 'left')
    for r in rows:
        table.add_row(r['case'], r['metric'], f'{r["value"]:.4g}', r['unit'], r['target'] or '')
    Console().print(table)


def best_of(function: Callable[[], object], repeats: int = 5) -> Seconds:
    """Return the shortest wall time of several calls."""
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        function()
        times.append(time.perf_counter() - begun)
    return min(times)
