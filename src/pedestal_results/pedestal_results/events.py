"""Events of a recording: modes, commands and refusals with their senders, injected faults, states of the equipment,
alarms. The numbers of their table mark them on the curves (figures.mark).
"""
import contextlib
import math
import typing
from collections.abc import Iterator, Sequence

from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.injection.table import CLEAR_COMMAND, INJECT_COMMANDS, INJECTED_FAULTS
from pedestal_common.quantities import Message, Seconds
from pedestal_common.wire import commands
from pedestal_operator import state
from pedestal_operator.page.page_log import Log
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording

STATE_TOPICS = ('adu/state', 'adu/stow_pins', 'ins/state', 'acu/blockage')
"""Topics whose texts state the condition of the equipment."""

RAISED_STATES = ('unacknowledged', 'acknowledged')  # states of an alarm whose condition holds
MAX_LISTED_EVENTS = 300  # largest number of events of a kind, from the beginning


ModeSpan: typing.TypeAlias = tuple[Seconds, Seconds, str]   # begin, end and name of a mode


class Event(typing.NamedTuple):
    """An event."""
    t: Seconds  # of its beginning
    kind: str   # of figures.EVENT_COLOURS
    who: str    # its source
    text: str
    end: Seconds = math.nan     # NaN for no end


def read(bag: Recording, mode_spans: Sequence[ModeSpan]) -> list[Event]:
    """Return the events of a recording of one beam in the order of time."""
    found = [[Event(start, 'mode', 'acu', mode, stop) for start, stop, mode in mode_spans], _replies(bag),
             _states(bag), _alarms(bag)]
    return sorted((event for events in found for event in events[:MAX_LISTED_EVENTS]), key=lambda event: event.t)


def _messages(bag: Recording, topic: str, message_type: str) -> Iterator[tuple[Seconds, Message]]:
    if bag.topics.get(topic) == message_type:
        for _, log, _, message in bag.messages(topic):
            yield (log - bag.start) / NS_PER_SECOND, message


def _replies(bag: Recording) -> list[Event]:
    """Return the events of all replies: commands, refusals and injected faults; a repeated jog is one event."""
    events: list[Event] = []
    log = Log()
    for node in nodes.NODES:
        for t, command, reply in recordings.replies(bag, node.replies):
            with contextlib.suppress(ValueError):  # the command has a wrong argument
                logged = log.revision
                log.replied(t, command, reply)
                if log.revision > logged:
                    if reply.granted and command.verb == CLEAR_COMMAND.name:
                        events = [event._replace(end=min(t, event.end)) if event.kind == 'injected fault'
                                  and event.text.startswith(f'{node.name}: ') else event for event in events]
                    events.append(_reply(t, node.name, command, reply))
    return events


def _reply(t: Seconds, node: str, command: commands.Command, reply: commands.Reply) -> Event:
    if not reply.granted:
        return Event(t, 'refused', command.who, f'{node}: {command}: {reply.text}')
    if command.verb not in [fault.name for fault in INJECTED_FAULTS.get(node, ())]:
        return Event(t, 'command', command.who, f'{node}: {command}')
    duration = commands.values(INJECT_COMMANDS[node], command)['duration']
    return Event(t, 'injected fault', command.who, f'{node}: {command}', t + duration)


def _states(bag: Recording) -> list[Event]:
    """Return the events of changed states of the equipment; the first state of a topic is none."""
    events = []
    for topic in STATE_TOPICS:
        before = None
        for t, message in _messages(bag, topic, 'std_msgs/msg/String'):
            if before not in (None, message.data):
                events.append(Event(t, 'state', topic, message.data or 'none'))
            before = message.data
    return events


def _alarms(bag: Recording) -> list[Event]:
    """Return the events of raised alarms, from the raising to the clearing of the condition."""
    events: list[Event] = []
    raised: dict[str, Event] = {}
    for t, message in _messages(bag, 'acu/alarms', 'diagnostic_msgs/msg/DiagnosticArray'):
        listed = {alarm['name']: alarm for alarm in map(state.alarm, message.status)
                  if alarm['state'] in RAISED_STATES}
        for name in [name for name in raised if name not in listed]:
            events.append(raised.pop(name)._replace(end=t))
        for name, alarm in listed.items():
            if name in raised:
                continue
            text = f'{name}, {alarm["priority"]}: {alarm["meaning"]}'
            text += f' ({alarm["detail"]})' if alarm['detail'] else ''
            text += f', a consequence of {alarm["cause"]}' if alarm['cause'] else ''
            raised[name] = Event(t, 'alarm', 'acu', text, math.inf)
    return [*events, *raised.values()]


def rows(events: Sequence[Event], end: Seconds) -> list[list[str]]:
    """Return the rows [number, time, duration, kind, source, text] of a table; end: time of the last message."""
    return [[str(number), f'{event.t:.2f}', _duration(event, end), event.kind, event.who, event.text]
            for number, event in enumerate(events, start=1)]


def _duration(event: Event, end: Seconds) -> str:
    if math.isnan(event.end):
        return ''
    return f'{event.end - event.t:.2f}' if event.end < end else 'to the end'
