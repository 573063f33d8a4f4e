"""ROS node of the station, and the loop that runs it: messages in, a step of the sequence, commands out."""
import collections
import contextlib
import math
import pathlib
import socket
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from rclpy.parameter import parameter_value_to_python

from pedestal_bringup.scenario.program import program_message
from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import STATION_NAMES
from pedestal_common.graph.modes import MODES
from pedestal_common.graph.steps import NS_PER_SECOND, GraphError
from pedestal_common.quantities import Message, Seconds, Value
from pedestal_common.wire import commands, messages
from pedestal_common.wire.commands import Command, Reply
from pedestal_operator.remote_node import REPLY_TIMEOUT_S, RETRY_PERIOD_S, Query, Remote, RemoteSession
from pedestal_station.outputs.file import ELEMENT_NAMES, Contact, Plan, PlanError, seconds, utc_text
from pedestal_station.station import progress, requests, sequence
from pedestal_station.station.fresh import Watch
from pedestal_station.station.recordings import Recordings
from pedestal_station.station.sequence import Aim, Inputs, Rules

TICK_S = 0.2  # time between two steps of the sequence [s]
MAX_KEPT_REPLIES = 100  # largest number of replies that are repeated
MAX_PLACE_DIFFERENCE_DEG = 0.01  # between the positions of the plan and of the control unit [deg]
PROOF_TIMEOUT_S = 300.0  # longest wait for the reports at the end [s]
ON_TARGET_MODES = 'autotrack', 'steptrack'  # modes in which the receiver measures the target
ON_TRACK_WORDS = 'tle, on track', 'program, on track'  # progress on the target of an antenna without handover
PROGRAM_TOPIC, COMMAND_TOPIC, REPLY_TOPIC = 'acu/program_track', 'station/command', 'station/command_result'
NIGHT_TOPIC, LOG_TOPIC = 'station/night', 'station/log'
DRIVE_STATE_TOPIC, EMERGENCY_STOP = 'adu/state', 'emergency stop'  # topic, and its text after an emergency stop

CONTROL_UNIT_PARAMETERS = ('graph.start', 'graph.beams', 'prediction.start_time', 'prediction.oldest',
                           'tracker.handover', 'tracker.receiver.beamwidth', 'azimuth.limits.low',
                           'azimuth.limits.high', *(f'prediction.station.{name}' for name in STATION_NAMES))


class Options(NamedTuple):
    """Options of the station."""
    bags: pathlib.Path          # folder of the recordings
    lead: Seconds               # see Rules
    gap: Seconds                # see Rules
    park: str                   # see Rules
    elements: pathlib.Path | None       # watched folder


def own_name() -> str:
    """Return the name of the station as a client, which no operator has."""
    return f'station@{socket.gethostname()}'


class StationNode(Remote):
    """Client of the control unit that also takes commands of operators and publishes the night."""
    holder: str             # client that has control of the antenna, '' for none
    interference: str       # mode of another client without control, or an emergency stop, since the last step

    def __init__(self, who: str, beam: str = '') -> None:
        super().__init__('station', who, 'acu', beam)
        self.holder = self.interference = ''
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
            self.refused.append(f'{COMMAND_TOPIC} refused: {error}')
            return
        answer = self._answers.get((command.who, command.number)) if command.number else None
        if answer is not None:
            self._write[REPLY_TOPIC](messages.serialize(answer))
        elif command not in self.received:
            self.received.append(command)

    def answer(self, command: Command, reply: Reply) -> None:
        """Publish the reply to a command."""
        message = commands.reply_message(command, reply)
        self._answers[command.who, command.number] = message
        while len(self._answers) > MAX_KEPT_REPLIES:
            self._answers.popitem(last=False)
        self._write[REPLY_TOPIC](messages.serialize(message))

    def tell(self, topic: str, text: str) -> None:
        """Publish a text."""
        self._write[topic](messages.serialize(messages.String(data=text)))

    def send_track(self, contact: Contact, ahead: Seconds) -> None:
        """Publish the track of a contact. ahead: UTC of the sky minus that of the graph."""
        import numpy as np
        rows = np.array(contact.track)
        track = program_message(rows[:, 0] - rows[0, 0], rows[:, 1:])
        messages.put_stamp(track.header.stamp, round((rows[0, 0] - ahead) * NS_PER_SECOND))
        self._write[PROGRAM_TOPIC](messages.serialize(track))

    def _take_reply(self, status: Message) -> None:
        """Take the replies of the control unit, also those to others: who has control, and who commanded a mode."""
        super()._take_reply(status)
        with contextlib.suppress(ValueError):
            command, reply = commands.of_reply(status)
            verb = command.verb.removeprefix('acu/')
            if reply.granted and verb in ('take', 'release'):
                self.holder = command.who if verb == 'take' else ''
            elif reply.granted and verb in MODES and command.who != self.who and self.holder in ('', self.who):
                self.interference = f'{command.who} commanded {verb}'

    def _text_taker(self, topic: str) -> Callable[[Message], None]:
        take = super()._text_taker(topic)

        def taken(message: Message) -> None:
            if topic == DRIVE_STATE_TOPIC and message.data == EMERGENCY_STOP:
                self.interference = EMERGENCY_STOP
            take(message)
        return taken

    def _take_status(self, array: Message) -> None:
        super()._take_status(array)
        if any(status.name == self.name_of('acu') for status in array.status):
            self.holder = self.diagnostics_of('acu').get('control', '')

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

    def __init__(self, session: RemoteSession, node: StationNode, plan: Plan, options: Options,
                 ros_arguments: Sequence[str] = ()) -> None:
        """Raises GraphError without a control unit, PlanError for a plan that is over or that is for another place."""
        self._session, self._node, self._plan = session, node, plan
        found = self._parameters()
        self._handover = bool(found['tracker.handover'])
        start, graph_start = str(found['prediction.start_time']), int(found['graph.start'])
        self._ahead = (seconds(orbit.instant('prediction.start_time', start)) - graph_start / NS_PER_SECOND
                       if start and graph_start else 0.0)
        self._rules = Rules(options.lead, options.gap, options.park, float(found['prediction.oldest']))
        self._file = progress.file_of(plan.path)
        begun = sequence.begin(plan.contacts, self.now)
        self._state = progress.resume(begun, self._file, self.now)
        self._antenna = requests.Antenna(plan.station, (math.degrees(found['azimuth.limits.low']),
                                                        math.degrees(found['azimuth.limits.high'])))
        self._check(found)
        self._watch = Watch(options.elements, plan.station, self._rules.oldest) if options.elements else None
        self._recordings = Recordings(options.bags, {
            'graph.pacing': 'realtime', **{name: found[name] for name in ('graph.start', 'graph.beams')},
            'beamwidth': found['tracker.receiver.beamwidth']}, ros_arguments)
        self._request, self._asked_at, self._sent_at = '', 0.0, 0.0
        self._night = ''

    @property
    def now(self) -> Seconds:
        """UTC of the sky: that of the stamps, or that of a simulation of another day (prediction.start_time)."""
        return self._node.clock()[1] / NS_PER_SECOND + self._ahead

    def _parameters(self) -> dict[str, Value]:
        """Return the parameters of the control unit. Raises GraphError."""
        from rcl_interfaces.srv import GetParameters
        node = self._node
        query = Query(node.create_client(GetParameters, f'{node.beam}acu/get_parameters'), CONTROL_UNIT_PARAMETERS,
                      parameter_value_to_python)
        self._session.until(query.answered, REPLY_TIMEOUT_S)
        if not query.values:
            raise GraphError(f'the control unit does not state its parameters within {REPLY_TIMEOUT_S:g} s')
        if self._session.remote.get_node_names().count('station') > 1:
            raise GraphError('another station commands this antenna')
        return dict(zip(CONTROL_UNIT_PARAMETERS, query.values))

    def _check(self, found: dict[str, Value]) -> None:
        """Name the passes that are over. Raises PlanError if all are, or if the plan is for another place."""
        place = [float(found[f'prediction.station.{name}']) for name in STATION_NAMES]
        if any(map(math.isnan, place)):
            raise PlanError('the control unit has no position: set `acu.prediction.station.*`')
        planned = [getattr(self._plan.station, name) for name in STATION_NAMES]
        if any(abs((a - b + 180.0) % 360.0 - 180.0) > MAX_PLACE_DIFFERENCE_DEG for a, b in zip(place[:2], planned)):
            raise PlanError(f'{self._plan.path}: station = {planned}: must be the position of the '
                            f'control unit, {place}')
        for entry in self._state.entries:
            if entry.text.startswith('refused: ') and entry.state == 'skipped':
                self._say([f'{entry.contact.case}: {entry.text}'])
        if not any(entry.state in ('queued', 'running') for entry in self._state.entries):
            raise PlanError(f'{self._plan.path}: all its passes are over at {utc_text(self.now)}')

    def run(self) -> bool:
        """Run until the last pass is over and its report is written. Return True if no pass has failed."""
        for entry in self._state.entries:
            if entry.state in ('queued', 'running'):
                contact = entry.contact
                self._say([f'{contact.case}: {entry.state}, {utc_text(contact.begin)} to {sequence.clock(contact.end)}'
                           + (f', {entry.text}' if entry.text else '')])
        self._session.until(lambda: self._node.present(self._node.name_of('acu')), REPLY_TIMEOUT_S)
        try:
            while not self._state.over:
                self.tick()
                self._session.until(lambda: False, TICK_S)
            self._recordings.prove_rest()
            deadline = time.monotonic() + PROOF_TIMEOUT_S
            while self._recordings.busy and time.monotonic() < deadline:
                self._session.until(lambda: False, TICK_S)
                self.tick()
        finally:
            self._recordings.close()
            self._node.close()
            if self._watch:
                self._watch.close()
        return not any(entry.state == 'failed' for entry in self._state.entries)

    def tick(self) -> None:
        """Make one step of the sequence."""
        before = self._state
        refused, self._node.refused = self._node.refused, []
        lines: list[str] = []
        result = sequence.step(self._state, self._inputs(self._answered(), lines), self._rules)
        self._state = result.state
        lines += [self._recorded(*each) for each in result.records]
        if result.command:
            self._send(result.command)
        for command, reply in result.replies:
            self._node.answer(command, reply)
        if before.entries != self._state.entries or before.held != self._state.held:
            try:
                progress.save(self._file, self._state)
            except OSError as error:
                lines.append(f'the progress is not kept: {error}')
        self._say([*refused, *result.lines, *filter(None, lines)])
        if (night := progress.night_text(self._state)) != self._night:
            self._night = night
            self._node.tell(NIGHT_TOPIC, night)

    def _recorded(self, what: str, case: str) -> str:
        """Begin or end a recording; return a line for the log. A full disk does not end the night."""
        if what == 'end':
            self._recordings.end(case)
            return ''
        try:
            return f'{case}: recorded in {self._recordings.begin(case)}'
        except OSError as error:
            return f'{case}: not recorded: {error}'

    def _inputs(self, reply: Reply | None, lines: list[str]) -> Inputs:
        """Return the inputs of a step, and add lines for the log."""
        node, now = self._node, self.now
        found = node.diagnostics_of('acu')
        fresh: Sequence[sequence.Fresh] = ()
        if self._watch:
            wanted = frozenset(entry.contact.number or entry.contact.name for entry in self._state.entries
                               if entry.state == 'queued' and entry.contact.elements)
            fresh, refused = self._watch.look(time.monotonic(), wanted, now)
            lines += refused
        received, node.received = node.received, []
        interference, node.interference = node.interference, ''
        return Inputs(now, node.present(node.name_of('acu')), node.texts.get('acu/mode', ''),
                      found.get('progress', ''), node.tracking(self._handover),
                      {name: found[name] for name in ELEMENT_NAMES if name in found},
                      node.holder if node.holder != node.who else '', node.alarm, reply, interference,
                      tuple(self._decoded(received, lines)), tuple(fresh), tuple(self._recordings.poll()))

    def _decoded(self, received: Sequence[Command], lines: list[str]) -> list[requests.Request]:
        """Return the requests of commands; refuse the others."""
        found = []
        for command in received:
            try:
                found.append(requests.request(command, self._antenna))
            except ValueError as error:
                lines.append(f'{command} of {command.who}: refused: {error}')
                self._node.answer(command, Reply(False, f'refused: {error}'))
        return found

    def _send(self, aim: Aim) -> None:
        entry = sequence.current(self._state)
        if aim.verb == 'program' and entry:
            self._node.send_track(entry.contact, self._ahead)
        self._request = self._node.request(aim.verb, aim.arguments)
        self._asked_at = self._sent_at = time.monotonic()

    def _answered(self) -> Reply | None:
        """Return the reply to the last command. A command without a reply is repeated, then given up."""
        if not self._request:
            return None
        reply, now = self._node.replied(self._request), time.monotonic()
        if reply is None and now - self._asked_at > REPLY_TIMEOUT_S:
            reply = Reply(False, f'no reply of the control unit within {REPLY_TIMEOUT_S:g} s')
        elif reply is None and now - self._sent_at > RETRY_PERIOD_S:
            self._sent_at = now
            self._node.repeat_request(self._request)
        if reply is not None:
            self._request = ''
        return reply

    def _say(self, lines: Sequence[str]) -> None:
        """Print lines, and publish them, each with its UTC."""
        stamped = [f'{utc_text(self.now)} {line}' for line in lines]
        if stamped:
            with contextlib.suppress(OSError):      # a closed terminal does not end the night
                print(*stamped, sep='\n', flush=True)
            self._node.tell(LOG_TOPIC, '\n'.join(stamped))


