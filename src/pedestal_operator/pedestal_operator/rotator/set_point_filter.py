"""Filter that turns the set-points of a rotator program into one steady motion. No ROS here.

Set-points P at a regular pace T are the measurements of a g-h filter (E. Brookner, Tracking and Kalman Filtering Made
Easy, 1998, section 1.2) with the rate r and the commanded point C, all [deg]:

    r = r + h ((P - P_before) / T - r)
    rate of C = r + g (P - C) / T

The motion of C continues from its present place, so it neither jumps nor stops. Irregular set-points cannot be
predicted: some programs wait until the error exceeds a threshold. Then C becomes P. If C is already ahead of P in the
direction of motion, C stays at its place.
"""
from collections.abc import Sequence

import numpy as np

from pedestal_common.quantities import Degrees, Pair, Seconds

MAX_SET_POINT_GAP_S = 3.0  # largest time between two set-points of one motion [s]
MAX_SET_POINT_RATE_DEG_S = 5.0  # rate between two set-points above which the second is a new target [deg/s]
PERIOD_TOLERANCE_RATIO = 0.3  # largest change of T from one set-point to the next at a regular pace, as part of T [-]
G, H = 0.5, 0.5  # gains of the g-h filter [-]
MOTION_DURATION_RATIO = 1.5  # time for which C moves after a set-point, divided by T [-]; then C stops


class SetPointFilter:
    """State of the filter."""
    set_point: Pair | None  # the last set-point P [deg], None before the first
    _when: Seconds          # time of the last set-point
    _T: Seconds | None      # the last T, None if the last set-point began a new motion
    _begins: Pair           # C at the time of the last set-point [deg]
    _rate: Pair             # at which it moves [deg/s]
    _moves: Seconds         # time for which it moves
    _r: Pair                # r

    def __init__(self) -> None:
        self.set_point, self._when, self._T = None, 0.0, None
        self._begins, self._rate, self._moves, self._r = np.zeros(2), np.zeros(2), 0.0, np.zeros(2)

    def continues(self, now: Seconds) -> bool:
        """Return True if a set-point at the time now continues the motion."""
        return self.set_point is not None and now - self._when < MAX_SET_POINT_GAP_S

    def place(self, now: Seconds) -> Pair:
        """Return C at the time now."""
        return self._begins + self._rate * min(now - self._when, self._moves)

    def take(self, set_point: Sequence[Degrees], now: Seconds) -> tuple[Pair, Pair, Seconds]:
        """Take a set-point at the time now. Return C [deg], its rates [deg/s] and their duration."""
        P, T = np.array(set_point), max(now - self._when, 1e-3)
        begins, rate, moves, r, regular = P, np.zeros(2), 0.0, np.zeros(2), None
        before = self.set_point
        measured = (P - before) / T if before is not None and self.continues(now) else np.full(2, np.inf)
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
