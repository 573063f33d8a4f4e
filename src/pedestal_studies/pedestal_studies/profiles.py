"""Target motions (profiles) of the filter studies: exact angle [rad], rate [rad/s] and acceleration [rad/s2].

`flyby-500m` and `flyby-60m` pass the antenna on a straight line at 15 m/s and are nearest in the middle of the record.
`s-turn-500m` is an S of turns at 3 m/s2 across the line of sight, 500 m away, between two straight legs. `s-20deg` is
Lin 2020's S motion of 20 deg at 3.5 deg/s.
"""
import math
from typing import NamedTuple

import numpy as np

from pedestal_common.quantities import Floats, Radians, RadiansPerSecond, Seconds, Times

PROFILES = ('flyby-500m', 'flyby-60m', 's-turn-500m', 's-20deg')  # names of the motions
RECORD_DURATION_S = 60.0  # duration of a record [s]
FLYBY_SPEED_M_S = 15.0  # speed of the flybys [m/s]
MIN_FLYBY_DISTANCES_M = {'flyby-500m': 500.0, 'flyby-60m': 60.0}  # least distance of the flybys [m]

TURN_ACCELERATION_M_S2, TURN_DISTANCE_M = 3.0, 500.0
"""Acceleration [m/s2] and distance [m] of the S-turn; an aircraft has this acceleration at a bank angle of 17 deg."""

TURN_SCHEDULE, ROLL_DURATION_S = {14.0: 1.0, 22.0: -1.0, 38.0: 1.0, 46.0: 0.0}, 1.0
"""{time of a roll [s]: direction of the turn after it, 1, -1 or 0 for straight on}, and duration of a roll [s].

The requirement for this motion states the acceleration and the distance. The times are ours.
"""

S_MOTION_STROKE_RAD, S_MOTION_RATE_RAD_S, S_MOTION_REVERSAL_S = math.radians(20.0), math.radians(3.5), 1.0
"""Lin 2020's S motion: stroke from end to end [rad], rate between the ends [rad/s], and duration of a reversal,
which is ours [s]."""


class Motion(NamedTuple):
    """Motion of a target in one angle."""
    angle: Floats           # [rad]
    rate: Floats            # [rad/s]
    acceleration: Floats    # [rad/s2]


def truth(name: str, t: Times) -> Motion:
    """Return the motion of a profile; KeyError for an unknown name."""
    if name in MIN_FLYBY_DISTANCES_M:
        return flyby(t - 0.5 * RECORD_DURATION_S, FLYBY_SPEED_M_S / MIN_FLYBY_DISTANCES_M[name])
    if name == 's-20deg':
        return s_motion(t, S_MOTION_STROKE_RAD, S_MOTION_RATE_RAD_S, S_MOTION_REVERSAL_S)
    return {'s-turn-500m': s_turn}[name](t)


def distance(name: str, t: Times) -> Floats:
    """Return the distance [m] of a flyby from the antenna; KeyError for another profile."""
    return np.hypot(MIN_FLYBY_DISTANCES_M[name], FLYBY_SPEED_M_S * (t - 0.5 * RECORD_DURATION_S))


def flyby(t: Times, w: RadiansPerSecond) -> Motion:
    """Return the motion of a target on a straight line, nearest at t = 0; w: speed over least distance."""
    u = w * t
    return Motion(np.arctan(u), w / (1.0 + u * u), -2.0 * u * w * w / (1.0 + u * u) ** 2)


def s_turn(t: Times) -> Motion:
    """Return the motion of an S-turn: to one side, twice as long to the other, back to the old course."""
    motion, before = Motion(*3 * (np.zeros(t.shape),)), 0.0
    for at, side in TURN_SCHEDULE.items():
        jump = (side - before) * TURN_ACCELERATION_M_S2 / TURN_DISTANCE_M
        motion = Motion(*(x + jump * more for x, more in zip(motion, _step(t - at, ROLL_DURATION_S))))
        before = side
    return motion


def _step(t: Times, width: Seconds) -> Motion:
    """Return the motion whose acceleration rises from 0 to 1 at t = 0, as half a cosine over `width`."""
    x = np.clip(t / width + 0.5, 0.0, 1.0)
    after = np.maximum(t - 0.5 * width, 0.0)
    return Motion(
        0.5 * width * width * (0.5 * x * x + (np.cos(np.pi * x) - 1.0) / np.pi**2) + 0.5 * after * (width + after),
        0.5 * width * (x - np.sin(np.pi * x) / np.pi) + after, 0.5 * (1.0 - np.cos(np.pi * x)))


def s_motion(t: Times, stroke: Radians, rate: RadiansPerSecond, reversal: Seconds) -> Motion:
    """Return a motion to and fro over `stroke` at +-rate, with reversals of half a cosine in rate.

    At t = 0 the target is in the middle and moves forward. The largest acceleration is pi rate / reversal. Raises
    ValueError if the reversals alone are longer than the stroke.
    """
    uniform = stroke / rate - 2.0 * reversal / math.pi
    if uniform < 0.0:
        raise ValueError(f'reversal = {reversal:g} s: must be at most pi stroke / (2 rate) = '
                         f'{0.5 * math.pi * stroke / rate:g} s')
    half, r = np.divmod(t + 0.5 * uniform, uniform + reversal)
    sign = rate * (1.0 - 2.0 * (half % 2))
    stay = np.minimum(r, uniform) - 0.5 * uniform
    x = np.pi * np.maximum(r - uniform, 0.0) / reversal
    T = reversal / math.pi
    return Motion(sign * (stay + T * np.sin(x)), sign * np.cos(x), -sign * np.sin(x) / T)
