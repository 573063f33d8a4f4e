"""`pedestal replay --page`: show a recording, without a graph, on the page of the operator with a slider."""
import math
import queue
import threading
import time
from collections.abc import Callable, Sequence

import numpy as np

from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.quantities import Json, Message, Nanoseconds, Seconds
from pedestal_common.wire import commands, messages, records
from pedestal_operator import remote_node
from pedestal_operator.antenna import POINTING_TOPIC
from pedestal_operator.page import page_log, page_sky, page_state
from pedestal_operator.page.page_log import Log
from pedestal_operator.page.page_passes import UpcomingPasses
from pedestal_operator.page.page_security import PAGE_ROLES
from pedestal_operator.page.page_server import PageServer
from pedestal_recording import bag as bags
from pedestal_recording import recording as recordings
from pedestal_workbench.again.replay import ReplayOptions

PAGE_FRAME_PERIOD_S, SLOW_FRAME_PERIOD_S = 0.1, 1.0
"""Period of the states that are sent to the pages [s]; period of the sections that change slowly [s]."""

MIN_REPLAY_RATE, MAX_REPLAY_RATE = 0.05, 50.0  # limits of the speed of the replay [multiples of real time]
MAX_PAGES = 32  # largest number of pages that show the recording at a time

MAX_EVENT_MESSAGES = 5000
"""Largest number of messages of a topic that fill the event log, from the beginning of the recording."""

DIAGNOSTICS_LOOKBACK = 60  # number of the last diagnostics messages in which the last status of each node is searched
NUMBER_TOPICS = (*remote_node.NUMBER_TOPICS, *page_state.EXTRA_NUMBER_TOPICS)  # topics whose numbers the page shows
TEXT_TOPICS = (*remote_node.TEXT_TOPICS, 'ins/state', 'acu/blockage')  # topics whose texts the page shows
LIST_TOPICS = ('acu/alarms', 'acu/program_track', 'diagnostics', 'acu/command_result')
"""Topics of other kinds that the page shows."""


class ShownRecording(page_state.PageAntenna):
    """A recording of one beam with the interface of a live Antenna: the newest messages at a position. Raises BagError
    if the bag has no joint_states."""

    def __init__(self, bag: bags.Bag) -> None:
        self.position: Seconds = 0.0    # time since the first joint state
        self._bag, self.beam = bag, bag.beam
        self._rows = {name: bag.rows(name) for name in (*NUMBER_TOPICS, *TEXT_TOPICS, *LIST_TOPICS)
                      if name in bag.topics and len(bag.rows(name))}
        if 'joint_states' not in self._rows:
            raise bags.BagError(f'{bag.path}: no joint_states in the bag, which the page needs')
        self._times = {name: np.maximum.accumulate(rows.stamp if name in NUMBER_TOPICS else rows.log)
                       for name, rows in self._rows.items()}
        joints = self._times['joint_states']
        self._begin, self.length = int(joints[0]), (int(joints[-1]) - int(joints[0])) / NS_PER_SECOND
        self._decoders = {name: records.Decoder(name, records.empty(records.of(name), 1)) for name in NUMBER_TOPICS}
        self.configuration = {name: value for node in page_state.SHOWN_PARAMETERS
                              for name, value in recordings.parameters(bag, node).items()}
        self.configuration['graph.start'] = bag.start
        self.alarms: list[Message] = []
        self.path: Json = None  # program track, for the page
        self.log = Log(most=MAX_EVENT_MESSAGES)
        self._forget()
        self._read_log()
        self.move(0.0)

    @property
    def now(self) -> Seconds:
        """Stamp of the position; UTC in a recording in realtime."""
        return (self._begin + round(self.position * NS_PER_SECOND)) / NS_PER_SECOND

    def age(self, name: str) -> Seconds:
        """Return the age of the last message of a topic or node, infinite before the first."""
        return self.now - self._received.get(name, -math.inf)

    def lines(self) -> list[page_log.Line]:
        """Return the lines of the event log up to the position."""
        return [line for line in self.log.lines if line['t'] <= self.now][-page_log.MAX_LOG_LINES:]

    def move(self, position: Seconds) -> None:
        """Go to a position, with all topics."""
        self.move_numbers(position)
        for name in TEXT_TOPICS:
            for text in self._messages(name, 1):
                self.texts[name] = text.data
        self.alarms = [status for array in self._messages('acu/alarms', 1) for status in array.status]
        for message in self._messages('acu/program_track', 1):
            self.path = page_sky.path(message, page_state.epoch(self)) or self.path
        last = self._count('diagnostics')
        for time_of, array in zip(self._times.get('diagnostics', ())[max(last - DIAGNOSTICS_LOOKBACK, 0):last],
                                  self._messages('diagnostics', DIAGNOSTICS_LOOKBACK)):
            for status in array.status:
                self.status[status.name], self._received[status.name] = status, time_of / NS_PER_SECOND

    def move_numbers(self, position: Seconds) -> None:
        """Go to a position, with the topics of numbers only, which is faster."""
        self.position = min(max(position, 0.0), self.length)
        self._forget()
        for text in self._messages(POINTING_TOPIC, 1):
            self.texts[POINTING_TOPIC] = text.data
        for name in NUMBER_TOPICS:
            for time_of, data in self._last(name, 1):
                self.numbers[name] = self._decoders[name].decoded(data)[1]
                self._received[name] = time_of / NS_PER_SECOND

    def _forget(self) -> None:
        self.numbers: dict[str, Sequence[float]] = {}
        self.texts: dict[str, str] = {}
        self.status: dict[str, Message] = {}
        self._received: dict[str, Seconds] = {}     # time of the last message of a topic or node

    def _count(self, name: str) -> int:
        moment = self._begin + round(self.position * NS_PER_SECOND)
        return int(np.searchsorted(self._times[name], moment, 'right')) if name in self._rows else 0

    def _last(self, name: str, most: int) -> list[tuple[Nanoseconds, bytes]]:
        """Return [(time, CDR bytes)] of the last messages of a topic up to the position, at most `most`."""
        last = self._count(name)
        first = max(last - most, 0)
        if last == 0:
            return []
        return [(int(at), data) for at, (*_, data) in zip(self._times[name][first:last],
                                                          self._bag.take(self._rows[name][first:last]))]

    def _messages(self, name: str, most: int) -> list[Message]:
        return [messages.deserialize(data, self._bag.topics[name]) for _, data in self._last(name, most)]

    def _read_log(self) -> None:
        events: list[tuple[Nanoseconds, str, Message]] = []
        for name in ('acu/mode', 'adu/state', 'acu/command_result', 'acu/alarms'):
            if name in self._rows:
                rows = self._rows[name][:MAX_EVENT_MESSAGES].view(np.recarray)
                events += [(row_log, name, messages.deserialize(data, self._bag.topics[name]))
                           for row_log, (*_, data) in zip(rows.log.tolist(), self._bag.take(rows))]
        for log, name, message in sorted(events, key=lambda row: row[0]):
            if name == 'acu/command_result':
                self.log.replied(log / NS_PER_SECOND, *commands.of_reply(message))
            elif name == 'acu/alarms':
                self.position, self.alarms = (log - self._begin) / NS_PER_SECOND, message.status
                self.log.alarms(log / NS_PER_SECOND, page_state.alarms(self))
            else:
                self.log.text(log / NS_PER_SECOND, name, message.data)


class Player:
    """Player that shows a recording on pages. Of the options, start, rate and paused count."""

    def __init__(self, recording: ShownRecording, port: int, options: ReplayOptions) -> None:
        self._recording, self._lock = recording, threading.Lock()
        self._playing, self._rate = not options.paused, options.rate or 1.0
        self._upcoming_passes = UpcomingPasses()
        recording.move(options.start)
        self._server = PageServer('127.0.0.1', port, names=(), most=MAX_PAGES, history=self._past)
        self.url = self._server.access.url(PAGE_ROLES[0])

    def play(self, stopped: Callable[[], bool]) -> None:
        """Serve the pages until stopped() returns True."""
        before, last_slow = time.monotonic(), -math.inf
        while not stopped():
            now = time.monotonic()
            with self._lock:
                moved = self._receive()
                if self._playing:
                    self._go(self._recording.position + self._rate * (now - before))
                slowly = moved or now - last_slow >= SLOW_FRAME_PERIOD_S
                self._show(slowly)
            last_slow = now if slowly else last_slow
            before = now
            time.sleep(PAGE_FRAME_PERIOD_S)
        self._server.close()
        self._upcoming_passes.close()

    def _go(self, position: Seconds) -> None:
        self._recording.move(position)
        self._playing = self._playing and position < self._recording.length

    def _receive(self) -> bool:
        """Execute the requests of the pages; return True if the position jumped."""
        moved = False
        while True:
            try:
                client, message, _ = self._server.requests.get_nowait()
            except queue.Empty:
                return moved
            wanted = (message or {}).get('replay')
            if not isinstance(wanted, dict):
                if message is not None:
                    self._server.reply(client, {'error': 'this is a recording: commands are not possible'})
                continue
            if _number(wanted.get('position')):
                self._go(float(wanted['position']))
                moved = True
            if _number(wanted.get('rate')):
                self._rate = min(max(float(wanted['rate']), MIN_REPLAY_RATE), MAX_REPLAY_RATE)
            if isinstance(wanted.get('playing'), bool):
                # "Play" at the end of the recording begins again at its beginning.
                again = wanted['playing'] and self._recording.position >= self._recording.length
                self._go(0.0 if again else self._recording.position)
                self._playing, moved = wanted['playing'], moved or again

    def _show(self, slowly: bool) -> None:
        """Send the state at the position to the pages; slowly: True to send the sections that change slowly too."""
        recording = self._recording
        sections: dict[str, object] = {
            'now': page_state.now(recording), 'status': page_state.status_section(recording),
            'alarms': page_state.alarms(recording), 'log': recording.lines(),
            'replay': {'length': recording.length, 'position': recording.position, 'playing': self._playing,
                       'rate': self._rate}}
        if slowly:
            past = page_sky.BeamHistory(page_state.CHART_SPAN_S)
            for frame in self._frames(SLOW_FRAME_PERIOD_S):
                past.add(frame['t'], frame['beam'])
            sections |= {'fixed': page_state.fixed(recording), 'past': past.places,
                         'sky': page_state.sky(recording, self._upcoming_passes.look(recording))}
        self._server.publish(sections)

    def _past(self) -> list[Json]:
        """Return the rows of the strip charts before the position, for a page that connects."""
        with self._lock:
            return [page_state.history_row(frame) for frame in self._frames(page_state.CHART_PERIOD_S)]

    def _frames(self, period: Seconds) -> list[dict[str, Json]]:
        """Return page_state.now every `period` over the span of the strip charts up to the position."""
        recording, position = self._recording, self._recording.position
        frames = []
        for count in range(-round(page_state.CHART_SPAN_S / period), 1):
            if position + count * period >= 0.0:
                recording.move_numbers(position + count * period)
                frames.append(page_state.now(recording))
        recording.move(position)
        return frames


def _number(value: Json) -> bool:
    return type(value) in (int, float) and math.isfinite(value)
