"""Output of the verbs of the command line: progress bars and tables on a terminal, and rows of results as JSON."""
from __future__ import annotations

import contextlib
import functools
import json
import math
import pathlib
import shutil
import string
import sys
import textwrap
import typing
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager

from pedestal_common.text_files.text_table import Cell, Column, TextTable

if typing.TYPE_CHECKING:    # these imports are slow, and most verbs need none of them
    import argparse
    from types import ModuleType

    from rich import progress
    from rich.table import Table as RichTable

    from pedestal_common.quantities import Row, Seconds
    from pedestal_results.results import Result, Values
    from pedestal_station.night import Night
    from pedestal_workbench.trials.solve import Tried

    _Columns: typing.TypeAlias = Iterable[progress.ProgressColumn]

EXIT_ERROR, EXIT_WRONG_COMMAND, EXIT_DISTURBED, EXIT_FAILED_RUN, EXIT_STOPPED = 1, 2, 3, 4, 130
EXIT_CODES = {
    0: 'the run came to its planned end, and the recording is complete',
    EXIT_ERROR: 'the run did not start, a node failed, or the recording is not complete; the last line states the '
                'reason',
    EXIT_WRONG_COMMAND: 'the command line has a wrong argument, or names a file that cannot be used',
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

MAX_SIDE_COLUMNS = 10  # largest width of the name of a compared side in a table; a letter replaces a longer one
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


def _show(table: TextTable, title: str = '', width: int = 0, framed: bool = False) -> None:
    """Print a title and a table by rich, at least `width` characters wide. framed: with a frame and wrapped cells."""
    _print(_drawn(table, title, framed), width)


def _print(shown: RichTable, width: int = 0) -> None:
    from rich.console import Console
    console = Console(width=max(Console().width, width) if width else None)
    with console.capture() as captured:     # because rich ends the process if the reader of a pipe has closed it
        console.print(shown)
    print(captured.get(), end='')


def _drawn(table: TextTable, title: str = '', framed: bool = False) -> RichTable:
    """Return a table for rich, see `_show`."""
    from rich.box import HEAVY_HEAD, SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text
    box, padding = (HEAVY_HEAD, (0, 1)) if framed else (SIMPLE_HEAD, (0, 1, 0, 0))
    shown = Table(title=Text(title) if title else None, title_justify='left', box=box, padding=padding,
                  pad_edge=framed)
    for head, right in zip(table.heads, table.right):
        shown.add_column(Text(head), justify='right' if right else 'left', no_wrap=not framed)
    for row in table.rows:
        shown.add_row(*map(Text, row))
    return shown


def _show_fitted(columns: Sequence[Column], rows: Sequence[Sequence[Cell]], optional: Sequence[str],
                 title: str = '') -> list[str]:
    """Print a table without those `optional` columns that are too many for the terminal, the last ones first. Return
    the names of the columns that are left out. A row stays one line."""
    from rich.console import Console
    from rich.measure import Measurement
    wide, left_out = Console(width=10 * MIN_TABLE_COLUMNS), list[str]()
    while True:
        kept = [i for i, column in enumerate(columns) if (column if isinstance(column, str) else column[0])
                not in left_out]
        drawn = _drawn(TextTable([columns[i] for i in kept], [[row[i] for i in kept] for row in rows]))
        needed = Measurement.get(wide, wide.options, drawn).maximum
        if needed <= Console().width or len(left_out) == len(optional):
            break
        left_out.append(optional[-1 - len(left_out)])
    print(title, end='\n' if title else '')
    _print(drawn, needed)
    return left_out


def show_results(title: str, columns: Sequence[str], results: Sequence[Values], whole: Values,
                 marks: Iterable[Mapping[str, str]] = ()) -> None:
    """Print the table of the results of a run, with a column for each beam.

    columns   names of the beams; '' for a single column
    whole     results of the run as a whole
    marks     {name: note on a value that is not as expected} of each column
    """
    from pedestal_results.intervals import measured
    marked: dict[str, list[str]] = {}
    for column, notes in zip(columns, marks):
        for metric, text in notes.items():
            marked.setdefault(metric, []).append(f'{column}: {text}' if column else text)
    units = {metric: unit for values in results for metric, (_, unit) in values.items()}
    rows = [(metric, *(measured(values.get(metric, (math.nan,))[0]) for values in results), unit,
             ', '.join(marked.get(metric, ()))) for metric, unit in units.items()]
    rows += [(metric, measured(value), *[''] * (len(columns) - 1), unit, '')
             for metric, (value, unit) in whole.items()]
    heads = ('metric', *((column or 'value', '>') for column in columns), 'unit', *(['off'] if marked else ()))
    print(title)
    _show(TextTable(heads, rows), width=MIN_TABLE_COLUMNS if len(columns) > 1 else 0, framed=True)


def show_measured(title: str, rows: Iterable[Row]) -> None:
    """Print rows of single numbers as a table."""
    _show(TextTable(('case', 'metric', ('value', '>.4g'), 'unit', ('target', '>')),
                    [(row['case'], row['metric'], row['value'], row['unit'], row['target']) for row in rows]),
          title, framed=True)


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


def show_study(title: str, rows: Iterable[Row], missed: Callable[[Row], bool]) -> None:
    """Print the rows of a study as a table; missed: function that returns True for a row that misses its target."""
    from pedestal_results.intervals import interval_text, number
    _show(TextTable(('case', 'metric', ('paper', '>'), ('ours', '>'), ('95 % interval', '>'), 'target', 'unit', ''),
                    [(row['case'], row['metric'], number(row['paper']), number(row['value']), interval_text(row),
                      row['target'], row['unit'], 'MISSED' if missed(row) else '') for row in rows]),
          title, MIN_TABLE_COLUMNS)


def _lettered(rows: Sequence[Row], names: Sequence[str]) -> tuple[list[Row], str]:
    """Return the rows with letters in place of the names of compared sides, and the legend; of short names the same
    rows without a legend."""
    if max(map(len, names), default=0) <= MAX_SIDE_COLUMNS or len(names) > len(string.ascii_uppercase):
        return list(rows), ''
    letters = dict(zip(names, string.ascii_uppercase))
    cases = {f'{a} against {b}': f'{letters[a]} against {letters[b]}' for a in names for b in names} | letters
    # The case of a beam is that of its side, '/' and the beam.
    return ([{**row, 'case': next((text + row['case'][len(case):] for case, text in cases.items()
                                   if f'{row["case"]}/'.startswith(f'{case}/')), row['case'])} for row in rows],
            ''.join(f'\n{letter}: {name}' for name, letter in letters.items()))


def show_trials(title: str, rows: Sequence[Row], metrics: Sequence[str] | None = None,
                names: Sequence[str] = ()) -> None:
    """Print the statistics of results over trials as a table, and the comparisons of sides as a second one.

    metrics     names of the printed results in their order, None for all rows. The rows of a comparison are printed
                for the first of these results only.
    names       of the compared sides; a letter takes the place of a long one
    """
    from pedestal_results.intervals import interval_text, number
    from pedestal_workbench.trials.statistics import coverage
    rows, legend = _lettered(rows, names)
    of_results: dict[tuple[str, str, str], dict[str, Row]] = {}
    others: list[Row] = []
    for row in rows:
        metric, _, key = row['metric'].rpartition('/')
        if metrics is not None and metric not in metrics:
            continue
        if key in ('mean', 'p05', 'p50', 'p95', 'max'):
            of_results.setdefault((row['case'], metric, row['unit']), {})[key] = row
        elif key in _COMPARISON_KEYS and (metrics is None or metric == metrics[0]):
            others.append(row)
    order = metrics or list(dict.fromkeys(metric for _, metric, _ in of_results))
    lines = [(metric, case, number(found['mean']['value']), interval_text(found['mean']),
              *(number(found[key]['value']) for key in ('p05', 'p50', 'p95', 'max')), coverage(found['mean']), unit)
             for (case, metric, unit), found in sorted(of_results.items(), key=lambda item: order.index(item[0][1]))]
    numbers = ('mean', '95 % interval', '5 %', 'median', '95 %', 'largest', 'trials')
    optional = ['95 % interval', 'largest', 'median', '95 %', '5 %']
    # A case or a number of trials that is the same in each row, as the title states it, goes before the interval.
    counts, cases = ({line[place] for line in lines} for place in (-2, 1))
    optional[1:1] = ['trials'] * (len(counts) == 1 and counts.pop().isdecimal()) + ['case'] * (len(cases) == 1)
    left_out = _show_fitted(('result', 'case', *((name, '>') for name in numbers), 'unit'), lines, optional,
                            title + legend)
    if others:
        left_out += _show_compared(others, metrics[0] if metrics else '')
    if left_out:
        print(f'not shown for lack of space: {", ".join(dict.fromkeys(left_out))}; a wider terminal '
              f'(COLUMNS={MIN_TABLE_COLUMNS}) or --json has them')


def _show_compared(rows: Sequence[Row], result: str) -> list[str]:
    """Print the rows of comparisons as a table. Return the columns that are left out. result: name of the result in
    all rows, '' for several; what is the same in all rows is in the title."""
    from pedestal_results.intervals import interval_text, number
    from pedestal_workbench.trials.statistics import coverage
    cases = {row['case'] for row in rows}
    lines = [[row['metric'].removeprefix(f'{result}/'), row['case'], number(row['value']), interval_text(row),
              coverage(row), row['unit']] for row in _without_hidden_factors(rows)]
    columns: list[Column] = ['', 'case', ('value', '>'), ('95 % interval', '>'), ('trials', '>'), 'unit']
    if len(cases) == 1:
        columns.pop(1)
        lines = [[line[0], *line[2:]] for line in lines]
    title = ': '.join(filter(None, (result, *(cases if len(cases) == 1 else ()))))
    return _show_fitted(columns, lines, ('95 % interval', 'trials'), title)


def _without_hidden_factors(rows: Sequence[Row]) -> list[Row]:
    """Return the rows of comparisons with the ratio of two means in place of their gain in percent if it is a factor
    above 2 or below 1/2, else with the gain."""
    factors = {(row['case'], row['metric'].removesuffix('/ratio')) for row in rows
               if row['metric'].endswith('/ratio') and not 0.5 <= (row['value'] or 1.0) <= 2.0}
    return [row for row in rows for metric, _, key in (row['metric'].rpartition('/'),)
            if key not in ('gain', 'ratio') or (key == 'ratio') == ((row['case'], metric) in factors)]


_COMPARISON_KEYS = 'rate', 'difference', 'gain', 'ratio', 'wins'    # of the rows that are no statistics of a result


def show_night(night: Night) -> None:
    """Print the plan of a night as a table."""
    from pedestal_station.outputs import words
    left_out = _show_fitted(words.COLUMNS, words.cells(night), words.OPTIONAL_COLUMNS, words.title(night))
    if left_out:
        print(f'not shown for lack of space: {", ".join(left_out)}; a wider terminal (COLUMNS={MIN_TABLE_COLUMNS}), '
              '--csv or --html has them')


def show_tried(key: str, unit: str, tried: Iterable[Tried]) -> None:
    """Print the values that a search has tried as a table; key, unit: name and unit of the parameter of the search."""
    from pedestal_results.intervals import interval_text, number
    from pedestal_workbench.trials.solve import reason
    lines = []
    for one in tried:
        cells = ('', '', '', '')
        if one.row:
            lost = one.row['mean_loss_s']
            cells = (number(one.row['value']), interval_text(one.row), one.row['unit'],
                     '' if lost is None else f'{lost:.3g} s')
        lines.append((f'{one.value:.6g}', *cells, reason(one)))
    _show_fitted((('value', '>'), ('mean', '>'), ('95 % interval', '>'), 'unit', ('lost', '>'), 'trials'), lines, (),
                 f'{key} [{unit}]' if unit else key)
