"""Steady motion from the set-points of a program without knowledge of turns, rates and ships.

Such a program sends a direction about every 0.8 s, with an azimuth of 0 to 360 deg. Ashore, a set-point is a `preset`
on the nearest turn of the azimuth. On a ship, it is a `slave` direction in earth angles. Successive set-points become
one motion (SetPointFilter), which ends at the last set-point.
"""
import math

import numpy as np

from pedestal_common.geometry import line_of_sight
from pedestal_common.graph import topics
from pedestal_operator.rotator.rotctld import Limits, turn
from pedestal_operator.rotator.set_point_filter import SetPointFilter

SLAVE_DURATION_S = 3600.0
"""Time for which a `slave` direction on a ship is valid [s]."""

ATTITUDE_TOPIC = 'ship/imu/data'
"""Topic of the attitude, which exists on a ship only."""

LIMIT_PARAMETERS = tuple(f'{axis}.limits.{end}' for axis in topics.AXES for end in ('low', 'high'))
"""Parameters of the control unit with the limits of the axes."""


class Pointing:
    """Set-points for a remote_node.Remote."""

    def __init__(self, remote):
        self._remote = remote
        self._filter = SetPointFilter()
        self._query = remote.query(LIMIT_PARAMETERS)
        remote.subscribe_numbers(ATTITUDE_TOPIC)

    @property
    def on_ship(self):
        """True if the antenna is on a ship."""
        return self._remote.present(ATTITUDE_TOPIC)

    @property
    def _mode(self):
        return 'slave' if self.on_ship else 'preset'

    @property
    def limits(self):
        """Limits of the axes [deg] from the parameters of the control unit, default Limits before the reply."""
        if self._query.values is None:
            return Limits()
        angles = [math.degrees(angle) for angle in self._query.values]
        return Limits(tuple(angles[:2]), tuple(angles[2:]))

    def look(self, now):
        """Take the limits of the control unit, and settle if no set-point has followed the last one."""
        self._query.look()
        if not self._filter.continues(now):
            self.settle(now)

    def earth_angles(self):
        """Return earth angles (azimuth, elevation) [deg] of the antenna, NaN if stale."""
        angles = self._remote.angles('joint_states')
        if not self.on_ship:
            return angles
        deck_to_earth = np.zeros((3, 3))
        line_of_sight.rotation(*self._remote.numbers[ATTITUDE_TOPIC][:4], deck_to_earth)
        beam = line_of_sight.direction(*np.radians(angles))
        return tuple(np.degrees(line_of_sight.earth_angles(*(deck_to_earth @ beam))))

    def go(self, azimuth, elevation, now):
        """Command a set-point [deg] at the time now [s]. Return the number of the request, None if out of reach."""
        low, high = self.limits.elevation
        if not (-720.0 <= azimuth <= 720.0 and (self.on_ship or low <= elevation <= high) and abs(elevation) <= 180.0):
            return None
        near = (self._filter.set_point if self._filter.continues(now) else self._remote.angles('joint_states'))[0]
        if self.on_ship:
            azimuth = near + (azimuth - near + 180.0) % 360.0 - 180.0 if math.isfinite(near) else azimuth
        else:
            azimuth = turn(azimuth, near if math.isfinite(near) else 0.0, self.limits.azimuth)
            if azimuth is None:
                return None
        return self._request(*self._filter.take((azimuth, elevation), now))

    def settle(self, now):
        """Stop at the last set-point, because no other follows; do nothing after a change of mode."""
        last, mode = self._filter.set_point, self._remote.texts.get('acu/mode')
        if last is not None and mode == self._mode and (self._filter.place(now) != last).any():
            self._request(last)
        self.reset()

    def reset(self):
        """Begin a new motion with the next set-point."""
        self._filter = SetPointFilter()

    def _request(self, angles, rates=(0.0, 0.0), moves=0.0):
        names = (*topics.AXES, *(f'{axis}_rate' for axis in topics.AXES))
        arguments = {**dict(zip(names, np.radians((*angles, *rates)))), 'moves': moves}
        if self.on_ship:
            arguments['holds'] = SLAVE_DURATION_S
        return self._remote.request(self._mode, arguments)

