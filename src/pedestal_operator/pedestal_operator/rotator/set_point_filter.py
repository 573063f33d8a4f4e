"""Filter that turns the set-points of a rotator program into one steady motion. No ROS here.

    P, C    set-point, and point that is commanded to the antenna: (azimuth, elevation) [deg]
    r       estimated rate of the set-points [deg/s]
    T       time from one set-point to the next [s]
    g, h    gains G and H of the filter

Set-points at a regular pace are the measurements of a g-h filter
(E. Brookner, Tracking and Kalman Filtering Made Easy, 1998, section 1.2):

    r = r + h ((P - P_before) / T - r)
    rate of C = r + g (P - C) / T

The motion of C continues from its present place, so it neither jumps nor stops. Irregular set-points cannot be
predicted: some programs wait until the error exceeds a threshold. Then C becomes P. If C is already ahead of P in the
direction of motion, C stays at its place.
"""
import numpy as np

MAX_SET_POINT_GAP_S = 3.0  # largest time between two set-points of one motion [s]
MAX_SET_POINT_RATE_DEG_S = 5.0  # rate between two set-points above which the second is a new target [deg/s]
PERIOD_TOLERANCE_RATIO = 0.3  # largest change of T from one set-point to the next at a regular pace, as part of T [-]
G, H = 0.5, 0.5  # gains of the g-h filter [-]
MOTION_DURATION_RATIO = 1.5  # time for which C moves after a set-point, divided by T [-]; then C stops


class SetPointFilter:
    """State of the filter. set_point: the last set-point P [deg], None before the first.

    _when       time of the last set-point [s]; _T: the last T, None if the last set-point began a new motion
    _begins     C at that time; it moves at _rate [deg/s] for the time _moves [s]
    _r          r
    """

    def __init__(self):
        self.set_point, self._when, self._T = None, 0.0, None
        self._begins, self._rate, self._moves, self._r = None, np.zeros(2), 0.0, np.zeros(2)

    def continues(self, now):
        """Return True if a set-point at the time now [s] continues the motion."""
        return self.set_point is not None and now - self._when < MAX_SET_POINT_GAP_S

    def place(self, now):
        """Return C at the time now [s]."""
        return self._begins + self._rate * min(now - self._when, self._moves)

    def take(self, set_point, now):
        """Take a set-point at the time now [s]. Return C [deg], its rates [deg/s] and their duration [s]."""
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
