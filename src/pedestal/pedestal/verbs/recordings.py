"""Verbs for a recording: check, repair, repeat, show, export, recompute and replay it."""
import argparse
import contextlib
import pathlib
import sys
import typing

from pedestal import console
from pedestal.verbs import arguments
from pedestal.verbs.arguments import Verb

if typing.TYPE_CHECKING:
    from pedestal_common.quantities import Table

DEFAULT_DEADLINE_S = 60.0  # longest wait of a replay for a subscriber or an answer [s]


def _add_verify(parser: argparse.ArgumentParser) -> None:
    """Exit code 1, with a list of the gaps, for an incomplete recording. `pedestal recover` repairs the recording of
    a killed run.

        pedestal verify my_bag
    """
    parser.add_argument('bag', type=pathlib.Path, help='recording: a folder or an .mcap file')


def _verify(options: argparse.Namespace) -> int:
    from pedestal_recording.bag import load
    from pedestal_recording.verify import verify
    check = verify(load(options.bag))
    print('\n'.join(check.lines()))
    return 0 if check.finished else 1


def _add_recover(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('bag', type=pathlib.Path, help='damaged recording: a folder or an .mcap file')
    parser.add_argument('--output', type=pathlib.Path, metavar='DIR', help='output folder; default: BAG-recovered')


def _recover(options: argparse.Namespace) -> int:
    from pedestal_recording.recover import recover
    print('\n'.join(recover(options.bag, options.output).lines()))
    return 0


def _add_rerun(parser: argparse.ArgumentParser) -> None:
    """Exit code 0 if all messages are equal, also if metadata or the layout of the file differ. Exit code 1 if any
    message differs.
    """
    parser.add_argument('recording', type=pathlib.Path, help='recording of the first run: a folder or an .mcap file')
    arguments.add_new_bag(parser)


def _rerun(options: argparse.Namespace) -> int:
    from pedestal_bringup.graph import graph
    from pedestal_bringup.scenario.program import Plan
    from pedestal_recording import bag
    from pedestal_workbench.again import rerun
    recording = bag.read(options.recording)
    chosen = rerun.scenario_of_recording(recording)
    path = graph.new_bag(options.bag, chosen.name)
    if graph.run(Plan(chosen), path, console.progress_of_run(chosen.header.duration)).stopped:
        raise KeyboardInterrupt
    result = rerun.result(recording, bag.read(path))
    print('\n'.join(result.lines()))
    return 0 if result.equal else 1


def _add_report(parser: argparse.ArgumentParser) -> None:
    """The file has a page with the verdict, the versions and the changed parameters, then the figures.

        pedestal report my_bag                       write my_bag/report.html
        pedestal report my_bag --pdf --png figures   also as PDF, and each figure as PNG
    """
    parser.add_argument('bag', type=pathlib.Path, help='recording: a folder or an .mcap file')
    parser.add_argument('--output', type=pathlib.Path, metavar='FILE', help='output file; default: report.html in '
                        'the bag')
    arguments.add_beam(parser)
    parser.add_argument('--png', type=pathlib.Path, metavar='DIR', help='folder in which each figure is also '
                        'written as PNG')
    parser.add_argument('--author', default='', metavar='NAME', help='name of the author on the first page; default: '
                        'none')
    parser.add_argument('--pdf', action='store_true', help='the report also as PDF, beside the HTML file')


def _report(options: argparse.Namespace) -> int:
    from pedestal_results.report import page
    report = page.write(options.bag, options.output, options.png, options.beam, options.author, options.pdf)
    print(report)
    if options.pdf:
        print(report.with_suffix('.pdf'))
    return 0


def _add_export(parser: argparse.ArgumentParser) -> None:
    """Each table has a row for each message, and the time in seconds in its first column.

        pedestal export my_bag --topics joint_states acu/estimate    two topics as CSV
        pedestal export my_bag --format parquet
        pedestal export my_bag --format tdm                          tracking data for orbit determination
    """
    parser.add_argument('bag', type=pathlib.Path, help='recording: a folder or an .mcap file')
    parser.add_argument('--format', choices=('csv', 'parquet', 'tdm'), default='csv', help='output format; tdm: '
                        'directions of the target for orbit determination (CCSDS 503.0-B-2); default: csv')
    parser.add_argument('--output', type=pathlib.Path, metavar='DIR', help='output folder, or with tdm also a .tdm '
                        'file; default: folder export in the bag')
    parser.add_argument('--topics', nargs='+', action='extend', default=[], metavar='NAME', help='topics to export; '
                        'default: all')
    parser.add_argument('--rate', type=float, metavar='HZ', help='largest rate of the records of a tdm [Hz]; default: '
                        '10')
    parser.add_argument('--participants', nargs=2, metavar=('STATION', 'TARGET'), help='names of station and target '
                        'in a tdm; default: station PEDESTAL; target: international designator of the TLE, or, if '
                        'there is no TLE, the kind of the target')
    parser.add_argument('--overwrite', action='store_true', help='replace existing files')


def _export(options: argparse.Namespace) -> int:
    if options.format == 'tdm':
        return _tracking_data(options)
    if options.rate is not None or options.participants:
        raise ValueError(f'--rate, --participants: need --format tdm, not {options.format}')
    from pedestal_recording.export import export
    for file, rows_or_reason, columns in export(options.bag, options.format, options.output, options.topics,
                                                options.overwrite, None if options.topics else _pointing(options)):
        if file is None:     # a topic that cannot be exported
            print(f'pedestal: left out: {rows_or_reason}', file=sys.stderr)
        else:
            print(f'{file}  {rows_or_reason} rows, {columns} columns')
    return 0


def _pointing(options: argparse.Namespace) -> 'dict[str, Table]':
    """Return {name: table of the pointing errors} of each beam of a recording with steps."""
    from pedestal_common.graph import nodes
    from pedestal_recording import bag as bags
    from pedestal_results.recorded_run import RecordedRun
    bag = bags.read(options.bag)
    found = {}
    for prefix in nodes.prefixes(bag.beams):
        run = RecordedRun(bag.view(prefix[:-1]))
        with contextlib.suppress(KeyError, ValueError):     # a recording of other tools may lack a topic or a number
            if not run.no_truth or run.receiver:
                found[f'{prefix}pointing_error'] = run.pointing_errors
    return found


def _tracking_data(options: argparse.Namespace) -> int:
    import datetime

    from pedestal_results import tdm
    arguments.refuse_given(options, ('topics',), 'a tdm is made of fixed topics, the option is for csv and parquet')
    created = datetime.datetime.now(datetime.timezone.utc)
    rate = 10.0 if options.rate is None else options.rate
    for file, records in tdm.export(options.bag, created, options.output, rate, options.participants or (),
                                    options.overwrite):
        print(f'{file}  {records} records')
    return 0


def _add_recompute(parser: argparse.ArgumentParser) -> None:
    """Feeds the recorded inputs of a node to its step function and compares the new outputs with the recorded outputs.
    It compares count and order of the messages, then every field. Exit code 1 if a field differs by more than its
    tolerance, or if the node did nothing in the recording (never locked, never in autotrack, never moved).

    A lockstep recording is recomputed exactly: the same version on the same machine gives the same bits. In a realtime
    recording, a step of the recomputation gets all messages that were sent before the next step began. In the run, a
    message in transit at that moment was used one step later, so small differences are normal.

    Commands are taken from the recorded replies and repeated at their steps. In a bag without replies, a change of
    acu/mode or adu/state that no recorded input explains is repeated as a request. The report states the number of the
    repeated commands. Changes of parameters during the run are not recorded. Diagnostics are not recomputed.

    With --param the verb compares old with new results, and a difference is no failure. The first line states whether
    the difference is significant: paired, with its interval. Because the recorded antenna
    does not follow the recomputed command, only two results are compared: the estimate against the recorded truth
    (error, noise, lag), and the noise of the command. The effect of a parameter on the pointing needs a new run.
    """
    parser.add_argument('bag', type=pathlib.Path, help='recording: a folder or an .mcap file')
    arguments.add_beam(parser)
    parser.add_argument('--node', action='append', default=[], metavar='NODE',
                        help='node to recompute: acu, adu, tracking_receiver, ins or ship_motion; may be repeated; '
                        'default: every node')
    parser.add_argument('--param', action='append', default=[], metavar='[NODE.]KEY=VALUE',
                        help='parameter and its new value, for a comparison of old and new; may be repeated')
    parser.add_argument('--params-file', type=pathlib.Path, metavar='FILE',
                        help='scenario or parameter file of the recorded nodes, for a bag without parameters')
    parser.add_argument('--pacing', choices=('lockstep', 'realtime'),
                        help='pacing of the run, which determines the inputs of each step; default: pacing in the '
                        'bag, else realtime')
    parser.add_argument('--absolute', type=float, metavar='X', help='absolute tolerance of every field, in its unit; '
                        'default: tolerance of the field (docs/operate/recordings.md)')
    parser.add_argument('--relative', type=float, metavar='X', help='additional tolerance relative to the recorded '
                        'value; default: 1e-9')
    parser.add_argument('--ignore', action='append', default=[], metavar='PATTERN',
                        help="topics or topic.field not to compare, for example 'acu/reference*'; may be repeated")
    parser.add_argument('--fields', action='store_true', help='with --param: also the differences of every field')
    parser.add_argument('--allow-idle', action='store_true', help='accept a node that did nothing in the recording '
                        '(never locked, never in autotrack, never moved)')
    console.add_json(parser)
    console.add_explain(parser)
    parser.add_argument('--iq', type=pathlib.Path, metavar='FILE', help='.sigmf-meta file of the I/Q samples of the '
                        'recorded run; the angle errors that the monopulse receiver computes from these samples are '
                        'compared byte by byte')
    parser.add_argument('--output', type=pathlib.Path, metavar='BAG',
                        help='new bag: the recording with recomputed outputs in place of the recorded outputs')


def _recompute(options: argparse.Namespace) -> int:
    console.check_json(options.json)
    if options.iq is not None:
        arguments.refuse_given(options, ('node', 'param', 'params_file', 'pacing', 'absolute', 'relative', 'ignore',
                                         'allow_idle', 'fields', 'explain', 'output'), 'has no effect with --iq')
        from pedestal_workbench.again import iq
        lines, rows, well = iq.main(options.bag, options.iq)
        print('\n'.join(lines))
        console.write_json(options.json, {'name': 'recompute', 'rows': rows})
        return 0 if well else 1
    from pedestal_workbench.again import recompute_report
    lines, rows, well = recompute_report.main(arguments.typed(recompute_report.RecomputeOptions, options))
    print('\n'.join(lines))
    if options.explain:
        from pedestal_workbench.again import what_if
        console.explain(what_if.COMPARISON_RESULTS, {line.split()[0] for line in lines if line})
    console.write_json(options.json, {'name': 'recompute', 'rows': rows})
    return 0 if well else 1


def _add_replay(parser: argparse.ArgumentParser) -> None:
    """Exit code 0: every message was published. 130: the replay was stopped, for example by Ctrl-C."""
    from pedestal_bringup.graph import operator_servers
    parser.add_argument('bag', type=pathlib.Path, help='recording: a folder or an .mcap file')
    into = parser.add_mutually_exclusive_group()
    into.add_argument('--node', nargs='+', action='extend', default=[], metavar='NAME',
                      help='nodes whose inputs are published, for example acu; default: every topic is published')
    into.add_argument('--topics', nargs='+', action='extend', default=[], metavar='NAME', help='topics to '
                      'publish')
    pace = parser.add_mutually_exclusive_group()
    pace.add_argument('--rate', type=float, default=1.0, metavar='X', help='speed of the replay as a multiple of real '
                      'time; default: 1')
    pace.add_argument('--lockstep', action='store_true', help='publish a step after the nodes have answered the '
                      'previous step')
    parser.add_argument('--start', type=float, default=0.0, metavar='S', help='time of the recording at which '
                        'the replay begins [s]; default: 0')
    parser.add_argument('--duration', type=float, metavar='S', help='length of the replayed part [s]; default: to '
                        'the end')
    parser.add_argument('--paused', action='store_true', help='start in pause')
    parser.add_argument('--page', nargs='?', type=operator_servers.port, const=operator_servers.SERVERS['page'].port,
                        metavar='PORT',
                        help="TCP port of the operator's page, which shows the recording with a slider; no ROS graph "
                             f"is needed; default: {operator_servers.SERVERS['page'].port}")
    parser.add_argument('--deadline', type=float, metavar='S',
                        help='longest wait for a subscriber or an answer, in wall-clock time [s]; default: 60')


def _replay(options: argparse.Namespace) -> int:
    if options.page is not None:
        return _on_the_page(options)
    from pedestal_workbench.again.replay import ReplayOptions, replay
    result = replay(options.bag, ReplayOptions(
        options.node, options.topics, None if options.lockstep else options.rate, options.start, options.duration,
        options.paused, DEFAULT_DEADLINE_S if options.deadline is None else options.deadline))
    print('\n'.join(result.lines()))
    if result.ended == 'stopped':
        raise KeyboardInterrupt
    return 0


def _on_the_page(options: argparse.Namespace) -> int:
    from pedestal_recording import bag
    from pedestal_workbench.again import replay, replay_page
    if options.node or options.topics or options.lockstep or options.duration is not None or (
            options.deadline is not None):
        raise ValueError('--page: goes only with --start, --rate and --paused; other options are for a replay into a '
                         'graph')
    wanted = replay.ReplayOptions(rate=options.rate, start=options.start, paused=options.paused)
    player = replay_page.Player(replay_page.ShownRecording(bag.read(options.bag, '')), options.page, wanted)
    with replay.stop_by_signal() as stopped:
        print(f'page: {player.url}', flush=True)
        player.play(stopped)
    return 0


VERBS = {
    'verify': Verb(_add_verify, _verify),
    'recover': Verb(_add_recover, _recover),
    'rerun': Verb(_add_rerun, _rerun),
    'report': Verb(_add_report, _report),
    'export': Verb(_add_export, _export),
    'recompute': Verb(_add_recompute, _recompute),
    'replay': Verb(_add_replay, _replay),
}
