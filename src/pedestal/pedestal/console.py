"""Output of the verbs of the command line: progress bars and tables on a terminal, and rows of results as JSON."""
from __future__ import annotations

import contextlib
import functools
import json
import math
import pathlib
import shutil
import sys
import textwrap
import typing
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager

from pedestal_results.row_text import interval, measured, number

if typing.TYPE_CHECKING:    # these imports are slow, and most verbs need none of them
    import argparse
    from types import ModuleType

    from rich import progress
    from rich.table import Table as RichTable
    from rich.text import TextType

    from pedestal_common.quantities import Row, Seconds
    from pedestal_results.results import Result, Values
    from pedestal_workbench.trials.solve import Tried

    _Columns: typing.TypeAlias = Iterable[progress.ProgressColumn]

EXIT_ERROR, EXIT_WRONG_COMMAND, EXIT_DISTURBED, EXIT_FAILED_RUN, EXIT_STOPPED = 1, 2, 3, 4, 130
EXIT_CODES = {
    0: 'the run came to its planned end, and the recording is complete',
    EXIT_ERROR: 'the run did not start, a node failed, or the recording is not complete; the last line states the '
                'reason',
    EXIT_WRONG_COMMAND: 'the command line has a wrong argument',
    EXIT_DISTURBED: 'a realtime run ended early, or its drive lost more than 1 % of its steps (steps in the 5 s after '
                    'a node died are not counted)',
    EXIT_FAILED_RUN: 'the drive tripped, a command of the scenario was refused, or the antenna never tracked a '
                     'target that it should have tracked; the verdict above the table states which',
    EXIT_STOPPED: 'the run was stopped, for example by Ctrl-C'}
"""{exit code of `pedestal run`: its meaning}. The codes 1, 3 and 130 take precedence over 4."""

MAX_JSON_MARK_BYTES = 100  # number of first bytes by which a file of JSON is recognised
STDOUT_PATH = pathlib.Path('/dev/stdout')  # path of the option --json without a file name, or with the file name -

MAX_NAME_COLUMNS, MAX_CELL_COLUMNS, MIN_SENTENCE_COLUMNS = 44, 24, 40
"""Largest width of the names in a list of show_list, of the other cells, and smallest width of the sentences
[characters]. A longer cell moves the rest of its row to the right. On a narrower terminal, the sentences are printed
below the cells."""

MIN_TABLE_COLUMNS = 150
"""Smallest width of a table of results on any terminal, so that a row stays one line [characters]."""


@contextlib.contextmanager
def _bar(columns: Callable[[ModuleType], _Columns], advance: Callable[..., None], description: str,
         total: float | None = None, rate: str = '') -> Iterator[Callable[..., None]]:
    """Yield a function of the progress: on a terminal it calls advance(bar, task, ...), in a pipe it does nothing."""
    if not sys.stderr.isatty():
        yield lambda *_: None
        return
    from rich import console, progress
    with progress.Progress(*columns(progress), console=console.Console(stderr=True)) as bar:
        yield functools.partial(advance, bar, bar.add_task(description, total=total, rate=rate))


def progress_of_run(duration: Seconds) -> AbstractContextManager[Callable[..., None]]:
    """Return a context with a function progress(time of the run): a bar on a terminal, nothing in a pipe."""
    def advance(bar: progress.Progress, task: progress.TaskID, seconds: Seconds) -> None:
        bar.update(task, completed=seconds, description='running' if seconds > 0.0 else None)
    return _bar(lambda rich: (rich.TextColumn('{task.description}'), rich.BarColumn(),
                              rich.TextColumn('{task.completed:.0f} / {task.total:.0f} s'), rich.TimeElapsedColumn()),
                advance, 'starting nodes (the first start compiles the laws)', duration)


def progress_of_share() -> AbstractContextManager[Callable[..., None]]:
    """Return a context with a function progress(share of the work that is done [-], text): a bar on a terminal,
    nothing in a pipe."""
    def advance(bar: progress.Progress, task: progress.TaskID, share: float, text: str) -> None:
        bar.update(task, completed=share, description=text)
    return _bar(lambda rich: (rich.BarColumn(), rich.TextColumn('{task.description}'), rich.TimeElapsedColumn()),
                advance, 'compiling the laws (first time only)', 1.0)


def progress_of_trials() -> AbstractContextManager[Callable[..., None]]:
    """Return a context with a function progress(trials done, all trials): a bar with the rate of the trials and the
    remaining time on a terminal, nothing in a pipe."""
    def advance(bar: progress.Progress, task: progress.TaskID, done: int, total: int) -> None:
        speed = bar.tasks[0].speed
        bar.update(task, completed=done, total=total)
        if speed:
            bar.update(task, rate=f'{speed:.1f} a second')
    return _bar(lambda rich: (rich.BarColumn(), rich.MofNCompleteColumn(),
                              rich.TextColumn('trials, {task.fields[rate]}'), rich.TimeElapsedColumn(),
                              rich.TextColumn('left'), rich.TimeRemainingColumn()),
                advance, '', rate='compiling the laws (first time only)')


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add the option --json [FILE] to the parser of a verb that measures."""
    parser.add_argument('--json', type=lambda text: STDOUT_PATH if text == '-' else pathlib.Path(text), metavar='FILE',
                        nargs='?', const=STDOUT_PATH, help='file for the results as JSON; without FILE, or with -: '
                        'JSON to standard output, all other output to standard error')


def check_json(path: pathlib.Path | None) -> None:
    """Raise ValueError if the file of --json cannot be written, or if it exists and holds anything but JSON."""
    if path and (path.is_dir() or not path.parent.is_dir()):
        raise ValueError(f'--json {path}: must be a file in a directory that exists')
    if path and path != STDOUT_PATH and path.is_file():
        with path.open('rb') as file:
            begin = file.read(MAX_JSON_MARK_BYTES).lstrip()
        if begin and not begin.startswith((b'{', b'[')):
            raise ValueError(f'--json {path}: exists already and holds no JSON; the file is not overwritten')


def write_json(path: pathlib.Path | None, content: object) -> None:
    """Write content as JSON to the path of --json; do nothing if the path is None."""
    if path:
        path.write_text(json.dumps(content, indent=1) + '\n')


def show_list(rows: Iterable[Sequence[str]]) -> None:
    """Print rows of texts in columns; the last text of a row is a sentence. On a terminal the sentence is wrapped to
    its width. In a pipe a row is one line."""
    rows = list(rows)
    if not rows:
        return
    widths = [min(max(len(row[i]) for row in rows), MAX_CELL_COLUMNS if i else MAX_NAME_COLUMNS)
              for i in range(len(rows[0]) - 1)]
    indent = sum(widths) + 2 * len(widths)
    terminal = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    for *cells, sentence in rows:
        head = '  '.join(f'{cell:{width}}' for cell, width in zip(cells, widths))
        if terminal is None:
            print(f'{head}  {sentence}')
        elif terminal < indent + MIN_SENTENCE_COLUMNS:
            # Because the terminal is too narrow for a column of sentences, they are printed below.
            fits = len(head.rstrip()) <= terminal
            below = (sentence,) if fits else ('  '.join(filter(None, cells[1:])), sentence)
            print(head.rstrip() if fits else cells[0],
                  *(textwrap.indent(textwrap.fill(text, terminal - 4), ' ' * 4) for text in below if text), sep='\n')
        else:
            first, *more = textwrap.wrap(sentence, terminal - indent) or ['']
            print(f'{head:{indent - 2}}  {first}', *(' ' * indent + line for line in more), sep='\n')


def exit_codes() -> str:
    """Return EXIT_CODES as the lines of a help text."""
    return '\n'.join(textwrap.fill(f'{code}: {meaning}.', 100, initial_indent='  ', subsequent_indent='      ')
                     for code, meaning in EXIT_CODES.items())


def show_results(title: str, columns: Sequence[str], results: Sequence[Values], whole: Values,
                 marks: Iterable[Mapping[str, str]] = ()) -> None:
    """Print the table of the results of a run.

    columns   heads, one for each beam; '' for a single column
    whole     results of the run as a whole
    marks     {name: note on a value that is not as expected} of each column
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text
    table = Table()
    table.add_column('metric')
    for column in columns:
        table.add_column(column or 'value', justify='right')
    table.add_column('unit')
    marked: dict[str, list[str]] = {}
    for column, notes in zip(columns, marks):
        for metric, text in notes.items():
            marked.setdefault(metric, []).append(f'{column}: {text}' if column else text)
    if marked:
        table.add_column('off')
    units = {metric: unit for values in results for metric, (_, unit) in values.items()}
    for metric, unit in units.items():
        table.add_row(metric, *(measured(values.get(metric, (math.nan,))[0]) for values in results), unit,
                      *([', '.join(marked.get(metric, ()))] if marked else ()))
    for metric, (value, unit) in whole.items():
        table.add_row(metric, measured(value), *[''] * (len(columns) - 1), unit)
    screen = Console(width=max(Console().width, MIN_TABLE_COLUMNS) if len(columns) > 1 else None)
    screen.print(Text(title))
    screen.print(table)


def add_all(parser: argparse.ArgumentParser,
            what: str = 'all results; default: the eight most important ones') -> None:
    """Add the option --all to the parser of a verb that prints results; what: help text of the option."""
    parser.add_argument('--all', action='store_true', help=what)


def add_explain(parser: argparse.ArgumentParser) -> None:
    """Add the option --explain to the parser of a verb that prints results."""
    parser.add_argument('--explain', action='store_true', help='print the definition of each result as a sentence')


def explain(table: Iterable[Result], names: Container[str]) -> None:
    """Print the definitions of the results in names."""
    show_list((row.name, row.sentence) for row in table if row.name in names)


def _table(title: TextType | None, heads: Iterable[str], left: Container[str]) -> RichTable:
    """Return an empty table; left: heads of the columns that are not aligned to the right."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    table = Table(title=title, title_justify='left', box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for name in heads:
        table.add_column(name, justify='left' if name in left else 'right', no_wrap=True)
    return table


def _print(table: RichTable, more: int = 0) -> None:
    """Print a table at least MIN_TABLE_COLUMNS wide; more: further columns."""
    from rich.console import Console
    Console(width=max(Console().width, MIN_TABLE_COLUMNS + more)).print(table)


def show_study(title: str, rows: Iterable[Row], missed: Callable[[Row], bool]) -> None:
    """Print the rows of a study as a table; missed: function that returns True for a row that misses its target."""
    table = _table(title, ('case', 'metric', 'paper', 'ours', '95 % interval', 'target', 'unit', ''),
                   left=('case', 'metric', 'target', 'unit', ''))
    for row in rows:
        table.add_row(row['case'], row['metric'], number(row['paper']), number(row['value']), interval(row),
                      row['target'] or '', row['unit'], 'MISSED' if missed(row) else '')
    _print(table)


def show_trials(title: str, rows: Sequence[Row], metrics: Sequence[str] | None = None) -> None:
    """Print the statistics of results over trials as a table. rows: of trials.statistics and trials.comparison;
    metrics: names of the printed results in their order, None for all. The rows of a comparison are printed for the
    first of these results only."""
    from rich.text import Text

    from pedestal_workbench.trials.statistics import coverage
    of_results: dict[tuple[str, str, str], dict[str, Row]] = {}
    others: list[Row] = []
    for row in rows:
        metric, _, key = row['metric'].rpartition('/')
        if metrics is not None and metric not in metrics:
            continue
        if key in ('mean', 'p05', 'p50', 'p95', 'max'):
            of_results.setdefault((row['case'], metric, row['unit']), {})[key] = row
        elif key in ('rate', 'difference', 'gain', 'wins') and (metrics is None or metric == metrics[0]):
            others.append(row)
    order = metrics or list(dict.fromkeys(metric for _, metric, _ in of_results))
    table = _table(Text(title), ('result', 'case', 'mean', '95 % interval', '5 %', 'median', '95 %', 'largest',
                                 'trials', 'unit'), left=('case', 'result', 'unit'))
    for case, metric, unit in sorted(of_results, key=lambda key: order.index(key[1])):
        found = of_results[case, metric, unit]
        mean = found['mean']
        table.add_row(metric, case, number(mean['value']), interval(mean),
                      *(number(found[key]['value']) for key in ('p05', 'p50', 'p95', 'max')), coverage(mean), unit)
    for row in others:
        table.add_row(row['metric'], row['case'], number(row['value']), interval(row), '', '', '', '',
                      coverage(row), row['unit'])
    _print(table, max((len(row['case']) for row in rows), default=0))


def show_tried(key: str, unit: str, tried: Iterable[Tried]) -> None:
    """Print the values that a search has tried, in rising order, with the mean of the result at each. key: parameter.
    """
    from pedestal_workbench.trials.solve import reason
    value = f'{key} {f"[{unit}]" if unit else ""}'.strip().replace('[', r'\[')
    table = _table(None, (value, 'mean', '95 % interval', 'unit', 'tracked', 'trials'), left=('unit', 'trials'))
    for one in tried:
        cells = ('', '', '', '')
        if one.row:
            share = one.row['tracked_percent']
            cells = (number(one.row['value']), interval(one.row), one.row['unit'],
                     '' if share is None else f'{share:.3g} %')
        table.add_row(f'{one.value:.6g}', *cells, reason(one))
    _print(table)
