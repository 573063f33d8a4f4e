"""How much of the ship's rotation is left in the pointing error of a recorded run.

isolation = 20 log10(motion / coherent), over the evaluated part of the run (Tracking.tracking) as far as the
target was within half a beamwidth and no slew through a keyhole under way, from the recorded truth; each rms is per
axis and sample, cross-elevation and elevation together.

motion    how far the direction to the target moves on the deck because the ship turns about its mean attitude: the
          angle between that direction and the one the deck would see in its mean attitude.
coherent  the part of the true pointing error that a linear law of the ship's rotation explains: least squares of each
          axis on nine series, the deck's turn from its mean attitude, its angular velocity and its angular
          acceleration, their means taken out, each in the axes of the beam (cross-elevation, elevation, along). The
          velocity stands between turn and acceleration, so leads and lags are in it; and in the axes of the beam,
          because there a wrong attitude, a delay or friction acts while the target moves across the deck.

Noise that is independent of the ship fits nine series a little as well, by chance. `floor` is the rms of that fit
which is expected of noise with the power spectrum of what the regression leaves over, smoothed over
SMOOTHING_HALF_WIDTH_HZ, in
random phases. `limit`, 20 log10(motion / floor), is therefore the isolation that a run of this length and noise can
show: where the isolation is near the limit (or above, by chance), the ship cannot be told from noise in the error, and
a run with less noise shows more (tracking_receiver.receiver.cn0_dbhz, the noises of the ins).
"""
import dataclasses
import math

import numpy as np

from pedestal_analysis.results import tracking

SMOOTHING_HALF_WIDTH_HZ = 0.02
"""Half the width [Hz] over which the power spectrum of the remainder is averaged."""
MIN_TRACKED_TIME_S = 20.0
"""Shortest evaluated time [s] that can tell: a few periods of the ship."""


@dataclasses.dataclass(frozen=True)
class Isolation:
    """motion, coherent, floor: rms [rad]."""
    motion: float
    coherent: float
    floor: float

    @property
    def isolation(self):
        """[dB]; NaN where nothing moved."""
        return _decibels(self.motion, self.coherent)

    @property
    def limit(self):
        """[dB]"""
        return _decibels(self.motion, self.floor)


def _decibels(large, small):
    return 20.0 * math.log10(large / small) if large > 0.0 and small > 0.0 else math.nan


def _beam_axes(direction):
    """(n, 3, 3): the unit vectors cross-elevation, elevation and along the beam as rows, of directions (n, 3) FLU."""
    x, y, z = direction.T
    flat = np.hypot(x, y)
    sa, ca = -y / flat, x / flat
    se, ce = np.array((z, flat)) / np.hypot(flat, z)
    return np.array(((-sa, -ca, np.zeros_like(sa)), (-se * ca, se * sa, ce), (ce * ca, -ce * sa, se))
                    ).transpose(2, 0, 1)


def measure(dt, error, target, attitude, deck_rate) -> Isolation:
    """The Isolation of n samples dt [s] apart.

    error (n, 2) [rad] cross-elevation, elevation; target (n, 3) ENU from the ship, of any length; attitude (n, 4)
    true quaternions x, y, z, w deck -> earth; deck_rate (n, 3) [rad/s] FLU.
    """
    # Slow to import, and most runs are ashore.
    from scipy import ndimage
    from scipy.spatial.transform import Rotation
    turns = Rotation.from_quat(attitude)
    mean = turns.mean()
    axes = _beam_axes(mean.inv().apply(target))

    def in_beam(vectors):
        return np.einsum('nij,nj->ni', axes, vectors)

    direction = in_beam(turns.inv().apply(target))
    moved = np.arctan2(np.hypot(direction[:, 0], direction[:, 1]), direction[:, 2])
    series = np.column_stack([in_beam(vectors) for vectors in (
        (mean.inv() * turns).as_rotvec(), deck_rate, np.gradient(deck_rate, dt, axis=0))])
    series -= series.mean(axis=0)
    basis, _ = np.linalg.qr(series / np.maximum(np.linalg.norm(series, axis=0), 1e-300))
    error = error - error.mean(axis=0)
    explained = basis.T @ error
    n = len(error)
    # The regression takes the share `weight` of the noise out of each frequency; its neighbours tell what was there.
    weight = np.sum(np.abs(np.fft.fft(basis, axis=0))**2, axis=1) / n
    power = np.sum(np.abs(np.fft.fft(error - basis @ explained, axis=0))**2, axis=1) / n
    width = 2 * round(SMOOTHING_HALF_WIDTH_HZ * n * dt) + 1
    power, left = (ndimage.uniform_filter1d(x, width, mode='wrap') for x in (power, 1.0 - weight))
    power /= np.maximum(left, 0.1)
    return Isolation(math.sqrt(np.mean(moved**2) / 2.0), math.sqrt(np.sum(explained**2) / (2 * n)),
                     math.sqrt(np.sum(power * weight) / (2 * n)))


def read(bag, run):
    """The Isolation of a bag.Bag whose tracking.Tracking is `run`; None ashore or when less than MIN_TRACKED_TIME_S
    was tracked."""
    if 'ship/truth' not in bag.topics or run.t.size < 2:
        return None
    ship = tracking.on_grid(bag, run.t, 'ship/truth', [*(f'orientation.{letter}' for letter in 'xyzw'),
                                                       *(f'twist.angular.{letter}' for letter in 'xyz')])
    azimuth, elevation = run.target_earth.T
    target = np.column_stack((np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation),
                              np.sin(elevation)))
    error = np.column_stack((run.cross_elevation, run.elevation_error))
    on = run.tracking & np.isfinite(np.column_stack((ship, target, error))).all(axis=1)
    if math.isfinite(run.beamwidth):
        on &= np.hypot(*error.T) <= 0.5 * run.beamwidth
    for begin, end, _ in tracking.keyholes(bag):
        on &= (run.t < begin) | (run.t > end + tracking.HANDOVER_SETTLING_S)
    dt = float(np.median(np.diff(run.t)))
    if np.sum(on) * dt < MIN_TRACKED_TIME_S:
        return None
    return measure(dt, error[on], target[on], ship[on, :4], ship[on, 4:])
