"""Errors of the attitude that the INS of a recorded run reported, against the truth, and its stated uncertainty."""
import dataclasses
import math

import numpy as np

from pedestal_common.quantities import Bools, Floats, Pairs, Radians, Seconds, Times, Vectors3
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording

ATTITUDE_TOPIC, INS_STATE_TOPIC = 'ship/imu/data', 'ins/state'


@dataclasses.dataclass
class KnownAttitude:
    """Errors of the INS at its stamps."""
    t: Times
    # rotation from the true to the reported attitude [rad]: about east and about north (level errors), and about up,
    # clockwise (heading error)
    error: Vectors3
    sigma: Pairs    # standard deviations of level and heading that the INS states [rad]
    # stamp at which ins/state became `aligned`; NaN if it never did. In a bag without ins/state, the first stamp
    aligned: Seconds

    @property
    def level(self) -> Floats:
        """Level error [rad], both axes together."""
        return np.hypot(self.error[:, 0], self.error[:, 1])

    @property
    def heading(self) -> Floats:
        """Heading error [rad], clockwise."""
        return self.error[:, 2]

    @property
    def is_aligned(self) -> Bools:
        """The rows after alignment."""
        return self.t >= self.aligned

    @property
    def at_alignment(self) -> tuple[Radians, Radians]:
        """(heading error, stated standard deviation of heading) at alignment; NaN without alignment."""
        first = np.argmax(self.is_aligned)
        return ((float(self.heading[first]), float(self.sigma[first, 1])) if self.is_aligned.any()
                else (math.nan, math.nan))


def read(bag: Recording) -> KnownAttitude | None:
    """Return the KnownAttitude of a recording; None for an antenna ashore."""
    if not (recordings.holds(bag, 'ship/truth') and recordings.holds(bag, ATTITUDE_TOPIC)):
        return None
    table = bag.table(ATTITUDE_TOPIC)
    t = table['t']
    quaternion = [f'orientation.{letter}' for letter in 'xyzw']
    true = recordings.at(bag, t, 'ship/truth', quaternion)
    reported = np.column_stack([table[name] for name in quaternion])
    both = np.isfinite(true + reported).all(axis=1)
    if not both.any():
        return None
    from scipy.spatial.transform import Rotation  # imported here, because the import is slow and most runs are ashore
    t, true = t[both], Rotation.from_quat(true[both])
    error = (Rotation.from_quat(reported[both]) * true.inv()).as_rotvec() * (1.0, 1.0, -1.0)
    # The INS states equal variances for roll and pitch, so x stands for both level axes; z is the heading.
    sigma = np.sqrt(np.column_stack([table[f'orientation_variance.{axis}'] for axis in 'xz'])[both])
    return KnownAttitude(t, error, sigma, aligned_from(bag, t[0]))


def aligned_from(bag: Recording, first: Seconds) -> Seconds:
    """Return the stamp at which the INS became aligned, as KnownAttitude.aligned; first: stamp of the attitude."""
    if not recordings.holds(bag, INS_STATE_TOPIC):
        return float(first)
    states = bag.table(INS_STATE_TOPIC)
    times = states['t'][np.array(states['data']) == 'aligned']
    return float(times[0]) if times.size else math.nan
