"""Verb `run`: a scenario as separate nodes, with its recording and its results."""
import argparse
import datetime
import inspect
import os
import sys
import typing
from collections.abc import Collection

from pedestal import console, stop
from pedestal.verbs import arguments
from pedestal.verbs.arguments import Verb

if typing.TYPE_CHECKING:
    from pedestal_bringup.graph.start import Outcome
    from pedestal_bringup.scenario.scenario import Scenario
    from pedestal_recording.bag import Bag

MAX_LOST_STEP_SHARE = 0.01  # largest share of lost steps of a realtime run, without those of restarts


def _add_run(parser: argparse.ArgumentParser) -> None:
    """Starts a process for each node, records every topic in a new bag, and prints a verdict and the results.

    Exit codes (1, 3 and 130 take precedence over 4):
    """
    arguments.add_scenario(parser)
    parser.add_argument('--pacing',
                        choices=('lockstep', 'realtime'), help='lockstep: as fast as the nodes can; realtime: by '
                        'the clock; default: value of the scenario')
    arguments.add_duration(parser, 'the run')
    parser.add_argument('--seed',
                        type=int, metavar='N', help='seed from which the seeds of all noises follow; default: '
                        'value of the scenario')
    arguments.add_new_bag(parser)
    console.add_json(parser)
    console.add_all(parser)
    console.add_explain(parser)
    arguments.add_param(parser)
    arguments.add_choice(parser, '; list: only print the passes')
    arguments.add_params_file(parser)
    parser.add_argument('--drives', choices=('adu', 'simulated'), help='simulated: four simulated CiA 402 '
                        'servo drives on a CAN bus of this machine, and drive_node in place of the drive unit; needs '
                        '--pacing realtime; default: value of the scenario')
    parser.add_argument('--receiver', metavar='PROGRAM', help='ROS 2 node of yours in place of the simulated '
                        'receiver: FILE.py or PACKAGE/EXECUTABLE, in quotes with its arguments. simulated-iq: I/Q '
                        'samples by UDP, and monopulse_receiver_node, in realtime; default: value of the scenario')
    for name, place in (('ship', 'ship and its IMU'), ('ins', 'INS'), ('drive', 'drive')):
        parser.add_argument(f'--{name}', metavar='PROGRAM', help='ROS 2 node of yours, as for --receiver, in place of '
                            f'the simulated {place}')
    from pedestal_bringup.graph.operator_servers import SERVER_ADDRESS, SERVERS, port
    for name, server in SERVERS.items():
        if server.port:
            parser.add_argument(f'--{name}', nargs='?', type=port, const=server.port, metavar='PORT',
                                help=f'in realtime: {server.does} on {SERVER_ADDRESS}; default port: {server.port}')
        else:
            parser.add_argument(f'--{name}', action='store_const', const=0, help=f'in realtime: {server.does}')


_add_run.__doc__ = f'{inspect.getdoc(_add_run)}\n\n{console.exit_codes()}'


def _run(options: argparse.Namespace) -> int:
    """Run, record and print the results. Return the exit code. Raises RuntimeError for an incomplete recording."""
    from pedestal_bringup.graph import graph, operator_servers
    from pedestal_bringup.scenario.program import Plan
    chosen = _chosen(options)
    if chosen is None:
        return 0
    now = datetime.datetime.now(datetime.timezone.utc).replace(tzinfo=None)
    for prefix in chosen.prefixes:
        acu = chosen.node_parameters(f'{prefix}acu')
        acu.pointing.check_date(now)
        if unchecked := acu.pointing.unchecked(acu.antenna):
            print(unchecked)
    bag = graph.new_bag(options.bag, chosen.name)
    console.check_json(options.json)
    ports = {name: getattr(options, name) for name in operator_servers.SERVERS}
    servers = operator_servers.processes({name: port for name, port in ports.items() if port is not None},
                                         chosen.header)
    plan = Plan(chosen)
    for line in plan.announced():
        print(line)
    outcome = graph.run(plan, bag, console.progress_of_run(chosen.header.duration), servers)
    if outcome.stopped:
        print(f'pedestal: stopped; the recorded part is in {bag}', file=sys.stderr)
        if not outcome.recorder.get('messages'):
            return stop.STOP_EXIT_CODE
    # Because this module imports numpy and scipy, which takes half a second, the verb loads it after the run.
    from pedestal_recording.bag import read
    recording = read(bag)
    failed = _results(options, chosen, outcome, recording)
    if outcome.stopped:
        return stop.STOP_EXIT_CODE
    if _disturbed(chosen, outcome, recording):
        return console.EXIT_DISTURBED
    return console.EXIT_FAILED_RUN if failed else 0


def _results(options: argparse.Namespace, chosen: 'Scenario', outcome: 'Outcome', recording: 'Bag') -> bool:
    """Print verdicts and results of a run and write --json. Return True if the verdict on a beam is a failure."""
    from pedestal_results import consistency, results
    from pedestal_results.recorded_run import RecordedRun
    beams = [prefix[:-1] for prefix in chosen.prefixes]
    views = [recording.view(beam) for beam in beams]
    runs = [RecordedRun(view) for view in views]
    verdicts = [run.verdict for run in runs]
    parts = [run.parts for run in runs]
    of_beams = [results.measured(part) for part in parts]
    # whole: results of the run, such as lost steps, in contrast to the results of each beam
    whole = results.measured({'run': outcome, 'supervised': outcome if chosen.header.pacing == 'realtime' else None})
    lost, steps = whole['lost_steps'][0], outcome.drive.get('steps')
    for beam, run, found in zip(beams, runs, verdicts):
        print(f'{beam}: {found.text}' if beam else found.text)
        if run.no_truth:
            print(f'no comparison with the truth: {run.no_truth}')
    shown = [*of_beams[0], *whole] if options.all else results.brief([*of_beams, whole])
    printed = {**whole, 'lost_steps': (lost, f'of {steps}' if lost and steps else 'steps')}
    console.show_results(f'{chosen.name}: {chosen.header.title}', beams, [_some(values, shown) for values in of_beams],
                         _some(printed, shown), map(results.marks, parts) if options.all else ())
    for beam, run in zip(beams, runs):
        for line in consistency.remarks(run.filter) if run.filter is not None else ():
            print(f'{beam}: {line}' if beam else line)
    if not options.all:
        print('--all prints all results, --explain their definitions')
    if options.explain:
        console.explain(results.RESULTS, shown)
    print(f'{recording.path}  mcap sha256 {outcome.recorder["sha256"]}')
    rows = [row for beam, values in zip(beams, of_beams)
            for row in results.rows(f'{chosen.name}/{beam}'.rstrip('/'), values)]
    console.write_json(options.json, {'name': chosen.name, 'rows': rows + results.rows(chosen.name, whole),
                                      'verdicts': {beam: found._asdict() for beam, found in zip(beams, verdicts)},
                                      'mcap_sha256': outcome.recorder['sha256']})
    return any(found.failed for found in verdicts)


def _disturbed(chosen: 'Scenario', outcome: 'Outcome', recording: 'Bag') -> bool:
    """Return True, with a line on stderr for each reason, if a realtime run ended early or lost too many steps. Raises
    RuntimeError for an incomplete recording."""
    from pedestal_common.graph import nodes
    from pedestal_recording.verify import verify
    check = verify(recording)
    if chosen.header.pacing != 'realtime' and check.aborted or not (check.complete or outcome.restarts):
        raise RuntimeError('the recording is not complete:\n' + '\n'.join(check.lines()))
    if not check.complete:
        print('pedestal: the recording has gaps because a node was restarted:\n' + '\n'.join(check.problems),
              file=sys.stderr)
    planned = chosen.header.duration / chosen.node_parameters(nodes.DRIVE_NODE).period
    reasons = [check.ending] if check.aborted else []
    if outcome.losses > MAX_LOST_STEP_SHARE * planned:
        reasons.append(f'the drive lost {outcome.losses} of {planned:.0f} steps, more than {MAX_LOST_STEP_SHARE:.0%}'
                       f'{", without those of restarts" if outcome.restarts else ""}: {_cure(chosen.header.priority)}')
    for reason in reasons:
        print(f'pedestal: {reason}', file=sys.stderr)
    return bool(reasons)


def _cure(priority: int) -> str:
    """Return the remedy for lost steps; priority: the realtime priority of the scenario, 0 for none."""
    load, cores = os.getloadavg()[0], len(os.sched_getaffinity(0))
    text = f'load {load:.1f} on {cores} cores; end other programs or use a machine with more cores'
    return text if priority else (f'{text}, or give the nodes a realtime priority: --param scenario.priority=10 '
                                  '(docs/operate/station.md)')


def _some(values: dict[str, tuple[float, str]], names: Collection[str]) -> dict[str, tuple[float, str]]:
    return {name: value for name, value in values.items() if name in names}


def _chosen(options: argparse.Namespace) -> 'Scenario | None':
    """Return the Scenario with the satellite, station and pass of the options; None after listing the passes."""
    from pedestal_bringup.scenario import files, scenario
    from pedestal_bringup.scenario.header import RECEIVERS
    from pedestal_common.graph import nodes
    given = {name: value for name in ('drives', *nodes.OWN_PLACES) if (value := getattr(options, name)) is not None}
    equipment = [files.override(f'scenario.{name}' if name == 'drives' or value in RECEIVERS else
                                f'scenario.own.{name}', value) for name, value in given.items()]
    changes = equipment + arguments.variant(options).overrides()
    choice = arguments.choice(options)
    if not choice.made:
        return scenario.load(options.scenario, changes, options.seed, options.duration, options.pacing)
    from pedestal import satellite
    now = datetime.datetime.now(datetime.timezone.utc).replace(tzinfo=None)
    draft = scenario.draft(options.scenario)
    if options.which == 'list':
        from pedestal_bringup.graph import operator_servers
        arguments.refuse_given(options, ('bag', 'json', 'all', 'explain', 'duration', 'start', 'seed', 'pacing',
                                         'drives', *nodes.OWN_PLACES, *operator_servers.SERVERS),
                               'has no effect with --pass list, which runs nothing')
        satellite.PassSelection(satellite.with_satellite(draft, changes, choice, now).draft, now).print_passes()
        return None
    found = satellite.chosen(draft, changes, choice, options.duration, now)
    for line in found.lines:
        print(line)
    return scenario.checked(found.draft, options.seed, found.duration, options.pacing)


VERBS = {'run': Verb(_add_run, _run)}
