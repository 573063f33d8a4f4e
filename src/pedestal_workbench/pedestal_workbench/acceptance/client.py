"""Client of a graph for acceptance: it commands an exercise at its times, watches the antenna, and stops it.

The client sends each action when the stamp of joint_states reaches its time. The recording states the stamp at which
the node has executed it.
"""
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from pedestal_bringup.scenario.program import program_message
from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.injection import table
from pedestal_common.quantities import Nanoseconds, Seconds
from pedestal_common.wire import commands, messages
from pedestal_operator.commander import EMERGENCY_STOP, Commander
from pedestal_operator.remote_node import RemoteSession, user
from pedestal_operator.state import PAST_STATES, alarm
from pedestal_recording.recording import Recording, holds, replies
from pedestal_workbench.acceptance.exercise import (
    Action,
    BreachError,
    Executed,
    Exercise,
    LateError,
    StoppedError,
    Track,
)
from pedestal_workbench.acceptance.in_loop import CLIENT

JOINTS_TOPIC, TRACK_TOPIC = 'joint_states', 'acu/program_track'
STOP_TIMEOUT_S = 2.0  # longest wait for the reply to `stop` or `clear` [s]
MAX_LATENESS_S = 0.1  # of a command [s]
TURN_S = 0.05  # longest time between two looks at the antenna [s]


class Sent(NamedTuple):
    """An action that was sent."""
    action: Action
    number: str     # of its request


class Client(Commander):
    """Client that makes exercises. injected: nodes into which it may inject faults."""

    def __init__(self, injected: Iterable[str] = table.INJECTED_FAULTS) -> None:
        super().__init__(CLIENT, f'{CLIENT} {user()}')
        self._injectors = {}
        for name in injected:
            row = nodes.row(name)
            self._injectors[name] = self.writer(row.obeys)
            self.message_reader(row.replies, self._take_reply)
        self._send_track = self.writer(TRACK_TOPIC)
        self.connect_drive()

    def subscribe_numbers(self, topic: str) -> None:
        """Subscribe to the only topic of every step that it needs, so that it keeps up with a graph in lockstep."""
        if topic == JOINTS_TOPIC:
            super().subscribe_numbers(topic)

    @property
    def stamp(self) -> Nanoseconds:
        """Stamp of the last joint_states, -1 before the first."""
        return self.stamps.get(JOINTS_TOPIC, -1)

    @property
    def reaches_acu(self) -> bool:
        """True while the control unit receives its commands."""
        return self.publishers_by_link[self._link(self.node.obeys)[0]].get_subscription_count() > 0

    def send(self, action: Action) -> Sent:
        """Send the command of an action, without waiting for its reply."""
        command = commands.parsed(action.command)
        if action.node == self.node.name or command.verb in nodes.DRIVE_SERVICES:
            return Sent(action, self.request(command.verb, command.arguments))
        sent = self._requests.add(command.verb, self.who, command.arguments)
        self._injectors[action.node](messages.serialize(commands.message(sent)))
        return Sent(action, sent.number)

    def send_track(self, track: Track, begin: Nanoseconds) -> None:
        """Publish a program track. begin: stamp of its time 0."""
        message = program_message(track.t, track.angles)
        messages.put_stamp(message.header.stamp, begin)
        self._send_track(messages.serialize(message))

    def trouble(self, exercise: Exercise) -> StoppedError | None:
        """Return why the antenna must be stopped in an exercise, None for no reason."""
        if self.holder not in ('', self.who):
            return StoppedError(f'control is with {self.holder}')
        unexpected = {each['name']: f'alarm {each["name"]}: {each["detail"] or each["meaning"]}'
                      for each in map(alarm, self.alarms)
                      if each['state'] not in PAST_STATES and each['name'] not in exercise.alarms}
        pressed = unexpected.pop(EMERGENCY_STOP, '')    # by an operator, if no other alarm explains it
        if breach := exercise.outside(self.encoder_angles(JOINTS_TOPIC), self.rates()) or '; '.join(
                unexpected.values()):
            return BreachError(breach)
        scheduled = self.interference.startswith(f'{commands.SCHEDULE_CLIENT} ')
        if self.interference and not scheduled and self.interference not in exercise.alarms:
            return StoppedError(self.interference)
        return StoppedError(pressed) if pressed else None


class ClientSession(RemoteSession):
    """Session of a Client."""
    remote: Client

    def take_control(self) -> None:
        """Take control of the antenna. Raises StoppedError if another client has it, GraphError without a reply."""
        reply = self.request('take')
        if not reply.granted:
            raise StoppedError(f'acceptance cannot take control: {reply.text}')
        self.remote.interference = ''

    def spin_to_newest(self) -> None:
        """Receive all messages that have arrived, so that the client acts on the newest one; wait for the first."""
        self.spin(TURN_S)
        last = None
        while last != self.remote.stamp:
            last = self.remote.stamp
            self.spin(0.0)

    def conduct(self, exercise: Exercise, begin: Nanoseconds, left: Callable[[], str | None]) -> list[Sent]:
        """Command an exercise at its times until its end. begin: stamp of its time 0; left(): why the antenna must be
        stopped for another reason, None after the end of the graph. Raises StoppedError, after it has stopped the
        antenna."""
        client, due, sent = self.remote, list(exercise.actions), list[Sent]()
        while (reason := left()) == '' and client.stamp < begin + round(exercise.duration * NS_PER_SECOND):
            self.spin_to_newest()
            elapsed = client.stamp - begin
            if due and elapsed > round((due[0].at + MAX_LATENESS_S) * NS_PER_SECOND):
                self.stop_antenna()
                raise LateError(lateness(due[0], elapsed / NS_PER_SECOND))
            while due and elapsed >= round(due[0].at * NS_PER_SECOND):
                sent.append(client.send(due.pop(0)))
            if elapsed >= 0 and (trouble := client.trouble(exercise)):
                self.stop_antenna()
                raise trouble
        if reason:
            self.stop_antenna()
            raise StoppedError(reason)
        return sent

    def stop_antenna(self) -> None:
        """Command the mode `stop`, which the control unit grants every client."""
        self.await_reply(self.remote.request('stop'))

    def await_reply(self, number: str) -> None:
        """Wait for the reply to a request, which a silent node does not send."""
        self.until(lambda: self.remote.replied(number), STOP_TIMEOUT_S)


def lateness(action: Action, t: Seconds) -> str:
    """Return the words on a late command. t: time of the exercise at which it was sent or executed."""
    return (f'{action.command}: {t - action.at:.2f} s late, must be at most {MAX_LATENESS_S:g} s; this computer is '
            'too busy')


def outcomes(exercise: Exercise, sent: Sequence[Sent], recording: Recording, begin: Seconds) -> tuple[Executed, ...]:
    """Return the actions with their outcomes as recorded. A service of the drive has no number: the recorded replies
    to a service are in the order of its requests. begin: in the time of the recording. Raises LateError for a late
    action, StoppedError for one without an outcome."""
    for late in exercise.actions[len(sent):]:
        raise LateError(lateness(late, exercise.duration))
    found: dict[str, tuple[Seconds, commands.Reply]] = {}
    services: dict[str, list[tuple[Seconds, commands.Reply]]] = defaultdict(list)
    for topic in {nodes.row(each.action.node).replies for each in sent}:
        for t, command, reply in replies(recording, topic) if holds(recording, topic) else ():
            if command.who == commands.SERVICE_CLIENT and t >= begin:
                services[command.verb].append((t, reply))
            found[command.number] = t, reply
    made = []
    for action, number in sent:
        of_service = services[commands.parsed(action.command).verb]
        if number not in found and not of_service:
            raise StoppedError(f'{action.node} did not reply to {action.command}')
        t, reply = found[number] if number in found else of_service.pop(0)
        if t - begin > action.at + MAX_LATENESS_S:
            raise LateError(lateness(action, t - begin))
        made.append(Executed(t - begin, action, *reply))
    return tuple(made)
