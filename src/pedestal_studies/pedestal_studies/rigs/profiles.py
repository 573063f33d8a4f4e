"""Target motions of the filter studies, exact: angle [rad], rate [rad/s] and acceleration [rad/s2] over time.

flyby-500m, flyby-60m: past the antenna on a straight line at 15 m/s, nearest in the middle of the record.
s-turn-500m: 500 m away, an S of turns at 3 m/s2 across the line of sight between two straight legs.
s-20deg: paper 003's S motion of 20 deg at 3.5 deg/s.
"""
import math

import numpy as np

PROFILES = ('flyby-500m', 'flyby-60m', 's-turn-500m', 's-20deg')

RECORD_DURATION_S = 60.0
"""Of a record [s]."""

FLYBY_SPEED_M_S = 15.0
"""Of the flybys [m/s]."""

MIN_FLYBY_DISTANCES_M = {'flyby-500m': 500.0, 'flyby-60m': 60.0}
"""Distance of the flybys when they are nearest [m]."""

TURN_ACCELERATION_M_S2, TURN_DISTANCE_M = 3.0, 500.0
"""Of the S-turn [m/s2, m]: a bank of 17 deg."""

TURN_SCHEDULE, ROLL_DURATION_S = {14.0: 1.0, 22.0: -1.0, 38.0: 1.0, 46.0: 0.0}, 1.0
"""When the target rolls [s], into which turn (0: straight on), and how long that takes [s]. The reference gives only
the acceleration and the distance; straight legs before and after give its numbers for cv and ca."""

S_MOTION_STROKE_RAD, S_MOTION_RATE_RAD_S, S_MOTION_REVERSAL_S = math.radians(20.0), math.radians(3.5), 1.0
"""Of paper 003's S motion, from end to end [rad], between its ends [rad/s], and the time of a reversal, ours [s]."""


def truth(name, t):
    """(angle, rate, acceleration), each (n,), of a profile at t (n,) [s]; KeyError for an unknown name."""
    if name in MIN_FLYBY_DISTANCES_M:
        return flyby(t - 0.5 * RECORD_DURATION_S, FLYBY_SPEED_M_S / MIN_FLYBY_DISTANCES_M[name])
    return {'s-turn-500m': s_turn, 's-20deg': lambda t: s_motion(t, S_MOTION_STROKE_RAD, S_MOTION_RATE_RAD_S,
                                                                 S_MOTION_REVERSAL_S)}[name](t)


def distance(name, t):
    """Distance [m] of a flyby from the antenna at t (n,) [s]; KeyError for another profile."""
    return np.hypot(MIN_FLYBY_DISTANCES_M[name], FLYBY_SPEED_M_S * (t - 0.5 * RECORD_DURATION_S))


def flyby(t, w):
    """(angle, rate, acceleration) (n,) of a straight line, nearest at t = 0; w: speed over smallest distance
    [rad/s]."""
    u = w * t
    return np.arctan(u), w / (1.0 + u * u), -2.0 * u * w * w / (1.0 + u * u) ** 2


def s_turn(t):
    """(angle, rate, acceleration) (n,) of an S-turn at t (n,) [s]: a turn to one side, one twice as long to the other
    side, and a third back to the old course; straight before and after."""
    motion, before = [0.0, 0.0, 0.0], 0.0
    for at, side in TURN_SCHEDULE.items():
        jump = (side - before) * TURN_ACCELERATION_M_S2 / TURN_DISTANCE_M
        motion = [x + jump * more for x, more in zip(motion, _step(t - at, ROLL_DURATION_S))]
        before = side
    return tuple(motion)


def _step(t, width):
    """(second integral, integral, s) of a step s from 0 to 1 at t = 0, half a cosine `width` [s] wide."""
    x = np.clip(t / width + 0.5, 0.0, 1.0)
    after = np.maximum(t - 0.5 * width, 0.0)
    return (0.5 * width * width * (0.5 * x * x + (np.cos(np.pi * x) - 1.0) / np.pi**2) + 0.5 * after * (width + after),
            0.5 * width * (x - np.sin(np.pi * x) / np.pi) + after, 0.5 * (1.0 - np.cos(np.pi * x)))


def s_motion(t, stroke, rate, reversal):
    """(angle, rate, acceleration) (n,) of a motion to and fro over `stroke` [rad] at +-rate [rad/s]; each reversal [s]
    is half a cosine in rate.

    At t = 0 it is in the middle and moves forward; the largest acceleration is pi rate / reversal. Raises ValueError
    where the reversals alone are longer than the stroke.
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
    return sign * (stay + T * np.sin(x)), sign * np.cos(x), -sign * np.sin(x) / T
