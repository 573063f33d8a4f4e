"""The levelled deck: the frame of the mean attitude of the ship, in which the look-ahead predicts keyholes.

Because the future attitude of a rolling ship is not known, the look-ahead uses the mean attitude.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import ASHORE_ATTITUDE
from pedestal_common.quantities import Bit, Quaternion, Radians2, Records, Seconds
from pedestal_common.record import Record


class LevelledDeck(Record):
    """Mean attitude."""
    mean: Quaternion    # levelled deck -> earth
    spread: Radians2    # mean square of the tilt of the deck from the levelled deck, about both horizontal axes
    since: Seconds      # stamp of the first attitude in the mean
    latest: Seconds     # stamp of the last attitude in the mean; -inf: no attitude yet


def initialise(deck: Records) -> None:
    """Start ashore, before any attitude of a ship."""
    deck['mean'], deck['latest'] = ASHORE_ATTITUDE, -math.inf


@compiled
def take(deck: LevelledDeck, stamp: Seconds, q: Quaternion, mean_time: Seconds, restart: Bit) -> None:
    """Add an attitude to the mean, which is an average over about mean_time.

    q        deck -> earth
    restart  1 if the mean shall begin with this attitude

    A mean begins as a horizontal deck with the heading of its first attitude.
    """
    mean = deck.mean
    if restart or not deck.latest > -math.inf:
        deck.since = stamp
        # The part (z, w) of the quaternion is its rotation about the vertical.
        length = math.hypot(q[2], q[3])
        mean[0] = mean[1] = 0.0
        mean[2], mean[3] = q[2] / length, q[3] / length
        deck.spread = 0.0
    else:
        T = stamp - deck.latest
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
        deck.spread += T / (min(stamp - deck.since, mean_time) + T) * (x * x + y * y - deck.spread)
    deck.latest = stamp
