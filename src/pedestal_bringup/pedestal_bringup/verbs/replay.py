"""publish a recording into a live graph"""
import pathlib


def add_arguments(parser):
    """Bag, which topics, pace, part of the recording."""
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
    parser.add_argument('--deadline', type=float, default=60.0, metavar='S',
                        help='wall-clock time a reader or an answer is waited for; default: 60')


def main(options):
    """Replay and print the outcome; raises KeyboardInterrupt where it was stopped."""
    from pedestal_bringup.again.replay import ReplayOptions, replay
    result = replay(options.bag, ReplayOptions(
        options.node, options.topics, None if options.lockstep else options.rate, options.start, options.duration,
        options.paused, options.deadline))
    print('\n'.join(result.lines()))
    if result.ended == 'stopped':
        raise KeyboardInterrupt
    return 0
