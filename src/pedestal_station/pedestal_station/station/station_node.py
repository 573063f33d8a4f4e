"""ROS node of the station, and the loop that runs it: messages in, a step of the sequence, commands out."""
import collections
import contextlib
import math
import pathlib
import socket
import time
from collections.abc import Sequence

import numpy as np

from pedestal_bringup.scenario.program import program_message
from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import STATION_NAMES
from pedestal_common.graph.steps import NS_PER_SECOND, GraphError
from pedestal_common.quantities import Message, Seconds, Value
from pedestal_common.wire import commands, messages
from pedestal_common.wire.commands import Command, Reply
from pedestal_operator.commander import DRIVE_STATE_TOPIC, EMERGENCY_STOP, Commander
from pedestal_operator.remote_node import REPLY_TIMEOUT_S, RemoteSession
from pedestal_station.outputs.file import ELEMENT_NAMES, Contact, Plan, PlanError, seconds, utc_text
from pedestal_station.station import progress
from pedestal_station.station.fresh import Watch
from pedestal_station.station.recordings import PROOF_TIMEOUT_S, Recordings
from pedestal_station.station.requests import Antenna
from pedestal_station.station.sequence import Aim, Fresh, Inputs, PassSequence, Rules, Step, clock

TICK_S = 0.2  # time between two steps of the sequence [s]
MAX_KEPT_COMMANDS = 100  # largest number of commands without a reply, and of replies that are repeated
MAX_PLACE_DIFFERENCE_DEG = 0.01  # between the positions of the plan and of the control unit [deg]
COMMAND_TIMEOUT_S = 2.5  # longest wait for the reply of the control unit; other commands wait meanwhile [s]
SAVE_PERIOD_S = 10.0  # longest time between two writes of the progress [s]
ON_TARGET_MODES = 'autotrack', 'steptrack'  # modes in which the receiver measures the target
ON_TRACK_WORDS = 'tle, on track', 'program, on track'  # progress on the target of an antenna without handover
PROGRAM_TOPIC, COMMAND_TOPIC, REPLY_TOPIC = 'acu/program_track', 'station/command', 'station/command_result'
NIGHT_TOPIC, LOG_TOPIC = 'station/night', 'station/log'
TO_COME = 'queued', 'running'  # states of a pass that the station will take

CONTROL_UNIT_PARAMETERS = ('graph.start', 'graph.beams', 'prediction.start_time', 'prediction.oldest',
                           'tracker.handover', 'tracker.receiver.beamwidth', 'azimuth.limits.low',
                           'azimuth.limits.high', *(f'prediction.station.{name}' for name in STATION_NAMES))


class StationNode(Commander):
    """Client of the control unit that also takes commands of operators and publishes the night."""

    def __init__(self, beam: str = '') -> None:
        super().__init__('station', f'station@{socket.gethostname()}', 'acu', beam)     # a name that no operator has
        self.received: list[Command] = []
        self.refused: list[str] = []
        self._answers: collections.OrderedDict[tuple[str, str], Message] = collections.OrderedDict()
        self._write = {topic: self.writer(topic) for topic in (NIGHT_TOPIC, LOG_TOPIC, REPLY_TOPIC, PROGRAM_TOPIC)}
        self.message_reader(COMMAND_TOPIC, self._take_command)

    def _take_command(self, status: Message) -> None:
        """Keep the command of an operator. A command that arrives again gets the same reply again."""
        try:
            command = commands.of_message(status)
        except ValueError as error:
            if len(self.refused) < MAX_KEPT_COMMANDS:
                self.refused.append(f'{COMMAND_TOPIC} refused: {error}')
            return
        answer = self._answers.get((command.who, command.number)) if command.number else None
        if answer is not None:
            self._write[REPLY_TOPIC](messages.serialize(answer))
        elif command not in self.received and len(self.received) < MAX_KEPT_COMMANDS:
            self.received.append(command)

    def answer(self, command: Command, reply: Reply) -> None:
        """Publish the reply to a command."""
        message = commands.reply_message(command, reply)
        self._answers[command.who, command.number] = message
        while len(self._answers) > MAX_KEPT_COMMANDS:
            self._answers.popitem(last=False)
        self._write[REPLY_TOPIC](messages.serialize(message))

    def tell(self, topic: str, text: str) -> None:
        """Publish a text."""
        self._write[topic](messages.serialize(messages.String(data=text)))

    def send_track(self, contact: Contact, ahead: Seconds) -> None:
        """Publish the track of a contact. ahead: UTC of the sky minus that of the graph."""
        rows = np.array(contact.track)
        track = program_message(rows[:, 0] - rows[0, 0], rows[:, 1:])
        messages.put_stamp(track.header.stamp, round((rows[0, 0] - ahead) * NS_PER_SECOND))
        self._write[PROGRAM_TOPIC](messages.serialize(track))

    def tracking(self, handover: bool) -> bool:
        """Return True while the target is measured, or is followed by an antenna without handover to the receiver."""
        found = self.diagnostics_of('acu')
        if self.texts.get('acu/mode') in ON_TARGET_MODES:
            return found.get('coasting', '') == '0'
        return not handover and found.get('progress') in ON_TRACK_WORDS

    @property
    def alarm(self) -> str:
        """Latched fault of the control unit, or the state of a drive that is off by itself; '' for none."""
        drive = self.texts.get(DRIVE_STATE_TOPIC, '')
        return self.diagnostics_of('acu').get('faults', '') or (
            f'drive: {drive}' if drive.startswith(('fault', EMERGENCY_STOP)) else '')


class Station:
    """The station in its loop."""

    def __init__(self, session: RemoteSession, node: StationNode, plan: Plan, rules: Rules,
                 elements: pathlib.Path | None) -> None:
        """Name the passes. elements: folder to watch. Raises GraphError without a control unit, PlanError for a plan
        that is over or that is for another place."""
        self._session, self._node = session, node
        self._found = found = self._parameters()
        start, graph_start = str(found['prediction.start_time']), int(found['graph.start'])
        self._ahead = (seconds(orbit.instant('prediction.start_time', start)) - graph_start / NS_PER_SECOND
                       if start and graph_start else 0.0)
        low, high = (math.degrees(found[f'azimuth.limits.{end}']) for end in ('low', 'high'))
        antenna = Antenna(plan.station, (low, high), float(found['prediction.oldest']))
        self._check_place(plan)
        self._passes = PassSequence(plan.contacts, rules, antenna, self.now)
        self._file = progress.file_of(plan.path)
        progress.resume(self._passes, self._file, self.now)
        self._watch = Watch(elements, antenna) if elements else None
        self._reply: Reply | None = None
        self._saved_at, self._doing = -math.inf, ''
        self._say([f'{each.contact.case}: {each.text}' if each.state == 'skipped' else
                   f'{each.contact.case}: {each.state}, {utc_text(each.contact.begin)} to {clock(each.contact.end)}'
                   + (f', {each.text}' if each.text else '') for each in self._passes.entries
                   if each.state in TO_COME or each.text.startswith('refused: ')])
        if not any(each.state in TO_COME for each in self._passes.entries):
            raise PlanError(f'{plan.path}: all its passes are over at {utc_text(self.now)}')

    @property
    def now(self) -> Seconds:
        """UTC of the sky: that of the stamps, or that of a simulation of another day (prediction.start_time)."""
        return self._node.clock()[1] / NS_PER_SECOND + self._ahead

    def _parameters(self) -> dict[str, Value]:
        """Return the parameters of the control unit. Raises GraphError."""
        found = self._session.parameters(CONTROL_UNIT_PARAMETERS)
        if self._node.get_node_names().count('station') > 1:
            raise GraphError('another station commands this antenna')
        return found

    def _check_place(self, plan: Plan) -> None:
        place = [float(self._found[f'prediction.station.{name}']) for name in STATION_NAMES]
        if any(map(math.isnan, place)):
            raise PlanError('the control unit has no position: set `acu.prediction.station.*`')
        planned = [getattr(plan.station, name) for name in STATION_NAMES]
        if any(abs((a - b + 180.0) % 360.0 - 180.0) > MAX_PLACE_DIFFERENCE_DEG for a, b in zip(place[:2], planned)):
            raise PlanError(f'{plan.path}: station = {planned}: must be the position of the control unit, {place}')

    def run(self, bags: pathlib.Path, ros_arguments: Sequence[str] = ()) -> bool:
        """Run until the last pass is over and its report is written. Return True if no pass has failed. bags: folder
        of the recordings."""
        found = self._found
        recordings = Recordings(bags, {'graph.pacing': 'realtime', 'beamwidth': found['tracker.receiver.beamwidth'],
                                       **{name: found[name] for name in ('graph.start', 'graph.beams')}},
                                ros_arguments)
        self._session.until(lambda: self._node.present(self._node.name_of('acu')), REPLY_TIMEOUT_S)
        try:
            while not self._passes.over:
                self.tick(recordings)
            recordings.prove_rest()
            deadline = time.monotonic() + PROOF_TIMEOUT_S
            while recordings.busy and time.monotonic() < deadline:
                self.tick(recordings)
        finally:
            recordings.close()
            self._node.close()
            if self._watch:
                self._watch.close()
        return not any(entry.state == 'failed' for entry in self._passes.entries)

    def tick(self, recordings: Recordings) -> None:
        """Make one step of the sequence, and wait for the next."""
        fresh, refused = self._watch.look(time.monotonic(), self._wanted(), self.now) if self._watch else ([], [])
        step = self._passes.step(self._inputs(fresh, recordings.poll()))
        step.lines[:0] = [*refused, *self._node.refused]
        self._node.refused = []
        for what, case in step.records:
            if what == 'end':
                recordings.end(case)
                continue
            try:
                step.lines.append(f'{case}: recorded in {recordings.begin(case)}')
            except OSError as error:    # a full disk does not end the night
                step.lines.append(f'{case}: not recorded: {error}')
        for command, reply in step.replies:
            self._node.answer(command, reply)
        self._publish(step)
        self._reply = self._execute(self._passes.pending) if self._passes.pending else None
        self._session.until(lambda: False, TICK_S)

    def _wanted(self) -> frozenset[str]:
        """Return the satellites whose elements may still be replaced."""
        return frozenset(entry.contact.satellite for entry in self._passes.entries if entry.state == 'queued'
                         and entry.contact.elements)

    def _inputs(self, fresh: Sequence[Fresh], reports: Sequence[tuple[str, str]]) -> Inputs:
        node = self._node
        found = node.diagnostics_of('acu')
        received, node.received = node.received, []
        interference, node.interference = node.interference, ''
        return Inputs(self.now, node.present(node.name_of('acu')), node.texts.get('acu/mode', ''),
                      found.get('progress', ''), node.tracking(bool(self._found['tracker.handover'])),
                      {name: found[name] for name in ELEMENT_NAMES if name in found},
                      node.holder if node.holder != node.who else '', node.alarm, self._reply, interference,
                      received, fresh, reports)

    def _publish(self, step: Step) -> None:
        """Keep the progress, state each decision, and publish the night where it has changed."""
        if step.lines or time.monotonic() - self._saved_at > SAVE_PERIOD_S:
            self._saved_at = time.monotonic()
            try:
                progress.save(self._file, self._passes)
            except OSError as error:
                step.lines.append(f'the progress is not kept: {error}')
        self._say(step.lines)
        if step.lines or self._passes.now != self._doing:
            self._doing = self._passes.now
            self._node.tell(NIGHT_TOPIC, progress.night_text(self._passes))

    def _execute(self, aim: Aim) -> Reply:
        """Send a command to the control unit, and return its reply."""
        entry = self._passes.first('running')
        if aim.verb == 'program' and entry:
            self._node.send_track(entry.contact, self._ahead)
        try:
            return self._session.request(aim.verb, aim.arguments, COMMAND_TIMEOUT_S)
        except GraphError as error:
            return Reply(False, str(error))

    def _say(self, lines: Sequence[str]) -> None:
        """Print lines, and publish them, each with its UTC."""
        stamped = [f'{utc_text(self.now)} {line}' for line in lines]
        if stamped:
            with contextlib.suppress(OSError):      # a closed terminal does not end the night
                print(*stamped, sep='\n', flush=True)
            self._node.tell(LOG_TOPIC, '\n'.join(stamped))
