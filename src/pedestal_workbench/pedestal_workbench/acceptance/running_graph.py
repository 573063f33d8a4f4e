"""Exercises on the running graph, simulated or real, with a recorder for each exercise. Acceptance has control of the
antenna meanwhile."""
import contextlib
import dataclasses
import math
import pathlib
import time
from collections.abc import Iterator

import numpy as np

from acu_tracker.params import AcuParameters
from drive_law.params import AduNodeParameters
from pedestal_bringup.graph import pass_recorder
from pedestal_bringup.graph.child import Child
from pedestal_bringup.graph.processes import exit_description, uninterrupted
from pedestal_common import parameters
from pedestal_common.geometry import pointing_report
from pedestal_common.graph import nodes
from pedestal_common.graph.modes import MODE_ROWS
from pedestal_common.graph.steps import NS_PER_SECOND, GraphError
from pedestal_common.graph.topics import AXES
from pedestal_common.injection import table
from pedestal_common.quantities import Radians, Seconds
from pedestal_operator.commander import DRIVE_STATE_TOPIC
from pedestal_operator.remote_node import REPLY_TIMEOUT_S
from pedestal_recording.bag import read
from pedestal_recording.recording import Decoded
from pedestal_workbench.acceptance import in_loop
from pedestal_workbench.acceptance.client import JOINTS_TOPIC, Client, ClientSession
from pedestal_workbench.acceptance.exercise import Action, Antenna, Exercise, Performed, Performer, Span, StoppedError

GRAPH_KEYS = 'graph.pacing', 'graph.start', 'graph.beams', 'graph.simulated'  # parameters of every node
START_TIMEOUT_S = 20.0  # longest wait for the first angles of a graph that has just been started [s]
RECORDER_TIMEOUT_S = 30.0  # longest start of a recorder, and its longest end [s]
WAY_MARGIN_S = 60.0  # longest way of the antenna, in addition to its time at the rate of the shaper [s]
SETTLING_S = 0.3  # after a command, until the diagnostics state its mode [s]
LEAD_S = 0.2  # from the last stamp before an exercise to its time 0 [s]
ANYWHERE = Span(-math.inf, math.inf, math.inf)  # envelope on the way to a start: the control unit keeps its limits
TARGET_MODES = 'program', 'tle'  # modes that lead to the target, in the order in which they are tried


class RunningGraph(Performer):
    """Performer on the running graph, as a context. folder: of the recordings.

    Raises GraphError without a graph or in lockstep, StoppedError if another client has control.
    """
    antenna: Antenna
    own_runs = False

    def __init__(self, folder: pathlib.Path) -> None:
        self._folder, self._session = folder.resolve(), ClientSession(Client, [])

    def __enter__(self) -> 'RunningGraph':
        self._session.__enter__()
        try:
            self._session.wait_for_node()
            self._graph = self._session.parameters(GRAPH_KEYS)
            if self._graph['graph.pacing'] == 'lockstep':
                raise GraphError('the running graph is in lockstep, which no recorder can join; --scenario starts a '
                                 'graph for each exercise')
            if not self._session.until(lambda: not self._silent(), START_TIMEOUT_S):
                raise GraphError(self._silent())
            acu = parameters.build(AcuParameters, self._session.parameters(parameters.defaults(AcuParameters)))
            adu = parameters.build(AduNodeParameters, self._session.parameters(
                parameters.defaults(AduNodeParameters), nodes.DRIVE_NODE)) if self._graph['graph.simulated'] else None
            simulated = tuple(node for node in table.INJECTED_FAULTS
                              if self._session.remote.count_subscribers(f'{node}/inject'))
            self.antenna = Antenna(acu, adu, acu.tracker.receiver.beamwidth, acu.period, simulated,
                                   bool(self._session.remote.count_publishers('ship/imu/data')))
            self._session.take_control()
        except BaseException:
            self._session.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Stop the antenna and release control."""
        with uninterrupted(), contextlib.suppress(GraphError):
            self._session.stop_antenna()
            self._session.request('release')
        self._session.__exit__()

    def check(self, exercise: Exercise) -> None:
        """Raise ValueError for an exercise that the running graph cannot make."""
        present = {f'{node}.{name}': value for node, part in self.antenna.parts.items()
                   for name, value in parameters.as_dict(part).items()}
        for key, value in exercise.changes.items():
            if present.get(key) != value:
                raise ValueError(f'{key}: must be {value} on the running graph, which keeps its parameters; or use '
                                 '--scenario')

    def perform(self, name: str, exercise: Exercise, seed: int) -> Performed:
        """Make an exercise from a stamp shortly after its recorder writes. Raises StoppedError."""
        session, bag = self._session, self._folder / name
        try:
            self._bring_to_start(exercise)
            with self._recorder(bag) as recorder:
                begin = session.remote.stamp + round(LEAD_S * NS_PER_SECOND)
                if exercise.start is None:
                    self._follow()
                if exercise.track:
                    session.remote.send_track(exercise.track, begin)
                session.conduct(exercise, begin, lambda: self._silent(recorder))
        except GraphError as error:
            raise StoppedError(str(error)) from None
        finally:
            with uninterrupted(), contextlib.suppress(GraphError):
                self._restore(exercise)
        recording = Decoded(read(bag))
        time_0 = (begin - recording.start) / NS_PER_SECOND
        return Performed(self.antenna, exercise, recording, time_0, in_loop.outcomes(exercise, recording, time_0), bag)

    def _silent(self, recorder: Child | None = None) -> str:
        """Return which node is silent or which process has ended, '' for none."""
        if recorder and (code := recorder.poll()) is not None:
            return f'the recorder {exit_description(code)}'
        silent = [name for name in (JOINTS_TOPIC, 'acu') if not self._session.remote.present(name)]
        return f'silent: {" and ".join(silent)}' if silent else ''

    def _bring_to_start(self, exercise: Exercise) -> None:
        """Bring the antenna to the start of an exercise, or without a start to its target, and let it stop there."""
        self._session.request('reset')
        if exercise.start is None:
            self._wait(exercise, self._follow(), WAY_MARGIN_S)
        else:
            here = np.radians(self._session.remote.encoder_angles(JOINTS_TOPIC))
            way = float(np.max(np.abs(here - exercise.start) / [self.antenna.rate(axis) for axis in AXES]))
            # The command has deck angles, the start has encoder angles.
            report = self._session.remote.pointing_model
            t = np.array([report.ends_s if report else 0.0])
            angles = pointing_report.directions(report, t, np.array([exercise.start]))[0].tolist()
            self._wait(exercise, self._command('preset', dict(zip(AXES, angles))), way + WAY_MARGIN_S)
        self._wait(exercise, self._command('stop'), WAY_MARGIN_S)

    def _follow(self) -> str:
        """Command a mode that leads to the target, and return the mode. Raises StoppedError without such a mode."""
        refusals = []
        for mode in TARGET_MODES:
            try:
                return self._command(mode)
            except StoppedError as error:
                refusals.append(str(error))
        raise StoppedError(f'the antenna has no target: {"; ".join(refusals)}')

    def _command(self, mode: str, arguments: dict[str, Radians] | None = None) -> str:
        """Command a mode and return it. Raises StoppedError for a refusal."""
        reply = self._session.request(mode, arguments)
        if not reply.granted:
            raise StoppedError(f'{mode}: {reply.text}')
        return mode

    def _wait(self, exercise: Exercise, mode: str, seconds: Seconds) -> None:
        """Wait until the antenna has arrived where a mode moves it. Raises StoppedError."""
        remote, begun = self._session.remote, time.monotonic()
        row = next(row for row in MODE_ROWS if row.name == mode)
        moving = dataclasses.replace(exercise, envelope=(ANYWHERE, ANYWHERE))

        def progress() -> str:
            return remote.diagnostics_of('acu').get('progress', 'silent')

        def over() -> bool:
            known = remote.arrivals['acu'] > begun + SETTLING_S
            return known and progress() in (row.arrived, row.handover) or remote.trouble(moving) is not None
        arrived = self._session.until(over, seconds)
        if (trouble := remote.trouble(moving)) or not arrived:
            raise StoppedError(str(trouble or f'the antenna has not arrived within {seconds:.0f} s: {progress()}'))

    @contextlib.contextmanager
    def _recorder(self, bag: pathlib.Path) -> Iterator[Child]:
        """Record as a context, which begins when the recorder writes. Raises StoppedError."""
        session, status = self._session, self._session.remote.status
        self._folder.mkdir(parents=True, exist_ok=True)
        status.pop(pass_recorder.RECORDER_NODE, None)
        recorder = pass_recorder.start(bag, {
            'graph.pacing': 'realtime', 'graph.start': self._graph['graph.start'], 'beamwidth': self.antenna.beamwidth,
            'graph.beams': self._graph['graph.beams']})

        def begun() -> bool:
            known = status.get(pass_recorder.RECORDER_NODE)
            counts = [pair.value for pair in known.values if pair.key == 'messages'] if known else []
            return counts not in ([], ['0']) or recorder.poll() is not None
        try:
            if not session.until(begun, RECORDER_TIMEOUT_S) or recorder.poll() is not None:
                raise StoppedError(f'the recorder does not record, see {pass_recorder.log_of(bag)}')
            yield recorder
        finally:
            with uninterrupted():
                pass_recorder.end(recorder, RECORDER_TIMEOUT_S)

    def _restore(self, exercise: Exercise) -> None:
        """Stop the antenna, end what an exercise has left: faults, alarms, pins, an emergency stop. Raises GraphError.
        """
        session, remote = self._session, self._session.remote
        session.stop_antenna()
        for node in {node for node, _ in exercise.faults}:
            session.await_reply(remote.send(Action(0.0, node, 'clear')))
        drive = remote.texts.get(DRIVE_STATE_TOPIC, '')
        if not drive.startswith('enabled') and any(action.node == nodes.DRIVE_NODE for action in exercise.actions):
            session.until(lambda: session.request('adu/reset_faults').granted, REPLY_TIMEOUT_S)
            session.request('adu/enable')
        if any(action.command == 'stow' for action in exercise.actions) and session.request('unstow').granted:
            session.until(lambda: remote.texts.get('acu/mode') == 'standby', WAY_MARGIN_S)
        session.request('reset')
        session.stop_antenna()
        if remote.interference in exercise.alarms:
            remote.interference = ''
