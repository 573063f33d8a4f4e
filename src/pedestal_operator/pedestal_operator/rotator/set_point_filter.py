"""Set-points that come one after the other, made into a steady motion. No ROS here.

    P, C    set-point and commanded point (azimuth, elevation) [deg]
    r       rate of the set-points [deg/s]
    T       time from one set-point to the next [s]

Set-points at a regular pace are the measurements of a g-h filter (E. Brookner, Tracking and Kalman Filtering Made
Easy, 1998, 1.2): r = r + h ((P - P_before) / T - r), and C goes on from where it is at r + g (P - C) / T, so that it
neither jumps nor stands. Where they come now and then, for example from a program that waits until the antenna is off
by a threshold, the next one cannot be foreseen: C is P, or stays where it is while that lies ahead of P.
"""
import numpy as np

MAX_SET_POINT_GAP_S = 3.0
"""Time [s] within which a set-point continues the one before."""

MAX_SET_POINT_RATE_DEG_S = 5.0
"""Rate [deg/s] between two set-points above which the second is a new target."""

PERIOD_TOLERANCE_RATIO = 0.3
"""Of T: by so much it may differ from the one before."""

G, H = 0.5, 0.5

MOTION_DURATION_RATIO = 1.5
"""Of T: for so long C moves. Then it stands."""


class SetPointFilter:
    """The last set-point, None for none, and the motion that it became part of."""

    def __init__(self):
        self.set_point, self._when, self._T = None, 0.0, None
        self._begins, self._rate, self._moves, self._r = None, np.zeros(2), 0.0, np.zeros(2)

    def continues(self, now):
        """Whether a set-point at the time now [s] continues the last one."""
        return self.set_point is not None and now - self._when < MAX_SET_POINT_GAP_S

    def place(self, now):
        """C at the time now [s]."""
        return self._begins + self._rate * min(now - self._when, self._moves)

    def take(self, set_point, now):
        """What becomes of a set-point at the time now [s]: C [deg], its rates [deg/s], how long they hold [s]."""
        P, T = np.array(set_point), max(now - self._when, 1e-3)
        begins, rate, moves, r, regular = P, np.zeros(2), 0.0, np.zeros(2), None
        measured = (P - self.set_point) / T if self.continues(now) else np.full(2, np.inf)
        if np.abs(measured).max() <= MAX_SET_POINT_RATE_DEG_S:
            C, regular = self.place(now), T
            if self._T is not None and abs(T - self._T) <= PERIOD_TOLERANCE_RATIO * T:
                r = self._r + H * (measured - self._r)
                rate = r + G * (P - C) / T
                rate[rate * r < 0.0] = 0.0
                begins, moves = C, MOTION_DURATION_RATIO * T
            else:
                r, begins = measured, np.where((P - C) * measured < 0.0, C, P)
        self.set_point, self._when, self._T = P, now, regular
        self._begins, self._rate, self._moves, self._r = begins, rate, moves, r
        return begins, rate, moves
