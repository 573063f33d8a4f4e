"""Isolation of a recorded run: how far the antenna suppresses the rotation of the ship in its pointing error, in dB.

    isolation = 20 log10(motion / coherent) [dB]

    motion      rms motion of the line of sight on the deck that the rotation of the ship causes [rad]: the angle
                between the direction to the target on the deck and on a deck in the mean attitude
    coherent    rms of the part of the true pointing error that a linear law of the ship's rotation explains [rad]

Both are computed from the recorded truth. Only the evaluated part of the run (Tracking.tracking) counts, with the
target within half a beamwidth, and without slews through a keyhole. Each rms is per axis and sample, cross-elevation
and elevation together.

The linear law is the least-squares fit of the pointing error of each axis to nine series. They are the three
components of the rotation of the deck from its mean attitude, of its angular velocity and of its angular acceleration,
each without its mean. Because the velocity is a quarter period away from rotation and acceleration, the fit includes
leads and lags. The components are taken along the axes of the beam: cross-elevation, elevation and along the beam.
Because a wrong attitude, a delay or friction acts in these axes, they fit while the target crosses the deck.

Noise that is independent of the ship also fits nine series a little, by chance. `floor` [rad] is the expected rms of
this fit for noise of random phase. The noise has the power spectrum of the remainder of the fit, smoothed over
SMOOTHING_HALF_WIDTH_HZ. Therefore `limit`, 20 log10(motion / floor), is the highest isolation that a run of this
length and noise can show. Near the limit, the effect of the ship cannot be separated from noise. By chance, the
isolation may also exceed the limit. A run with less noise can show more isolation: parameter
tracking_receiver.receiver.cn0_dbhz, and the noises of the node `ins`.
"""
import dataclasses
import math
from collections.abc import Iterable

import numpy as np

from pedestal_common.quantities import Decibels, Floats, Pairs, Quaternions, Radians, Seconds, Vectors3
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import tracking

SMOOTHING_HALF_WIDTH_HZ = 0.02
"""Half the width over which the power spectrum of the remainder of the fit is averaged [Hz]."""
MIN_TRACKED_TIME_S = 20.0  # shortest evaluated time for an isolation: a few periods of the ship [s]


@dataclasses.dataclass(frozen=True)
class Isolation:
    """Isolation of a run, from three rms values, see the module."""
    motion: Radians
    coherent: Radians
    floor: Radians

    @property
    def isolation(self) -> Decibels:
        """Isolation; NaN without motion."""
        return _decibels(self.motion, self.coherent)

    @property
    def limit(self) -> Decibels:
        """Highest isolation that a run of this length and noise can show."""
        return _decibels(self.motion, self.floor)


def _decibels(large: float, small: float) -> Decibels:
    return 20.0 * math.log10(large / small) if large > 0.0 and small > 0.0 else math.nan


def _beam_axes(direction: Vectors3) -> Floats:
    """Return the unit vectors FLU in cross-elevation, in elevation and along each beam, as rows of (n, 3, 3)."""
    x, y, z = direction.T
    flat = np.hypot(x, y)
    sa, ca = -y / flat, x / flat
    se, ce = np.array((z, flat)) / np.hypot(flat, z)
    return np.array(((-sa, -ca, np.zeros_like(sa)), (-se * ca, se * sa, ce), (ce * ca, -ce * sa, se))
                    ).transpose(2, 0, 1)


def measure(dt: Seconds, error: Pairs, target: Vectors3, attitude: Quaternions, deck_rate: Vectors3) -> Isolation:
    """Return the Isolation of samples at intervals of dt.

    error       true pointing error in cross-elevation and elevation [rad]
    target      vector from ship to target, ENU, of any length
    attitude    true rotation deck -> earth
    deck_rate   true angular velocity of the deck, FLU [rad/s]
    """
    # Because the import is slow and most runs are ashore, it is made here.
    from scipy import ndimage
    from scipy.spatial.transform import Rotation
    turns = Rotation.from_quat(attitude)
    mean = turns.mean()
    axes = _beam_axes(mean.inv().apply(target))

    def in_beam(vectors: Vectors3) -> Vectors3:
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
    # The fit takes the share `weight` of the noise at each frequency out of the remainder. The smoothing over the
    # neighbouring frequencies and the division by the remaining share restore the spectrum of the noise.
    weight = np.sum(np.abs(np.fft.fft(basis, axis=0))**2, axis=1) / n
    power = np.sum(np.abs(np.fft.fft(error - basis @ explained, axis=0))**2, axis=1) / n
    width = 2 * round(SMOOTHING_HALF_WIDTH_HZ * n * dt) + 1
    power, remaining_share = (ndimage.uniform_filter1d(x, width, mode='wrap') for x in (power, 1.0 - weight))
    power /= np.maximum(remaining_share, 0.1)
    # Each rms is per axis, so the sum of the squares of both axes is halved.
    return Isolation(math.sqrt(np.mean(moved**2) / 2.0), math.sqrt(np.sum(explained**2) / (2 * n)),
                     math.sqrt(np.sum(power * weight) / (2 * n)))


def read(bag: Recording, run: tracking.Tracking, keyholes: Iterable[tracking.Slew]) -> Isolation | None:
    """Return the Isolation of a recording; None ashore, or with an evaluated time below MIN_TRACKED_TIME_S."""
    if 'ship/truth' not in bag.topics or run.t.size < 2:
        return None
    ship = recordings.at(bag, run.t, 'ship/truth', [*(f'orientation.{letter}' for letter in 'xyzw'),
                                                    *(f'twist.angular.{letter}' for letter in 'xyz')])
    azimuth, elevation = run.target_earth.T
    target = np.column_stack((np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation),
                              np.sin(elevation)))
    error = run.error
    on = run.tracking & np.isfinite(np.column_stack((ship, target, error))).all(axis=1)
    if math.isfinite(run.beamwidth):
        on &= np.hypot(*error.T) <= 0.5 * run.beamwidth
    for begin, end, _ in keyholes:
        on &= (run.t < begin) | (run.t > end + tracking.HANDOVER_SETTLING_S)
    dt = float(np.median(np.diff(run.t)))
    if np.sum(on) * dt < MIN_TRACKED_TIME_S:
        return None
    return measure(dt, error[on], target[on], ship[on, :4], ship[on, 4:])
