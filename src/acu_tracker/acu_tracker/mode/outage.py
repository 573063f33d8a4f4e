"""An outage of the receiver: how long it lasts, and whether a keyhole or a hidden sector explains it.

s, c: records of control_unit.STATE and CONSTANTS.
"""
from acu_tracker import modes
from acu_tracker.estimation import target
from acu_tracker.lookahead import planner
from acu_tracker.program import bridge
from pedestal_common.compiled import compiled
from pedestal_common.geometry import blockage


@compiled
def since_accepted(s, c):
    """Time [s] since the last accepted measurement, beyond the receiver's latency and the age of its errors."""
    return s.stamp - s.target.tracker.stamp - c.p.receiver_latency - c.p.tracker.receiver.age


@compiled
def coasting(s, c):
    """Whether the estimate has gone without a measurement for coast_after."""
    return since_accepted(s, c) > c.p.tracker.coast_after


@compiled
def permitted(s, c):
    """Whether a keyhole or a hidden sector explains an outage of the receiver, now or within the last coast_time."""
    return s.stamp - s.outage <= c.p.tracker.coast_time


@compiled
def watch(s, c, program):
    """Note why the receiver may be without signal: the target is hidden, or the beam slews through the keyhole."""
    follows = modes.FOLLOWS[s.mode]
    s.blocked = follows and blockage.blocked(c.lookahead.sectors, s.target_angles[0], s.target_angles[1])
    reason = (modes.BLOCKED if s.blocked else
              modes.KEYHOLE if follows and planner.slewing(s.lookahead, s.stamp) else modes.NONE)
    if reason != modes.NONE:
        s.outage, s.reason = s.stamp, reason
        if s.mode == modes.AUTOTRACK and not coasting(s, c):
            bridge.begin(s.bridge, program, s.stamp, target.earth_outlook(s.target, c.tracker, s.stamp).u)
    elif s.reason == modes.BLOCKED or s.reason == modes.KEYHOLE:
        s.reason = modes.NONE
