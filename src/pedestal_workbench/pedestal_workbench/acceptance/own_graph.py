"""Exercises on simulated graphs that acceptance starts itself, one for each exercise: `pedestal run` as a child."""
import contextlib
import pathlib
import sys
from collections.abc import Iterator

from pedestal_bringup.graph import pass_recorder
from pedestal_bringup.graph.child import Child
from pedestal_bringup.graph.processes import SHOWN_LOG_LINES, exit_description, uninterrupted
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph import domain
from pedestal_common.graph.steps import GraphError
from pedestal_common.injection import table
from pedestal_common.quantities import Nanoseconds
from pedestal_recording.bag import read
from pedestal_recording.recording import Decoded
from pedestal_workbench.acceptance import client, in_loop
from pedestal_workbench.acceptance.client import Client, ClientSession
from pedestal_workbench.acceptance.exercise import Exercise, Performed, StoppedError

START_TIMEOUT_S = 120.0  # longest time until the nodes of a run have started, compiled laws included [s]
END_TIMEOUT_S = 60.0  # longest time from the end of a run to its results, and from a signal to its end [s]
JUDGED_EXIT_CODES = 0, 4  # of `pedestal run` after a whole run; 4: its verdict on the tracking is a failure


class OwnGraph:
    """Performer on the graphs of a variant. folder: of the recordings."""
    own_runs = True

    def __init__(self, variant: Variant, folder: pathlib.Path) -> None:
        self._variant, self._folder = variant, folder.resolve()
        self.antenna = in_loop.antenna(variant.load())

    def __enter__(self) -> 'OwnGraph':
        return self

    def __exit__(self, *_: object) -> None:
        """A graph ends with its exercise."""

    def check(self, exercise: Exercise) -> None:
        """Raise ValueError for an exercise that no run of the variant can make."""
        self._changed(exercise, 1).load(_pacing(exercise))

    def _changed(self, exercise: Exercise, seed: int) -> Variant:
        return in_loop.run_of(exercise, self._variant, self.antenna.period, seed)

    def perform(self, name: str, exercise: Exercise, seed: int) -> Performed:
        """Make an exercise from time 0 of a run. Raises StoppedError."""
        bag, pacing = self._folder / name, _pacing(exercise)
        arguments = [*self._changed(exercise, seed).arguments(), '--bag', str(bag), '--pacing', pacing]
        with domain.of_child(), _run(arguments, bag) as run:
            with ClientSession(Client, ['--ros-args', '-p', f'graph.pacing:={pacing}']) as session:
                try:
                    sent = session.conduct(exercise, _begun(session, run, exercise), lambda: _left(run))
                except GraphError as error:     # the run has ended early, which explains more
                    raise StoppedError(f'{error}{_ending(run, bag)}') from None
                session.until(lambda: run.poll() is not None, END_TIMEOUT_S)
        if run.returncode not in JUDGED_EXIT_CODES:
            raise StoppedError(f'the run ended early{_ending(run, bag)}')
        recording = Decoded(read(bag))
        executed = client.outcomes(exercise, sent, recording, 0.0)
        return Performed(self.antenna, exercise, recording, 0.0, executed, bag)


def _pacing(exercise: Exercise) -> str:
    """Return the pacing of a run: realtime for a fault that a lockstep graph cannot have."""
    injected = exercise.faults + [
        (key.partition('.')[0], command.verb) for key, text in exercise.changes.items() if key.endswith('.inject')
        for _, command in table.scheduled_commands(key.partition('.')[0], str(text))]
    return 'realtime' if any(table.refused_in_lockstep(*fault) for fault in injected) else 'lockstep'


@contextlib.contextmanager
def _run(arguments: list[str], bag: pathlib.Path) -> Iterator[Child]:
    """Start a run as a context, at whose end it ends in order."""
    bag.parent.mkdir(parents=True, exist_ok=True)
    run = pass_recorder.logged_child([sys.executable, '-m', 'pedestal.cli', 'run', *arguments], bag)
    try:
        yield run
    finally:
        with uninterrupted():
            pass_recorder.end(run, END_TIMEOUT_S)


def _begun(session: ClientSession, run: Child, exercise: Exercise) -> Nanoseconds:
    """Wait for the begin of a run, take control, load the track, and return the stamp of time 0. Raises GraphError.

    A run in lockstep does not wait for this client: a wait for a reply would delay the first actions. Time 0 of a run
    in realtime is seconds after the start of its nodes.
    """
    remote, lockstep = session.remote, _pacing(exercise) == 'lockstep'
    if exercise.track and lockstep:
        remote.send_track(exercise.track, 0)    # latched: the control unit receives it before the first step
    session.until(lambda: run.poll() is not None or remote.reaches_acu and (remote.stamp >= 0 or not lockstep),
                  START_TIMEOUT_S)
    remote.request('take')
    if lockstep or run.poll() is not None:
        return 0
    start: Nanoseconds = session.parameters(['graph.start'])['graph.start']
    if exercise.track:
        remote.send_track(exercise.track, start)
    return start


def _left(run: Child) -> str | None:
    return '' if run.poll() is None else None


def _ending(run: Child, bag: pathlib.Path) -> str:
    """Return the words on the end of a run, with the last lines of its log; '' while it runs."""
    if run.poll() is None:
        return ''
    lines = pass_recorder.log_of(bag).read_text(errors='replace').splitlines()[-SHOWN_LOG_LINES:]
    assert run.returncode is not None
    return '\n'.join([f': `pedestal run` {exit_description(run.returncode)}:', *lines])
