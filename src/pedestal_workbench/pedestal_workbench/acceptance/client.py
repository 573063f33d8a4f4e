"""Client of a running graph for acceptance: it commands an exercise at its times, watches the antenna, and stops it.

The client sends each action when the stamp of joint_states reaches its time. The recording states the stamp at which
the node has executed it.
"""
from collections.abc import Callable

from pedestal_bringup.scenario.program import program_message
from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.injection import table
from pedestal_common.quantities import Nanoseconds
from pedestal_common.wire import commands, messages
from pedestal_operator.commander import Commander
from pedestal_operator.remote_node import RemoteSession, user
from pedestal_workbench.acceptance import in_loop
from pedestal_workbench.acceptance.exercise import Action, Exercise, LateError, StoppedError, Track

CLIENT = 'acceptance'   # name of the node of the client
JOINTS_TOPIC, TRACK_TOPIC = 'joint_states', 'acu/program_track'
STOP_TIMEOUT_S = 2.0  # longest wait for the reply to `stop` or `clear` [s]
TURN_S = 0.05  # longest time between two looks at the antenna [s]


class Client(Commander):
    """Client that makes exercises."""

    def __init__(self) -> None:
        super().__init__(CLIENT, f'{CLIENT} {user()}')
        self._injectors = {}
        for name in table.INJECTED_FAULTS:
            row = nodes.row(name)
            self._injectors[name] = self.writer(row.obeys)
            self.message_reader(row.replies, self._take_reply)
        self._send_track = self.writer(TRACK_TOPIC)
        self.connect_drive()

    @property
    def stamp(self) -> Nanoseconds:
        """Stamp of the last joint_states, -1 before the first."""
        return self.stamps.get(JOINTS_TOPIC, -1)

    def send(self, action: Action) -> str:
        """Send the command of an action, without waiting for its reply, and return the number of the request."""
        command = commands.parsed(action.command)
        if action.node == self.node.name or command.verb in nodes.DRIVE_SERVICES:
            return self.request(command.verb, command.arguments)
        sent = self._requests.add(command.verb, self.who, command.arguments)
        self._injectors[action.node](messages.serialize(commands.message(sent)))
        return sent.number

    def send_track(self, track: Track, begin: Nanoseconds) -> None:
        """Publish a program track. begin: stamp of its time 0."""
        message = program_message(track.t, track.angles)
        messages.put_stamp(message.header.stamp, begin)
        self._send_track(messages.serialize(message))

    def trouble(self, exercise: Exercise) -> StoppedError | None:
        """Return why the antenna must be stopped in an exercise, None for no reason."""
        if self.holder not in ('', self.who):
            return StoppedError(f'control is with {self.holder}')
        scheduled = self.interference.startswith(f'{commands.SCHEDULE_CLIENT} ')
        return in_loop.trouble(exercise, exercise.outside(self.encoder_angles(JOINTS_TOPIC), self.rates()),
                               self.alarms, '' if scheduled else self.interference)


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

    def conduct(self, exercise: Exercise, begin: Nanoseconds, left: Callable[[], str]) -> None:
        """Command an exercise at its times until its end. begin: stamp of its time 0; left(): why the antenna must be
        stopped for another reason. Raises StoppedError, after it has stopped the antenna."""
        client, due = self.remote, list(exercise.actions)
        while client.stamp < begin + round(exercise.duration * NS_PER_SECOND):
            self.spin_to_newest()
            t = (client.stamp - begin) / NS_PER_SECOND
            trouble = client.trouble(exercise) if t >= 0.0 else None
            if reason := left():
                trouble = StoppedError(reason)
            elif not trouble and due and t > due[0].at + in_loop.MAX_LATENESS_S:
                trouble = LateError(in_loop.lateness(due[0], t))
            if trouble:
                self.stop_antenna()
                raise trouble
            while due and t >= due[0].at:
                client.send(due.pop(0))

    def stop_antenna(self) -> None:
        """Command the mode `stop`, which the control unit grants every client."""
        self.await_reply(self.remote.request('stop'))

    def await_reply(self, number: str) -> None:
        """Wait for the reply to a request, which a silent node does not send."""
        self.until(lambda: self.remote.replied(number), STOP_TIMEOUT_S)
