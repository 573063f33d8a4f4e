"""Content of the sky plot of the page. Its angles are earth angles [deg], also on a moving deck. No ROS here."""
import collections
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pedestal_common.geometry import line_of_sight
from pedestal_common.graph import topics
from pedestal_common.quantities import Degrees, Matrix3, Message, Pairs, Seconds, Times
from pedestal_common.wire import messages

HORIZON_STEP_DEG = 5.0  # difference in azimuth between two points of a line around the horizon [deg]
MAX_PATH_POINTS = 240  # largest number of points of a path
MIN_HISTORY_STEP_DEG = 0.3  # smallest step of the beam history, less than the width of a line [deg]


class Path(NamedTuple):
    """A program track."""
    times: Times    # UTC
    angles: Pairs   # [deg]: earth azimuth without jumps of 360 deg, elevation


def path(message: Message, midnight: Seconds) -> Path | None:
    """Return the path of a message of acu/program_track, None for a preset. midnight: UTC of a stamp 0."""
    if len(message.points) < 2 or not set(topics.AXES) <= set(message.joint_names):
        return None
    start = messages.nanoseconds(message.header.stamp) * 1e-9 or midnight
    columns = [message.joint_names.index(axis) for axis in topics.AXES]
    times = [start + point.time_from_start.sec + point.time_from_start.nanosec * 1e-9 for point in message.points]
    angles = [[point.positions[column] for column in columns] for point in message.points]
    return Path(np.array(times), np.degrees(angles))


def thinned(path: Path | None) -> list[list[float]]:
    """Return [[azimuth, elevation, time], ...] of a path, MAX_PATH_POINTS rows at most."""
    if path is None:
        return []
    rows = np.unique(np.linspace(0, len(path.times) - 1, MAX_PATH_POINTS).astype(int))
    return np.column_stack((path.angles[rows], path.times[rows])).round(3).tolist()


def passage(path: Path | None, loss: str) -> list[dict[str, object]]:
    """Return a list with the pass of a path, [] if it stays below the horizon. Times are UTC [s], angles in deg.

    highest: elevation; from, to, travel: azimuth at rise and at set, and its change; loss: text of the predicted loss.
    """
    if path is None:
        return []
    up = np.flatnonzero(path.angles[:, 1] > 0.0)
    if not up.size:
        return []
    rise, fall = up[0], up[-1]
    azimuth, elevation = path.angles[:, 0], path.angles[:, 1]
    top = rise + int(np.argmax(elevation[rise:fall + 1]))
    return [{'aos': float(path.times[rise]), 'los': float(path.times[fall]),
             'highest': round(float(elevation[top]), 1), 'from': round(float(azimuth[rise] % 360.0), 1),
             'to': round(float(azimuth[fall] % 360.0), 1),
             'travel': round(float(azimuth[fall] - azimuth[rise]), 1), 'loss': loss}]


class BeamHistory:
    """Past directions of the beam in the last `span`."""
    _rows: collections.deque[tuple[Seconds, Sequence[Degrees]]]     # time, (azimuth, elevation)

    def __init__(self, span: Seconds) -> None:
        self._span, self._rows = span, collections.deque()

    def add(self, t: Seconds, place: Sequence[Degrees]) -> None:
        """Add the direction of the beam at a time t; an unknown direction is NaN."""
        while self._rows and self._rows[0][0] < t - self._span:
            self._rows.popleft()
        last = self._rows[-1][1] if self._rows else (math.inf, math.inf)
        if max(abs(a - b) for a, b in zip(place, last)) >= MIN_HISTORY_STEP_DEG:
            self._rows.append((t, place))

    @property
    def places(self) -> list[Sequence[Degrees]]:
        """Points (azimuth, elevation) of the history, in order of time."""
        return [place for _, place in self._rows]


class Deck:
    """Deck at an attitude, a quaternion deck -> earth (x, y, z, w); None ashore (deck and earth angles are equal)."""
    _to_earth: Matrix3 | None

    def __init__(self, quaternion: Sequence[float] | None) -> None:
        self._to_earth = None
        if quaternion is not None:
            self._to_earth = np.zeros((3, 3))
            x, y, z, w = quaternion
            line_of_sight.rotation(x, y, z, w, self._to_earth)

    def seen(self, azimuth: Degrees, elevation: Degrees) -> list[Degrees]:
        """Return earth angles [azimuth, elevation] of deck angles; NaN stays NaN."""
        if self._to_earth is None or not math.isfinite(azimuth + elevation):
            return [round(azimuth, 3), round(elevation, 3)]
        deck = line_of_sight.direction(math.radians(azimuth), math.radians(elevation))
        earth = line_of_sight.earth_angles(*line_of_sight.to_earth(self._to_earth, *deck))
        return [round(math.degrees(angle), 3) for angle in earth]

    def line(self, points: Sequence[Sequence[Degrees]]) -> list[list[Degrees]]:
        """Return a line in earth angles, with a point every HORIZON_STEP_DEG; points: its corners in deck angles."""
        found: list[list[Degrees]] = []
        for (A, E), (B, F) in zip(points, points[1:]):     # azimuth and elevation of two neighbours
            count = max(int(abs(B - A) / HORIZON_STEP_DEG), 1)
            found += [self.seen(A + (B - A) * i / count, E + (F - E) * i / count) for i in range(count)]
        return found + [self.seen(*points[-1])] if points else found

    def sector(self, low: Degrees, high: Degrees, top: Degrees) -> list[list[Degrees]]:
        """Return the outline of a hidden sector of the deck, azimuth low to high and elevation 0 to top."""
        return self.line([(low, 0.0), (low, top), (high, top), (high, 0.0)])


def numbers(text: str) -> list[list[Degrees]]:
    """Return [[number, ...], ...] of a parameter 'a b; c d' [rad]."""
    return [[math.degrees(float(word)) for word in part.split()] for part in text.split(';') if part.strip()]
