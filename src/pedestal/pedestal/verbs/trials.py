"""Verb `trials`: many runs with varied parameters, their statistics, comparison and search."""
import argparse
import dataclasses
import datetime
import math
import pathlib
import re
import sys
import typing
from collections.abc import Sequence

from pedestal import console
from pedestal.verbs import arguments
from pedestal.verbs.arguments import Verb

if typing.TYPE_CHECKING:
    from pedestal_workbench.trials.experiment import Side
    from pedestal_workbench.trials.plan import Plan

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
    with parameters of its own; a side without parameters names the base. --against and --against-param add one side.
    Trial i of all sides has the same seed and drawn values. The side with the best result of --by is printed first.

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
    arguments.add_choice(parser)
    _add_questions(parser)
    arguments.add_workers(parser)
    parser.add_argument('--output', type=pathlib.Path, metavar='DIR', help='output folder; default: '
                        'trials/SCENARIO')
    console.add_all(parser, 'statistics of all results; default: of the result of --by and of the most important ones')
    console.add_json(parser)


def _add_questions(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--side', action='append', nargs='+', default=[], metavar=('NAME', 'NODE.KEY=VALUE'),
                        help='setting to compare with the others (a side): its name, then the parameters that it '
                        'changes, if any; may be repeated')
    parser.add_argument('--against', metavar='SCENARIO', help='scenario to compare with; default: the same scenario')
    parser.add_argument('--against-param', action='append', default=[], metavar='NODE.KEY=VALUE',
                        help='parameter that only the second of two compared settings has, and its value; may be '
                        'repeated')
    parser.add_argument('--by', metavar='RESULT', help='result that ranks the trials and decides a comparison; '
                        'default: pointing_rms_deg')
    parser.add_argument('--require', action='append', default=[], metavar="'RESULT < LIMIT'", help="criterion for a "
                        "trial, with <, <=, > or >=, for example 'pointing_max_deg < 0.1'; may be repeated")
    parser.add_argument('--solve', metavar='NODE.KEY[=LOW:HIGH]', help='parameter whose value is searched, and the '
                        'range of the search; needs --until; default range: that of the parameter')
    parser.add_argument('--until', metavar="'RESULT = LIMIT'", help="goal of the search by --solve: the mean of "
                        "RESULT over the trials is LIMIT, for example 'pointing_rms_deg = 0.02'")


def _trials(options: argparse.Namespace) -> int:
    if bool(options.solve) != bool(options.until):
        raise ValueError(f'--{"solve" if options.solve else "until"}: needs --{"until" if options.solve else "solve"}')
    if options.solve:
        arguments.refuse_given(options, ('side', 'against', 'against_param', 'require', 'by'),
                               'has no effect with --solve')
    console.check_json(options.json)
    _choose(options)
    return _solve(options) if options.solve else _compare(options)


def _choose(options: argparse.Namespace) -> None:
    """Put the satellite, station and pass of the options into the changes that all trials share."""
    choice = arguments.choice(options)
    if not choice.made:
        return
    if choice.which == 'list':
        raise ValueError('--pass list: must be next, N or a UTC; pedestal run --pass list prints the passes')
    from pedestal import satellite
    from pedestal_bringup.scenario import scenario
    now = datetime.datetime.now(datetime.timezone.utc).replace(tzinfo=None)
    found = satellite.chosen(scenario.draft(options.scenario), arguments.variant(options).overrides(), choice,
                             options.duration, now)
    options.param, options.params_file, options.duration = found.changes, [], found.duration
    for line in found.lines:
        print(line)


def _folder(options: argparse.Namespace, name: str) -> pathlib.Path:
    return options.output or pathlib.Path('trials', name)


def _compare(options: argparse.Namespace) -> int:
    from pedestal_results import results
    from pedestal_workbench.trials import monte_carlo, trials_page
    from pedestal_workbench.trials.experiment import Experiment
    sides = _sides(options)
    plan, folder = sides[0].plan, _folder(options, sides[0].plan.name)
    experiment = Experiment(sides, folder, options.by, options.require)
    with monte_carlo.Pool(options.workers, options.scheduler) as pool, console.progress_of_trials() as progress:
        try:
            found = experiment.run(pool, progress)
        except KeyboardInterrupt:
            done, total = experiment.progress
            print(f'pedestal: {done} of {total} trials are in {folder}; the same command continues', file=sys.stderr)
            raise
    page = folder / 'trials.html'
    page.write_text(trials_page.page(found, options.command), encoding='utf-8')
    for line in (*found.sentences, *found.failures):
        print(line)
    by = found.ranking.rpartition('/')[2]
    shown = [by, *(result.name for result in results.RESULTS if result.brief and result.name != by)]
    console.show_trials(f'{plan.runs} trials of {" against ".join(dict.fromkeys(side.plan.name for side in sides))}',
                        found.rows, None if options.all else shown, found.names if len(sides) > 1 else ())
    for line in (*found.sensitivities, *found.worst_lines):
        print(line)
    print(f'table {found.table.file}, page {page}' + ('' if options.all else '; --all prints all results'))
    console.write_json(options.json, {'name': plan.name, 'rows': found.rows})
    return 0


def _solve(options: argparse.Namespace) -> int:
    from pedestal_workbench.trials import experiment, monte_carlo, solve
    from pedestal_workbench.trials.plan import plan
    variant = arguments.variant(options)

    def make_plan(more: Sequence[str]) -> 'Plan':
        return plan(variant.with_(more), options.runs or solve.DEFAULT_RUNS, options.vary, options.sobol)

    nominal = make_plan(())
    wanted = solve.search_range(options.solve, nominal.scenario(0))
    if wanted.key in nominal.varied:
        raise ValueError(f'--solve {wanted.key}: the parameter is varied too')
    aim, folder = solve.goal(options.until, experiment.result_names(nominal)), _folder(options, nominal.name)
    with monte_carlo.Pool(options.workers, options.scheduler) as pool, console.progress_of_trials() as progress:
        count = [0, 0]

        def counted(done: int, total: int) -> None:
            count[:] = done, total
            progress(done, total)
        try:
            found = solve.Search(make_plan, wanted, aim, folder, pool, counted).run()
        except KeyboardInterrupt:
            print(f'pedestal: {count[0]} of {count[1]} trials at the present value of {wanted.key} are in {folder}, '
                  'with those of the values before; the same command continues', file=sys.stderr)
            raise
    print(found.sentence)
    console.show_tried(wanted.key, wanted.unit, found.tried)
    print(f'tables {folder}/{solve.table_prefix(wanted.key)}*.csv')
    console.write_json(options.json, {
        'name': nominal.name, 'rows': [one.row for one in found.tried if one.row], 'parameter': wanted.key,
        'value': found.value if math.isfinite(found.value) else None, 'unit': wanted.unit, 'sentence': found.sentence})
    return 0


def _sides(options: argparse.Namespace) -> 'list[Side]':
    from pedestal_workbench.trials.experiment import Side
    from pedestal_workbench.trials.plan import plan
    first = plan(arguments.variant(options), options.runs, options.vary, options.sobol)
    sides = [Side(first, BASE_SIDE if options.side else '')]

    def add(source: str, more: Sequence[str], label: str, table: str) -> None:
        variant = dataclasses.replace(arguments.variant(options), source=source, seed=first.seed).with_(more)
        sides.append(Side(plan(variant, first.runs, options.vary, options.sobol), label, table))

    if options.against or options.against_param:
        add(options.against or options.scenario, options.against_param, '', 'against')
    # A side without a change is the base; it comes first, so that it may take the place of the label of the base.
    for name, *more in sorted(options.side, key=lambda side: len(side) > 1):
        labels = [side.label for side in sides]
        if not re.fullmatch(r'[\w.-]+', name) or name in labels:
            raise ValueError(f'--side {name}: must be a name of letters, digits, -, _ and ., other than '
                             f'{", ".join(filter(None, labels))}')
        if not more and sides[0].label == BASE_SIDE:
            sides[0] = dataclasses.replace(sides[0], label=name)
        else:
            add(options.scenario, more, name, f'side_{name}')
    return sides


VERBS = {
    'trials': Verb(_add_trials, _trials),
}
