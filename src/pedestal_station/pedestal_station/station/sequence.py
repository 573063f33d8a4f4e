"""The sequence of a night: a state machine that takes the passes one after another. No ROS and no clock here.

    step(state, inputs, rules) -> Step: the next state, commands for the antenna, lines for the log, replies

A pass is queued, then running, and at last done, failed or skipped; the plan or an inserted pass may have dropped it.
At most one pass runs. Within it the antenna points to the begin of the contact, follows the elements, and changes to
autotrack by the rules of the control unit. All times are UTC.
"""
import dataclasses
import math
from collections.abc import Mapping
from typing import NamedTuple

from pedestal_common.graph.modes import MODE_ROWS
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Days, Seconds, Value
from pedestal_common.wire.commands import HELD_REFUSAL, Command, Reply
from pedestal_station import objects
from pedestal_station.outputs.file import Contact, epoch_of, orbit_of, utc_text
from pedestal_station.station.requests import Request

FOLLOWING_MODES = tuple(row.name for row in MODE_ROWS if row.follows and row.name not in ('slave', 'sun'))
"""Modes of a pass: those in which the control unit follows the target of the elements."""

RECORD_LEAD_S = 10.0  # time before the begin of a contact at which its recording begins [s]
FOLLOW_LEAD_S = 5.0  # time before the begin of a contact from which the antenna follows the target [s]
RETRY_S, SETTLING_S = 2.0, 2.0  # time until a command is repeated; time after a command until the mode is judged [s]
MAX_ALARM_S = 5.0  # time with an alarm after which a pass fails [s]
MAX_STOW_S = 300.0  # longest time for the stow after the last pass [s]
PIN_REFUSAL = 'stow pins not out'  # part of the refusal of a mode that the stow pins forbid
UNPLANNED = 'dropped', 'skipped', 'failed'  # states of a pass that `insert` may queue


class Rules(NamedTuple):
    """Settings of the station."""
    lead: Seconds       # time before a contact from which the antenna points to its begin: for slew and setup
    gap: Seconds        # shortest wait in which the antenna is parked
    park: str           # stored preset at which it waits; '': stow
    oldest: Days        # largest age of elements, that of the control unit


class Entry(NamedTuple):
    """A pass of the night."""
    contact: Contact
    state: str                  # queued, running, done, failed, skipped or dropped
    text: str = ''              # the reason of the state
    tracked: Seconds = 0.0      # time on the target within the contact
    report: str = ''            # its recording: where it is, and whether it is complete
    inserted: bool = False      # True for a pass of an operator


class Aim(NamedTuple):
    """A mode, as the station commands it."""
    verb: str
    arguments: Mapping[str, str | float]


class Fresh(NamedTuple):
    """Elements of a satellite that a file holds."""
    satellite: str              # catalogue number, else name
    elements: Mapping[str, str]
    source: str                 # file


class State(NamedTuple):
    """State of the station."""
    entries: tuple[Entry, ...]      # in the order of their begin
    held: str = ''                  # reason for which the station waits for `resume`; '' if it does not
    waits: str = ''                 # reason for which it waits, and then goes on by itself; '' if it does not
    aim: Aim | None = None          # mode that the control unit has accepted last from the station
    pending: Aim | None = None      # commanded mode without a reply yet
    retry: Seconds = -math.inf      # earliest time of the next command
    last: Seconds = math.nan        # time of the last step
    alarm_since: Seconds = math.inf  # begin of the present alarm
    refusal: str = ''               # last refusal of the control unit in this pass
    recording: str = ''             # case of the pass that is recorded
    now: str = ''                   # what the station does
    ends: Seconds = math.inf        # latest end of the station, after the last pass
    over: bool = False              # True at the end


class Inputs(NamedTuple):
    """What the station knows at a step."""
    now: Seconds
    present: bool                           # True if the control unit publishes
    mode: str = ''
    progress: str = ''                      # words of the control unit for the mode
    tracking: bool = False                  # True while the target is measured, or followed without a receiver
    elements: Mapping[str, str] = {}        # of the mode tle in the control unit
    holder: str = ''                        # other client that has control, '' for none
    alarm: str = ''                         # latched fault of the control unit or of the drive, '' for none
    reply: Reply | None = None              # to State.pending
    interference: str = ''                  # what another client has done without control, '' for nothing
    requests: tuple[Request, ...] = ()
    fresh: tuple[Fresh, ...] = ()
    reports: tuple[tuple[str, str], ...] = ()   # (case, text) of each finished recording


class Step(NamedTuple):
    """Result of a step."""
    state: State
    command: Aim | None                     # for the control unit
    records: tuple[tuple[str, str], ...]    # ('begin' or 'end', case) of recordings
    lines: tuple[str, ...]                  # of the log
    replies: tuple[tuple[Command, Reply], ...]


def begin(contacts: tuple[Contact, ...], now: Seconds) -> State:
    """Return the state at the begin of a night: a pass whose time is over is skipped."""
    entries = []
    for contact in contacts:
        if not contact.taken:
            entries.append(Entry(contact, 'dropped', contact.reason))
        elif contact.end <= now:
            entries.append(Entry(contact, 'skipped', f'refused: its time was over at {clock(contact.end)}'))
        else:
            entries.append(Entry(contact, 'queued', _warning(contact)))
    return State(tuple(entries))


def clock(utc: Seconds) -> str:
    """Return the time of day of a UTC, HH:MM:SS."""
    return utc_text(utc)[11:19]


def current(state: State) -> Entry | None:
    """Return the pass under way."""
    return next((entry for entry in state.entries if entry.state == 'running'), None)


def upcoming(state: State) -> Entry | None:
    """Return the next queued pass."""
    return next((entry for entry in state.entries if entry.state == 'queued'), None)


def step(state: State, inputs: Inputs, rules: Rules) -> Step:
    """Return the Step at `inputs.now`."""
    turn = _Turn(state, inputs, rules)
    turn.take_reply()
    turn.take_fresh()
    for case, report in inputs.reports:
        turn.change(case, report=report)
        turn.say(f'{case}: {report}')
    turn.watch_control()
    for each in inputs.requests:
        turn.answer(each)
    turn.watch_pass()
    turn.begin_pass()
    turn.record()
    command = turn.command()
    turn.finish()
    turn.describe()
    return Step(turn.state._replace(last=inputs.now), command, tuple(turn.records), tuple(turn.lines),
                tuple(turn.replies))


def aim_at(contact: Contact, now: Seconds) -> Aim:
    """Return the mode of a pass under way."""
    if now < contact.begin - FOLLOW_LEAD_S:
        azimuth, elevation = map(math.radians, contact.point)
        return Aim('preset', {'azimuth': azimuth, 'elevation': elevation})
    return Aim('tle', dict(contact.elements)) if contact.elements else Aim('program', {})


def _age(contact: Contact) -> Days:
    """Return the distance of the epoch of the elements from the begin of a contact."""
    return abs(contact.begin - epoch_of(contact.elements)) / SECONDS_PER_DAY


def _refusal(contact: Contact, rules: Rules) -> str:
    """Return why the elements of a contact are refused, '' if they are not."""
    return objects.age_refusal(orbit_of(contact.elements), contact.begin, rules.oldest) if contact.elements else ''


def _warning(contact: Contact) -> str:
    """Return a warning about the elements of a contact, '' without one."""
    return objects.age_warning(orbit_of(contact.elements), contact.begin) if contact.elements else ''


@dataclasses.dataclass
class _Turn:
    """One step in progress."""
    state: State
    inputs: Inputs
    rules: Rules

    def __post_init__(self) -> None:
        self.lines: list[str] = []
        self.records: list[tuple[str, str]] = []
        self.replies: list[tuple[Command, Reply]] = []

    def set(self, **changes: Value) -> None:
        """Change fields of the state."""
        self.state = self.state._replace(**changes)

    def say(self, line: str) -> None:
        """Add a line to the log."""
        self.lines.append(line)

    def change(self, case: str, **changes: Value) -> None:
        """Change fields of an entry."""
        self.set(entries=tuple(entry._replace(**changes) if entry.contact.case == case else entry
                               for entry in self.state.entries))

    def close(self, entry: Entry, state: str, text: str) -> None:
        """End a pass, with its recording if it runs."""
        case = entry.contact.case
        self.change(case, state=state, text=text)
        self.say(f'{case}: {state}: {text}')
        if entry.state == 'running':
            self.set(aim=None, refusal='', alarm_since=math.inf)
        if self.state.recording == case:
            self.records.append(('end', case))
            self.set(recording='')

    def take_reply(self) -> None:
        """Take the reply of the control unit to the last command."""
        reply, pending = self.inputs.reply, self.state.pending
        if reply is None or pending is None:
            return
        if reply.granted:
            self.set(aim=pending, pending=None, retry=self.inputs.now + SETTLING_S, refusal='')
            return
        wait = 0.0 if PIN_REFUSAL in reply.text and pending.verb != 'unstow' else RETRY_S
        if reply.text != self.state.refusal and HELD_REFUSAL not in reply.text:
            self.say(f'{pending.verb}: {reply.text}')
        self.set(aim=None, pending=None, retry=self.inputs.now + wait, refusal=reply.text)

    def take_fresh(self) -> None:
        """Give fresher elements to the queued passes of their satellites."""
        for fresh in self.inputs.fresh:
            for entry in self.state.entries:
                contact = entry.contact
                if entry.state != 'queued' or (contact.number or contact.name) != fresh.satellite or not (
                        contact.elements and epoch_of(fresh.elements) > epoch_of(contact.elements)):
                    continue
                newer = contact._replace(elements=fresh.elements)
                self.change(contact.case, contact=newer, text=_warning(newer))
                self.say(f'{contact.case}: elements of {fresh.source}, {_age(newer):.1f} days old at the pass, '
                         f'in place of {_age(contact):.1f}')

    def watch_control(self) -> None:
        """Wait while the control unit is silent, or another client has control. An interference holds the station."""
        given = self.inputs
        waits = f'control is with {given.holder}' if given.holder else ''
        waits = waits if given.present else 'the control unit is silent'
        if waits != self.state.waits:
            self.say(f'waits: {waits}' if waits else 'goes on')
            self.set(waits=waits, aim=None)
        if given.interference and not self.state.held:
            self.hold(given.interference)

    def hold(self, reason: str) -> None:
        """Send no more commands until `resume`."""
        self.set(held=reason, aim=None)
        self.say(f'holds until `resume`: {reason}')

    def answer(self, request: Request) -> None:
        """Execute the request of an operator, and reply."""
        command = request.command
        try:
            if self.state.over:
                raise ValueError('the night is over')
            text = {'hold': self._hold, 'resume': self._resume, 'skip': self._skip,
                    'insert': self._insert}[command.verb](request)
            granted = True
        except ValueError as error:
            granted, text = False, f'refused: {error}'
            self.say(f'{command} of {command.who}: {text}')
        self.replies.append((command, Reply(granted, text)))

    def _hold(self, request: Request) -> str:
        if self.state.held:
            raise ValueError(f'the station holds already: {self.state.held}')
        reason = request.command.arguments.get('reason', '')
        self.hold(f'{request.command.who}{f": {reason}" if reason else ""}')
        return 'the station holds'

    def _resume(self, request: Request) -> str:
        if not self.state.held:
            raise ValueError('the station does not hold')
        self.set(held='', aim=None, retry=self.inputs.now)
        self.say(f'resumes: {request.command.who}')
        return 'the station goes on'

    def _skip(self, request: Request) -> str:
        entry = self._named(request.case) if request.case else current(self.state) or upcoming(self.state)
        if entry is None or entry.state not in ('queued', 'running'):
            raise ValueError(f'case = {request.case}: is {entry.state}' if entry else 'no pass is queued')
        self.close(entry, 'skipped', f'by {request.command.who}')
        return f'{entry.contact.case} is skipped'

    def _named(self, case: str) -> Entry:
        """Return the entry of a case. Raises ValueError."""
        entry = next((entry for entry in self.state.entries if entry.contact.case == case), None)
        if entry is None:
            raise ValueError(f'case = {case}: must be one of '
                             f'{", ".join(entry.contact.case for entry in self.state.entries)}')
        return entry

    def _insert(self, request: Request) -> str:
        contact = request.contact
        if contact is None:
            entry = self._named(request.case)
            if entry.state not in UNPLANNED:
                raise ValueError(f'case = {request.case}: is {entry.state}')
            contact = entry.contact
        if contact.end <= self.inputs.now:
            raise ValueError(f'{contact.case}: its time was over at {clock(contact.end)}')
        if refusal := _refusal(contact, self.rules):
            raise ValueError(f'{contact.case}: {refusal}')
        overlapping = [entry for entry in self.state.entries if entry.state in ('queued', 'running')
                       and entry.contact.begin < contact.end and contact.begin < entry.contact.end]
        for entry in overlapping:
            if entry.state == 'running':
                raise ValueError(f'{contact.case} overlaps {entry.contact.case}, which is under way; skip that first')
        if request.contact is not None:
            cases = [entry.contact.case for entry in self.state.entries]
            number = next(k for k in range(1, len(cases) + 2) if f'{contact.name}/{k}' not in cases)
            contact = contact._replace(case=f'{contact.name}/{number}')
            entries = (*self.state.entries, Entry(contact, 'queued', _warning(contact), inserted=True))
            self.set(entries=tuple(sorted(entries, key=lambda entry: entry.contact.begin)))
        else:
            self.change(contact.case, state='queued', text=_warning(contact), tracked=0.0)
        self.set(ends=math.inf)
        self.say(f'{contact.case}: inserted by {request.command.who}, {clock(contact.begin)} to {clock(contact.end)}')
        for entry in overlapping:
            self.close(entry, 'dropped', f'lost to {contact.case}')
        return f'{contact.case} is queued'

    def watch_pass(self) -> None:
        """Count the time on the target, and end a pass at its end or after an alarm. Skip queued passes whose time is
        over."""
        given, now = self.inputs, self.inputs.now
        for waiting in self.state.entries:
            if waiting.state == 'queued' and waiting.contact.end <= now:
                self.close(waiting, 'skipped', f'its time went by: {self._obstacle or "the station was off"}')
        entry = current(self.state)
        if entry is None:
            return
        contact, passed = entry.contact, now - self.state.last
        if given.tracking and contact.begin <= now <= contact.end and 0.0 < passed < RETRY_S:
            entry = entry._replace(tracked=entry.tracked + passed)
            self.change(contact.case, tracked=entry.tracked)
        follows = now >= contact.begin - FOLLOW_LEAD_S
        since = min(self.state.alarm_since, now) if given.alarm and follows else math.inf
        self.set(alarm_since=since)
        share = f'on the target for {entry.tracked:.0f} of {contact.end - contact.begin:.0f} s'
        if now >= contact.end and entry.tracked > 0.0:
            self.close(entry, 'done', share)
        elif now >= contact.end:
            self.close(entry, 'failed', self._obstacle or self.state.refusal or 'no signal')
        elif now - since > MAX_ALARM_S:
            self.close(entry, 'failed', f'alarm: {given.alarm}; {share}')

    @property
    def _obstacle(self) -> str:
        """Reason for which the station waits, '' for none."""
        return f'held: {self.state.held}' if self.state.held else self.state.waits

    def begin_pass(self) -> None:
        """Begin the next pass at its time, unless the station waits. Old elements end it at once."""
        coming = upcoming(self.state)
        while coming and not (self._obstacle or current(self.state)) and (
                self.inputs.now >= coming.contact.begin - self.rules.lead):
            contact = coming.contact
            if refusal := _refusal(contact, self.rules):
                self.close(coming, 'failed', f'refused: {refusal}')
            else:
                self.change(contact.case, state='running')
                self.set(aim=None, refusal='')
                elements = (f'elements of {utc_text(epoch_of(contact.elements))[:16]}, {_age(contact):.1f} days '
                            'old' if contact.elements else 'a track of the plan')
                self.say(f'{contact.case}: begins, {clock(contact.begin)} to {clock(contact.end)}, {elements}')
            coming = upcoming(self.state)

    def record(self) -> None:
        """Begin the recording of a pass shortly before its contact."""
        entry = current(self.state)
        if entry and not self.state.recording and self.inputs.now >= entry.contact.begin - RECORD_LEAD_S:
            self.records.append(('begin', entry.contact.case))
            self.set(recording=entry.contact.case)

    def _wanted(self) -> Aim | None:
        """Return the mode that the antenna should have; None if any mode will do."""
        entry, coming = current(self.state), upcoming(self.state)
        park = Aim('preset', {'point': self.rules.park}) if self.rules.park else Aim('stow', {})
        if entry:
            return aim_at(entry.contact, self.inputs.now)
        if coming is None:
            return Aim('stow', {})
        wait = coming.contact.begin - self.rules.lead - self.inputs.now
        return park if wait > self.rules.gap else None

    def _fits(self, wanted: Aim) -> bool:
        """Return True if the control unit does what the station wants."""
        given = self.inputs
        if wanted.verb not in ('tle', 'program'):
            return given.mode == wanted.verb
        return given.mode in FOLLOWING_MODES and all(
            given.elements.get(name, '').strip() == str(value).strip() for name, value in wanted.arguments.items())

    def command(self) -> Aim | None:
        """Return the next command to the control unit, None for none."""
        wanted, state = self._wanted(), self.state
        if state.over or self._obstacle or wanted is None or state.pending or self.inputs.now < state.retry:
            return None
        if state.aim == wanted and self._fits(wanted):
            return None
        if state.aim == wanted:
            self.say(f'the mode is {self.inputs.progress or self.inputs.mode}: {wanted.verb} is commanded again')
        if PIN_REFUSAL in state.refusal:
            wanted = Aim('unstow', {})
        self.set(pending=wanted, retry=math.inf)
        return wanted

    def finish(self) -> None:
        """End the night when the antenna is stowed after the last pass."""
        if current(self.state) or upcoming(self.state) or self.state.over:
            return
        now = self.inputs.now
        if self.state.ends == math.inf:
            self.set(ends=now + MAX_STOW_S)
            self.say('all passes are over: stows')
        stowed = self.state.aim == Aim('stow', {}) and self.inputs.progress == 'stowed'
        if stowed or now >= self.state.ends:
            self.say('stowed' if stowed else f'not stowed: {self._obstacle or self.state.refusal or "no arrival"}')
            self.set(over=True)

    def describe(self) -> None:
        """State in one line what the station does."""
        entry, coming = current(self.state), upcoming(self.state)
        if self.state.held:
            text = f'holds until `resume`: {self.state.held}'
        elif self.state.waits:
            text = f'waits: {self.state.waits}'
        elif entry and self.inputs.now < entry.contact.begin - FOLLOW_LEAD_S:
            text = f'points to {entry.contact.case}, begin {clock(entry.contact.begin)}'
        elif entry:
            text = f'{"tracks" if self.inputs.tracking else "acquires"} {entry.contact.case} until ' \
                   f'{clock(entry.contact.end)}'
        elif coming:
            text = f'next: {coming.contact.case} at {clock(coming.contact.begin)}'
        else:
            text = 'over' if self.state.over else 'all passes are over: stows'
        self.set(now=text)


