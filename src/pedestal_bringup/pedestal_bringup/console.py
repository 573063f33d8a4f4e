"""Output of the verbs: progress and tables of results on a terminal, rows as JSON."""
import contextlib
import json
import math
import pathlib
import shutil
import sys
import textwrap

EXIT_STOPPED = 130
EXIT_WRONG_COMMAND = 2
EXIT_DISTURBED = 3

STDOUT = pathlib.Path('/dev/stdout')
"""What --json - stands for."""

WIDEST_NAME, WIDEST, SENTENCE = 44, 24, 40
"""Columns that the name of a list and its other cells have to themselves, a longer one moves what follows; and the
least that a sentence beside them has, which stands below them otherwise."""

TABLE_WIDTH = 150
"""Columns that a table of results may take on any terminal, so that a row stays one line."""


@contextlib.contextmanager
def progress_of_run(duration):
    """Context with a function progress(seconds of the run): a bar on a terminal, nothing in a pipe. duration [s]."""
    if not sys.stderr.isatty():
        yield lambda seconds: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
    columns = (TextColumn('{task.description}'), BarColumn(), TextColumn('{task.completed:.0f} / {task.total:.0f} s'),
               TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task('starting nodes (the first start compiles the laws)', total=duration)

        def advance(seconds):
            bar.update(task, completed=seconds, description='running' if seconds > 0.0 else None)
        yield advance


@contextlib.contextmanager
def progress_of_share():
    """Context with a function progress(fraction done, what comes next): a bar on a terminal, nothing in a pipe."""
    if not sys.stderr.isatty():
        yield lambda share, text: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
    with Progress(BarColumn(), TextColumn('{task.description}'), TimeElapsedColumn(),
                  console=Console(stderr=True)) as bar:
        task = bar.add_task('compiling the laws (the first time)', total=1.0)
        yield lambda share, text: bar.update(task, completed=share, description=text)


def add_json(parser):
    """The option --json FILE of a verb that measures."""
    parser.add_argument('--json', type=lambda text: STDOUT if text == '-' else pathlib.Path(text), metavar='FILE',
                        help='write the result rows; -: to the standard output, and all else to the standard error')


def check_json(path):
    """Raises ValueError where --json cannot be written."""
    if path and (path.is_dir() or not path.parent.is_dir()):
        raise ValueError(f'--json {path}: must be a file in a directory that exists')


def write_json(path, content):
    """Write content as JSON to the path of --json; nothing where that is None."""
    if path:
        path.write_text(json.dumps(content, indent=1) + '\n')


def show_list(rows):
    """Print rows of texts in columns; on a terminal the last is wrapped to its width, in a pipe a row is a line."""
    rows = list(rows)
    widths = [min(max(len(row[i]) for row in rows), WIDEST if i else WIDEST_NAME) for i in range(len(rows[0]) - 1)]
    indent = sum(widths) + 2 * len(widths)
    terminal = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    for *cells, sentence in rows:
        head = '  '.join(f'{cell:{width}}' for cell, width in zip(cells, widths))
        if terminal is None:
            print(f'{head}  {sentence}')
        elif terminal < indent + SENTENCE:
            # Too narrow for a column of sentences: they go below.
            print(head.rstrip(), textwrap.indent(textwrap.fill(sentence, terminal - 4), ' ' * 4), sep='\n')
        else:
            first, *more = textwrap.wrap(sentence, terminal - indent) or ['']
            print(f'{head:{indent - 2}}  {first}', *(' ' * indent + line for line in more), sep='\n')


def show_results(title, columns, results, whole):
    """Print a table of metrics. columns: heads, '' for a single one; results: {metric: (value, unit)} of each column;
    whole: {metric: (value, unit)} of the run."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text
    table = Table(title=Text(title), title_justify='left')
    table.add_column('metric')
    for column in columns:
        table.add_column(column or 'value', justify='right')
    table.add_column('unit')
    for metric, (_, unit) in results[0].items():
        table.add_row(metric, *(_measured(values[metric][0]) for values in results), unit)
    for metric, (value, unit) in whole.items():
        table.add_row(metric, _measured(value), *[''] * (len(columns) - 1), unit)
    Console(width=max(Console().width, TABLE_WIDTH) if len(columns) > 1 else None).print(table)


def _measured(value):
    return f'{value:.6g}' if math.isfinite(value) else 'not measured'


def show_study(title, rows, missed):
    """Print the table of a study's rows; missed(row) -> whether its target is not met."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    def number(value):
        return '-' if value is None else f'{value:.4g}'

    table = Table(title=title, title_justify='left', box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for name, justify in (('case', 'left'), ('metric', 'left'), ('paper', 'right'), ('ours', 'right'),
                          ('95 % interval', 'right'), ('target', 'left'), ('unit', 'left'), ('', 'left')):
        table.add_column(name, justify=justify, no_wrap=True)
    for row in rows:
        interval = f'{number(row["ci_low"])} to {number(row["ci_high"])}' if 'runs' in row else ''
        table.add_row(row['case'], row['metric'], number(row['paper']), number(row['value']), interval,
                      row['target'] or '', row['unit'], 'MISSED' if missed(row) else '')
    Console(width=max(Console().width, TABLE_WIDTH)).print(table)
