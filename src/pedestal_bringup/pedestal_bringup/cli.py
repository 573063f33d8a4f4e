"""The command line `pedestal`: thin verbs over graph, bag, report, studies and bench."""
import argparse
import contextlib
import inspect
import json
import math
import pathlib
import shlex
import signal
import sys

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from pedestal_common.parameters import ParameterError

EXIT_STOPPED = 130
EXIT_WRONG_COMMAND = 2

RECOMPUTE = """\
Feeds the recorded inputs of a node to its step function and compares what it answers with what was recorded: count and
order of the messages first, then every field. Exit code 1 when something differs beyond its tolerance, or when the
recording never exercised the node (never locked, never in autotrack, never moved).

Exact for a lockstep recording: the same version on the same machine gives the same bits. In a realtime recording a
step gets what had been sent when the next one began: that is what the node had, but for messages that were on their
way to it just then. Services are not recorded: a change of acu/mode or adu/state that the node would not make by
itself is asked for at that step, and counted. Nor are parameters that were changed while running. Diagnostics are not
recomputed.

With --param it does not fail but reports old against new. The recorded antenna does not move with the recomputed
command: compared are the estimate against the recorded truth (error, noise, lag) and the noise of the command; what a
parameter does to the pointing, a new run tells."""


def main(args=None) -> int:
    """Exit code 0; 1 with one line on stderr for anything that went wrong; 2 for a wrong command line."""
    parser = _parser()
    options = parser.parse_args(args)
    options.command = shlex.join(('pedestal', *(sys.argv[1:] if args is None else args)))
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: signal.raise_signal(signal.SIGINT))
    try:
        return options.verb(options)
    except (ParameterError, ValueError, RuntimeError, OSError) as error:
        print(f'pedestal: error: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('pedestal: stopped', file=sys.stderr)
        return EXIT_STOPPED


def _parser():
    parser = argparse.ArgumentParser(prog='pedestal', description='The control system of a tracking antenna: run it, '
                                     'record it, look at it.')
    verbs = parser.add_subparsers(title='verbs', required=True, metavar='VERB')

    run = verbs.add_parser('run', help='run a scenario as separate nodes and record it')
    run.add_argument('scenario', help='name (see `pedestal scenarios`) or path of a .yaml')
    run.add_argument('--pacing', choices=('lockstep', 'realtime'), help='default: what the scenario says')
    run.add_argument('--duration', type=float, metavar='S', help="length of the run in the drive's time")
    run.add_argument('--seed', type=int, metavar='N', help='seed of every noise stream')
    run.add_argument('--bag', type=pathlib.Path, metavar='DIR', help='default: bags/runs/SCENARIO-N')
    run.add_argument('--json', type=pathlib.Path, metavar='FILE', help='write the result rows')
    run.add_argument('--param', action='append', default=[], metavar='NODE.KEY=VALUE',
                     help='change a parameter, as acu.azimuth.feedforward.bandwidth=20; may be repeated')
    run.add_argument('--params-file', type=pathlib.Path, metavar='FILE',
                     help='ROS 2 parameter file whose values replace those of the scenario, as `pedestal tune` writes')
    run.set_defaults(verb=_run)

    scenarios = verbs.add_parser('scenarios', help='list the scenarios')
    scenarios.set_defaults(verb=_scenarios)

    listed = verbs.add_parser('parameters', help='list the parameters of a node: default, range, unit, meaning')
    listed.add_argument('node', help='acu, adu, beam_steering, tracking_receiver, ship_motion, ins, recorder ...')
    listed.set_defaults(verb=_parameters)

    program = verbs.add_parser('program', help='send the program track of a scenario to a running ACU')
    program.add_argument('scenario')
    program.add_argument('--duration', type=float, metavar='S', help='of the run it is for')
    program.add_argument('--param', action='append', default=[], metavar='NODE.KEY=VALUE')
    program.set_defaults(verb=_program)

    verify = verbs.add_parser('verify', help='prove that a recording is complete; exit code 1 with the gaps if not')
    verify.add_argument('bag', type=pathlib.Path)
    verify.set_defaults(verb=_verify)

    recover = verbs.add_parser('recover', help='make a readable bag of what is left in a damaged one')
    recover.add_argument('bag', type=pathlib.Path)
    recover.add_argument('--output', type=pathlib.Path, metavar='DIR', help='default: beside it, BAG-recovered')
    recover.set_defaults(verb=_recover)

    rerun = verbs.add_parser('rerun', help='make a recorded run again and compare; exit code 1 when a message differs')
    rerun.add_argument('recording', type=pathlib.Path)
    rerun.add_argument('--bag', type=pathlib.Path, metavar='DIR', help='of the new run; default: bags/runs/SCENARIO-N')
    rerun.set_defaults(verb=_rerun)

    report = verbs.add_parser('report', help='write a recording as one HTML file with its figures')
    report.add_argument('bag', type=pathlib.Path)
    report.add_argument('--output', type=pathlib.Path, metavar='FILE', help='default: report.html in the bag')
    _add_beam(report)
    report.add_argument('--png', type=pathlib.Path, metavar='DIR', help='also write each figure as PNG')
    report.set_defaults(verb=_report)

    study = verbs.add_parser('study', help='measure the compiled closed loop against the papers: rows and figures')
    study.add_argument('name', nargs='?', metavar='NAME', help='without one: list the studies')
    study.add_argument('--json', type=pathlib.Path, metavar='FILE', help='write the result rows')
    study.add_argument('--output', type=pathlib.Path, metavar='DIR', help='of the figures; default: studies/NAME')
    study.add_argument('--runs', type=int, metavar='N', help='of each case; default: what the study says')
    workers = study.add_mutually_exclusive_group()
    workers.add_argument('--workers', type=int, metavar='N', help='processes for the runs; default: one per core')
    workers.add_argument('--scheduler', metavar='ADDRESS', help="Dask cluster for the runs, as tcp://host:8786; needs "
                         "pip install 'pedestal_bringup[cluster]' here and the pedestal packages there")
    study.set_defaults(verb=_study)

    export = verbs.add_parser('export', help='write a recording as one table per topic, CSV or Parquet')
    export.add_argument('bag', type=pathlib.Path)
    export.add_argument('--format', choices=('csv', 'parquet'), default='csv', help='default: csv')
    export.add_argument('--output', type=pathlib.Path, metavar='DIR', help='default: export in the bag')
    export.add_argument('--topics', nargs='+', action='extend', default=[], metavar='NAME', help='default: all')
    export.add_argument('--overwrite', action='store_true', help='replace tables that are there')
    export.set_defaults(verb=_export)

    _add_recompute(verbs)

    tune = verbs.add_parser('tune', help='find the parameters of a filter or of the feed-forward')
    tune.add_argument('source', metavar='BAG|SCENARIO', help='a recording: innovations; a scenario: pointing error')
    tune.add_argument('--filter', metavar='KIND', help='the kind of filter to tune')
    tune.add_argument('--feedforward', action='store_true', help="the gains that follow from the drive's rate loop")
    tune.add_argument('--axis', choices=('azimuth', 'elevation', 'both'), default='both', help='default: both')
    tune.add_argument('--seed', type=int, metavar='N', help='first seed; default: what the scenario says')
    tune.add_argument('--runs', type=int, metavar='N', help='seeds to tune on, the next one judges; default: 2')
    tune.add_argument('--duration', type=float, metavar='S', help='of a run')
    tune.add_argument('--param', action='append', default=[], metavar='NODE.KEY=VALUE',
                      help='change a parameter of the scenario; may be repeated')
    tune.add_argument('--output', type=pathlib.Path, metavar='FILE', help='default: NAME-KIND.yaml')
    tune.set_defaults(verb=_tune)

    replay = verbs.add_parser('replay', help='publish a recording into a live graph')
    replay.add_argument('bag', type=pathlib.Path)
    into = replay.add_mutually_exclusive_group()
    into.add_argument('--node', nargs='+', action='extend', default=[], metavar='NAME',
                      help='what these nodes read, as acu; default: every topic')
    into.add_argument('--topics', nargs='+', action='extend', default=[], metavar='NAME', help='these topics')
    pace = replay.add_mutually_exclusive_group()
    pace.add_argument('--rate', type=float, default=1.0, metavar='X', help='times real time; default: 1')
    pace.add_argument('--lockstep', action='store_true', help='a step when the nodes have answered the one before')
    replay.add_argument('--start', type=float, default=0.0, metavar='S', help='begin this far into the recording')
    replay.add_argument('--duration', type=float, metavar='S', help='of the recording; default: to its end')
    replay.add_argument('--paused', action='store_true', help='begin with a pause')
    replay.add_argument('--deadline', type=float, default=60.0, metavar='S',
                        help='wall-clock time a reader or an answer is waited for; default: 60')
    replay.set_defaults(verb=_replay)

    bench = verbs.add_parser('bench', help='measure this machine: the lockstep ring, the compiled core, bags')
    bench.add_argument('what', nargs='?', choices=('graph', 'core', 'bag'), help='default: all')
    bench.add_argument('--json', type=pathlib.Path, metavar='FILE')
    bench.set_defaults(verb=_bench)
    return parser


def _add_beam(verb):
    verb.add_argument('--beam', default='', metavar='NAME', help='of a recording of several, as beam_2; default: the '
                      'first')


def _add_recompute(verbs):
    verb = verbs.add_parser('recompute', help='feed recorded inputs to a node again and compare its outputs',
                            description=RECOMPUTE, formatter_class=argparse.RawDescriptionHelpFormatter)
    verb.add_argument('bag', type=pathlib.Path)
    _add_beam(verb)
    verb.add_argument('--node', action='append', default=[], metavar='NODE',
                      help='acu, adu, tracking_receiver, ins or ship_motion; may be repeated; default: every node')
    verb.add_argument('--param', action='append', default=[], metavar='[NODE.]KEY=VALUE',
                      help='change a parameter and report old against new; may be repeated')
    verb.add_argument('--params-file', type=pathlib.Path, metavar='FILE',
                      help='scenario or parameter file of the recorded nodes, where the bag does not say')
    verb.add_argument('--pacing', choices=('lockstep', 'realtime'),
                      help='how inputs belong to steps; default: as the bag says, else realtime')
    verb.add_argument('--absolute', type=float, metavar='X', help='tolerance of every field, in its unit; default: by '
                      'kind of field')
    verb.add_argument('--relative', type=float, metavar='X', help='and relative to the recorded value; default: 1e-9')
    verb.add_argument('--ignore', action='append', default=[], metavar='PATTERN',
                      help="topics or topic.field not to compare, as 'acu/reference*'; may be repeated")
    verb.add_argument('--allow-idle', action='store_true', help='compare also where the node was never exercised')
    verb.add_argument('--live', action='store_true', help='feed the real node process, in lockstep over DDS')
    verb.add_argument('--json', type=pathlib.Path, metavar='FILE', help='write the numbers as rows')
    verb.add_argument('--output', type=pathlib.Path, metavar='BAG',
                      help='write the recording again, with the recomputed outputs in place of the recorded')
    verb.set_defaults(verb=_recompute)


@contextlib.contextmanager
def _progress(duration):
    """A function progress(seconds): a bar on a terminal, nothing in a pipe."""
    if not sys.stderr.isatty():
        yield lambda seconds: None
        return
    columns = (TextColumn('{task.description}'), BarColumn(), TextColumn('{task.completed:.0f} / {task.total:.0f} s'),
               TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task('starting nodes (the first start compiles the laws)', total=duration)

        def advance(seconds):
            bar.update(task, completed=seconds, description='running' if seconds > 0.0 else None)
        yield advance


def _check_json(path):
    if path and (path.is_dir() or not path.parent.is_dir()):
        raise ValueError(f'--json {path}: must be a file in a directory that exists')


def _run(options):
    from pedestal_bringup import consistency, graph, isolation, known_attitude, results, scenario
    from pedestal_bringup.bag import read
    from pedestal_bringup.verify import verify
    changes = (scenario.file_overrides(options.params_file) if options.params_file else []) + options.param
    chosen = scenario.load(options.scenario, changes, options.seed, options.duration, options.pacing)
    bag = _new_bag(options.bag, chosen.name)
    _check_json(options.json)
    with _progress(chosen.header.duration) as progress:
        try:
            outcome = graph.run(chosen, bag, progress)
        except KeyboardInterrupt:
            print(f'pedestal: stopped; what was recorded is in {bag}', file=sys.stderr)
            return EXIT_STOPPED
    recording = read(bag)
    of_beams = []
    for prefix in chosen.prefixes:
        beam = recording.view(prefix[:-1])
        tracked = results.tracking(beam)
        of_beams.append({**results.summary(tracked), **consistency.summary(consistency.read(beam, tracked)),
                         **results.announced_losses(beam), **isolation.summary(isolation.read(beam, tracked)),
                         **known_attitude.summary(known_attitude.read(beam))})
    whole = {'lost_steps': (float(outcome.drive['lost_steps']), ''),
             'realtime_factor': (outcome.drive['realtime_factor'], ''),
             'messages': (float(outcome.recorder['messages']), '')}
    _show(f'{chosen.name}: {chosen.header.title}', [prefix[:-1] for prefix in chosen.prefixes], of_beams, whole)
    print(f'{bag}  mcap sha256 {outcome.recorder["sha256"]}')
    if options.json:
        rows = [row for prefix, values in zip(chosen.prefixes, of_beams)
                for row in results.rows(f'{chosen.name}/{prefix}'.rstrip('/'), values)]
        _write_json(options.json, {'name': chosen.name, 'rows': rows + results.rows(chosen.name, whole),
                                   'mcap_sha256': outcome.recorder['sha256']})
    check = verify(bag)
    if not check.complete:
        raise RuntimeError('the recording is not complete:\n' + '\n'.join(check.lines()))
    return 0


def _new_bag(given, scenario):
    """Where to record: as given, or bags/runs/SCENARIO-N."""
    from pedestal_bringup import graph
    bag = given or graph.free_bag(scenario)
    if bag.exists():
        raise ValueError(f'--bag {bag} exists already; a recording is never overwritten')
    return bag


def _show(title, beams, of_beams, whole):
    """A table of metrics: a column for each beam, one for a single one (beams: ['']), and what belongs to the run."""
    table = Table(title=title, title_justify='left')
    table.add_column('metric')
    for beam in beams:
        table.add_column(beam or 'value', justify='right')
    table.add_column('unit')
    for metric, (_, unit) in of_beams[0].items():
        table.add_row(metric, *(_number(values[metric][0]) for values in of_beams), unit)
    for metric, (value, unit) in whole.items():
        table.add_row(metric, _number(value), *[''] * (len(beams) - 1), unit)
    Console(width=max(Console().width, TABLE_WIDTH) if len(beams) > 1 else None).print(table)


def _number(value):
    return f'{value:.6g}' if math.isfinite(value) else 'not measured'


def _write_json(path, content):
    path.write_text(json.dumps(content, indent=1) + '\n')


def _scenarios(_options):
    from pedestal_bringup import scenario
    for name, title in scenario.available().items():
        print(f'{name:14} {title}')
    return 0


def _parameters(options):
    from pedestal_bringup import scenario
    from pedestal_common import parameters
    parameters_type = scenario.parameters_of(options.node)
    values = parameters.defaults(parameters_type)
    for name, field in parameters.flatten(parameters_type):
        meta = field.metadata
        allowed = f'{meta["low"]:g} to {meta["high"]:g}' if 'low' in meta else ' | '.join(meta.get('options', ()))
        unit = f' [{meta["unit"]}]' if meta.get('unit') else ''
        value = f'{values[name]:g}' if isinstance(values[name], float) else str(values[name])
        print(f'{name:42} {value:>14}  {allowed:24} {meta["doc"]}{unit}')
    return 0


def _program(options):
    from pedestal_bringup import graph, scenario
    return graph.send_program(scenario.load(options.scenario, options.param, duration=options.duration))


def _verify(options):
    from pedestal_bringup.verify import verify
    check = verify(options.bag)
    print('\n'.join(check.lines()))
    return 0 if check.complete else 1


def _recover(options):
    from pedestal_bringup.recover import recover
    print('\n'.join(recover(options.bag, options.output).lines()))
    return 0


def _rerun(options):
    from pedestal_bringup import bag, graph, rerun
    recording = bag.read(options.recording)
    chosen = rerun.configured(recording)
    path = _new_bag(options.bag, chosen.name)
    with _progress(chosen.header.duration) as progress:
        graph.run(chosen, path, progress)
    comparison = rerun.compare(recording, bag.read(path))
    print('\n'.join(comparison.lines()))
    return 0 if comparison.equal else 1


def _report(options):
    from pedestal_bringup import report
    print(report.write(options.bag, options.output, options.png, options.beam))
    return 0


def _study(options):
    from pedestal_bringup import studies
    if options.name not in studies.NAMES:
        problem = f'unknown study {options.name!r}' if options.name else 'no study named'
        print(f'pedestal: error: {problem}, there are', file=sys.stderr)
        for name, line in studies.descriptions().items():
            print(f'  {name:10} {line}', file=sys.stderr)
        return EXIT_WRONG_COMMAND
    from pedestal_bringup.studies import experiment
    output = options.output or pathlib.Path('studies', options.name)
    _check_json(options.json)
    study = studies.study(options.name)
    with contextlib.ExitStack() as stack:
        many = _many_runs(options, study, stack)
        output.mkdir(parents=True, exist_ok=True)
        progress = stack.enter_context(_share())
        result = study.run(progress, **many)
        for name, draw in result.figures.items():
            progress(None, f'drawing {name}')
            experiment.save(draw, output / f'{name}.png')
    _show_study(f'study {options.name}', result.rows if result.shown is None else result.shown)
    for remark in result.remarks:
        print(remark)
    print(f'figures in {output}: {", ".join(f"{name}.png" for name in result.figures)}')
    if options.json:
        _write_json(options.json, {'name': options.name, 'rows': result.rows})
    return 0


def _many_runs(options, study, stack):
    """What a study of many runs is told beside its progress; the pool is closed with the stack."""
    asked = {name: getattr(options, name) for name in ('runs', 'workers', 'scheduler')}
    if 'runs' not in inspect.signature(study.run).parameters:
        for name, value in asked.items():
            if value is not None:
                raise ValueError(f'--{name} {value}: study {options.name} has one run of each case')
        return {}
    if asked['runs'] is not None and asked['runs'] < 1:
        raise ValueError(f'--runs {options.runs}: must be at least 1')
    from pedestal_bringup import monte_carlo
    return {'runs': options.runs or study.RUNS,
            'pool': stack.enter_context(monte_carlo.Pool(options.workers, options.scheduler))}


@contextlib.contextmanager
def _share():
    """A function progress(share done, what comes next): a bar on a terminal, nothing in a pipe."""
    if not sys.stderr.isatty():
        yield lambda share, text: None
        return
    with Progress(BarColumn(), TextColumn('{task.description}'), TimeElapsedColumn(),
                  console=Console(stderr=True)) as bar:
        task = bar.add_task('compiling the laws (the first time)', total=1.0)
        yield lambda share, text: bar.update(task, completed=share, description=text)


TABLE_WIDTH = 120
"""Columns that the table of a study or of several beams may take on any terminal, so that a row is one line."""


def _show_study(title, rows):
    from pedestal_bringup.studies import experiment

    def number(value):
        return '-' if value is None else f'{value:.4g}'

    table = Table(title=title, title_justify='left', box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for name, justify in (('case', 'left'), ('metric', 'left'), ('paper', 'right'), ('ours', 'right'),
                          ('target', 'left'), ('unit', 'left'), ('', 'left')):
        table.add_column(name, justify=justify, no_wrap=True)
    for row in rows:
        table.add_row(row['case'], row['metric'], number(row['paper']), number(row['value']), row['target'] or '',
                      row['unit'], 'MISSED' if experiment.missed(row) else '')
    Console(width=max(Console().width, TABLE_WIDTH)).print(table)


def _export(options):
    from pedestal_bringup.export import export
    for file, rows, columns in export(options.bag, options.format, options.output, options.topics, options.overwrite):
        if file is None:
            print(f'pedestal: left out: {rows}', file=sys.stderr)
        else:
            print(f'{file}  {rows} rows, {columns} columns')
    return 0


def _recompute(options):
    from pedestal_bringup import recompute_verb
    lines, rows, well = recompute_verb.main(options)
    print('\n'.join(lines))
    if options.json:
        _write_json(options.json, {'name': 'recompute', 'rows': rows})
    return 0 if well else 1


def _tune(options):
    from pedestal_bringup import tune
    with _share() as progress:
        lines = tune.main(options, options.command, progress)
    print('\n'.join(lines))
    return 0


def _replay(options):
    from pedestal_bringup.replay import replay
    outcome = replay(options.bag, options.node, options.topics, None if options.lockstep else options.rate,
                     options.start, options.duration, options.paused, options.deadline)
    print('\n'.join(outcome.lines()))
    if outcome.ended == 'stopped':
        raise KeyboardInterrupt
    return 0


def _bench(options):
    from pedestal_bringup import bench
    content = {'name': 'bench', 'rows': []}
    for what in (options.what,) if options.what else bench.BENCHES:
        content['rows'] += bench.BENCHES[what]()
    if options.json:
        _write_json(options.json, content)
    return 0


if __name__ == '__main__':
    sys.exit(main())
