"""Verdict on a run: one sentence on what happened, from the recording alone.

A run has failed in three cases: its drive tripped, a command of the scenario was refused, or a commanded mode should
have tracked the target and never did. Autotrack on a side lobe never tracked the target. A run has not failed if no
commanded mode tracks, or if the run ended on the way to the target, before the receiver could lock.
"""
import math
import typing
from collections.abc import Iterator, Mapping

import numpy as np

from acu_tracker.command_table import ACU_COMMANDS
from acu_tracker.modes import REASON_TEXTS
from pedestal_common.graph import modes, nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.quantities import Bools, Floats, Json, Seconds
from pedestal_common.wire import commands
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import trackable
from pedestal_results.tracking import DEG_PER_RAD, Tracking, keyholes

TRIPPED, REFUSED, NOT_LOCKED, NOT_TRACKED = 'tripped', 'refused', 'never locked', 'never tracked'
TRACKED, ON_THE_WAY, NO_TARGET = 'tracked', 'ended on the way', 'no target'  # words of the verdicts
FAILURE_WORDS = TRIPPED, REFUSED, NOT_LOCKED, NOT_TRACKED
"""Words of a verdict on a failed run. The other words belong to runs that did what was commanded."""

TRACKING_MODES = 'autotrack', 'steptrack'  # modes in which the antenna tracks by the receiver

DRIVE_STATE_TOPIC, EMERGENCY_STOP = 'adu/state', 'emergency stop'
REPLY_TOPICS = tuple(node.replies for node in nodes.NODES if node.replies)

WAITING_REASONS = tuple(REASON_TEXTS[name] for name in ('DRIVE_NOT_READY', 'INS_ALIGNING', 'ATTITUDE_INVALID',
                                                        'BEFORE_PROGRAM', 'BELOW_HORIZON'))
"""Reasons of the control unit that only delay a mode: the mode begins when the reason has passed."""

LOCK_ALLOWANCE_S = 1.0
"""Allowance before a run counts as failed [s].

With the target in the beam, the receiver must lock within `acquire_time` plus this time. After the first lock, the
control unit must enter autotrack within `lock_count` steps plus this time.
"""
APPROACH_WINDOW_S, MIN_APPROACH = 0.5, 0.1
"""A beam is on the way to the target if its distance shrank by more than MIN_APPROACH beamwidths in the last
APPROACH_WINDOW_S seconds."""
MIN_SWING_RAD = math.radians(1.0)
"""Least decrease and increase of the distance by which a beam has come near the target and gone away again [rad]."""

MIN_OFF_TARGET_S, MIN_REASON_SHARE = 0.5, 0.1
"""Time more than a beamwidth off the target [s], and share of the trackable time outside autotrack after its end, that
a verdict on a tracked run states."""


class Verdict(typing.NamedTuple):
    """Verdict on a run. word: one of the constants TRIPPED to NO_TARGET; text: the sentence."""
    word: str
    text: str

    @property
    def failed(self) -> bool:
        """True if the run failed."""
        return self.word in FAILURE_WORDS

    @property
    def why(self) -> str:
        """Word and sentence of a run that did not track, '' for a run that tracked."""
        return '' if self.word == TRACKED else f'{self.word}: {self.text.removeprefix(f"{self.word}: ")}'


def of(bag: Recording, run: Tracking) -> Verdict:
    """Return the Verdict on a recording of one beam and its Tracking."""
    trip, refused = _trip(bag), _refusals(bag)
    word, text = _tracking(bag, run)
    if not (trip or refused):
        return Verdict(word, text)
    if trip:
        percent = run.tracked_percent
        share = f'tracked {percent:.3g} %: ' if word != NO_TARGET and math.isfinite(percent) else ''
        return Verdict(TRIPPED, share + '; '.join((trip, *refused)))
    return Verdict(REFUSED, '; '.join((*refused, *[text] * (word != NO_TARGET))))


def _trip(bag: Recording) -> str:
    """Return the text of the first fault on which the drive tripped, with its time; '' without a trip."""
    if DRIVE_STATE_TOPIC not in bag.topics:
        return ''
    table = bag.table(DRIVE_STATE_TOPIC)
    for t, state in zip(table['t'], table['data']):
        if 'fault: ' in state or state.startswith(EMERGENCY_STOP):
            return f'drive {state.replace("fault: ", "fault ")} at {t:.3f} s'
    return ''


def _replies(bag: Recording) -> Iterator[tuple[Seconds, commands.Command, commands.Reply]]:
    for topic in REPLY_TOPICS:
        yield from recordings.replies(bag, topic)


def _refusals(bag: Recording) -> list[str]:
    reasons = [(command.verb, t, reply.text.removeprefix('refused: ').partition('; mode is ')[0])
               for t, command, reply in _replies(bag)
               if command.who == commands.SCHEDULE_CLIENT and not reply.granted]
    return [f'{verb} at {t:.4g} s refused: {reason}' for verb, t, reason in reasons]


def _leads_to_tracking(mode: str, handover: bool) -> bool:
    """Return True if a mode tracks, or hands over to a mode that leads to tracking; handover: parameter
    tracker.handover.
    """
    row = next((row for row in modes.MODE_ROWS if row.name == mode), None)
    if row is None or mode in TRACKING_MODES:
        return row is not None
    return bool(row.handover) and (handover or not row.table) and _leads_to_tracking(row.handover, handover)


def _tracking(bag: Recording, run: Tracking) -> tuple[str, str]:
    """Return (word, sentence) on the tracking of a run, without its faults and refusals."""
    acu = recordings.parameters(bag, 'acu')
    handover = acu.get('tracker.handover', True)
    wanted = [mode for mode in (acu.get('initial_mode', 'standby'), *(command.verb for _, command, _ in _replies(bag)),
                                *np.unique(run.mode[run.known_mode]).tolist()) if _leads_to_tracking(mode, handover)]
    shares = {mode: 100.0 * float(np.mean(run.mode == mode)) for mode in modes.MODES if (run.mode == mode).any()}
    distance = run.distance
    near = distance < 0.5 * run.beamwidth
    by_level = run.mode == 'steptrack'
    if 'autotrack' in shares:
        return _autotracked(bag, run, distance, near)
    if by_level.any() and (near[by_level].any() or not math.isfinite(run.beamwidth)):
        whole, rest = _counted_time(bag, run)
        return TRACKED, f'tracked by its level for {run.share("steptrack"):.3g} % of {whole}{rest}'
    if not wanted:
        return NO_TARGET, _without_target(shares, acu)
    if not any(modes.MODE_ROWS[modes.MODES.index(mode)].follows for mode in shares):
        return _never_began(bag, wanted[0])
    return _never_tracked(bag, run, distance, near, acu)


def _counted_time(bag: Recording, run: Tracking) -> tuple[str, str]:
    """Return (the time of which a verdict states a share, what the rest of the run was)."""
    duration, rest = f'{run.t[-1] - run.t[0]:.4g} s', trackable.rest(bag, run.obstacle, run.period)
    if not rest:
        return duration, ''
    return (f'the {run.trackable_time:.4g} s in which the target could be tracked',
            f'; in the run of {duration} the target was {rest}')


def _autotracked(bag: Recording, run: Tracking, distance: Floats, near: Bools) -> tuple[str, str]:
    """Return (word, sentence) on a run with autotrack.

    distance: angle from beam to target [rad]; near: True with the target within half a beamwidth.
    """
    auto = run.mode == 'autotrack'
    off = auto & run.trackable & (distance > run.beamwidth)
    off_s, wide = np.sum(off) * run.period, np.max(distance[off], initial=0.0) * DEG_PER_RAD
    if off_s > MIN_OFF_TARGET_S and not near[auto].any():
        return NOT_TRACKED, (f'tracked 0 %: autotrack for {np.sum(auto) * run.period:.3g} s, always off the target by '
                             f'up to {wide:.3g} deg: a side lobe, or another signal')
    whole, rest = _counted_time(bag, run)
    text = f'tracked {run.tracked_percent:.3g} % of {whole}'
    if not math.isnan(run.lock_time):
        text += f', first lock at {run.lock_time:.4g} s'
    if off_s > MIN_OFF_TARGET_S:
        text += f'; {off_s:.3g} s of it more than a beamwidth off the target, by up to {wide:.3g} deg'
        announced = sum(slew.loss for slew in keyholes(bag))
        text += f' (announced for the keyhole: {announced:.3g} s)' if announced else ''
    ended = run.t[auto][-1]
    reason = bag.last_values(f'{bag.beam}acu').get('refused autotrack', '')
    if reason and np.sum(run.trackable & (run.t > ended)) > MIN_REASON_SHARE * np.sum(run.trackable):
        text += f'; no autotrack from {ended:.4g} s on: {reason}'
    return TRACKED, text + rest


def _without_target(shares: Mapping[str, float], acu: Mapping[str, Json]) -> str:
    """Return the sentence on a run in which no mode should track; shares: {mode: share of the steps [%]}."""
    begun = acu.get('initial_mode', 'standby')
    if not shares:
        return 'no mode is recorded'
    return ('no target was to be tracked: ' + ', '.join(f'{mode} {share:.3g} %' for mode, share in shares.items())
            + ('' if begun in shares else f'; {begun} was never entered'))


def _never_began(bag: Recording, mode: str) -> tuple[str, str]:
    """Return (word, sentence) on a run that never entered a mode that follows a target; mode: the first wanted one."""
    values = bag.last_values(f'{bag.beam}acu')
    reason = values.get(f'refused {mode}', '')
    if not reason or reason.startswith(WAITING_REASONS):
        return ON_THE_WAY, f'ended before mode {mode} was entered' + (f': {reason}' if reason else '')
    return NOT_TRACKED, f'tracked 0 %: mode {mode} was never entered: {reason}'


def _never_tracked(bag: Recording, run: Tracking, distance: Floats, near: Bools,
                   acu: Mapping[str, Json]) -> tuple[str, str]:
    """Return (word, sentence) on a run that followed a direction to the target, but never tracked by the receiver."""
    receiver = recordings.parameters(bag, 'tracking_receiver')
    count = acu.get('tracker.lock_count', 0) * run.period
    follows = np.isin(run.mode, [row.name for row in modes.MODE_ROWS if row.follows])
    left = float(run.t[-1] - run.t[follows][0])
    locked = np.isfinite(run.measured[:, 0])
    if locked.any():
        first = float(run.t[locked][0])
        if run.t[-1] - first < count + LOCK_ALLOWANCE_S:
            return ON_THE_WAY, f'ended {run.t[-1] - first:.2g} s after the first lock, before autotrack'
        reason = bag.last_values(f'{bag.beam}acu').get('refused autotrack', '')
        lost = f'locked for {np.sum(locked) * run.period:.3g} s from {first:.4g} s on, but never in autotrack'
        return NOT_TRACKED, f'tracked 0 %: {lost}' + (f': {reason}' if reason else '')
    allowance = receiver.get('receiver.acquire_time', 0.0) + LOCK_ALLOWANCE_S
    level, needed = run.cn0[np.isfinite(run.cn0)], receiver.get('receiver.acquire_level_dbhz', math.nan)
    at = f', lock at {needed:.3g}' if math.isfinite(needed) else ''
    best = 'never locked: ' + (f'best level {level.max():.3g} dB-Hz{at}' if level.size else 'no level was recorded')
    if not np.isfinite(distance).any():     # the true target is unknown
        return NOT_LOCKED, best
    if not run.trackable.any():
        return NOT_LOCKED, f'{best}: the target was {trackable.rest(bag, run.obstacle, run.period)}'
    if np.sum(near & run.trackable) * run.period >= allowance:
        return NOT_LOCKED, best + _link(run, near, receiver)
    away = f'{distance[-1] * DEG_PER_RAD:.3g} deg away'
    if left < allowance or near[-1] or _approaches(run, distance):
        return ON_THE_WAY, f'ended on the way to the target, {away}, before the receiver could lock'
    due = _next_command(acu, run.t[-1])
    if due:
        return ON_THE_WAY, f'ended before the command {due}, the target {away}'
    return NOT_LOCKED, f'{best}; the beam came within {np.nanmin(distance) * DEG_PER_RAD:.3g} deg of the target'


def _link(run: Tracking, near: Bools, receiver: Mapping[str, Json]) -> str:
    """Return the range up to which the signal would lock, and the parameters that would do it; '' for a sufficient
    signal on the axis. near: True with the target within half a beamwidth."""
    level, needed, exponent = (receiver.get(f'receiver.{key}', math.nan) for key in (
        'cn0_dbhz', 'acquire_level_dbhz', 'range_exponent'))
    distance, reference = run.range[near], receiver.get('receiver.reference_range', math.nan)
    if not (exponent and np.isfinite(distance).any() and math.isfinite(level + reference)):
        return ''
    nearest = float(np.nanmin(distance))
    missing = needed - level + 10.0 * exponent * math.log10(nearest / reference)
    if missing <= 0.0:
        return ''
    up_to = nearest * 10.0**(-missing / (10.0 * exponent))
    return (f'; at {1e-3 * nearest:.5g} km the signal is {missing:.3g} dB too weak, and locks up to '
            f'{1e-3 * up_to:.5g} km: receiver.cn0_dbhz of {level + missing:.3g} at {1e-3 * reference:g} km, or '
            'scenario.link.eirp of the target, would do it')


def _next_command(acu: Mapping[str, Json], end: Seconds) -> str:
    """Return the next scheduled command after the end of a run that leads to tracking, with its time, or ''."""
    for due, command in commands.schedule('acu.commands', acu.get('commands', ''), ACU_COMMANDS):
        at = due / NS_PER_SECOND
        if at > end and _leads_to_tracking(command.verb, acu.get('tracker.handover', True)):
            return f'{command.verb} at {at:g} s'
    return ''


def _approaches(run: Tracking, distance: Floats) -> bool:
    """Return True if the beam approaches the target at the end, and has not come near and gone away again before."""
    window = round(APPROACH_WINDOW_S / run.period)
    if not (distance.size > window and run.mode[-1] not in ('', 'standby')
            and distance[-1 - window] - distance[-1] > MIN_APPROACH * run.beamwidth):
        return False
    known = distance[np.isfinite(distance) & (run.mode != 'standby')]
    swing = max(MIN_SWING_RAD, run.beamwidth)
    before, after = np.maximum.accumulate(known), np.maximum.accumulate(known[::-1])[::-1]
    return not ((before - known > swing) & (after - known > swing)).any()
