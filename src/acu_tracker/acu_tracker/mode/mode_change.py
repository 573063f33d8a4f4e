"""The mode of a step: the facts that the mode machine (`modes`) decides by, and what a change does to the state.

s, c, u, o: records of control_unit.STATE and CONSTANTS, of signals.INPUTS and OUTPUTS; of_all: the Tables.
"""
from acu_tracker import modes
from acu_tracker.estimation import divergence, slope_sign, tracker
from acu_tracker.geometry import attitude, direction, encoders
from acu_tracker.mode import by_level, outage, reach, resumption, stow, supervision
from acu_tracker.program import tables
from acu_tracker.search import coast
from acu_tracker.servo import frozen, unasked
from pedestal_common.compiled import compiled


@compiled
def _situation(s, c, u, of_all, request, fallback):
    """(modes.Situation at s.stamp, flags of the tables); a table is evaluated only where it matters."""
    t_m = s.stamp + c.lead
    unstable = modes.NONE
    if s.attitude.stabilised:
        # Before the first attitude the state of the INS may not have arrived yet.
        unstable = (modes.INS_ALIGNING if s.aligning and s.attitude.history.count > 0 else
                    modes.NONE if attitude.at(s.attitude, c.p, t_m)[0] else modes.ATTITUDE_INVALID)
    since = outage.since_accepted(s, c)
    silent = not outage.permitted(s, c)
    spread = by_level.sigma(s, c) if s.target.tracker.running and silent and outage.coasting(s, c) else 0.0
    lost = not s.target.tracker.running or (
        silent and coast.over(since, c.p.tracker.coast_time, spread, c.p.tracker.receiver.beamwidth))
    ends = modes.SIGNAL_LOST if lost else modes.SIDE_LOBE if by_level.in_side_lobe(s, c) else modes.NONE
    unfit = modes.NONE if tracker.locked(s.target.tracker, c.p.tracker, since) else modes.NOT_LOCKED
    if s.mode == modes.AUTOTRACK and supervision.obeys(s):
        divergence.watch(s.divergence, outage.coasting(s, c) and silent)
    if s.divergence.diverged:
        unfit = ends = modes.DIVERGED
    pins = stow.obstacle(s.stow, c.p.stow_pins, u.pins)
    falls_back = s.mode == modes.SEARCH or (s.mode == modes.AUTOTRACK and ends != modes.NONE)
    program, flags = modes.NONE, 0
    tle = sun = modes.NONE
    if unstable == modes.NONE:
        if reach.matters(s, modes.PROGRAM, request, fallback, falls_back):
            program, flags = reach.table(s, c, u, modes.PROGRAM, of_all)
        if reach.matters(s, modes.TLE, request, fallback, falls_back):
            tle, flag = reach.table(s, c, u, modes.TLE, of_all)
            flags |= flag
        if reach.matters(s, modes.SUN, request, fallback, falls_back):
            sun, flag = reach.table(s, c, u, modes.SUN, of_all)
            flags |= flag
    unchecked = modes.DIVERGED if s.divergence.diverged else modes.NONE
    stowed = reach.outside(c, c.axis[0].p.stow, c.axis[1].p.stow)
    preset = reach.outside(c, s.preset.angle[0], s.preset.angle[1])
    unled = modes.NONE if direction.there(s.slave, s.stamp) else modes.NO_DIRECTION
    obstacle = (modes.NONE, modes.NONE, stowed, modes.PINS_OUT, preset, modes.NONE, unled, program, tle, sun, unfit,
                unchecked, unchecked, modes.NONE)
    obeyed = u.drive_ready != 0 and supervision.distrust(s) == modes.DRIVE_NOT_READY
    drive = encoders.taken(s.encoders, s.stamp), obeyed
    return modes.situation(drive, unstable, pins, s.table, obstacle, (ends, by_level.end(s, c))), flags


@compiled
def change(s, c, u, o, of_all, request):
    """Run the mode machine at s.stamp with a `request` or NO_REQUEST: (result, flags of the tables)."""
    # There is no coasting on a filter that has begun anew.
    fallback = s.fallback if s.fallback != modes.AUTOTRACK or s.target.tracker.running else modes.PROGRAM
    now, flags = _situation(s, c, u, of_all, request, fallback)
    o.locked = now.obstacle[modes.AUTOTRACK] == modes.NONE
    handover = by_level.found(s, c) if modes.BY_LEVEL[s.mode] else c.p.tracker.handover != 0
    mode, reason, result = modes.next_mode(s.mode, request, now, handover, fallback)
    if result == modes.ACCEPTED:
        s.pending = modes.NO_REQUEST
        if modes.BY_TABLE[mode]:
            s.target.tracker.accepted_in_a_row = 0
    if modes.BY_TABLE[mode] and mode != s.table:
        s.table, s.bridge.valid = mode, 0
    if reason != modes.NONE:
        s.reason = supervision.distrust(s) if reason == modes.DRIVE_NOT_READY else reason
    if mode != s.mode and modes.BY_LEVEL[mode]:
        tracked = s.mode == modes.AUTOTRACK and not outage.coasting(s, c)
        by_level.begin(s, c, tables.of_mode(of_all, s.table), mode, tracked)
    if s.mode == modes.AUTOTRACK and now.end[modes.AUTOTRACK] != modes.NONE and mode != modes.AUTOTRACK:
        s.target.tracker.running = 0
    if mode != s.mode:
        s.mode, s.entered = mode, 1
        divergence.restart(s.divergence)
        slope_sign.restart(s.slope_sign)
    return result, flags


@compiled
def refusals(s, c, u, of_all, why):
    """Put into why (len(MODES),) for each mode NONE or why `change` would refuse it now. s: a copy of the state, which
    the question changes."""
    for mode in range(len(why)):
        now, _ = _situation(s, c, u, of_all, mode, s.fallback)
        why[mode] = modes.obstacle(mode, now)
        if why[mode] == modes.DRIVE_NOT_READY:
            why[mode] = supervision.distrust(s)


@compiled
def bridge_silence(s, c, stamp):
    """After a silence the axes stand. The mode goes on, from where they are, if it was short enough."""
    if s.mode != modes.STANDBY:
        s.mode = resumption.mode_after(s.resumption, s.mode, s.stamp, stamp, c.p.resume_time)
        if s.mode == modes.STANDBY:
            s.reason = modes.SILENCE
    unasked.restart(s.unasked, stamp)
    frozen.restart(s.frozen, stamp)
