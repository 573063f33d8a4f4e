"""The levelled deck: the frame of the mean attitude of the ship, in which the look-ahead predicts keyholes.

Because the future attitude of a rolling ship is not known, the look-ahead uses the mean attitude.
"""
import math
from typing import Annotated

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import ASHORE_ATTITUDE
from pedestal_common.quantities import Floats
from pedestal_common.record import Record


class LevelledDeck(Record):
    """Mean attitude."""
    mean: Annotated[Floats, (4,)]  # quaternion (x, y, z, w) levelled deck -> earth
    # mean square of the tilt of the deck from the levelled deck, about both horizontal axes together [rad2]
    spread: float
    since: float  # stamp of the first attitude in the mean [s]
    latest: float  # stamp of the last attitude in the mean [s]; -inf: no attitude yet


def initialise(s):
    """Start ashore, before any attitude of a ship; s (n,) of LevelledDeck."""
    s['mean'], s['latest'] = ASHORE_ATTITUDE, -math.inf


@compiled
def take(s, stamp, q, mean_time, restart):
    """Add an attitude to the mean, which is an average over about mean_time [s].

    stamp    of the attitude [s]
    q        quaternion (4,) deck -> earth
    restart  True if the mean shall begin with this attitude

    A mean begins as a horizontal deck with the heading of its first attitude.
    """
    mean = s.mean
    if restart or not s.latest > -math.inf:
        s.since = stamp
        # The part (z, w) of the quaternion is its rotation about the vertical.
        length = math.hypot(q[2], q[3])
        mean[0] = mean[1] = 0.0
        mean[2], mean[3] = q[2] / length, q[3] / length
        s.spread = 0.0
    else:
        T = stamp - s.latest
        share = T / (mean_time + T)
        dot = 0.0
        for i in range(4):
            dot += mean[i] * q[i]
        norm = 0.0
        # q and -q are the same attitude. The sign that is nearer to the mean is used.
        for i in range(4):
            mean[i] += share * (math.copysign(1.0, dot) * q[i] - mean[i])
            norm += mean[i] * mean[i]
        for i in range(4):
            mean[i] /= math.sqrt(norm)
        # x, y: horizontal components of the difference of the vertical axes of the deck and the levelled deck.
        x = 2.0 * (q[0] * q[2] - q[3] * q[1] - mean[0] * mean[2] + mean[3] * mean[1])
        y = 2.0 * (q[1] * q[2] + q[3] * q[0] - mean[1] * mean[2] - mean[3] * mean[0])
        # Until mean_time has passed, all attitudes have the same weight in the spread.
        s.spread += T / (min(stamp - s.since, mean_time) + T) * (x * x + y * y - s.spread)
    s.latest = stamp
