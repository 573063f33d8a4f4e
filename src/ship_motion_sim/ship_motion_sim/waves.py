"""A seaway as a sum of sine waves, and the response of the hull to each wave. Plain numpy, run once at the start.

The elevation of the surface at the ship is zeta = sum Re(a e^{j(w_e t + phase)}). A wave that travels along the unit
vector (d_x, d_y) of the deck (FLU) has zeta ~ e^{-j k (d_x x + d_y y)}. Its slope along x is -j k d_x a.
"""
import math
import typing

import numpy as np

from pedestal_common.quantities import (
    Complexes,
    Floats,
    Meters,
    MetersPerSecond,
    MetersPerSecond2,
    RadiansPerSecond,
    Seconds,
)
from pedestal_common.reproducible import cos, exp, power, sin
from pedestal_common.text_files import csv_table
from ship_motion_sim import earth
from ship_motion_sim.params import HullParameters, ShipParameters

WAVE_COMPONENT_COUNT = 80  # number of sine waves of a seaway
SURGE, SWAY, HEAVE, ROLL, PITCH, YAW = range(6)
FREEDOM_COUNT = 6
SEA_STATES = {3: (0.88, 7.5), 4: (1.88, 8.8), 5: (3.25, 9.7), 6: (5.0, 12.4)}  # {sea state: (Hs [m], Tp [s])}

SPECTRUM_COLUMN_RANGES = {'frequency_hz': (1e-3, 10.0), 'density_m2_per_hz': (0.0, 1e4)}
"""{column of a measured spectrum: (lowest, highest)}."""

_GRID_STEPS_PER_COMPONENT = 100  # grid steps per component in the integration of the spectrum


class Waves(typing.NamedTuple):
    """Components (n,) of the motion of the ship."""
    frequency: Floats       # w_e [rad/s]
    phase: Floats           # [rad]
    response: Complexes     # X (n, 6) of surge, sway, heave [m], roll, pitch, yaw [rad]


def shape(w: Floats, tp: Seconds, gamma: float) -> Floats:
    """Return the density of JONSWAP at w [rad/s] > 0, apart from a constant factor (Hasselmann et al. 1973)."""
    wp = 2.0 * math.pi / tp
    width = np.where(w <= wp, 0.07, 0.09)
    return power(w, -5.0) * exp(-1.25 * power(wp / w, 4.0)) * power(gamma, exp(-0.5 * ((w - wp) / (width * wp)) ** 2))


def band(tp: Seconds) -> tuple[RadiansPerSecond, RadiansPerSecond]:
    """Return the (lowest, highest) frequency of the components: 0.55 wp to 4 wp, at most 2.2 rad/s."""
    wp = 2.0 * math.pi / tp
    return 0.55 * wp, min(4.0 * wp, 2.2)


def _grid(tp: Seconds) -> Floats:
    return np.linspace(*band(tp), WAVE_COMPONENT_COUNT * _GRID_STEPS_PER_COMPONENT + 1)


def _integral(x: Floats, y: Floats) -> Floats:
    """Return the integral of y from x[0] to each x, by the trapezoidal rule."""
    return np.concatenate(((0.0,), np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(x))))


def spectrum(w: Floats, hs: Meters, tp: Seconds, gamma: float) -> Floats:
    """Return S(w) [m2 s/rad] at w [rad/s], zero outside the band; its integral is Hs^2/16."""
    low, high = band(tp)
    grid = _grid(tp)
    level = hs ** 2 / 16.0 / _integral(grid, shape(grid, tp, gamma))[-1]
    return np.where((w >= low) & (w <= high), level * shape(w, tp, gamma), 0.0)


def _second_order(w: Floats, period: Seconds, damping: float) -> Complexes:
    """Return w_n^2 / (w_n^2 - w^2 + 2 j z w_n w), the response of an oscillator to e^{jwt}; z: damping."""
    wn = 2.0 * math.pi / period
    stiffness: Complexes = wn ** 2 - w ** 2 + 2j * damping * wn * w
    return wn ** 2 / stiffness


def _mean_over(u: Floats) -> Floats:
    """Return sin u / u: the mean of a sine wave over a length, relative to its middle; u: half of its phase."""
    v = np.where(u == 0.0, 1.0, u)
    return np.where(u == 0.0, 1.0, sin(v) / v)


def _slope_over(u: Floats) -> Floats:
    """Return 3 (sin u - u cos u) / u^3: the slope of the best straight line through a sine wave over a length. The
    slope is relative to that in the middle; u: that of _mean_over."""
    small = np.abs(u) < 1e-2
    v = np.where(small, 1.0, u)
    return np.where(small, 1.0 - u ** 2 / 10.0, 3.0 * (sin(v) - v * cos(v)) / (v * v * v))


def transfer(hull: HullParameters, w: Floats, mu: Floats, speed: MetersPerSecond,
             gravity: MetersPerSecond2) -> tuple[Floats, Complexes]:
    """Return (w_e, RAO): encounter frequency [rad/s] and response amplitude operator (..., 6) to a wave of 1 m.

    The freedoms are surge, sway, heave [m], roll, pitch, yaw [rad]. The pressure of a wave falls with the depth (Smith
    correction e^{-k draught / 2}) and averages over length and beam of the hull. Roll and pitch follow the slope of
    the wave. Surge and sway are the orbital motion of the water. At a crest the water moves in the direction of the
    wave, so its displacement is -j times the elevation. Yaw follows the change of sway along the hull.
    """
    k = w ** 2 / gravity
    d_x, d_y = cos(mu), -sin(mu)
    w_e = w - k * speed * d_x
    u_length, u_beam = 0.5 * k * hull.length * d_x, 0.5 * k * hull.beam * d_y
    level = exp(-0.5 * k * hull.draught) * _mean_over(u_beam)
    force = level * _mean_over(u_length)
    moment = level * _slope_over(u_length)
    roll = _second_order(w_e, hull.roll_period, hull.roll_damping)
    pitch = _second_order(w_e, hull.pitch_period, hull.pitch_damping)
    heave = _second_order(w_e, hull.heave_period, hull.heave_damping)
    yaw = _second_order(w_e, hull.yaw_period, hull.yaw_damping)
    rao = np.stack((-1j * d_x * force,
                    -1j * d_y * force,
                    heave * force,
                    -1j * k * d_y * hull.roll_gain * roll * force,
                    1j * k * d_x * pitch * moment,
                    -hull.yaw_gain * k * d_x * d_y * yaw * moment), axis=-1)
    return w_e, rao


def measured(params: ShipParameters) -> csv_table.Rows:
    """Return the Rows of the measured spectrum. Raises csv_table.TableError."""
    return csv_table.read(params.spectrum_file, SPECTRUM_COLUMN_RANGES)


def density(params: ShipParameters) -> tuple[Floats, Floats]:
    """Return (w [rad/s], S [m2 s/rad]) of the sea state or the measured spectrum. Raises csv_table.TableError."""
    if params.spectrum == 'file':
        frequency, level = measured(params).numbers.T
        w = 2.0 * math.pi * frequency
        grid = np.linspace(w[0], w[-1], WAVE_COMPONENT_COUNT * _GRID_STEPS_PER_COMPONENT + 1)
        return grid, np.interp(grid, w, level / (2.0 * math.pi))
    hs, tp = SEA_STATES.get(params.sea_state, (params.significant_height, params.peak_period))
    grid = _grid(tp)
    return grid, spectrum(grid, hs, tp, params.gamma)


def seaway(params: ShipParameters) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the waves: (w [rad/s], amplitude [m], phase [rad], mu [rad]), each (WAVE_COMPONENT_COUNT,).

    Each of equal bins of the band has one wave at a random frequency. This avoids the repetition of waves of equal
    spacing dw after 2 pi / dw. A wave has the whole energy of its bin, so sum a^2/2 = Hs^2/16 for every seed.
    """
    grid, S = density(params)
    energy = _integral(grid, S)
    random = np.random.default_rng(params.seed)
    w = (grid[0] + (np.arange(WAVE_COMPONENT_COUNT) + random.random(WAVE_COMPONENT_COUNT)) * (grid[-1] - grid[0])
         / WAVE_COMPONENT_COUNT)
    amplitude = np.sqrt(2.0 * np.diff(energy[::_GRID_STEPS_PER_COMPONENT]))
    phase = random.uniform(0.0, 2.0 * math.pi, WAVE_COMPONENT_COUNT)
    mu = np.radians(params.wave_angle_deg + params.spread_deg * random.standard_normal(WAVE_COMPONENT_COUNT))
    return w, amplitude, phase, mu


def _plain(params: ShipParameters) -> Waves:
    """Return the Waves of PlainParameters: a component for each freedom, with X = -j a of the motion a sin(w t)."""
    plain = params.plain
    sines = ((HEAVE, plain.heave_amplitude, plain.heave_period),
             (ROLL, math.radians(plain.roll_amplitude_deg), plain.roll_period),
             (PITCH, math.radians(plain.pitch_amplitude_deg), plain.pitch_period),
             (YAW, math.radians(plain.yaw_amplitude_deg), plain.yaw_period))
    response = np.zeros((len(sines), FREEDOM_COUNT), complex)
    for row, (freedom, amplitude, _) in enumerate(sines):
        response[row, freedom] = -1j * amplitude
    return Waves(2.0 * math.pi / np.array([period for _, _, period in sines]), np.zeros(len(sines)), response)


def build(params: ShipParameters) -> Waves:
    """Return the components of the ship motion, at most WAVE_COMPONENT_COUNT, from waves or plain sines."""
    if params.motion == 'plain':
        return _plain(params)
    w, amplitude, phase, mu = seaway(params)
    w_e, rao = transfer(params.hull, w, mu, params.speed, earth.gravity(math.radians(params.latitude_deg)))
    return Waves(w_e, phase, rao * amplitude[:, None])
