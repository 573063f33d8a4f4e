"""The pointing geometry against katpoint's first-order terms and against rotations composed by scipy."""
import math

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from adu_drive import drive_unit
from adu_drive.plant import mount
from drive_law.params import AduParameters, MountParameters
from pedestal_common.compiled import compiled
from pedestal_common.geometry import pointing_model
from pedestal_common.geometry.line_of_sight import direction
from pedestal_common.parameters import build

TERMS = {'non_perpendicularity': .02, 'collimation': .03, 'tilt_forward': .015, 'tilt_starboard': -.01, 'sag': -.04}
"""P3, P4, P5, P6, P8 of reference vectors of katpoint's pointing model [deg]; with the zeros P1 = .1 and P7 = .05:"""

KATPOINT = {(0, 10): (.074827, .025608), (45, 30): (.087112, .018895), (120, 60): (.088481, .013840),
            (200, 45): (.063046, .011041), (300, 85): (-.106941, .062674)}
"""{(azimuth, elevation): offsets} [deg]."""

TILT = {(45, 30): (.010207, .003534), (300, 85): (-.091627, .016154)}
"""The same of the tilt alone, by an exact rotation."""


@compiled
def _beam(constants, A, E, A_dot, E_dot):
    return mount.beam(constants[0].mount, A, E, A_dot, E_dot)


def beam(degrees, A, E, A_dot=0.0, E_dot=0.0):
    """mount.beam of MountParameters in degrees; angles and rates in rad."""
    p = AduParameters(mount=MountParameters(**{name: math.radians(value) for name, value in degrees.items()}))
    angles, rates = _beam(drive_unit.constants(p), A, E, A_dot, E_dot)
    return np.array(angles), np.array(rates)


def offsets(degrees, azimuth, elevation):
    """Offsets [deg] that put the beam at these angles [deg]: the exact geometry turned round by a solver."""
    wanted = np.radians([azimuth, elevation])
    solved = least_squares(lambda x: beam(degrees, *x)[0] - wanted, wanted, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return np.degrees(solved.x - wanted)


@pytest.mark.parametrize('at', KATPOINT)
def test_small_terms_are_those_of_katpoint(at):
    """To second order in the terms, (0.05 deg)^2 / cos^2 E; 0.1 and 0.05 deg are the zeros of the encoders."""
    second_order = math.radians(0.05) * 0.05 / math.cos(math.radians(at[1])) ** 2
    assert offsets(TERMS, *at) + (.1, .05) == pytest.approx(KATPOINT[at], abs=second_order)


@pytest.mark.parametrize('at', TILT)
def test_tilt_is_an_exact_rotation(at):
    assert offsets({name: TERMS[name] for name in ('tilt_forward', 'tilt_starboard')}, *at) == pytest.approx(
        TILT[at], abs=1.5e-6)


@pytest.mark.parametrize('name', TERMS)
def test_each_term_alone_has_the_sign_of_its_formula(name):
    A, E = math.radians(70.0), math.radians(35.0)
    tan, cos = math.tan(E), math.cos(E)
    formula = {'non_perpendicularity': (tan, 0.0), 'collimation': (-1.0 / cos, 0.0),
               'tilt_forward': (math.sin(A) * tan, math.cos(A)), 'tilt_starboard': (-math.cos(A) * tan, math.sin(A)),
               'sag': (0.0, cos)}
    assert offsets({name: 0.01}, 70.0, 35.0) == pytest.approx(0.01 * np.array(formula[name]), abs=5e-6)


LARGE = {'non_perpendicularity': 3.0, 'collimation': -4.0, 'tilt_forward': 2.0, 'tilt_starboard': 5.0, 'sag': 1.0}


@pytest.mark.parametrize('A', [-4.0, -0.3, 1.1, 7.5])
@pytest.mark.parametrize('E', [0.0, 0.6, 1.4, 1.6])
def test_large_terms_against_composed_rotations(A, E):
    """scipy's rotations about FLU axes: azimuth turns about -z, elevation about -y; also past the zenith."""
    n, c, f, s, sag = (math.radians(LARGE[name]) for name in (
        'non_perpendicularity', 'collimation', 'tilt_forward', 'tilt_starboard', 'sag'))
    turned = (Rotation.from_rotvec([s, f, 0.0]) * Rotation.from_euler('z', -A) * Rotation.from_euler('x', -n)
              * Rotation.from_euler('y', -(E - sag * math.cos(E))) * Rotation.from_euler('z', -c)).apply([1, 0, 0])
    angles, _ = beam(LARGE, A, E)
    assert direction(*angles) == pytest.approx(turned, abs=1e-12)
    if E < 1.0:
        assert abs(angles[0] - A) < 0.3


def test_rates_are_the_derivatives_of_the_angles():
    A, E, A_dot, E_dot, h = 2.0, 1.2, 0.3, -0.2, 1e-5
    ahead, behind = (beam(LARGE, A + x * A_dot, E + x * E_dot)[0] for x in (h, -h))
    assert beam(LARGE, A, E, A_dot, E_dot)[1] == pytest.approx((ahead - behind) / (2.0 * h), rel=1e-8)


def test_the_dish_tells_of_the_mount_and_the_encoders_do_not(drive):
    true, leaning = (drive(build(AduParameters, {'initial_elevation': 0.7, **values})).run(0.5, azimuth=0.3).log
                     for values in ({}, {'mount.collimation': 1e-3, 'mount.sag': 5e-4}))
    for axis in ('azimuth', 'elevation'):
        assert true[axis]['position'].tobytes() == leaning[axis]['position'].tobytes()
    off = leaning['azimuth']['load_position'] - true['azimuth']['load_position']
    assert off == pytest.approx(1e-3 / math.cos(0.7), rel=2e-3)
    assert leaning['elevation']['load_position'] - true['elevation']['load_position'] == pytest.approx(
        -5e-4 * math.cos(0.7), rel=2e-3)


def test_errors_of_the_encoder(drive):
    """What it tells at rest is its own formula of the true angle; the dish stays where it was."""
    values = {'zero': 2e-3, 'eccentricity_sin': 3e-4, 'eccentricity_cos': -2e-4, 'interpolation': 5e-5, 'lines': 100}
    p = build(AduParameters, {'initial_azimuth': 1.0, 'initial_elevation': 0.7, **{
        f'azimuth.encoder.error.{name}': value for name, value in values.items()}})
    a = drive(p).run(0.5, azimuth=0.0).log['azimuth']
    true = a['load_position']
    told = true + 2e-3 + 3e-4 * np.sin(true) - 2e-4 * np.cos(true) + 5e-5 * np.sin(100 * true)
    assert true == pytest.approx(1.0, abs=1e-6)
    assert a['position'] == pytest.approx(told, abs=math.pi / 2 ** 22 * 1.001)


def test_a_wrong_zero_is_no_disagreement_of_the_encoders(drive):
    """The motor encoders were set by the same zero; a disc off its centre is seen by them."""
    def faults(**errors):
        p = build(AduParameters, {'initial_elevation': 0.7,
                                  **{f'azimuth.encoder.error.{name}': value for name, value in errors.items()}})
        return drive(p).run(0.1, azimuth=0.0).log['azimuth']['faults'].any()
    assert not faults(zero=0.05) and faults(eccentricity_cos=0.006)


@compiled
def _direction_motion(m, A, E, A_dot, E_dot):
    return pointing_model.direction_motion(m[0], A, E, A_dot, E_dot)


@pytest.mark.parametrize('A', [-4.0, -0.3, 1.1, 7.5])
@pytest.mark.parametrize('E', [0.0, 0.6, 1.4, 1.7, 2.5])
@pytest.mark.parametrize('terms', [TERMS, LARGE], ids=['small', 'large'])
def test_the_pointing_model_is_the_law_of_the_mount(terms, A, E):
    """The model of the control unit and the simulated pedestal are written apart; zeros shift the encoders."""
    names = {'non_perpendicularity': 'p3', 'collimation': 'p4', 'tilt_forward': 'p5', 'tilt_starboard': 'p6',
             'sag': 'p8'}
    zeros = {'p1': 0.03, 'p7': -0.02}
    m = pointing_model.model(zeros | {names[name]: math.radians(value) for name, value in terms.items()})
    angles, rates = beam(terms, A, E, 0.3, -0.2)
    on_sky, on_sky_rates = _direction_motion(m, A + zeros['p1'], E + zeros['p7'], 0.3, -0.2)
    assert on_sky == pytest.approx(angles, abs=1e-12) and on_sky_rates == pytest.approx(rates, abs=1e-10)
