"""The alarms of the control unit: their step, and their reset. `s` is the record of control_unit.STATE."""
import math

from acu_tracker import modes
from acu_tracker.alarms import annunciator, conditions, table
from acu_tracker.geometry import attitude
from acu_tracker.mode import stow
from acu_tracker.servo import frozen, unasked
from pedestal_common.compiled import compiled

MOVES_UNASKED, FROZEN, DIVERGED = (table.INDEX[name] for name in ('moves unasked', 'drive frozen', 'diverged'))
"""Alarms whose fault the control unit latches itself."""

LATCHED = 1 << MOVES_UNASKED | 1 << FROZEN | 1 << DIVERGED


@compiled
def latched(s):
    """Bits of the alarms whose fault waits for a reset."""
    return (s.unasked.moves << MOVES_UNASKED) | (s.frozen.frozen << FROZEN) | (s.divergence.diverged << DIVERGED)


@compiled
def obeys(s):
    """Whether both axes obey; while one does not, the target leaves the beam, and no filter is to blame."""
    return not (s.supervision.axis[0].immobile or s.supervision.axis[1].immobile)


@compiled
def distrust(s):
    """Why a drive that may be ready is not trusted with a mode; DRIVE_NOT_READY: it is trusted."""
    if s.unasked.moves:
        return modes.MOVES_UNASKED
    return modes.DRIVE_FROZEN if s.frozen.frozen else modes.DRIVE_NOT_READY


@compiled
def step(s, c, u, o, dt, signal_lost):
    """Bring the alarms to this step, dt [s] after the one before. c, u, o: constants, inputs, outputs; signal_lost:
    whether autotrack is without signal and nothing explains it."""
    jumped, ship = dt > c.p.step_gap, s.attitude.stabilised and s.attitude.history.count > 0
    facts = conditions.Facts(
        0.0 if jumped else dt, dt if jumped else 0.0, dt > 1.5 * c.p.period, latched(s),
        ship and not attitude.at(s.attitude, c.p, s.stamp + c.lead)[0], ship and s.attitude.jump.apart, signal_lost,
        c.p.unasked_rate, c.p.tracker.receiver.beamwidth)
    mode = modes.STANDBY if stow.rests(s.stow, c.p.stow_pins, u.pins, s.mode) else s.mode
    conditions.take(s.supervision, mode, u, o, c.axis, s.unasked, facts)
    o.alarms = s.supervision.alarms.revision


@compiled
def reset(s):
    """Reset what is latched, between two steps: annunciator.NONE, or the index of an alarm whose cause is still there,
    and nothing is changed. A mode that waited to be entered is forgotten: nothing moves until one is asked for."""
    alarms, t = s.supervision.alarms, s.stamp
    if s.unasked.moves and unasked.beyond(s.unasked, t):
        return MOVES_UNASKED
    cause = annunciator.persists(alarms, LATCHED)
    if cause != annunciator.NONE:
        return cause
    waited = latched(s) != 0
    s.unasked.moves = s.frozen.frozen = s.divergence.diverged = 0
    frozen.restart(s.frozen, t)
    for i in (MOVES_UNASKED, FROZEN, DIVERGED):
        annunciator.know(alarms, i, False, t)
    if annunciator.reset(alarms, t) or waited:
        s.pending, s.resumption.until = modes.NO_REQUEST, -math.inf
    return annunciator.NONE
