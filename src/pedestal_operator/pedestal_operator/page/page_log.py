"""Event log of the page: commands with their senders and replies, changed states and alarms. No ROS here."""
from collections import deque
from collections.abc import Iterable, Mapping
from typing import TypedDict

from pedestal_common.quantities import Json, Seconds
from pedestal_common.wire.commands import Command, Reply

MAX_LOG_LINES = 200  # largest number of lines, and of names whose last jog is kept
JOG_VERB, NEW_JOG_PAUSE_S = 'rate', 2.0  # command of a jog, and pause after which it is a new line [s]


class Line(TypedDict):
    """A line of the event log, as the page receives it."""
    t: Seconds      # UTC
    who: str
    text: str
    bad: bool       # True for a refusal or an alarm


class Log:
    """The newest lines of the event log. most: largest number of lines."""
    lines: deque[Line]
    revision: int                   # number of lines added
    _last_jogs: dict[str, Seconds]  # {client: time of its last command, if that was a jog}
    _texts: dict[str, str]          # {topic: its last text}
    _alarms: dict[str, str]         # {alarm: its last state}

    def __init__(self, most: int = MAX_LOG_LINES) -> None:
        self.lines, self.revision = deque(maxlen=most), 0
        self._last_jogs, self._texts, self._alarms = {}, {}, {}

    def add_line(self, t: Seconds, who: str, text: str, bad: bool = False) -> None:
        """Add a line."""
        self.lines.append({'t': t, 'who': who, 'text': text, 'bad': bad})
        self.revision += 1

    def replied(self, t: Seconds, command: Command, reply: Reply) -> None:
        """Log the reply to a command at a time t, UTC. A repeated jog is logged once."""
        # The time is stored first. A command that is no jog then deletes it, because the next jog is a new line.
        before, self._last_jogs[command.who] = self._last_jogs.get(command.who, -NEW_JOG_PAUSE_S), t
        if command.verb != JOG_VERB:
            del self._last_jogs[command.who]
        elif t - before < NEW_JOG_PAUSE_S and reply.granted:
            return
        if len(self._last_jogs) > MAX_LOG_LINES:
            self._last_jogs.clear()
        self.add_line(t, command.who, f'{command.verb}: {reply.text}', not reply.granted)

    def text(self, t: Seconds, topic: str, text: str) -> None:
        """Log the text of a topic if it has changed."""
        if self._texts.get(topic) != text:
            self._texts[topic] = text
            self.add_line(t, topic, text, topic == 'adu/state' and text.startswith(('fault', 'emergency')))

    def alarms(self, t: Seconds, alarms: Iterable[Mapping[str, Json]]) -> None:
        """Log the changed states in a list of alarms (page_state.alarms)."""
        states = {alarm['name']: alarm['state'] for alarm in alarms}
        for name in (*states, *(name for name in self._alarms if name not in states)):
            state = states.get(name, 'normal')
            if state != self._alarms.get(name, 'normal'):
                self.add_line(t, 'alarm', f'{name}: {state}', state == 'unacknowledged')
        self._alarms = states
