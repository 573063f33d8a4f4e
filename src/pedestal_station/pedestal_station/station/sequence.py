"""The sequence of a night: a state machine that takes the passes one after another. No ROS and no clock here.

    PassSequence.step(inputs) -> Step: lines for the log, recordings that begin or end, replies

A pass is queued, then running, and at last done, failed or skipped; the plan or an inserted pass may have dropped it.
At most one pass runs. Within it the antenna points to the begin of the contact, follows the elements, and changes to
autotrack by the rules of the control unit. All times are UTC.
"""
import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from pedestal_common.graph.modes import MODE_ROWS
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Days, Seconds
from pedestal_common.wire.commands import HELD_REFUSAL, Command, Reply
from pedestal_station import objects
from pedestal_station.outputs.file import MAX_PASSES, Contact, epoch_of, orbit_of, utc_text
from pedestal_station.station.requests import Antenna, Request, request

FOLLOWING_MODES = tuple(row.name for row in MODE_ROWS if row.follows and row.name not in ('slave', 'sun'))
"""Modes of a pass: those in which the control unit follows the target of the elements."""

RECORD_LEAD_S = 10.0  # time before the begin of a contact at which its recording begins [s]
FOLLOW_LEAD_S = 5.0  # time before the begin of a contact from which the antenna follows the target [s]
RETRY_S, SETTLING_S = 2.0, 2.0  # time until a command is repeated; time after a command until the mode is judged [s]
MAX_ALARM_S = 5.0  # time with an alarm after which a pass fails [s]
MAX_STOW_S = 300.0  # longest time for the stow after the last pass [s]
PIN_REFUSAL = 'stow pins not out'  # part of the refusal of a mode that the stow pins forbid
MAX_NAMED_PASSES = 20  # largest number of passes that a refusal names
UNPLANNED = 'dropped', 'skipped', 'failed'  # states of a pass that `insert` may queue


class Rules(NamedTuple):
    """Options of the station."""
    lead: Seconds       # time before a contact from which the antenna points to its begin: for slew and setup
    gap: Seconds        # shortest wait in which the antenna is parked
    park: str           # stored preset at which it waits; '': stow


@dataclasses.dataclass
class Entry:
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


STOW = Aim('stow', {})


class Fresh(NamedTuple):
    """Elements of a satellite that a file holds."""
    satellite: str              # catalogue number, else name
    elements: Mapping[str, str]
    source: str                 # file


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
    reply: Reply | None = None              # to the command of the last step
    interference: str = ''                  # what another client has done without control, '' for nothing
    commands: Sequence[Command] = ()        # of operators
    fresh: Sequence[Fresh] = ()
    reports: Sequence[tuple[str, str]] = () # (case, text) of each finished recording


class Step(NamedTuple):
    """Result of a step, beside the command to the control unit (PassSequence.pending)."""
    lines: list[str]                    # of the log
    records: list[tuple[str, str]]      # ('begin' or 'end', case) of recordings
    replies: list[tuple[Command, Reply]]


def clock(utc: Seconds) -> str:
    """Return the time of day of a UTC, HH:MM:SS."""
    return utc_text(utc)[11:19]


def _age(contact: Contact) -> Days:
    """Return the distance of the epoch of the elements from the begin of a contact."""
    return abs(contact.begin - epoch_of(contact.elements)) / SECONDS_PER_DAY


def _refusal(contact: Contact, oldest: Days) -> str:
    """Return why the elements of a contact are refused, '' if they are not."""
    return objects.age_refusal(orbit_of(contact.elements), contact.begin, oldest) if contact.elements else ''


def _warning(contact: Contact) -> str:
    """Return a warning about the elements of a contact, '' without one."""
    return objects.age_warning(orbit_of(contact.elements), contact.begin) if contact.elements else ''


class PassSequence:
    """The passes of a night, and what the station does with them."""
    entries: list[Entry]    # in the order of their begin
    held = ''               # reason for which the station waits for `resume`; '' if it does not
    over = False            # True at the end
    pending: Aim | None = None  # command of the last step for the control unit, None for none
    _waits = ''             # reason for which the station waits, and then goes on by itself; '' if it does not
    _aim: Aim | None = None     # mode that the control unit has accepted last from the station
    _retry = -math.inf      # earliest time of the next command
    _last = math.nan        # time of the last step
    _alarm_since = math.inf     # begin of the present alarm
    _refusal = ''           # last refusal of the control unit in this pass
    _recording = ''         # case of the pass that is recorded
    _ends = math.inf        # latest end of the station, after the last pass

    def __init__(self, contacts: Iterable[Contact], rules: Rules, antenna: Antenna, now: Seconds) -> None:
        """Queue the passes of a plan, and skip those whose time is over."""
        self.rules, self.antenna = rules, antenna
        self.entries = [
            Entry(contact, 'dropped', contact.reason) if not contact.taken
            else Entry(contact, 'skipped', f'refused: its time was over at {clock(contact.end)}')
            if contact.end <= now else Entry(contact, 'queued', _warning(contact)) for contact in contacts]

    def step(self, inputs: Inputs) -> Step:
        """Return the Step at `inputs.now`."""
        self._given = inputs
        self._lines, self._records, self._replies = step = Step([], [], [])
        self._take_reply(inputs.reply)
        for fresh in inputs.fresh:
            self._take_fresh(fresh)
        for case, report in inputs.reports:
            for entry in self.entries:
                entry.report = report if entry.contact.case == case else entry.report
            self._lines.append(f'{case}: {report}')
        self._watch_control()
        for command in inputs.commands:
            self._answer(command)
        self._watch_pass()
        self._begin_pass()
        self.pending = self._command()
        self._finish()
        self._last = inputs.now
        return step

    def _close(self, entry: Entry, state: str, text: str) -> None:
        """End a pass, with its recording if it runs."""
        case = entry.contact.case
        if entry.state == 'running':
            self._aim, self._refusal, self._alarm_since = None, '', math.inf
        entry.state, entry.text = state, text
        self._lines.append(f'{case}: {state}: {text}')
        if self._recording == case:
            self._records.append(('end', case))
            self._recording = ''

    def _take_reply(self, reply: Reply | None) -> None:
        """Take the reply of the control unit to the command of the last step."""
        if reply is None or self.pending is None:
            return
        if reply.granted:
            self._aim, self._refusal, wait = self.pending, '', SETTLING_S
        else:
            if reply.text != self._refusal and HELD_REFUSAL not in reply.text:
                self._lines.append(f'{self.pending.verb}: {reply.text}')
            wait = 0.0 if PIN_REFUSAL in reply.text and self.pending.verb != 'unstow' else RETRY_S
            self._aim, self._refusal = None, reply.text
        self._retry = self._given.now + wait

    def _take_fresh(self, fresh: Fresh) -> None:
        """Give fresher elements to the queued passes of their satellite."""
        for entry in self.entries:
            old = entry.contact
            if entry.state == 'queued' and old.satellite == fresh.satellite and old.elements and (
                    epoch_of(fresh.elements) > epoch_of(old.elements)):
                entry.contact = dataclasses.replace(old, elements=fresh.elements)
                entry.text = _warning(entry.contact)
                self._lines.append(f'{old.case}: elements of {fresh.source}, {_age(entry.contact):.1f} days old at '
                                   f'the pass, in place of {_age(old):.1f}')

    def _watch_control(self) -> None:
        """Wait while the control unit is silent, or another client has control. An interference holds the station."""
        given = self._given
        waits = f'control is with {given.holder}' if given.holder else ''
        waits = waits if given.present else 'the control unit is silent'
        if waits != self._waits:
            self._lines.append(f'waits: {waits}' if waits else 'goes on')
            self._waits, self._aim = waits, None
        if given.interference and not self.held:
            self._wait_for_resume(given.interference)

    def _wait_for_resume(self, reason: str) -> None:
        self.held, self._aim = reason, None
        self._lines.append(f'holds until `resume`: {reason}')

    def _answer(self, command: Command) -> None:
        """Execute the command of an operator, and reply."""
        try:
            if self.over:
                raise ValueError('the night is over')
            given = request(command, self.antenna)
            reply = Reply(True, {'hold': self._hold, 'resume': self._resume, 'skip': self._skip,
                                 'insert': self._insert}[command.verb](given))
        except ValueError as error:
            reply = Reply(False, f'refused: {error}')
            self._lines.append(f'{command} of {command.who}: {reply.text}')
        self._replies.append((command, reply))

    def _hold(self, given: Request) -> str:
        if self.held:
            raise ValueError(f'the station holds already: {self.held}')
        reason = given.command.arguments.get('reason', '')
        self._wait_for_resume(f'{given.command.who}{f": {reason}" if reason else ""}')
        return 'the station holds'

    def _resume(self, given: Request) -> str:
        if not self.held:
            raise ValueError('the station does not hold')
        self.held, self._aim, self._retry = '', None, self._given.now
        self._lines.append(f'resumes: {given.command.who}')
        return 'the station goes on'

    def _skip(self, given: Request) -> str:
        entry = self._named(given.case) if given.case else self.first('running') or self.first('queued')
        if entry is None or entry.state not in ('queued', 'running'):
            raise ValueError(f'case = {given.case}: is {entry.state}' if entry else 'no pass is queued')
        self._close(entry, 'skipped', f'by {given.command.who}')
        return f'{entry.contact.case} is skipped'

    def _named(self, case: str) -> Entry:
        """Return the entry of a case. Raises ValueError."""
        for entry in self.entries:
            if entry.contact.case == case:
                return entry
        cases = [entry.contact.case for entry in self.entries]
        more = ' ...' if len(cases) > MAX_NAMED_PASSES else ''
        raise ValueError(f'case = {case}: must be one of {", ".join(cases[:MAX_NAMED_PASSES])}{more}')

    def _insert(self, given: Request) -> str:
        entry = self._named(given.case) if given.contact is None else self._new(given.contact)
        contact = entry.contact
        if entry.state not in UNPLANNED:
            raise ValueError(f'case = {given.case}: is {entry.state}')
        if contact.end <= self._given.now:
            raise ValueError(f'{contact.case}: its time was over at {clock(contact.end)}')
        if refusal := _refusal(contact, self.antenna.oldest):
            raise ValueError(f'{contact.case}: {refusal}')
        overlapping = [other for other in self.entries if other.state in ('queued', 'running')
                       and other.contact.begin < contact.end and contact.begin < other.contact.end]
        for other in overlapping:
            if other.state == 'running':
                raise ValueError(f'{contact.case} overlaps {other.contact.case}, which is under way; skip that first')
        entry.state, entry.text, entry.tracked, self._ends = 'queued', _warning(contact), 0.0, math.inf
        if given.contact is not None:
            self.entries = sorted((*self.entries, entry), key=lambda each: each.contact.begin)
        self._lines.append(f'{contact.case}: inserted by {given.command.who}, {clock(contact.begin)} to '
                           f'{clock(contact.end)}')
        for other in overlapping:
            self._close(other, 'dropped', f'lost to {contact.case}')
        return f'{contact.case} is queued'

    def _new(self, contact: Contact) -> Entry:
        """Return the entry of a pass that the plan does not have. Raises ValueError."""
        if len(self.entries) >= MAX_PASSES:
            raise ValueError(f'the station has {len(self.entries)} passes, must be at most {MAX_PASSES}')
        cases = {entry.contact.case for entry in self.entries}
        number = next(k for k in range(1, len(cases) + 2) if f'{contact.object}/{k}' not in cases)
        return Entry(dataclasses.replace(contact, case=f'{contact.object}/{number}'), 'dropped', inserted=True)

    def _watch_pass(self) -> None:
        """Count the time on the target, and end a pass at its end or after an alarm. Skip queued passes whose time is
        over."""
        given, now = self._given, self._given.now
        for waiting in self.entries:
            if waiting.state == 'queued' and waiting.contact.end <= now:
                self._close(waiting, 'skipped', f'its time went by: {self._obstacle or "the station was off"}')
        entry = self.first('running')
        if entry is None:
            return
        contact, passed = entry.contact, now - self._last
        if given.tracking and contact.begin <= now <= contact.end and 0.0 < passed < RETRY_S:
            entry.tracked += passed
        follows = now >= contact.begin - FOLLOW_LEAD_S
        self._alarm_since = min(self._alarm_since, now) if given.alarm and follows else math.inf
        share = f'on the target for {entry.tracked:.0f} of {contact.end - contact.begin:.0f} s'
        if now >= contact.end and entry.tracked > 0.0:
            self._close(entry, 'done', share)
        elif now >= contact.end:
            self._close(entry, 'failed', self._obstacle or self._refusal or 'no signal')
        elif now - self._alarm_since > MAX_ALARM_S:
            self._close(entry, 'failed', f'alarm: {given.alarm}; {share}')

    @property
    def _obstacle(self) -> str:
        """Reason for which the station waits, '' for none."""
        return f'held: {self.held}' if self.held else self._waits

    def _begin_pass(self) -> None:
        """Begin the next pass at its time, unless the station waits. Old elements end it at once. Begin its recording
        shortly before its contact."""
        now = self._given.now
        while (coming := self.first('queued')) and not (self._obstacle or self.first('running')) and (
                now >= coming.contact.begin - self.rules.lead):
            contact = coming.contact
            if refusal := _refusal(contact, self.antenna.oldest):
                self._close(coming, 'failed', f'refused: {refusal}')
                continue
            coming.state, self._aim, self._refusal = 'running', None, ''
            elements = (f'elements of {utc_text(epoch_of(contact.elements))[:16]}, {_age(contact):.1f} days '
                        'old' if contact.elements else 'a track of the plan')
            self._lines.append(f'{contact.case}: begins, {clock(contact.begin)} to {clock(contact.end)}, {elements}')
        entry = self.first('running')
        if entry and not self._recording and now >= entry.contact.begin - RECORD_LEAD_S:
            self._recording = entry.contact.case
            self._records.append(('begin', self._recording))

    def _wanted(self) -> Aim | None:
        """Return the mode that the antenna should have; None if any mode will do."""
        entry, coming, now = self.first('running'), self.first('queued'), self._given.now
        if entry and now < entry.contact.begin - FOLLOW_LEAD_S:
            azimuth, elevation = map(math.radians, (entry.contact.azimuth_deg, entry.contact.elevation_deg))
            return Aim('preset', {'azimuth': azimuth, 'elevation': elevation})
        if entry:
            return Aim('tle', dict(entry.contact.elements)) if entry.contact.elements else Aim('program', {})
        if coming and coming.contact.begin - self.rules.lead - now <= self.rules.gap:
            return None
        return Aim('preset', {'point': self.rules.park}) if coming and self.rules.park else STOW

    def _fits(self, wanted: Aim) -> bool:
        """Return True if the control unit does what the station wants."""
        given = self._given
        if wanted.verb not in ('tle', 'program'):
            return given.mode == wanted.verb
        return given.mode in FOLLOWING_MODES and all(
            given.elements.get(name, '').strip() == str(value).strip() for name, value in wanted.arguments.items())

    def _command(self) -> Aim | None:
        """Return the next command to the control unit, None for none."""
        wanted = self._wanted()
        if self.over or self._obstacle or wanted is None or self._given.now < self._retry:
            return None
        if self._aim == wanted:
            if self._fits(wanted):
                return None
            self._lines.append(f'the mode is {self._given.progress or self._given.mode}: {wanted.verb} is commanded '
                               'again')
        return Aim('unstow', {}) if PIN_REFUSAL in self._refusal else wanted

    def _finish(self) -> None:
        """End the night when the antenna is stowed after the last pass."""
        if self.first('running') or self.first('queued') or self.over:
            return
        now = self._given.now
        if self._ends == math.inf:
            self._ends = now + MAX_STOW_S
            self._lines.append('all passes are over: stows')
        stowed = self._aim == STOW and self._given.progress == 'stowed'
        if stowed or now >= self._ends:
            self.over = True
            why = self._obstacle or self._refusal or 'no arrival'
            self._lines.append('stowed' if stowed else f'not stowed: {why}')

    @property
    def now(self) -> str:
        """What the station does, in one line."""
        entry, coming = self.first('running'), self.first('queued')
        if self.held:
            return f'holds until `resume`: {self.held}'
        if self._waits:
            return f'waits: {self._waits}'
        if entry and self._last < entry.contact.begin - FOLLOW_LEAD_S:
            return f'points to {entry.contact.case}, begin {clock(entry.contact.begin)}'
        if entry:
            doing = 'tracks' if self._given.tracking else 'acquires'
            return f'{doing} {entry.contact.case} until {clock(entry.contact.end)}'
        if coming:
            return f'next: {coming.contact.case} at {clock(coming.contact.begin)}'
        return 'over' if self.over else 'all passes are over: stows'

    def first(self, state: str) -> Entry | None:
        """Return the first pass in a state."""
        return next((entry for entry in self.entries if entry.state == state), None)
