"""`pedestal replay`: publish the recorded messages of a bag into a live graph of ROS nodes, byte by byte."""
import contextlib
import dataclasses
import math
import pathlib
import signal
import time
from collections.abc import Callable, Iterator, Mapping, Sequence

from rclpy.utilities import try_shutdown

from pedestal_common.graph import nodes
from pedestal_common.graph.nodes import Link
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node import middleware, shell
from pedestal_common.quantities import Seconds
from pedestal_common.text_files.text_table import TextTable
from pedestal_recording import bag as bags
from pedestal_workbench.again.player import ANSWER_TOPICS, Player, answer_of
from pedestal_workbench.again.playlist import Playlist, selected_topics, writes
from pedestal_workbench.again.terminal import Keyboard


@dataclasses.dataclass(frozen=True)
class ReplayOptions:
    """Selection and pace of a replay. Raises ValueError for a number out of range."""
    nodes: list[str] = dataclasses.field(default_factory=list)  # their inputs are published
    names: list[str] = dataclasses.field(default_factory=list)  # of published topics; without nodes and names, all
    rate: float | None = 1.0    # speed of the replay, in multiples of real time; None: in lockstep with the nodes
    start: Seconds = 0.0    # time after the first message at which the replay begins
    duration: Seconds | None = None     # length of the replay, None to the end of the recording
    paused: bool = False    # True to begin with a pause
    deadline: Seconds = 60.0    # longest wait for a subscriber or for an answer

    def __post_init__(self) -> None:
        for option in ('rate', 'duration', 'deadline'):
            value = getattr(self, option)
            if value is not None and not (0.0 < value < math.inf):
                raise ValueError(f'--{option} {value:g}: must be above 0')
        if not 0.0 <= self.start < math.inf:
            raise ValueError(f'--start {self.start:g} s: must be 0 or more')


@dataclasses.dataclass
class ReplayResult:
    """Result of a replay."""
    bag: str    # its path
    sent: dict[str, int]    # number of sent messages of a topic
    first: Seconds  # stamp of the first sent message
    last: Seconds   # stamp of the last sent message
    wall: Seconds   # wall time of the replay
    answers: dict[str, tuple[int, int]]     # of a node: number of its answers, number of steps that it had to answer
    ended: str  # 'whole', 'quit' (by a key) or 'stopped' (by a signal)

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        lines = TextTable(('', ('', '>9')), self.sent.items()).lines()
        lines += [f'{node} answered {count} of {steps} steps' for node, (count, steps) in self.answers.items()]
        span = self.last - self.first
        factor = f' ({span / self.wall:.3g} x real time)' if self.ended == 'whole' and span > 0.0 else ''
        return [*lines, f'{self.bag}: {sum(self.sent.values())} messages sent, from {self.first:.6f} to '
                        f'{self.last:.6f} s in {self.wall:.3f} s{factor}'
                        + ('' if self.ended == 'whole' else f'; {self.ended} before the end')]


@contextlib.contextmanager
def stop_by_signal() -> Iterator[Callable[[], bool]]:
    """Yield stopped(), True after a signal. Without this handler a signal would interrupt a call of rclpy."""
    signals: list[bool] = []
    before = {number: signal.signal(number, lambda *_: signals.append(True))
              for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
              if signal.getsignal(number) is not signal.SIG_IGN}
    try:
        yield lambda: bool(signals)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def replay(path: str | pathlib.Path, options: ReplayOptions, ready: Callable[[], None] = lambda: None) -> ReplayResult:
    """Publish a bag into the live graph of this ROS domain; ready() is called before the first message. Raises
    BagError; ValueError for options that do not fit the bag; GraphError for a graph that does not fit."""
    bag = bags.read(path)
    chosen = selected_topics(bag, options.nodes, options.names)
    if options.rate is None:
        _check_lockstep(options.nodes, chosen, bag.graph)
    # The clock is always published too, because simulated nodes may need it. The exceptions are a clock that is chosen
    # anyway, and a node under test that publishes the clock itself.
    written = 'clock' in chosen or any(writes(bag.graph, node, 'clock') for node in options.nodes)
    companion = 'clock' if 'clock' in bag.topics and not written else None
    playlist = Playlist(bag, [*chosen, *filter(None, [companion])], options.start, options.duration)
    keyboard = Keyboard()
    if options.paused and not keyboard.available:
        raise ValueError('--paused: standard input must be a terminal, because a key ends the pause')
    middleware.initialise([])
    try:
        with stop_by_signal() as stopped, keyboard:
            player = Player(playlist, companion, options, keyboard, stopped)
            try:
                begun = time.monotonic()
                if player.connect():
                    ready()
                    begun = time.monotonic()
                    with contextlib.suppress(shell.Stopped):
                        player.play()
                wall = time.monotonic() - begun
                player.finish()
            finally:
                player.close()
            return ReplayResult(
                str(path), {name: channel.sent for name, channel in player.channels.items()},
                playlist.first / NS_PER_SECOND, player.position / NS_PER_SECOND, wall,
                {node.name: (node.answers, node.steps) for node in player.under_test if node.trigger},
                'stopped' if stopped() else 'quit' if player.pace.quit else 'whole')
    finally:
        try_shutdown()


def _check_lockstep(under_test: Sequence[str], chosen: Sequence[str], graph: Mapping[str, Link]) -> None:
    """Raise ValueError if the nodes under test cannot answer the steps of a replay of the chosen topics."""
    answering = [node for node in under_test if nodes.plain(node) in ANSWER_TOPICS]
    if not answering:
        problem = (f'{", ".join(under_test)} does not answer steps at their stamps' if under_test else
                   'set --node to a node that answers the steps')
        raise ValueError(f'--lockstep: {problem}; must be one of {", ".join(ANSWER_TOPICS)}')
    for node in answering:
        trigger, _ = answer_of(node, graph)
        if trigger not in (None, *chosen):
            raise ValueError(f'--lockstep: {node} answers {trigger}, which is not published')
