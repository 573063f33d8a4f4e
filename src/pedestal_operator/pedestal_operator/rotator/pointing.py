"""Set-points of a program that knows nothing of turns, rates and ships: one after the other, into a steady motion.

Such a program sends where the antenna shall point, every 0.8 s or so, azimuth 0 to 360 deg. Ashore a set-point is a
`preset` on the turn of the azimuth that is nearest; on a ship a `slave` direction in earth angles. Those that follow
each other become one motion (`course`), which ends at the last of them.
"""
import math

import numpy as np

from pedestal_common.geometry import line_of_sight
from pedestal_common.graph import topics
from pedestal_operator.rotator.rotctld import Limits, turn
from pedestal_operator.rotator.set_point_filter import SetPointFilter

SLAVE_DURATION_S = 3600.0
"""Time [s] for which a direction on a ship holds."""

ATTITUDE_TOPIC = 'ship/imu/data'
LIMIT_PARAMETERS = tuple(f'{axis}.limits.{end}' for axis in topics.AXES for end in ('low', 'high'))
"""Parameters of the control unit."""


class Pointing:
    """The set-points for a remote_node.Remote."""

    def __init__(self, remote):
        self._remote = remote
        self._course = SetPointFilter()
        self._query = remote.query(LIMIT_PARAMETERS)
        remote.hear(ATTITUDE_TOPIC)

    @property
    def aboard(self):
        """Whether the antenna stands on a ship."""
        return self._remote.present(ATTITUDE_TOPIC)

    @property
    def _mode(self):
        return 'slave' if self.aboard else 'preset'

    @property
    def limits(self):
        """Limits of the axes [deg], as the control unit has told them."""
        if self._query.values is None:
            return Limits()
        angles = [math.degrees(angle) for angle in self._query.values]
        return Limits(tuple(angles[:2]), tuple(angles[2:]))

    def look(self, now):
        """Hear what the control unit tells of its limits; settle where no set-point has followed the last one."""
        self._query.look()
        if not self._course.continues(now):
            self.settle(now)

    def angles_told(self):
        """(azimuth, elevation) [deg] of the antenna against the earth; NaN where it is silent."""
        angles = self._remote.angles('joint_states')
        if not self.aboard:
            return angles
        deck_to_earth = np.zeros((3, 3))
        line_of_sight.rotation(*self._remote.numbers[ATTITUDE_TOPIC][:4], deck_to_earth)
        beam = line_of_sight.direction(*np.radians(angles))
        return tuple(np.degrees(line_of_sight.earth_angles(*(deck_to_earth @ beam))))

    def go(self, azimuth, elevation, now):
        """Ask for a set-point [deg] at the time now [s]: the number of the request, None where it is out of reach."""
        low, high = self.limits.elevation
        if not (-720.0 <= azimuth <= 720.0 and (self.aboard or low <= elevation <= high) and abs(elevation) <= 180.0):
            return None
        near = (self._course.set_point if self._course.continues(now) else self._remote.angles('joint_states'))[0]
        if self.aboard:
            azimuth = near + (azimuth - near + 180.0) % 360.0 - 180.0 if math.isfinite(near) else azimuth
        else:
            azimuth = turn(azimuth, near if math.isfinite(near) else 0.0, self.limits.azimuth)
            if azimuth is None:
                return None
        return self._ask(*self._course.take((azimuth, elevation), now))

    def settle(self, now):
        """Stand at the last set-point: no other follows. Not where somebody has asked for another mode."""
        wanted, mode = self._course.set_point, self._remote.texts.get('acu/mode')
        if wanted is not None and mode == self._mode and (self._course.place(now) != wanted).any():
            self._ask(wanted)
        self.forget()

    def forget(self):
        """The next set-point is the first one."""
        self._course = SetPointFilter()

    def _ask(self, angles, rates=(0.0, 0.0), moves=0.0):
        names = (*topics.AXES, *(f'{axis}_rate' for axis in topics.AXES))
        arguments = {**dict(zip(names, np.radians((*angles, *rates)))), 'moves': moves}
        if self.aboard:
            arguments['holds'] = SLAVE_DURATION_S
        return self._remote.ask(self._mode, arguments)

