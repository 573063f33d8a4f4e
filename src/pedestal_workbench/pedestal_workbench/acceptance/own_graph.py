"""Exercises on simulated graphs that acceptance starts itself, one for each exercise. Commands are parameters of the
nodes, so that a graph in lockstep equals the closed loop to the last bit."""
import contextlib
import multiprocessing
import os
import pathlib
import signal
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

import numpy as np

from pedestal_bringup.graph import graph, pass_recorder
from pedestal_bringup.graph.processes import exit_description
from pedestal_bringup.scenario.program import Plan
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph import domain
from pedestal_common.graph.modes import MODES
from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import Seconds
from pedestal_common.wire import commands
from pedestal_recording.bag import read
from pedestal_recording.recording import Decoded, Recording, at, replies
from pedestal_workbench.acceptance import in_loop
from pedestal_workbench.acceptance.exercise import Exercise, LateError, Performed, StoppedError, Track

MAX_LOST_STEP_SHARE = 0.01  # largest share of lost steps of a run in realtime [-]


class OwnGraph(in_loop.InLoop):
    """Performer on the graphs of a variant, as a context. folder: of the recordings.

    Each run is a fork of a process that has loaded the modules of all nodes, because a start of Python takes longer
    than many exercises.
    """

    def __init__(self, variant: Variant, folder: pathlib.Path) -> None:
        super().__init__(variant)
        self._folder = folder.resolve()
        self._begun: dict[str, Future[int]] = {}    # runs that were begun ahead, by name
        self._processes: list[BaseProcess] = []     # of runs

    def __enter__(self) -> 'OwnGraph':
        self._starter = multiprocessing.get_context('forkserver')
        self._starter.set_forkserver_preload([__name__])
        self._threads = ThreadPoolExecutor(1 if domain.VARIABLE in os.environ else os.cpu_count())
        return self

    def __exit__(self, *_: object) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        for process in list(self._processes):
            process.terminate()
        self._threads.shutdown()

    def expect(self, performances: Sequence[tuple[str, Exercise, int]]) -> None:
        """Begin the runs in lockstep, as many at a time as this computer has cores."""
        for name, exercise, seed in performances:
            if in_loop.pacing(exercise) == 'lockstep':
                self._begun[name] = self._begin(name, exercise, seed)

    def _begin(self, name: str, exercise: Exercise, seed: int) -> Future[int]:
        variant = in_loop.run_of(exercise, self._variant, self._scenario, seed)
        return self._threads.submit(self._losses, variant, in_loop.pacing(exercise), exercise.track,
                                    self._folder / name, dict(os.environ))

    def _losses(self, *arguments: object) -> int:
        """Return the number of lost steps of a run in a process of its own. Raises RuntimeError if it ended early,
        also if it was killed."""
        receiver, sender = self._starter.Pipe(duplex=False)
        process = self._starter.Process(target=_run, args=(sender, *arguments), daemon=True)
        process.start()
        self._processes.append(process)
        sender.close()
        try:
            found: int | RuntimeError = receiver.recv()
        except EOFError:
            process.join()
            assert process.exitcode is not None
            raise RuntimeError(exit_description(process.exitcode)) from None
        process.join()
        self._processes.remove(process)
        if isinstance(found, RuntimeError):
            raise found
        return found

    def perform(self, name: str, exercise: Exercise, seed: int) -> Performed:
        """Make an exercise from time 0 of a run. Raises StoppedError."""
        bag = self._folder / name
        try:
            lost = (self._begun.pop(name, None) or self._begin(name, exercise, seed)).result()
        except RuntimeError as error:
            raise StoppedError(f'the run ended early: {error}') from None
        if lost > MAX_LOST_STEP_SHARE * exercise.duration / self.antenna.period:
            raise LateError(f'the drive lost {lost} steps; this computer is too busy')
        recording = Decoded(read(bag))
        if trouble := _trouble(recording, exercise):
            raise trouble
        return Performed(self.antenna, exercise, recording, 0.0, in_loop.outcomes(exercise, recording), bag)


def _run(sender: Connection, variant: Variant, pacing: str, track: Track | None, bag: pathlib.Path,
         environment: Mapping[str, str]) -> None:
    """Run a graph in this process, whose output goes to the log of its bag. Send the number of lost steps, or the
    error."""
    os.setsid()     # a Ctrl-C on the terminal is for acceptance only, which then ends this process
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    acceptance = multiprocessing.parent_process()
    assert acceptance

    def advance(_: Seconds) -> None:
        """End the run if acceptance was killed."""
        if not acceptance.is_alive():
            raise KeyboardInterrupt
    os.environ.update(environment)
    bag.parent.mkdir(parents=True, exist_ok=True)
    with open(pass_recorder.log_of(bag), 'ab') as log:
        for stream in 1, 2:
            os.dup2(log.fileno(), stream)
    try:
        sender.send(graph.run(Plan(variant.load(pacing), track), bag, contextlib.nullcontext(advance)).losses)
    except RuntimeError as error:
        sender.send(error)


def _trouble(recording: Recording, exercise: Exercise) -> StoppedError | None:
    """Return why the antenna had to be stopped in an exercise, None for no reason."""
    t = np.asarray(recording.table('joint_states')['t'])
    angles, rates = (np.degrees(at(recording, t, 'joint_states', [f'{axis}.{name}' for axis in AXES]))
                     for name in ('position', 'velocity'))
    alarms = [alarm for _, _, _, array in recording.messages('acu/alarms') for alarm in array.status]
    others = [f'{command.who} commanded {command.verb}' for _, command, reply in
              replies(recording, 'acu/command_result') if reply.granted and command.who != commands.SCHEDULE_CLIENT
              and command.verb.removeprefix('acu/') in MODES]
    outside = next(filter(None, map(exercise.outside, angles, rates)), '')
    return in_loop.trouble(exercise, outside, alarms, ''.join(others[:1]))
