"""The event log of the page: who asked for what, and what the antenna said of it. No ROS here."""
import collections

MAX_LOG_LINES = 200
"""Lines that are shown, and people whose jogs are remembered."""

JOG_VERB, NEW_JOG_PAUSE_S = 'rate', 2.0
"""The verb of a jog, which is asked for again and again, and the time [s] after which another one is a new line."""


class Log:
    """The newest lines, at most so many. lines: [{'t': s UTC, 'who': name, 'text': line, 'bad': whether it is a
    refusal or an alarm}]; revision: counts them."""

    def __init__(self, most=MAX_LOG_LINES):
        self.lines, self.revision = collections.deque(maxlen=most), 0
        self._jogged, self._texts, self._alarms = {}, {}, {}

    def say(self, t, who, text, bad=False):
        """Add a line."""
        self.lines.append({'t': t, 'who': who, 'text': text, 'bad': bad})
        self.revision += 1

    def replied(self, t, command, reply):
        """A commands.Command was answered by a commands.Reply."""
        before, self._jogged[command.who] = self._jogged.get(command.who, -NEW_JOG_PAUSE_S), t
        if command.verb != JOG_VERB:
            del self._jogged[command.who]
        elif t - before < NEW_JOG_PAUSE_S and reply.granted:
            return
        if len(self._jogged) > MAX_LOG_LINES:
            self._jogged.clear()
        self.say(t, command.who, f'{command.verb}: {reply.text}', not reply.granted)

    def text(self, t, topic, text):
        """A text topic says something else."""
        if self._texts.get(topic) != text:
            self._texts[topic] = text
            self.say(t, topic, text, topic == 'adu/state' and text.startswith(('fault', 'emergency')))

    def alarms(self, t, alarms):
        """The list of alarms (page_state.alarms) is another one."""
        states = {alarm['name']: alarm['state'] for alarm in alarms}
        for name in (*states, *(name for name in self._alarms if name not in states)):
            state = states.get(name, 'normal')
            if state != self._alarms.get(name, 'normal'):
                self.say(t, 'alarm', f'{name}: {state}', state == 'unacknowledged')
        self._alarms = states
