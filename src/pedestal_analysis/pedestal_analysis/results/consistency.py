"""Whether the target filter of a recorded run is honest: NIS of its innovations, NEES of its errors against truth.

Both are squared errors in units of the covariance the filter states (Bar-Shalom, Li, Kirubarajan 2001, section 5.4):
NIS against the measurements, chi-square with as many degrees of freedom as were measured; NEES of angle and rate
against the truth, two degrees of freedom. A filter that is too sure of itself has more, one that is too careful less.
"""
import dataclasses
import functools
import math

import numpy as np
from scipy import special

from acu_tracker.geometry.motion import motion_of_position
from acu_tracker.geometry.vector import Vector, minus, rotated, turn, vector
from pedestal_analysis.results import tracking
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.graph import topics

NEES_FREEDOMS = 2
"""Of the NEES: angle and rate."""
BAND_PROBABILITY = 0.95
"""Share of honest filters inside a band."""

NOTABLE_DEVIATION = 0.1
"""Share of its expectation by which a mean is off, beside lying outside of its band, where a table marks it: over
minutes the band is narrower than any model is true."""

FILTER_NUMBERS = ('innovation', 'rate_innovation', 'nis', 'sigma', 'rate_sigma', 'correlation')


@dataclasses.dataclass
class Consistency:
    """The numbers of acu/filter on the steps of a Tracking: arrays (n, 2) of azimuth and elevation, NaN where none.

    innovation [rad], rate_innovation [rad/s], nis; sigma [rad], rate_sigma [rad/s] and correlation that the filter
    states of its estimate; probability (n, 2, 4) of topics.MOTION_MODELS; error, rate_error: estimate less truth [rad,
    rad/s]; nees of the two; tracking (n,) bool: the evaluated part.
    """
    t: np.ndarray
    innovation: np.ndarray
    rate_innovation: np.ndarray
    nis: np.ndarray
    sigma: np.ndarray
    rate_sigma: np.ndarray
    correlation: np.ndarray
    probability: np.ndarray
    error: np.ndarray
    rate_error: np.ndarray
    nees: np.ndarray
    tracking: np.ndarray

    @property
    def freedoms(self):
        """Degrees of freedom (n, 2) of the NIS."""
        return 1.0 + np.isfinite(self.rate_innovation)

    @functools.cached_property
    def axes(self):
        """The Axis of azimuth and that of elevation."""
        return Axis(self, 0), Axis(self, 1)


@compiled
def _rates(relative, velocity, attitude, ship_velocity, rates):
    """Fill the rates (n, 2) of earth azimuth and elevation of a target at `relative` [m], moving with `velocity`
    [m/s], from a ship that moves with `ship_velocity` in its own frame."""
    for k in range(len(relative)):
        q = attitude[k]
        v = minus(vector(velocity[k]), rotated(turn(q[0], q[1], q[2], q[3]), vector(ship_velocity[k])))
        motion = motion_of_position(vector(relative[k]), v, Vector(0.0, 0.0, 0.0))
        rates[k, 0], rates[k, 1] = motion.azimuth.rate, motion.elevation.rate


def read(bag, run):
    """The Consistency of a bag.Bag whose tracking.Tracking is `run`; None when it has no acu/filter."""
    if 'acu/filter' not in bag.topics or not bag.rows('acu/filter').size:
        return None
    t = run.t
    at_steps = functools.partial(tracking.on_grid, bag, t)
    numbers = at_steps('acu/filter', [f'{axis}_{name}.position' for name in FILTER_NUMBERS for axis in topics.AXES])
    numbers = dict(zip(FILTER_NUMBERS, np.split(numbers, len(FILTER_NUMBERS), axis=1)))
    probability = at_steps('acu/filter', [f'{axis}_{model}.position' for axis in topics.AXES
                                         for model in topics.MOTION_MODELS]).reshape(t.size, 2, -1)
    estimate = at_steps('acu/estimate', [f'{axis}.{field}' for field in ('position', 'velocity')
                                        for axis in topics.AXES])
    place, twist = ('position.x', 'position.y', 'position.z'), ('twist.linear.x', 'twist.linear.y', 'twist.linear.z')
    relative, velocity = at_steps('target/truth', place), at_steps('target/truth', twist)
    attitude, ship_velocity = np.tile(line_of_sight.ASHORE_ATTITUDE, (t.size, 1)), np.zeros((t.size, 3))
    if 'ship/truth' in bag.topics:
        relative = relative - at_steps('ship/truth', place)
        attitude = at_steps('ship/truth', [f'orientation.{letter}' for letter in 'xyzw'])
        ship_velocity = at_steps('ship/truth', twist)
    true_rate = np.empty((t.size, 2))
    _rates(relative, velocity, attitude, ship_velocity, true_rate)
    error = (estimate[:, :2] - run.target_earth + math.pi) % (2.0 * math.pi) - math.pi
    rate_error = estimate[:, 2:] - true_rate
    with np.errstate(all='ignore'):  # a filter that states nothing it could be held to has no NEES
        a, b, correlation = error / numbers['sigma'], rate_error / numbers['rate_sigma'], numbers['correlation']
        nees = (a * a - 2.0 * correlation * a * b + b * b) / (1.0 - correlation * correlation)
    return Consistency(t, **numbers, probability=probability, error=error, rate_error=rate_error, nees=nees,
                       tracking=run.tracking)


def independent(values):
    """How many independent samples a correlated series (n,) is worth for its mean: n / (1 + 2 sum of its
    autocorrelations), summed while two neighbours together are positive (Geyer 1992, initial positive sequence)."""
    n = values.size
    deviation = values - values.mean()
    if n < 4 or not deviation.any():
        return float(n)
    spectrum = np.fft.rfft(deviation, 2 * n)
    correlation = np.fft.irfft(spectrum * spectrum.conj())[:n]
    pairs = (correlation[:n - n % 2] / correlation[0]).reshape(-1, 2).sum(axis=1)
    stop = np.argmax(pairs <= 0.0) if (pairs <= 0.0).any() else pairs.size
    return float(n / max(2.0 * pairs[:stop].sum() - 1.0, 1.0))


def bounds(freedoms):
    """(low, high) that hold a chi-square value with this many degrees of freedom, a number or an array, with
    BAND_PROBABILITY."""
    # A long run has few different numbers, and each is found by iteration.
    different, places = np.unique(freedoms, return_inverse=True)
    places = places.reshape(np.shape(freedoms))
    return tuple(special.chdtri(different, tail)[places] for tail in (0.5 + 0.5 * BAND_PROBABILITY, 0.5 - 0.5
                                                                      * BAND_PROBABILITY))


def band(freedoms, count):
    """The two bounds that hold the mean of `count` chi-square values with this many degrees of freedom with
    BAND_PROBABILITY."""
    return tuple(float(bound / count) for bound in bounds(freedoms * count))


class Axis:
    """One axis, 0 azimuth or 1 elevation, of a Consistency over the evaluated part; NaN where nothing was measured.

    nis: mean, nis_expected: degrees of freedom; nees: mean; error, rate_error: rms [rad, rad/s]; sigma, rate_sigma:
    rms of what the filter states.
    """

    def __init__(self, known, i):
        on = known.tracking
        nis, freedoms, nees = known.nis[on, i], known.freedoms[on, i], known.nees[on, i]
        self._freedoms, self._nis, self._nees = freedoms[np.isfinite(nis)], nis[np.isfinite(nis)], nees[
            np.isfinite(nees)]
        self.nis, self.nis_expected, self.nees = _mean(self._nis), _mean(self._freedoms), _mean(self._nees)
        self.error, self.rate_error, self.sigma, self.rate_sigma = (
            tracking.known_rms(values[on, i])
            for values in (known.error, known.rate_error, known.sigma, known.rate_sigma))

    @functools.cached_property
    def nis_inside(self):
        """Share of single values of the NIS inside their band."""
        if not self._nis.size:
            return math.nan
        low, high = bounds(self._freedoms)
        return float(np.mean((self._nis >= low) & (self._nis <= high)))

    @functools.cached_property
    def nis_band(self):
        """Of the mean of the NIS."""
        return band(self.nis_expected, independent(self._nis)) if self._nis.size else (math.nan, math.nan)

    @functools.cached_property
    def count(self):
        """Independent errors that the NEES is over."""
        return independent(self._nees) if self._nees.size else math.nan

    @functools.cached_property
    def nees_band(self):
        """Of the mean of the NEES."""
        return band(NEES_FREEDOMS, self.count) if self._nees.size else (math.nan, math.nan)

    @property
    def nis_mark(self):
        """The `mark` of its NIS."""
        return mark(self.nis, self.nis_expected, self.nis_band)

    @property
    def nees_mark(self):
        """The `mark` of its NEES."""
        return mark(self.nees, NEES_FREEDOMS, self.nees_band)

    @property
    def verdict(self):
        """A plain sentence."""
        if not math.isfinite(self.nees):
            return 'nothing was evaluated'
        low, high = self.nees_band
        times = math.sqrt(self.nees / NEES_FREEDOMS)
        where = f'mean NEES {self.nees:.3g}, {100.0 * BAND_PROBABILITY:g} % of honest filters have {low:.3g} to {high:.3g}'
        if self.nees > high:
            return f'too sure of itself: its errors are {times:.2g} times what it states ({where})'
        if self.nees < low:
            return f'too careful: its errors are only {times:.2g} times what it states ({where})'
        return f'honest: its errors are what it states ({where})'


def mark(mean, expected, band):
    """'too sure' or 'too careful' where a mean of squared errors is off its expectation by more than
    NOTABLE_DEVIATION and
    outside of its band, else ''."""
    if mean > max(band[1], (1.0 + NOTABLE_DEVIATION) * expected):
        return 'too sure'
    return 'too careful' if mean < min(band[0], (1.0 - NOTABLE_DEVIATION) * expected) else ''


def _mean(values):
    return float(np.mean(values)) if values.size else math.nan
