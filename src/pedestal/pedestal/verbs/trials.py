"""Verb `trials`: many runs with varied parameters, their statistics, comparison and search."""
import argparse
import contextlib
import math
import pathlib
import re
import sys
import typing
from collections.abc import Iterable, Sequence

from pedestal import console
from pedestal.verbs import arguments
from pedestal.verbs.arguments import Verb
from pedestal_common.quantities import Row

if typing.TYPE_CHECKING:
    from pedestal_workbench.trials.plan import Plan
    from pedestal_workbench.trials.statistics import Requirement
    from pedestal_workbench.trials.table import Table

WORST_TRIAL_COUNT = 10  # number of the worst trials whose commands are printed
BASE_SIDE = 'base'  # label of the side with the parameters of --param alone, beside labels of --side


def _add_trials(parser: argparse.ArgumentParser) -> None:
    """Each trial has its own seed and gives the same kinds of results as `pedestal run`. A trial runs all nodes in one
    process, without ROS. For each of the worst trials a `pedestal run` command is printed, which runs separate nodes
    and gives the same numbers.

    --vary NODE.KEY=DISTRIBUTION draws a parameter from uniform(low, high), normal(mean, sigma) or choice(a, b, ...).
    With an x after the distribution, as in normal(1, 0.1)x, the drawn number is a factor of the value of the scenario.
    The form --vary FILE.csv reads the trials from a file with a column for each parameter and a row for each trial.

    Rows are written to OUTPUT/trials.csv as soon as they exist. Repeat the command to continue after Ctrl-C or a
    crash. The column `why` of the table holds the verdict on each trial that did not track.

    --side NAME NODE.KEY=VALUE ... adds a side to a comparison and may be repeated. A side is a variant of the scenario
    with parameters of its own. --against and --against-param add one side. Trial i of all sides has the same seed and
    drawn values. The side with the best result of --by is printed first.

    --require 'RESULT < LIMIT' prints the share of the trials that meet a criterion, with its 95 % interval. A trial
    without the result does not meet it.

    --solve NODE.KEY=LOW:HIGH --until 'RESULT = LIMIT' searches for the value of a parameter at which the mean of a
    result reaches a limit. Without LOW:HIGH the search covers the range of the parameter.
    """
    arguments.add_scenario(parser)
    parser.add_argument('--runs', type=int, metavar='N', help='number of trials; default: 100, or the rows of a .csv; '
                        'at each value of --solve: 12')
    parser.add_argument('--vary', action='append', default=[], metavar='NODE.KEY=DISTRIBUTION|FILE.csv',
                        help="varied parameter, for example 'adu.azimuth.load.inertia=normal(1, 0.1)x', or file of "
                        'trials; may be repeated')
    parser.add_argument('--sobol', action='store_true', help='use a Sobol sequence in place of random draws; its '
                        'points fill the ranges evenly')
    arguments.add_duration(parser, 'a trial')
    parser.add_argument('--seed', type=int, metavar='N', help='seed of the first trial; default: value of the '
                        'scenario')
    arguments.add_param(parser)
    arguments.add_params_file(parser)
    _add_questions(parser)
    arguments.add_workers(parser)
    parser.add_argument('--output', type=pathlib.Path, metavar='DIR', help='output folder; default: '
                        'trials/SCENARIO')
    console.add_all(parser, 'statistics of all results; default: of the result of --by and of the most important ones')
    console.add_json(parser)


def _add_questions(parser: argparse.ArgumentParser) -> None:
    """Add sides of a comparison, criteria and search."""
    parser.add_argument('--side', action='append', nargs='+', default=[], metavar=('NAME', 'NODE.KEY=VALUE'),
                        help='side of a comparison: its name, then the parameters that it changes; may be repeated')
    parser.add_argument('--against', metavar='SCENARIO', help='scenario of the second side of a comparison')
    parser.add_argument('--against-param', action='append', default=[], metavar='NODE.KEY=VALUE',
                        help='parameter of the second side and its value; may be repeated')
    parser.add_argument('--by', metavar='RESULT', help='result that ranks the trials and decides a comparison; '
                        'default: pointing_rms_deg')
    parser.add_argument('--require', action='append', default=[], metavar="'RESULT < LIMIT'", help="criterion for a "
                        "trial, with <, <=, > or >=, for example 'pointing_max_deg < 0.1'; may be repeated")
    parser.add_argument('--solve', metavar='NODE.KEY[=LOW:HIGH]', help='parameter whose value is searched, and the '
                        'range of the search')
    parser.add_argument('--until', metavar="'RESULT = LIMIT'", help="limit that the mean of a result reaches at the "
                        "value of --solve, for example 'pointing_rms_deg = 0.02'")


def _trials(options: argparse.Namespace) -> int:
    """Run the trials, print their statistics, write table, page and rows. Return exit code 0."""
    _check_together(options)
    console.check_json(options.json)
    return _solve(options) if options.solve else _compare(options)


def _check_together(options: argparse.Namespace) -> None:
    """Raise ValueError for options that exclude or need each other."""
    if bool(options.solve) != bool(options.until):
        raise ValueError(f'--{"solve" if options.solve else "until"}: needs --{"until" if options.solve else "solve"}')
    if options.solve:
        arguments.refuse_given(options, ('side', 'against', 'against_param', 'require', 'by'),
                               'has no effect with --solve')


def _compare(options: argparse.Namespace) -> int:
    """Run the trials of all sides. Return exit code 0."""
    from pedestal_results import results
    from pedestal_workbench.trials import comparison, statistics, trials_page
    plans, labels, files = _sides(options)
    known = _result_names(plans[0])
    required = [statistics.requirement(text, known) for text in options.require]
    if options.by:
        statistics.check_result(f'--by {options.by}', options.by, known)
    folder = options.output or pathlib.Path('trials', plans[0].name)
    tables = _tables(options, plans, files, folder)
    # differences: parameters in which the sides differ; names: label of a side, else these; full: both
    differences = comparison.names(*plans)
    names = [label or text for label, text in zip(labels, differences)]
    full = [f'{label} ({text})' if label else text for label, text in zip(labels, differences)]
    ranking = statistics.ranked_by(tables[0], options.by)
    order = comparison.ranked(tables, ranking) if len(plans) > 1 else [0]
    best = order[0]

    def pair(first: int, second: int, names: Sequence[str] = full) -> comparison.Sides:
        return comparison.Sides(names[first], names[second], tables[first], tables[second])

    rows = [row for other in range(1, len(plans)) for row in comparison.rows(pair(0, other, names))]
    for place in order:
        name, table = names[place], tables[place]
        rows += [*statistics.of_results(name, table), *statistics.of_requirements(name, table, required),
                 *statistics.of_questions(name, table), *statistics.of_sensitivity(name, table)]
    lines = [comparison.unchanged(plans[best], plans[other]) or comparison.sentence(pair(best, other), ranking)
             for other in order[1:]]
    lines += _requirement_lines(rows, required)
    shown = trials_page.read(plans[0], tables[0], ranking, pair(best, order[1]) if lines and len(plans) > 1 else None,
                             lines, options.command, WORST_TRIAL_COUNT)
    file = folder / 'trials.html'
    file.write_text(trials_page.page(shown, rows), encoding='utf-8')
    print('\n'.join(lines), end='\n' if lines else '')
    for name, table in zip(names, tables):
        if line := statistics.failures(table):
            print(f'{name}: {line}')
    by = ranking.rpartition('/')[2]
    shown_names = [by, *(result.name for result in results.RESULTS if result.brief and result.name != by)]
    title = f'{plans[0].runs} trials of {plans[0].name}'
    console.show_trials(f'{title}: {" against ".join(names)}' if len(names) > 1 else title, rows,
                        None if options.all else shown_names)
    if sensitivities := _sensitivity_lines(rows, by):
        print('\n'.join(sensitivities))
    print(f'the worst trials by {ranking}:', *_worst_lines(plans[0], tables[0], ranking, shown.worst), sep='\n')
    print(f'table {tables[0].file}, page {file}' + ('' if options.all else '; --all prints all results'))
    console.write_json(options.json, {'name': plans[0].name, 'rows': rows})
    return 0


def _tables(options: argparse.Namespace, plans: 'Sequence[Plan]', files: Iterable[str],
            folder: pathlib.Path) -> 'list[Table]':
    """Run the trials that are not yet in the tables of a folder, and return the tables, one for each plan."""
    from pedestal_workbench.trials import ensemble, monte_carlo
    with contextlib.ExitStack() as stack:
        tables = [stack.enter_context(ensemble.open_table(plan, folder, file)) for plan, file in zip(plans, files)]
        pool = stack.enter_context(monte_carlo.Pool(options.workers, options.scheduler))
        progress = stack.enter_context(console.progress_of_trials())
        try:
            ensemble.run_missing_trials(plans, tables, pool, progress)
        except KeyboardInterrupt:
            done = sum(table.count_in_file for table in tables)
            print(f'pedestal: {done} of {sum(plan.runs for plan in plans)} trials are in {folder}; the same command '
                  'continues', file=sys.stderr)
            raise
    return tables


def _worst_lines(plan: 'Plan', table: 'Table', ranking: str, worst: Iterable[int]) -> list[str]:
    """Return a line for each of the worst trials: its result, its command and the verdict on it."""
    from pedestal_results import intervals
    from pedestal_workbench.trials import statistics
    values, whys = table.column(ranking), table.text(statistics.why_column(ranking))
    return [f'{intervals.number(values[i] if math.isfinite(values[i]) else None):>10}  {plan.command(i)}'
            + (f'  # {whys[i]}' if whys[i] else '') for i in worst]


def _solve(options: argparse.Namespace) -> int:
    """Search for the parameter value that --solve and --until define. Return exit code 0."""
    from pedestal_workbench.trials import monte_carlo, solve
    from pedestal_workbench.trials.plan import plan

    def make_plan(more: Sequence[str]) -> 'Plan':
        return plan(options.scenario, options.runs or solve.DEFAULT_RUNS, options.vary, (*options.param, *more),
                    options.seed, options.duration, options.sobol, options.params_file)

    nominal = make_plan(())
    wanted = solve.search_range(options.solve, nominal.scenario(0))
    if wanted.key in nominal.varied:
        raise ValueError(f'--solve {wanted.key}: the parameter is varied too')
    aim = solve.goal(options.until, _result_names(nominal))
    folder = options.output or pathlib.Path('trials', nominal.name)
    with contextlib.ExitStack() as stack:
        pool = stack.enter_context(monte_carlo.Pool(options.workers, options.scheduler))
        progress = stack.enter_context(console.progress_of_trials())
        found = solve.Search(make_plan, wanted, aim, folder, pool, progress).run()
    print(found.sentence)
    console.show_tried(wanted.key, wanted.unit, found.tried)
    print(f'tables {folder}/{solve.table_prefix(wanted.key)}*.csv')
    console.write_json(options.json, {
        'name': nominal.name, 'rows': [one.row for one in found.tried if one.row], 'parameter': wanted.key,
        'value': found.value if math.isfinite(found.value) else None, 'unit': wanted.unit, 'sentence': found.sentence})
    return 0


def _sides(options: argparse.Namespace) -> 'tuple[list[Plan], list[str], list[str]]':
    """Return (Plans, labels, names of the tables) of the trials and of all other sides. Raises ValueError."""
    from pedestal_workbench.trials.plan import plan
    first = plan(options.scenario, options.runs, options.vary, options.param, options.seed, options.duration,
                 options.sobol, options.params_file)
    plans, labels, files = [first], [BASE_SIDE if options.side else ''], ['trials']

    def add(source: str, more: Sequence[str], label: str, file: str) -> None:
        plans.append(plan(source, first.runs, options.vary, (*options.param, *more), first.seed,
                          options.duration, options.sobol, options.params_file))
        labels.append(label)
        files.append(file)

    if options.against or options.against_param:
        add(options.against or options.scenario, options.against_param, '', 'against')
    for name, *more in options.side:
        if not re.fullmatch(r'[\w.-]+', name) or name in labels:
            raise ValueError(f'--side {name}: must be a name of letters, digits, -, _ and ., other than '
                             f'{", ".join(filter(None, labels))}')
        if not more:
            raise ValueError(f'--side {name}: needs at least one NODE.KEY=VALUE')
        add(options.scenario, more, name, f'side_{name}')
    return plans, labels, files


def _result_names(plan: 'Plan') -> list[str]:
    """Return the names of the results of the trials of a Plan, with the names of its beams."""
    from pedestal_workbench.trials.ensemble import TRIAL_RESULTS
    return [f'{prefix}{result}' for prefix in plan.scenario(0).prefixes for result in TRIAL_RESULTS]


def _requirement_lines(rows: Iterable[Row], required: 'Iterable[Requirement]') -> list[str]:
    """Return a line for each requirement and case: the share of the trials that meet it, and the trials without the
    result."""
    from pedestal_results import intervals
    found = []
    for one in required:
        for row in rows:
            if row['metric'] == f'require({one.text})/rate':
                count = round((row['value'] or 0.0) * row['runs'] / 100.0)
                left_out = ', '.join(f'{number} {word}' for word, number in row['left_out'].items())
                without = f'; without the result: {left_out}' if left_out else ''
                found.append(f'{row["case"]}: {one.text} in {count} of {row["runs"]} trials, {row["value"]:.3g} % '
                             f'({intervals.interval_text(row)} %){without}')
    return found


def _sensitivity_lines(rows: Iterable[Row], ranking: str) -> list[str]:
    """Return lines with the sensitivity of the ranking result to each varied parameter, the strongest first. A line
    names its case if there are several."""
    from pedestal_results import intervals
    # Because eta_squared is the square of a correlation, its square root is compared with a rank correlation.
    powers = {f'{ranking}/rank_correlation': 1.0, f'{ranking}/eta_squared': 0.5}
    found = [row for row in rows if row['metric'].partition('(')[0] in powers]
    several = len({row['case'] for row in found}) > 1
    return [f'{row["case"]}: ' * several
            + f'{row["metric"]}: {intervals.number(row["value"])} ({intervals.interval_text(row)})'
            for row in sorted(found, key=lambda row: -abs(row['value'] or 0.0)**powers[
                row['metric'].partition('(')[0]])]


VERBS = {
    'trials': Verb(_add_trials, _trials),
}
