"""The turn of the azimuth by whole revolutions: at a limit of its travel the axis goes round to its target.

During the turn the beam is off the target on purpose. Errors of the receiver that belong to this time are not used,
and the outage is explained. The reference of the axis, compared with the azimuth of the target at the same instant,
shows when the beam is back. A travel below one revolution has such a turn as soon as the target is inside the travel
again.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled

TURN_DTYPE = np.dtype([('under_way', 'i8'), ('begun', 'f8'), ('over', 'f8')], align=True)
"""State of the turn.

under_way    1 from the change of the azimuth wrap until the beam is on the target again
begun, over  begin [s] of this turn or the last one, -inf for none, and its last instant so far [s]
"""

MAX_OFFSET_BEAMWIDTHS = 0.5
"""Largest intended pointing offset [beamwidths] at which the receiver's error is still used."""


def initialise(s):
    """Begin without a turn; s: view of TURN_DTYPE."""
    s['begun'] = s['over'] = -math.inf


@compiled
def begin(s, t):
    """Begin a turn at t [s], if none is under way."""
    if not s.under_way:
        s.under_way, s.begun, s.over = 1, t, t


@compiled
def stop(s):
    """End the turn: the antenna follows no target."""
    s.under_way = 0


@compiled
def watch(s, axis, target, beamwidth, t):
    """Compare the azimuth of the axis with deck angles (azimuth, elevation) of the target at t [s]; all in rad.

    `axis` and the azimuth of the target count revolutions.
    """
    if s.under_way:
        azimuth, elevation = target
        s.over, left = t, abs(azimuth - axis)
        s.under_way = left > math.pi or left * math.cos(elevation) > MAX_OFFSET_BEAMWIDTHS * beamwidth


@compiled
def covers(s, t):
    """Return True if a turn was under way at t [s]."""
    return s.begun <= t and (s.under_way != 0 or t <= s.over)
