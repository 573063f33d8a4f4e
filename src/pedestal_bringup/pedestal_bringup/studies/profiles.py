"""Target motions of the filter studies, exact: angle [rad], rate [rad/s] and acceleration [rad/s2] over time.

flyby-500m, flyby-60m: past the antenna on a straight line at 15 m/s, nearest in the middle of the record.
s-turn-500m: 500 m away, 3 m/s2 across the line of sight, now to one side, now to the other.
s-20deg: paper 003's S motion of 20 deg at 3.5 deg/s.
"""
import math

import numpy as np

PROFILES = ('flyby-500m', 'flyby-60m', 's-turn-500m', 's-20deg')

DURATION = 60.0
"""Of a record [s]."""

SPEED = 15.0
"""Of the flybys [m/s]."""

NEAREST = {'flyby-500m': 500.0, 'flyby-60m': 60.0}
"""Distance of the flybys when they are nearest [m]."""

TURN_ACCELERATION, TURN_DISTANCE = 3.0, 500.0
"""Of the S-turn [m/s2, m]: a bank of 17 deg."""

TURN_TIME, ROLL_TIME = 8.0, 1.0
"""From one turn to the next, and the part of it in which the target rolls from one bank to the other [s].
At 15 m/s the course swings by +-45 deg. The reference says only 3 m/s2 at 500 m: these two are ours."""

STROKE, RATE, REVERSAL = math.radians(20.0), math.radians(3.5), 1.0
"""Of paper 003's S motion, from end to end [rad], between its ends [rad/s], and the time of a reversal, ours [s]."""


def truth(name, t):
    """(angle, rate, acceleration) of a profile at t (n,) [s]; KeyError for an unknown name."""
    if name in NEAREST:
        return flyby(t - 0.5 * DURATION, SPEED / NEAREST[name])
    return {'s-turn-500m': s_turn, 's-20deg': lambda t: s_motion(t, STROKE, RATE, REVERSAL)}[name](t)


def flyby(t, w):
    """A straight line passed at speed over distance w [rad/s], nearest at t = 0."""
    u = w * t
    return np.arctan(u), w / (1.0 + u * u), -2.0 * u * w * w / (1.0 + u * u) ** 2


def s_turn(t):
    """Acceleration across the line of sight that changes sides every TURN_TIME."""
    a = TURN_ACCELERATION / TURN_DISTANCE
    _, wave, integral, second = _reversing(t, TURN_TIME - ROLL_TIME, ROLL_TIME)
    return a * second, a * integral, a * wave


def s_motion(t, stroke, rate, reversal):
    """To and fro over `stroke` [rad] from end to end at +-rate [rad/s], each reversal [s] half a cosine in rate.

    In the middle, forward, at t = 0; the largest acceleration is pi rate / reversal. ValueError where the reversals
    alone are longer than the stroke.
    """
    uniform = stroke / rate - 2.0 * reversal / math.pi
    if uniform < 0.0:
        raise ValueError(f'reversal = {reversal:g} s: must be at most pi stroke / (2 rate) = '
                         f'{0.5 * math.pi * stroke / rate:g} s')
    slope, wave, integral, _ = _reversing(t, uniform, reversal)
    return rate * integral, rate * wave, rate * slope


def _reversing(t, uniform, reversal):
    """(dw/dt, w, its integral, its second integral) of a wave w that stays +1 for `uniform` [s], becomes -1 along half
    a cosine in `reversal` [s], stays, comes back; t = 0 in the middle of a stay at +1. Both integrals have mean 0.
    """
    half, r = np.divmod(t + 0.5 * uniform, uniform + reversal)
    sign = 1.0 - 2.0 * (half % 2)
    stay = np.minimum(r, uniform)
    x = np.pi * np.maximum(r - uniform, 0.0) / reversal
    T = reversal / np.pi
    last = 0.5 * uniform * reversal + 2.0 * T * T
    return (-sign * np.sin(x) / T, sign * np.cos(x), sign * (stay - 0.5 * uniform + T * np.sin(x)),
            sign * (0.5 * stay * (stay - uniform) + 0.5 * uniform * T * x + T * T * (1.0 - np.cos(x)) - 0.5 * last))
