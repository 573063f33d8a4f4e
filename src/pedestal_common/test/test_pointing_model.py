"""The pointing model against katpoint's first-order formula, rotations composed by scipy, and itself turned round."""
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pedestal_common.compiled import compiled
from pedestal_common.geometry import pointing_model
from pedestal_common.geometry.line_of_sight import angles, direction

RNG = np.random.default_rng(38)

TERMS = {'p1': .1, 'p3': .02, 'p4': .03, 'p5': .015, 'p6': -.01, 'p7': .05, 'p8': -.04}
"""Terms of the reference vectors [deg]."""

KATPOINT = {(0, 10): (.074827, .025608), (45, 30): (.087112, .018895), (120, 60): (.088481, .013840),
            (200, 45): (.063046, .011041), (300, 85): (-.106941, .062674)}
"""{(azimuth, elevation): offsets} of katpoint 0.10 for these terms [deg]."""

TILT = {(45, 30): (.010207, .003534), (300, 85): (-.091627, .016154)}
"""The same of the tilt alone, by an exact rotation."""

LARGE = {'p1': -2.0, 'p3': 3.0, 'p4': -4.0, 'p5': 2.0, 'p6': 5.0, 'p7': 1.5, 'p8': 1.0, 'p9': .01, 'p11': -.4,
         'p12': -.01, 'p13': .5, 'p14': -.3, 'p15': .2, 'p16': .1, 'p17': -.2, 'p18': .3, 'p19': .1, 'p20': -.15,
         'p21': .25, 'p22': -.35}
"""Terms far above those of a real pedestal [deg]; P9 and P12 are factors."""


def model(degrees):
    return pointing_model.model({name: value if name in pointing_model.FACTORS else math.radians(value)
                                 for name, value in degrees.items()})


@compiled
def _encoder_of(m, azimuth, elevation):
    return pointing_model.encoder_of(m[0], azimuth, elevation)


@compiled
def _direction_of(m, A, E):
    return pointing_model.direction_of(m[0], A, E)


@compiled
def _direction_motion(m, A, E, A_dot, E_dot):
    return pointing_model.direction_motion(m[0], A, E, A_dot, E_dot)


@compiled
def _encoder_motion(m, u, v, w, plunged, near):
    return pointing_model.encoder_motion(m[0], u, v, w, plunged, near)


def first_order(terms, A, E):
    """katpoint's PointingModel.offset, without its clipping at the zenith; terms [rad, -]."""
    p = dict.fromkeys(pointing_model.TERMS, 0.0) | terms
    sin, cos, tan = math.sin, math.cos, math.tan
    return (p['p1'] + p['p3'] * tan(E) - p['p4'] / cos(E) + p['p5'] * sin(A) * tan(E) - p['p6'] * cos(A) * tan(E)
            + p['p12'] * A + p['p13'] * cos(A) + p['p14'] * sin(A) + p['p17'] * cos(2 * A) + p['p18'] * sin(2 * A),
            p['p5'] * cos(A) + p['p6'] * sin(A) + p['p7'] + p['p8'] * cos(E) + p['p9'] * E + p['p11'] * sin(E)
            + p['p15'] * cos(2 * A) + p['p16'] * sin(2 * A) + p['p19'] * cos(8 * E) + p['p20'] * sin(8 * E)
            + p['p21'] * cos(A) + p['p22'] * sin(A))


def offsets(m, azimuth, elevation):
    """Angles of the encoders less those of the direction."""
    A, E, reachable = _encoder_of(m, azimuth, elevation)
    assert reachable
    return A - azimuth, E - elevation


@pytest.mark.parametrize('at', KATPOINT)
def test_small_terms_are_those_of_katpoint(at):
    """To second order in the terms: (0.1 deg)^2 / cos^2 E."""
    second_order = math.radians(0.1) * 0.1 / math.cos(math.radians(at[1])) ** 2
    assert np.degrees(offsets(model(TERMS), *np.radians(at))) == pytest.approx(KATPOINT[at], abs=second_order)


@pytest.mark.parametrize('at', TILT)
def test_tilt_is_an_exact_rotation(at):
    tilt = model({name: TERMS[name] for name in ('p5', 'p6')})
    assert np.degrees(offsets(tilt, *np.radians(at))) == pytest.approx(TILT[at], abs=1.5e-6)


@pytest.mark.parametrize('name', pointing_model.TERMS)
@pytest.mark.parametrize('at', [(0.4, 0.3), (2.5, 1.1), (-2.0, 0.05), (5.0, 0.7), (1.2, 2.3)])
def test_each_term_alone_is_that_of_katpoint(name, at):
    """Also past the zenith. The difference to first order falls with the square of the term."""
    errors = []
    for value in (1e-3, 1e-4):
        terms = {name: value}
        errors.append(np.abs(np.subtract(offsets(pointing_model.model(terms), *at), first_order(terms, *at))).max())
    assert errors[0] < 4e-5 and errors[1] < max(0.011 * errors[0], 1e-14)


@pytest.mark.parametrize('A', [-4.0, -0.3, 1.1, 7.5])
@pytest.mark.parametrize('E', [0.0, 0.6, 1.4, 1.7, 2.9])
def test_large_rotations_are_those_of_scipy(A, E):
    """scipy's rotations about FLU axes: azimuth turns about -z, elevation about -y."""
    terms = {name: LARGE[name] for name in ('p1', 'p3', 'p4', 'p5', 'p6', 'p7', 'p8')}
    p = {name: math.radians(value) for name, value in terms.items()}
    E_beam = E - p['p7'] - p['p8'] * math.cos(E - p['p7'])
    turned = (Rotation.from_rotvec([p['p6'], p['p5'], 0.0]) * Rotation.from_euler('z', p['p1'] - A)
              * Rotation.from_euler('x', -p['p3']) * Rotation.from_euler('y', -E_beam)
              * Rotation.from_euler('z', -p['p4'])).apply([1, 0, 0])
    assert direction(*_direction_of(model(terms), A, E)) == pytest.approx(turned, abs=1e-12)


MODELS = {'without terms': {}, 'test vector': TERMS, 'large': LARGE,
          'new station': {'p1': .3, 'p3': .03, 'p4': .05, 'p5': .07, 'p6': -.07, 'p7': -.3, 'p8': .05},
          'rotations': {name: LARGE[name] for name in ('p3', 'p4', 'p5', 'p6')}}


def axis_distance(m, azimuth, elevation):
    """Angle between a direction and the azimuth axis [rad]."""
    return math.acos(min(max(np.dot(m[0]['tilt'][:, 2], direction(azimuth, elevation)), -1.0), 1.0))


@pytest.mark.parametrize('name', MODELS)
def test_round_trip(name):
    """From the sky to the encoders and back: 1e-9 rad, from elevation 0 to 89.9 deg and past the zenith.

    The exception is the cone about the azimuth axis. Because the azimuth near the axis may be some revolutions off the
    azimuth of the direction, the directions are compared, and the azimuths without revolutions.
    """
    m = model(MODELS[name])
    cone, unreached = abs(m[0]['p']['p3'] - m[0]['p']['p4']), 0
    elevations = np.linspace(0.0, math.radians(89.9), 100)
    for elevation in np.concatenate((elevations, math.pi - elevations)):
        for azimuth in RNG.uniform(-2 * math.pi, 2 * math.pi, 20):
            A, E, reachable = _encoder_of(m, azimuth, elevation)
            if not reachable:
                assert axis_distance(m, azimuth, elevation) < cone + 1e-9
                unreached += 1
                continue
            assert axis_distance(m, azimuth, elevation) > cone - 1e-9
            back = _direction_of(m, A, E)
            assert direction(*back) == pytest.approx(direction(azimuth, elevation), abs=1e-9)
            assert math.remainder(back[0] - azimuth, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
            assert back[1] == pytest.approx(elevation, abs=1e-9)
            if axis_distance(m, azimuth, elevation) > cone + 1e-3:
                again = _encoder_of(m, *back)
                assert math.remainder(again[0] - A, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
                assert again[1] == pytest.approx(E, abs=1e-9)
    assert unreached < 0.1 * 20 * 2 * len(elevations)


def test_the_round_trip_counts_revolutions():
    """The factor P12 multiplies the whole angle: it differs from turn to turn."""
    for terms in (TERMS, LARGE):
        m = model(terms)
        for turn in (-2.0, -1.0, 0.0, 1.0, 2.0):
            azimuth = 1.0 + 2.0 * math.pi * turn
            A, E, _ = _encoder_of(m, azimuth, 0.5)
            assert _direction_of(m, A, E) == pytest.approx((azimuth, 0.5), abs=1e-9)


@pytest.mark.parametrize('lean, off', [(.03, .05), (-.2, .1), (2.0, -1.0)])
def test_the_cone_about_the_azimuth_axis_cannot_be_reached(lean, off):
    """Inside it the nearest direction is taken: on the edge of the cone, on the same side of the axis."""
    m, cone = model({'p1': .4, 'p3': lean, 'p4': off, 'p7': -.3}), math.radians(abs(lean - off))
    for share in (1.01, 0.99, 0.5, 0.01):
        for azimuth in RNG.uniform(-3.0, 3.0, 20):
            wanted = azimuth, 0.5 * math.pi - share * cone
            A, E, reachable = _encoder_of(m, *wanted)
            back = _direction_of(m, A, E)
            assert reachable == (share > 1.0)
            if not reachable:
                assert back[1] == pytest.approx(0.5 * math.pi - cone, abs=1e-8)
            # The azimuth comes with the precision of a direction near the zenith.
            assert math.remainder(back[0] - azimuth, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)
    assert np.isfinite(_encoder_of(m, 1.0, 0.5 * math.pi)[:2]).all()


def test_zero_terms_change_no_bit():
    m = model({})
    for azimuth, elevation in RNG.uniform(-7.0, 7.0, (100, 2)):
        assert _encoder_of(m, azimuth, elevation) == (azimuth, elevation, True)
        assert _direction_of(m, azimuth, elevation) == (azimuth, elevation)


@pytest.mark.parametrize('name', MODELS)
@pytest.mark.parametrize('at', [(2.0, 0.5), (-1.0, 1.3), (0.7, 2.2)])
def test_rates_of_the_direction_are_the_derivatives(name, at):
    m, rates, h = model(MODELS[name]), (0.3, -0.2), 1e-5
    ahead, behind = (np.array(_direction_of(m, at[0] + x * rates[0], at[1] + x * rates[1])) for x in (h, -h))
    assert _direction_motion(m, *at, *rates)[1] == pytest.approx((ahead - behind) / (2 * h), rel=1e-7)


@pytest.mark.parametrize('name', MODELS)
@pytest.mark.parametrize('plunged', [False, True])
def test_motion_of_the_encoders_is_the_derivative(name, plunged):
    """A direction on a great circle, with a rate that grows."""
    m, h = model(MODELS[name]), 1e-4
    x, y = np.linalg.qr(np.column_stack(([.6, -.5, .9], [.2, .9, .3])))[0].T * np.array([[-1.0], [1.0]])

    def path(t):
        angle, rate, bend = 0.4 * t + 0.15 * t * t, 0.4 + 0.3 * t, 0.3
        s, c = math.sin(angle), math.cos(angle)
        return c * x + s * y, rate * (c * y - s * x), bend * (c * y - s * x) - rate * rate * (c * x + s * y)

    def encoders(t):
        u, v, w = path(t)
        A, E, reachable = _encoder_motion(m, tuple(u), tuple(v), tuple(w), plunged, 0.3)
        assert reachable
        on_sky = angles(*direction(*_direction_of(m, A[0], E[0])))
        assert direction(*on_sky) == pytest.approx(u, abs=1e-12)
        return np.array([A, E])

    before, now, after = encoders(0.3 - h), encoders(0.3), encoders(0.3 + h)
    assert (now[1, 0] > 0.5 * math.pi) == plunged
    assert now[:, 1] == pytest.approx((after[:, 0] - before[:, 0]) / (2 * h), rel=1e-6, abs=1e-7)
    assert now[:, 2] == pytest.approx((after[:, 1] - before[:, 1]) / (2 * h), rel=1e-6, abs=1e-7)


def test_an_unknown_term_is_refused():
    with pytest.raises(ValueError, match='term p2: must be one of p1, p3'):
        pointing_model.model({'p2': 0.1})
