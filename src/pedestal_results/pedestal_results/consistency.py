"""Consistency of the target filter of a recorded run: are its errors as large as the uncertainty that it states?

The NIS (normalised innovation squared) answers this for the innovations, and the NEES (normalised estimation error
squared) for the errors of the estimate. Both are squared errors in units of the covariance that the filter states
(Bar-Shalom, Li, Kirubarajan 2001, section 5.4). In a consistent filter the NIS is chi-square distributed, with one
degree of freedom for each measured number. The NEES of angle and rate has two. With larger values the filter is too
sure, with smaller values too careful. The truth for the NEES is that of the module sensor_frame.
"""
import dataclasses
import functools
import math
from typing import Annotated, TypeAlias

import numpy as np
from scipy import special

from acu_tracker.geometry.vector import (
    AxisMotion,
    LineOfSight,
    Motion,
    Vector,
    cross,
    earth_angles,
    minus,
    motion_of_position,
    rotated,
    turn,
    vector,
)
from acu_tracker.geometry.vector import line_of_sight as line_of_sight_of
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.graph import topics
from pedestal_common.quantities import (
    Bools,
    Floats,
    Ints,
    Pairs,
    Quaternions,
    Radians,
    RadiansPerSecond,
    Seconds,
    Times,
    Vectors3,
)
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import tracking

NEES_FREEDOMS = 2  # degrees of freedom of the NEES: angle and rate
BAND_PROBABILITY = 0.95  # probability that the mean NIS or NEES of a consistent filter lies inside its band [-]

NOTABLE_DEVIATION = 0.1
"""Smallest relative deviation of a mean NIS or NEES from its expectation that a table marks [-].

The mean must also lie outside its band. Because the band of a run of minutes is narrower than the accuracy of any
model, the band alone would mark every filter.
"""

MIN_JUDGED_S = 10.0  # shortest evaluated part from which a mean NIS or NEES is judged [s]
SEVERE_RATIO = 1.5
"""Ratio of a mean to its expectation that `remarks` states [-]: the interval of the ratio must be beyond it, or below
its inverse."""

CURES = {
    ('NIS', 'too sure'): 'raise acu.tracker.receiver.sigma_floor, or state the errors of an INS in '
                         'acu.tracker.attitude',
    ('NIS', 'too careful'): 'state acu.tracker.receiver.noise_bandwidth of a receiver that smooths its errors, or '
                            'lower acu.tracker.receiver.sigma_floor',
    ('NEES', 'too sure'): 'fit the process noise by `pedestal tune SCENARIO --filter KIND`, or state the errors of an '
                          'INS in acu.tracker.attitude'}
"""{(number, note): what a user can do}. With too large a stated sigma of the estimate nothing is to be done."""

FILTER_NUMBERS = ('innovation', 'rate_innovation', 'nis', 'sigma', 'rate_sigma', 'correlation')
"""Numbers of the topic acu/filter that this module reads, for each axis; their units are in topics.FILTER_UNITS."""


Band: TypeAlias = tuple[float, float]   # low, high: BAND_PROBABILITY of the consistent filters lie between them


@dataclasses.dataclass
class Consistency:
    """Numbers of the target filter at the steps of a Tracking; azimuth and elevation, NaN where missing."""
    t: Times    # of the step
    innovation: Pairs   # measurement minus prediction, of the angle [rad]
    rate_innovation: Pairs  # the same of the rate [rad/s]
    nis: Pairs  # normalised innovation squared [-]
    sigma: Pairs    # standard deviation of the angle that the filter states [rad]
    rate_sigma: Pairs   # the same of the rate [rad/s]
    correlation: Pairs  # of angle and rate, stated by the filter [-]
    probability: Annotated[Floats, '(n, 2, m)']     # of each of the m topics.MOTION_MODELS
    error: Pairs    # estimate minus truth in the frame of the sensors, of the angle [rad]
    rate_error: Pairs   # the same of the rate [rad/s]
    nees: Pairs     # normalised estimation error squared [-]
    tracking: Bools     # the evaluated part of the run, see Tracking

    @property
    def freedoms(self) -> Pairs:
        """Degrees of freedom of the NIS."""
        return 1.0 + np.isfinite(self.rate_innovation)

    @functools.cached_property
    def axes(self) -> tuple['Axis', 'Axis']:
        """The Axis objects of azimuth and elevation."""
        return Axis(self, 0), Axis(self, 1)


@compiled
def _rates(relative: Vectors3, velocity: Vectors3, attitude: Quaternions, ship_velocity: Vectors3,
           rates: Pairs) -> None:
    """Fill the rates [rad/s] of earth azimuth and elevation of a target seen from a ship.

    relative        vector from ship to target, ENU [m]
    velocity        of the target, ENU [m/s]
    ship_velocity   in the frame of the ship, FLU [m/s]
    """
    for k in range(len(relative)):
        q = attitude[k]
        v = minus(vector(velocity[k]), rotated(turn(q[0], q[1], q[2], q[3]), vector(ship_velocity[k])))
        motion = motion_of_position(vector(relative[k]), v, Vector(0.0, 0.0, 0.0))
        rates[k, 0], rates[k, 1] = motion.azimuth.rate, motion.elevation.rate


@compiled
def _turn_rates(angles: Pairs, turned: Pairs, rates: Pairs) -> None:
    """Turn the rates [rad/s] of earth angles [rad] in place, to those at the `turned` angles.

    Each row is turned as if its offset stood still. Because the filter takes the changes of a slow error for a random
    walk of the angle, they are no rate.
    """
    for k in range(len(angles)):
        sight = line_of_sight_of(Motion(AxisMotion(angles[k, 0], rates[k, 0], 0.0),
                                        AxisMotion(angles[k, 1], rates[k, 1], 0.0)))
        u = Vector(*line_of_sight.earth_direction(turned[k, 0], turned[k, 1]))
        # The small turn has the rotation vector r = u_before x u_after, and adds r x du to the derivative du.
        more = cross(cross(sight.u, u), sight.du)
        du = Vector(sight.du.x + more.x, sight.du.y + more.y, sight.du.z + more.z)
        motion = earth_angles(LineOfSight(u, du, Vector(0.0, 0.0, 0.0)))
        rates[k, 0], rates[k, 1] = motion.azimuth.rate, motion.elevation.rate


def read(bag: Recording, run: tracking.Tracking) -> Consistency | None:
    """Return the Consistency of a recording whose Tracking is `run`; None without acu/filter."""
    if not recordings.holds(bag, 'acu/filter'):
        return None
    t = run.t
    at_steps = functools.partial(recordings.at, bag, t)
    columns = at_steps('acu/filter', [f'{axis}_{name}.position' for name in FILTER_NUMBERS for axis in topics.AXES])
    numbers = dict(zip(FILTER_NUMBERS, np.split(columns, len(FILTER_NUMBERS), axis=1)))
    probability = at_steps('acu/filter', [f'{axis}_{model}.position' for axis in topics.AXES
                                         for model in topics.MOTION_MODELS]).reshape(t.size, 2, -1)
    estimate = at_steps('acu/estimate', [f'{axis}.{field}' for field in ('position', 'velocity')
                                        for axis in topics.AXES])
    place, twist = ('position.x', 'position.y', 'position.z'), ('twist.linear.x', 'twist.linear.y', 'twist.linear.z')
    relative, velocity = at_steps('target/truth', place), at_steps('target/truth', twist)
    attitude = np.tile(line_of_sight.ASHORE_ATTITUDE, (t.size, 1))
    ship_velocity = np.zeros((t.size, 3))
    if 'ship/truth' in bag.topics:
        relative = relative - at_steps('ship/truth', place)
        attitude = at_steps('ship/truth', [f'orientation.{letter}' for letter in 'xyzw'])
        ship_velocity = at_steps('ship/truth', twist)
    true_rate = np.empty((t.size, 2))
    _rates(relative, velocity, attitude, ship_velocity, true_rate)
    _turn_rates(run.target_earth, run.sensor_truth, true_rate)
    error = (estimate[:, :2] - run.sensor_truth + math.pi) % (2.0 * math.pi) - math.pi
    rate_error = estimate[:, 2:] - true_rate
    with np.errstate(all='ignore'):  # a filter without a stated covariance has no NEES
        a, b, correlation = error / numbers['sigma'], rate_error / numbers['rate_sigma'], numbers['correlation']
        nees = (a * a - 2.0 * correlation * a * b + b * b) / (1.0 - correlation * correlation)
    return Consistency(t, **numbers, probability=probability, error=error, rate_error=rate_error, nees=nees,
                       tracking=run.tracking)


def effective_count(values: Floats) -> float:
    """Return the number of independent samples whose mean is as accurate as the mean of a correlated series.

    This number is n / (1 + 2 sum of the autocorrelations). The sum ends at the first pair of neighbours whose sum is
    not positive (Geyer 1992, initial positive sequence).
    """
    n = values.size
    deviation = values - values.mean()
    if n < 4 or not deviation.any():
        return float(n)
    spectrum = np.fft.rfft(deviation, 2 * n)
    correlation = np.fft.irfft(spectrum * spectrum.conj())[:n]
    pairs = (correlation[:n - n % 2] / correlation[0]).reshape(-1, 2).sum(axis=1)
    stop = np.argmax(pairs <= 0.0) if (pairs <= 0.0).any() else pairs.size
    return float(n / max(2.0 * pairs[:stop].sum() - 1.0, 1.0))


def bounds(freedoms: float | Floats | Ints) -> tuple[Floats, Floats]:
    """Return (low, high), between which a chi-square value lies with BAND_PROBABILITY."""
    # Because chdtri is slow and a long run has few different degrees of freedom, each of them is computed once.
    different, places = np.unique(freedoms, return_inverse=True)
    places = places.reshape(np.shape(freedoms))
    tails = 0.5 + 0.5 * BAND_PROBABILITY, 0.5 - 0.5 * BAND_PROBABILITY
    low, high = (special.chdtri(different, tail)[places] for tail in tails)
    return low, high


def band(freedoms: float, count: float) -> Band:
    """Return (low, high), between which the mean of `count` chi-square values lies with BAND_PROBABILITY."""
    low, high = bounds(freedoms * count)
    return float(low / count), float(high / count)


class Axis:
    """Statistics of one axis i, 0 azimuth or 1 elevation, over the evaluated part of the run; NaN without
    measurements.
    """
    seconds: Seconds    # duration of the evaluated part
    nis: float      # mean
    nis_expected: float     # expected mean NIS, the mean of its degrees of freedom
    nees: float     # mean
    error: Radians  # rms of the angle
    rate_error: RadiansPerSecond    # rms of the rate
    sigma: Radians  # rms of the stated standard deviations of the angle
    rate_sigma: RadiansPerSecond    # the same of the rate

    def __init__(self, known: Consistency, i: int) -> None:
        on = known.tracking
        self.seconds = float(np.sum(on) * np.median(np.diff(known.t))) if known.t.size > 1 else 0.0
        nis, freedoms, nees = known.nis[on, i], known.freedoms[on, i], known.nees[on, i]
        self._freedoms, self._nis = freedoms[np.isfinite(nis)], nis[np.isfinite(nis)]
        self._nees = nees[np.isfinite(nees)]
        self.nis, self.nis_expected, self.nees = _mean(self._nis), _mean(self._freedoms), _mean(self._nees)
        self.error, self.rate_error, self.sigma, self.rate_sigma = (
            tracking.known_rms(values[on, i])
            for values in (known.error, known.rate_error, known.sigma, known.rate_sigma))

    @functools.cached_property
    def nis_inside(self) -> float:
        """Share of the values of the NIS between their `bounds` [-]."""
        if not self._nis.size:
            return math.nan
        low, high = bounds(self._freedoms)
        return float(np.mean((self._nis >= low) & (self._nis <= high)))

    @functools.cached_property
    def nis_band(self) -> Band:
        """Band of the mean NIS."""
        return band(self.nis_expected, effective_count(self._nis)) if self._nis.size else (math.nan, math.nan)

    @functools.cached_property
    def count(self) -> float:
        """Number of independent errors in the mean NEES."""
        return effective_count(self._nees) if self._nees.size else math.nan

    @functools.cached_property
    def nees_band(self) -> Band:
        """Band of the mean NEES."""
        return band(NEES_FREEDOMS, self.count) if self._nees.size else (math.nan, math.nan)

    @property
    def nis_mark(self) -> str:
        """The note on the mean NIS, see `mark`."""
        return mark(self.nis, self.nis_expected, self.nis_band) if self.judged else ''

    @property
    def nees_mark(self) -> str:
        """The note on the mean NEES, see `mark`."""
        return mark(self.nees, NEES_FREEDOMS, self.nees_band) if self.judged else ''

    @property
    def judged(self) -> bool:
        """True if the evaluated part is long enough for a note on its means."""
        return self.seconds >= MIN_JUDGED_S

    @property
    def severe(self) -> tuple[str, str, float]:
        """(NIS or NEES, note, ratio of the rms errors to the stated ones) of a filter that is far off, else two empty
        texts. With a severe NIS the NEES is not regarded, because both have one cause."""
        for number, mean, expected, (low, high) in (('NIS', self.nis, self.nis_expected, self.nis_band),
                                                    ('NEES', self.nees, float(NEES_FREEDOMS), self.nees_band)):
            note = 'too sure' if mean / high > SEVERE_RATIO else 'too careful'
            far = note == 'too sure' or mean / low < 1.0 / SEVERE_RATIO
            if self.judged and far and (number, note) in CURES:
                return number, note, math.sqrt(mean / expected)
        return '', '', math.nan

    @property
    def verdict(self) -> str:
        """The sentence on the mean NEES: too sure, too careful or consistent."""
        if not math.isfinite(self.nees):
            return 'nothing was evaluated'
        if not self.judged:
            return (f'not judged: {self.seconds:.3g} s evaluated, {MIN_JUDGED_S:g} s are needed (mean NEES '
                    f'{self.nees:.3g})')
        low, high = self.nees_band
        kind = 'too sure' if self.nees > high else 'too careful' if self.nees < low else 'consistent'
        return (f'{kind}: the errors are {math.sqrt(self.nees / NEES_FREEDOMS):.2g} times the stated sigma (mean NEES '
                f'{self.nees:.3g}, {100.0 * BAND_PROBABILITY:g} % of consistent filters have {low:.3g} to {high:.3g})')


def remarks(known: Consistency) -> list[str]:
    """Return a line for each kind of severe inconsistency, with what can be done; [] for a filter without one."""
    found: dict[tuple[str, str], list[str]] = {}
    for axis, name in zip(known.axes, topics.AXES):
        number, note, ratio = axis.severe
        if note:
            found.setdefault((number, note), []).append(f'{ratio:.2g} in {name}')
    what = {'NIS': 'innovations', 'NEES': 'errors'}
    return [f'the filter is {note}: the rms of its {what[number]} over that which it states is '
            f'{" and ".join(ratios)}; {CURES[number, note]}' for (number, note), ratios in found.items()]


def mark(mean: float, expected: float, band: Band) -> str:
    """Return the note on a mean that is outside its band and off by more than NOTABLE_DEVIATION, else ''."""
    if mean > max(band[1], (1.0 + NOTABLE_DEVIATION) * expected):
        return 'too sure'
    return 'too careful' if mean < min(band[0], (1.0 - NOTABLE_DEVIATION) * expected) else ''


def _mean(values: Floats) -> float:
    return float(np.mean(values)) if values.size else math.nan
