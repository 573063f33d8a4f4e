"""What the INS of a recorded run knew of the deck's attitude, against the truth and against what it says of itself."""
import dataclasses
import math

import numpy as np
from scipy.spatial.transform import Rotation

from pedestal_bringup.analysis import results

TOPIC, STATE = 'ship/imu/data', 'ins/state'


@dataclasses.dataclass
class KnownAttitude:
    """Rows at the stamps t (n,) [s] of the INS.

    error (n, 3) [rad]: the small rotation from the true attitude to the known one about east and north (level) and,
    turned round so that it counts clockwise, about up (heading); any size up to half a turn. sigma (n, 2) [rad]: what
    the INS says of level and heading, 1 sigma. aligned: stamp [s] at which it said so, NaN when it says `aligning` to
    the end, the first stamp when it never says anything.
    """
    t: np.ndarray
    error: np.ndarray
    sigma: np.ndarray
    aligned: float

    @property
    def level(self):
        """Level error (n,) [rad], both axes together."""
        return np.hypot(self.error[:, 0], self.error[:, 1])

    @property
    def heading(self):
        """Heading error (n,) [rad], clockwise."""
        return self.error[:, 2]


def read(bag):
    """The KnownAttitude of a bag (bag.Bag); None ashore."""
    if any(topic not in bag.topics or not bag.rows(topic).size for topic in ('ship/truth', TOPIC)):
        return None
    table = bag.table(TOPIC)
    t = table['t']
    quaternion = [f'orientation.{letter}' for letter in 'xyzw']
    true = results.on_grid(bag, t, 'ship/truth', quaternion)
    both = np.isfinite(true).all(axis=1)
    if not both.any():
        return None
    t, true = t[both], Rotation.from_quat(true[both])
    known = Rotation.from_quat(np.column_stack([table[name] for name in quaternion])[both])
    error = (known * true.inv()).as_rotvec() * (1.0, 1.0, -1.0)
    sigma = np.sqrt(np.column_stack([table[f'orientation_variance.{axis}'] for axis in 'xz'])[both])
    return KnownAttitude(t, error, sigma, _aligned(bag, t[0]))


def _aligned(bag, first):
    if STATE not in bag.topics or not bag.rows(STATE).size:
        return float(first)
    said = bag.table(STATE)
    times = said['t'][np.array(said['data']) == 'aligned']
    return float(times[0]) if times.size else math.nan


def summary(found) -> dict:
    """{metric: (value, unit)}, of nothing where `found` is None.

    aligned_s: when the INS said `aligned`; heading_at_alignment_deg: its heading error then, with its 1 sigma beside;
    heading_error_rms_deg, level_error_rms_deg (per axis): from then on.
    """
    if found is None:
        return {}
    degrees = math.degrees(1.0)
    after = found.t >= found.aligned
    at = np.argmax(after)
    then = (found.heading[at], found.sigma[at, 1]) if after.any() else (math.nan, math.nan)
    return {'aligned_s': (found.aligned, 's'),
            'heading_at_alignment_deg': (float(then[0]) * degrees, 'deg'),
            'heading_sigma_at_alignment_deg': (float(then[1]) * degrees, 'deg'),
            'heading_error_rms_deg': (results.rms(found.heading[after]) * degrees, 'deg'),
            'level_error_rms_deg': (results.rms(found.error[after, :2]) * degrees, 'deg')}
