"""Pointing of the antenna by the set-points (directions) of a rotator program, as one steady motion.

Such a program knows nothing of azimuth turns, rates and ships. It sends a direction about every 0.8 s, with an azimuth
of 0 to 360 deg. Ashore, a set-point becomes a command `preset` on the nearest turn of the azimuth; on a ship, a
command `slave` in earth angles. Successive set-points become one motion, which ends at the last one.
"""
import math
from collections.abc import Sequence

import numpy as np

from pedestal_common.geometry import line_of_sight
from pedestal_common.graph import topics
from pedestal_common.quantities import Degrees, Pair, Seconds
from pedestal_operator.remote_node import Remote
from pedestal_operator.rotator.rotctld import Limits, turn
from pedestal_operator.rotator.set_point_filter import SetPointFilter

(OUTCOME_DONE, OUTCOME_REFUSED, OUTCOME_OUT_OF_REACH, OUTCOME_BUSY, OUTCOME_NO_REPLY,
 OUTCOME_NO_POSITION) = range(6)
"""BUSY: another client is in control. NO_POSITION: position or limits of the antenna are unknown."""


class Refused(Exception):  # noqa: N818  no error of the server
    """A refused request. reason: one line."""

    def __init__(self, outcome: int, reason: str) -> None:
        super().__init__(reason)
        self.outcome, self.reason = outcome, reason


SLAVE_DURATION_S = 3600.0
"""Time for which a `slave` direction is valid [s]: longer than a pass. A program may send one set-point only."""

MAX_ANGLE_AGE_S = 0.5  # of angles and attitude, which are published at each step of the drive [s]

MAX_AZIMUTH_DEG, MAX_SHIP_ELEVATION_DEG = 720.0, 180.0
"""Largest azimuth of a set-point; largest elevation on a ship [deg], where the limits of the axes do not apply."""

ATTITUDE_TOPIC = 'ship/imu/data'  # topic of the attitude, which exists on a ship only

LIMIT_PARAMETERS = tuple(f'{axis}.limits.{end}' for axis in topics.AXES for end in ('low', 'high'))


def _out_of_reach(name: str, angle: Degrees, low: Degrees, high: Degrees) -> Refused:
    return Refused(OUTCOME_OUT_OF_REACH, f'{name} {angle:g} deg: must be {low:g} to {high:g}')


class Pointing:
    """Pointing of an antenna by set-points."""

    def __init__(self, remote: Remote) -> None:
        self._remote = remote
        self._filter = SetPointFilter()
        self._query = remote.query(LIMIT_PARAMETERS)
        remote.subscribe_numbers(ATTITUDE_TOPIC)

    @property
    def on_ship(self) -> bool:
        """True if the antenna is on a ship, also while the attitude is stale."""
        return self._remote.exists(ATTITUDE_TOPIC)

    @property
    def _mode(self) -> str:
        return 'slave' if self.on_ship else 'preset'

    @property
    def limits(self) -> Limits:
        """Limits of the axes from the parameters of the control unit. Raises Refused before its reply."""
        if self._query.values is None:
            raise Refused(OUTCOME_NO_POSITION, 'the limits of the antenna are unknown: no reply of the control unit')
        low_az, high_az, low_el, high_el = (math.degrees(angle) for angle in self._query.values)
        return Limits((low_az, high_az), (low_el, high_el))

    def look(self, now: Seconds) -> None:
        """Take the limits of the control unit, and settle if no set-point has followed the last one in time."""
        self._query.look()
        if not self.continues(now):
            self.settle(now)

    def continues(self, now: Seconds) -> bool:
        """Return True if a set-point at the time now continues the motion."""
        return self._filter.continues(now)

    def set_point(self, now: Seconds) -> tuple[Degrees, Degrees] | None:
        """Return the last set-point (azimuth, elevation) of the motion, None if no motion continues."""
        last = self._filter.set_point
        if last is None or not self.continues(now):
            return None
        azimuth, elevation = last
        return azimuth % 360.0, elevation

    def earth_angles(self) -> tuple[Degrees, Degrees]:
        """Return earth angles (azimuth, elevation) of the antenna. Raises Refused if they are stale."""
        stale = [topic for topic in ('joint_states', *([ATTITUDE_TOPIC] if self.on_ship else []))
                 if not self._remote.present(topic, MAX_ANGLE_AGE_S)]
        angles = self._remote.directions('joint_states')
        if stale or not all(map(math.isfinite, angles)):
            raise Refused(OUTCOME_NO_POSITION, f'the position of the antenna is unknown: no {" and ".join(stale)}'
                          if stale else 'the position of the antenna is unknown: joint_states is not a number')
        if not self.on_ship:
            return angles
        deck_to_earth = np.zeros((3, 3))
        x, y, z, w = self._remote.numbers[ATTITUDE_TOPIC][:4]
        line_of_sight.rotation(x, y, z, w, deck_to_earth)
        beam = line_of_sight.direction(*np.radians(angles))
        azimuth, elevation = np.degrees(line_of_sight.earth_angles(*(deck_to_earth @ beam)))
        return azimuth, elevation

    def target(self, azimuth: Degrees, elevation: Degrees, now: Seconds) -> tuple[Degrees, Degrees]:
        """Return the set-point (azimuth, elevation) for a direction, on the nearest turn. Raises Refused."""
        limits = self.limits
        low, high = (-MAX_SHIP_ELEVATION_DEG, MAX_SHIP_ELEVATION_DEG) if self.on_ship else limits.elevation
        self._check('azimuth', azimuth, -MAX_AZIMUTH_DEG, MAX_AZIMUTH_DEG)
        self._check('elevation', elevation, low, high)
        self.earth_angles()     # Only for its check: it raises Refused without a fresh position.
        # On a ship the first `near` is a deck angle and not an earth angle. This is sufficient, because the whole
        # turns of an earth azimuth matter only from one set-point to the next.
        last = self._filter.set_point
        near = last[0] if last is not None and self.continues(now) else self._remote.directions('joint_states')[0]
        if self.on_ship:
            return near + (azimuth - near + 180.0) % 360.0 - 180.0, elevation
        turned = turn(azimuth, near, limits.azimuth)
        if turned is None:
            raise _out_of_reach('azimuth', azimuth, *limits.azimuth)
        return turned, elevation

    def go(self, target: tuple[Degrees, Degrees], now: Seconds) -> str:
        """Command a set-point of `target` at the time now. Return the number of the request."""
        return self._request(*self._filter.take(target, now))

    @staticmethod
    def _check(name: str, angle: Degrees, low: Degrees, high: Degrees) -> None:
        if not low <= angle <= high:
            raise _out_of_reach(name, angle, low, high)

    def settle(self, now: Seconds) -> None:
        """Stop at the last set-point, because no other follows; do nothing after a change of mode."""
        last, mode = self._filter.set_point, self._remote.texts.get('acu/mode')
        if last is not None and mode == self._mode and (self._filter.place(now) != last).any():
            self._request(last)
        self.reset()

    def reset(self) -> None:
        """Begin a new motion with the next set-point."""
        self._filter = SetPointFilter()

    def _request(self, angles: Pair, rates: Sequence[float] | Pair = (0.0, 0.0), moves: Seconds = 0.0) -> str:
        """Command angles [deg] that move at rates [deg/s] for the time `moves`. Return the number of the request."""
        names = (*topics.AXES, *(f'{axis}_rate' for axis in topics.AXES))
        arguments = {**dict(zip(names, np.radians((*angles, *rates)))), 'moves': moves}
        if self.on_ship:
            arguments['holds'] = SLAVE_DURATION_S
        return self._remote.request(self._mode, arguments)
