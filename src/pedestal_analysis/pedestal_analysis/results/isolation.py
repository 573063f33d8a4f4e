"""Isolation of the pointing error of a recorded run from the rotation of the ship.

isolation = 20 log10(motion / coherent), from the recorded truth. It is computed over the evaluated part of the run
(Tracking.tracking) with the target within half a beamwidth, without slews through a keyhole. Each rms is per axis and
sample, cross-elevation and elevation together.

motion    Motion of the direction to the target on the deck because the ship rotates about its mean attitude: the angle
          between the direction and the direction on a deck in the mean attitude.
coherent  Part of the true pointing error that a linear law of the ship's rotation explains. It is the least-squares
          fit of each axis to nine series: rotation of the deck from its mean attitude, angular velocity and angular
          acceleration, without their means, each in the axes of the beam (cross-elevation, elevation, along). The
          velocity is a quarter period from both rotation and acceleration, so leads and lags are included. The axes
          are those of the beam because a wrong attitude, a delay or friction acts there while the target crosses the
          deck.

Noise that is independent of the ship also fits nine series a little, by chance. `floor` is the expected rms of that
fit for noise of random phase. The power spectrum of the noise is that of the remainder of the regression, smoothed
over SMOOTHING_HALF_WIDTH_HZ. `limit`, 20 log10(motion / floor), is therefore the highest isolation that a run of this
length and noise can show. Near the limit (or above, by chance), the effect of the ship cannot be separated from noise.
A run with less noise shows more isolation (tracking_receiver.receiver.cn0_dbhz, the noises of the ins).
"""
import dataclasses
import math

import numpy as np

from pedestal_analysis.results import tracking

SMOOTHING_HALF_WIDTH_HZ = 0.02
"""Half the width of the average over the power spectrum of the remainder [Hz]."""
MIN_TRACKED_TIME_S = 20.0
"""Shortest evaluated time for an isolation: a few periods of the ship [s]."""


@dataclasses.dataclass(frozen=True)
class Isolation:
    """motion, coherent, floor: rms [rad]."""
    motion: float
    coherent: float
    floor: float

    @property
    def isolation(self):
        """Isolation [dB]; NaN without motion."""
        return _decibels(self.motion, self.coherent)

    @property
    def limit(self):
        """Highest isolation that the run can show [dB]."""
        return _decibels(self.motion, self.floor)


def _decibels(large, small):
    return 20.0 * math.log10(large / small) if large > 0.0 and small > 0.0 else math.nan


def _beam_axes(direction):
    """Return unit vectors cross-elevation, elevation and along the beam as rows (n, 3, 3), for directions (n, 3)
    FLU."""
    x, y, z = direction.T
    flat = np.hypot(x, y)
    sa, ca = -y / flat, x / flat
    se, ce = np.array((z, flat)) / np.hypot(flat, z)
    return np.array(((-sa, -ca, np.zeros_like(sa)), (-se * ca, se * sa, ce), (ce * ca, -ce * sa, se))
                    ).transpose(2, 0, 1)


def measure(dt, error, target, attitude, deck_rate) -> Isolation:
    """Return the Isolation of n samples at intervals of dt [s].

    error (n, 2) [rad]: cross-elevation, elevation; target (n, 3): ENU from the ship, of any length; attitude (n, 4):
    true quaternions x, y, z, w deck -> earth; deck_rate (n, 3): [rad/s] FLU.
    """
    # Because the import is slow and most runs are ashore, it is made here.
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
    # The regression removes the share `weight` of the noise at each frequency; the neighbours restore the level.
    weight = np.sum(np.abs(np.fft.fft(basis, axis=0))**2, axis=1) / n
    power = np.sum(np.abs(np.fft.fft(error - basis @ explained, axis=0))**2, axis=1) / n
    width = 2 * round(SMOOTHING_HALF_WIDTH_HZ * n * dt) + 1
    power, remaining_share = (ndimage.uniform_filter1d(x, width, mode='wrap') for x in (power, 1.0 - weight))
    power /= np.maximum(remaining_share, 0.1)
    # Each rms is per axis, so the sum of the squares of both axes is halved.
    return Isolation(math.sqrt(np.mean(moved**2) / 2.0), math.sqrt(np.sum(explained**2) / (2 * n)),
                     math.sqrt(np.sum(power * weight) / (2 * n)))


def read(bag, run):
    """Return the Isolation of a bag.Bag whose tracking.Tracking is `run`.

    None ashore, and for less than MIN_TRACKED_TIME_S of evaluated time.
    """
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
