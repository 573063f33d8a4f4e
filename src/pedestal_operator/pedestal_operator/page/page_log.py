"""Event log of the page: commands with their senders and replies, changed states and alarms. No ROS here."""
import collections

MAX_LOG_LINES = 200  # largest number of lines, and of names whose last jog is kept

JOG_VERB, NEW_JOG_PAUSE_S = 'rate', 2.0
"""Command of a jog, which is repeated, and the pause after which a jog is a new line [s]."""


class Log:
    """The newest lines of the event log. most: largest number of lines.

    lines      [{'t': UTC [s], 'who': name, 'text': line, 'bad': True for a refusal or an alarm}]
    revision   number of lines added
    """

    def __init__(self, most=MAX_LOG_LINES):
        self.lines, self.revision = collections.deque(maxlen=most), 0
        self._last_jogs, self._texts, self._alarms = {}, {}, {}

    def add_line(self, t, who, text, bad=False):
        """Add a line."""
        self.lines.append({'t': t, 'who': who, 'text': text, 'bad': bad})
        self.revision += 1

    def replied(self, t, command, reply):
        """Log the commands.Reply to a commands.Command at a time t, UTC [s]. A repeated jog is logged once."""
        # The time is stored first. A command that is no jog then deletes it, because the next jog is a new line.
        before, self._last_jogs[command.who] = self._last_jogs.get(command.who, -NEW_JOG_PAUSE_S), t
        if command.verb != JOG_VERB:
            del self._last_jogs[command.who]
        elif t - before < NEW_JOG_PAUSE_S and reply.granted:
            return
        if len(self._last_jogs) > MAX_LOG_LINES:
            self._last_jogs.clear()
        self.add_line(t, command.who, f'{command.verb}: {reply.text}', not reply.granted)

    def text(self, t, topic, text):
        """Log the text of a topic if it has changed."""
        if self._texts.get(topic) != text:
            self._texts[topic] = text
            self.add_line(t, topic, text, topic == 'adu/state' and text.startswith(('fault', 'emergency')))

    def alarms(self, t, alarms):
        """Log the changed states in a list of alarms (page_state.alarms)."""
        states = {alarm['name']: alarm['state'] for alarm in alarms}
        for name in (*states, *(name for name in self._alarms if name not in states)):
            state = states.get(name, 'normal')
            if state != self._alarms.get(name, 'normal'):
                self.add_line(t, 'alarm', f'{name}: {state}', state == 'unacknowledged')
        self._alarms = states
