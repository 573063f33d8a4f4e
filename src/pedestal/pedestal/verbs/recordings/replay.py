"""publish a recording into a live graph"""
import pathlib

DEFAULT_DEADLINE_S = 60.0


def add_arguments(parser):
    """Bag, which topics, pace, part of the recording."""
    from pedestal_bringup.graph import operator_servers
    parser.add_argument('bag', type=pathlib.Path)
    into = parser.add_mutually_exclusive_group()
    into.add_argument('--node', nargs='+', action='extend', default=[], metavar='NAME',
                      help='the topics these nodes read, for example acu; default: every topic')
    into.add_argument('--topics', nargs='+', action='extend', default=[], metavar='NAME', help='these topics')
    pace = parser.add_mutually_exclusive_group()
    pace.add_argument('--rate', type=float, default=1.0, metavar='X', help='times real time; default: 1')
    pace.add_argument('--lockstep', action='store_true', help='a step when the nodes have answered the one before')
    parser.add_argument('--start', type=float, default=0.0, metavar='S', help='begin this far into the recording')
    parser.add_argument('--duration', type=float, metavar='S', help='of the recording; default: to its end')
    parser.add_argument('--paused', action='store_true', help='begin with a pause')
    parser.add_argument('--page', nargs='?', type=operator_servers.port, const=operator_servers.SERVERS['page'].port,
                        metavar='PORT',
                        help="show it on the operator's page with a slider, without a graph; default port: "
                             f"{operator_servers.SERVERS['page'].port}")
    parser.add_argument('--deadline', type=float, metavar='S',
                        help='wall-clock time a reader or an answer is waited for; default: 60')


def main(options):
    """Replay and print the outcome; raises KeyboardInterrupt where it was stopped."""
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


def _on_the_page(options):
    """Show the recording until Ctrl-C; exit code 0."""
    from pedestal_analysis.reprocess import replay, replay_page
    from pedestal_recording import bag
    if options.node or options.topics or options.lockstep or options.duration is not None or (
            options.deadline is not None):
        raise ValueError('--page: takes --start, --rate and --paused; everything else is for a replay into a graph')
    wanted = replay.ReplayOptions(rate=options.rate, start=options.start, paused=options.paused)
    player = replay_page.Player(replay_page.Recording(bag.read(options.bag, '')), options.page, wanted)
    with replay.stop_by_signal() as stopped:
        print(f'page: {player.url}', flush=True)
        player.play(stopped)
    return 0
