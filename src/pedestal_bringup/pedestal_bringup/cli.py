"""The command line `pedestal`: thin verbs over graph, bag, report and bench."""
import argparse
import contextlib
import json
import math
import pathlib
import signal
import sys

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from pedestal_common.parameters import ParameterError

EXIT_STOPPED = 130

RECOMPUTE = """\
Feeds the recorded inputs of a node to its step function and compares what it answers with what was recorded: count and
order of the messages first, then every field. Exit code 1 when something differs beyond its tolerance, or when the
recording never exercised the node (never locked, never in autotrack, never moved).

Exact for a lockstep recording: the same version on the same machine gives the same bits. In a realtime recording a
step gets what had been sent when the next one began: that is what the node had, but for messages that were on their
way to it just then. Services are not recorded: a change of acu/mode that the ACU would not make by itself is asked for
at that step, and counted. Nor are parameters that were changed while running. Diagnostics are not recomputed.

With --param it does not fail but reports old against new. The recorded antenna does not move with the recomputed
command: compared are the estimate against the recorded truth (error, noise, lag) and the noise of the command; what a
parameter does to the pointing, a new run tells."""


def main(args=None) -> int:
    """Exit code 0; 1 with one line on stderr for anything that went wrong; 2 for a wrong command line."""
    parser = _parser()
    options = parser.parse_args(args)
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
    run.set_defaults(verb=_run)

    scenarios = verbs.add_parser('scenarios', help='list the scenarios')
    scenarios.set_defaults(verb=_scenarios)

    listed = verbs.add_parser('parameters', help='list the parameters of a node: default, range, unit, meaning')
    listed.add_argument('node', help='acu, adu, tracking_receiver, ship_motion, ins, recorder or scenario')
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

    report = verbs.add_parser('report', help='write a recording as one HTML file with its figures')
    report.add_argument('bag', type=pathlib.Path)
    report.add_argument('--output', type=pathlib.Path, metavar='FILE', help='default: report.html in the bag')
    report.add_argument('--png', type=pathlib.Path, metavar='DIR', help='also write each figure as PNG')
    report.set_defaults(verb=_report)

    _add_recompute(verbs)

    bench = verbs.add_parser('bench', help='measure this machine: the lockstep ring, or the compiled core')
    bench.add_argument('what', nargs='?', choices=('graph', 'core'), help='default: both')
    bench.add_argument('--json', type=pathlib.Path, metavar='FILE')
    bench.set_defaults(verb=_bench)
    return parser


def _add_recompute(verbs):
    verb = verbs.add_parser('recompute', help='feed recorded inputs to a node again and compare its outputs',
                            description=RECOMPUTE, formatter_class=argparse.RawDescriptionHelpFormatter)
    verb.add_argument('bag', type=pathlib.Path)
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


def _run(options):
    from pedestal_bringup import graph, results, scenario
    from pedestal_bringup.bag import read
    from pedestal_bringup.verify import verify
    chosen = scenario.load(options.scenario, options.param, options.seed, options.duration, options.pacing)
    bag = options.bag or graph.free_bag(chosen.name)
    if bag.exists():
        raise ValueError(f'--bag {bag} exists already; a recording is never overwritten')
    if options.json and (options.json.is_dir() or not options.json.parent.is_dir()):
        raise ValueError(f'--json {options.json}: must be a file in a directory that exists')
    with _progress(chosen.header.duration) as progress:
        try:
            outcome = graph.run(chosen, bag, progress)
        except KeyboardInterrupt:
            print(f'pedestal: stopped; what was recorded is in {bag}', file=sys.stderr)
            return EXIT_STOPPED
    values = results.summary(results.tracking(read(bag)))
    values['lost_steps'] = (float(outcome.drive['lost_steps']), '')
    values['realtime_factor'] = (outcome.drive['realtime_factor'], '')
    values['messages'] = (float(outcome.recorder['messages']), '')
    _show(f'{chosen.name}: {chosen.header.title}', values)
    print(f'{bag}  mcap sha256 {outcome.recorder["sha256"]}')
    if options.json:
        _write_json(options.json, {'name': chosen.name, 'rows': results.rows(chosen.name, values),
                                   'mcap_sha256': outcome.recorder['sha256']})
    check = verify(bag)
    if not check.complete:
        raise RuntimeError('the recording is not complete:\n' + '\n'.join(check.lines()))
    return 0


def _show(title, values):
    table = Table(title=title, title_justify='left')
    table.add_column('metric')
    table.add_column('value', justify='right')
    table.add_column('unit')
    for metric, (value, unit) in values.items():
        table.add_row(metric, f'{value:.6g}' if math.isfinite(value) else 'not measured', unit)
    Console().print(table)


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


def _report(options):
    from pedestal_bringup import report
    print(report.write(options.bag, options.output, options.png))
    return 0


def _recompute(options):
    from pedestal_bringup import recompute_verb
    lines, rows, well = recompute_verb.main(options)
    print('\n'.join(lines))
    if options.json:
        _write_json(options.json, {'name': 'recompute', 'rows': rows})
    return 0 if well else 1


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
