"""publish a recording into a running graph

Exit code 0: every message was published. 130: the replay was stopped, for example by Ctrl-C.
"""
import argparse
import pathlib

DEFAULT_DEADLINE_S = 60.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add bag, topics, pace and part of the recording."""
    from pedestal_bringup.graph import operator_servers
    parser.add_argument('bag', type=pathlib.Path, help='recording: a folder or an .mcap file')
    into = parser.add_mutually_exclusive_group()
    into.add_argument('--node', nargs='+', action='extend', default=[], metavar='NAME',
                      help='nodes, for example acu; only their inputs are published; default: every topic')
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


def main(options: argparse.Namespace) -> int:
    """Replay and print the outcome. Return exit code 0. Raises KeyboardInterrupt if the replay was stopped."""
    if options.page is not None:
        return _on_the_page(options)
    from pedestal_analysis.reprocess.replay import ReplayOptions, replay
    result = replay(options.bag, ReplayOptions(
        options.node, options.topics, None if options.lockstep else options.rate, options.start, options.duration,
        options.paused, DEFAULT_DEADLINE_S if options.deadline is None else options.deadline))
    print('\n'.join(result.lines()))
    if result.ended == 'stopped':
        raise KeyboardInterrupt
    return 0


def _on_the_page(options: argparse.Namespace) -> int:
    """Show the recording on the operator's page until Ctrl-C. Return exit code 0."""
    from pedestal_analysis.reprocess import replay, replay_page
    from pedestal_recording import bag
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
