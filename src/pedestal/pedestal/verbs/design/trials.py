"""run a scenario many times with varied parameters, and print statistics and the worst trials

Each trial has its own seed. It yields the same kinds of results as `pedestal run`. A trial runs all nodes in one
process, without ROS. For each of the worst trials a `pedestal run` command is printed, which runs separate nodes and
gives the same numbers.

--vary NODE.KEY=DISTRIBUTION draws a parameter from uniform(low, high), normal(mean, sigma) or choice(a, b, ...). With
an x after the distribution, as in normal(1, 0.1)x, the drawn number is a factor of the value of the scenario. The
form --vary FILE.csv reads the trials from a file with a column for each parameter and a row for each trial.

Rows are written to OUTPUT/trials.csv as soon as they exist. Repeat the command to continue after Ctrl-C or a crash.
--against and --against-param compare two variants. Trial i of both variants has the same seed and drawn values.
"""
import argparse
import contextlib
import pathlib
import sys
import typing
from collections.abc import Iterable, Mapping

from pedestal.verbs import arguments
from pedestal_analysis import console

if typing.TYPE_CHECKING:
    from pedestal_analysis.trials.plan import Plan

WORST_TRIAL_COUNT = 10
"""Number of the worst trials whose commands are printed."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add scenario, varied parameters, number and processes of the trials, and the other side of a comparison."""
    arguments.add_scenario(parser)
    parser.add_argument('--runs', type=int, metavar='N', help='number of trials; default: 100, or the rows of a .csv')
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
    parser.add_argument('--against', metavar='SCENARIO', help='scenario of the second variant')
    parser.add_argument('--against-param', action='append', default=[], metavar='NODE.KEY=VALUE',
                        help='parameter of the second variant and its value; may be repeated')
    parser.add_argument('--by', metavar='RESULT', help='result that ranks the trials and decides a comparison; '
                        'default: pointing_rms_deg')
    arguments.add_workers(parser)
    parser.add_argument('--output', type=pathlib.Path, metavar='DIR', help='output folder; default: '
                        'trials/SCENARIO')
    console.add_json(parser)


def main(options: argparse.Namespace) -> int:
    """Run the trials, print their statistics, write table, page and rows. Return exit code 0."""
    from pedestal_analysis.report import trials_page
    from pedestal_analysis.trials import comparison, ensemble, monte_carlo, statistics
    plans = _plans(options)
    console.check_json(options.json)
    folder = options.output or pathlib.Path('trials', plans[0].name)
    with contextlib.ExitStack() as stack:
        tables = [stack.enter_context(ensemble.open_table(plan, folder, name))
                  for plan, name in zip(plans, ('trials', 'against'))]
        pool = stack.enter_context(monte_carlo.Pool(options.workers, options.scheduler))
        progress = stack.enter_context(console.progress_of_trials())
        try:
            ensemble.run_missing_trials(plans, tables, pool, progress)
        except KeyboardInterrupt:
            print(f'pedestal: {sum(len(table.rows) for table in tables)} of {sum(plan.runs for plan in plans)} trials '
                  f'are in {folder}; the same command continues', file=sys.stderr)
            raise
    names = comparison.names(*plans) if len(plans) > 1 else (plans[0].name,)
    sides = comparison.Sides(*names, *tables) if len(plans) > 1 else None
    ranking = statistics.ranked_by(tables[0], options.by)
    rows = comparison.rows(sides) if sides else []
    for name, table in zip(names, tables):
        rows += [*statistics.of_results(name, table), *statistics.of_questions(name, table),
                 *statistics.of_sensitivity(name, table)]
    shown = trials_page.read(plans[0], tables[0], ranking, sides, options.command, WORST_TRIAL_COUNT)
    file = folder / 'trials.html'
    file.write_text(trials_page.page(shown, rows), encoding='utf-8')
    console.show_trials(f'{plans[0].runs} trials: {" against ".join(names)}', rows)
    for name, table in zip(names, tables):
        if line := statistics.failures(table):
            print(f'{name}: {line}')
    print('\n'.join(_correlation_lines(rows, ranking)))
    print(f'the worst trials by {ranking}:')
    for i in shown.worst:
        print(f'{console.number(tables[0].column(ranking)[i]):>10}  {plans[0].command(i)}')
    if sides:
        print(comparison.sentence(sides, ranking))
    print(f'table {tables[0].file}, page {file}')
    console.write_json(options.json, {'name': plans[0].name, 'rows': rows})
    return 0


def _plans(options: argparse.Namespace) -> 'list[Plan]':
    """Return the Plan of the trials and, for a comparison, the Plan of the other side."""
    from pedestal_analysis.trials.plan import plan
    changes = arguments.changes(options)
    first = plan(options.scenario, options.runs, options.vary, changes, options.seed, options.duration, options.sobol)
    if not (options.against or options.against_param):
        return [first]
    return [first, plan(options.against or options.scenario, first.runs, options.vary,
                        (*changes, *options.against_param), first.seed, options.duration, options.sobol)]


def _correlation_lines(rows: Iterable[Mapping[str, typing.Any]], ranking: str) -> list[str]:
    """Return lines with the correlation of the ranking result with each varied parameter, the strongest first."""
    found = [row for row in rows if row['metric'].startswith(f'{ranking}/rank_correlation(')]
    return [f'{row["metric"]}: {console.number(row["value"])} ({console.interval(row)})'
            for row in sorted(found, key=lambda row: -abs(row['value']))]
