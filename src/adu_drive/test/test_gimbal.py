"""Turning bodies against Lagrange's equations by sympy, and the energy of a drive that lets them go."""
import math

import numpy as np
import pytest
import sympy

from adu_drive import drive_unit
from adu_drive.plant import gimbal
from drive_law.params import AduParameters
from pedestal_common.compiled import compiled
from pedestal_common.parameters import ParameterError, build

BODIES = {'elevating.about_beam': 130.0, 'elevating.about_lift': 100.0, 'elevating.product_xy': 12.0,
          'elevating.product_xz': -9.0, 'elevating.product_yz': 7.0, 'elevation.load.inertia': 150.0,
          'azimuth.load.inertia': 210.0}


@pytest.fixture(scope='module')
def lagrange():
    """f(A, E, A', E', A'', E'', w (3), w' (3)) -> generalised torques (2,), from the kinetic energy of both bodies."""
    t = sympy.symbols('t')
    A, E = (sympy.Function(name)(t) for name in 'AE')
    w = sympy.Matrix([sympy.Function(f'w{i}')(t) for i in range(3)])
    I_x, I_y, I_z, xy, xz, yz = 130, 150, 100, 12, -9, 7
    dish = sympy.Matrix([[I_x, -xy, -xz], [-xy, I_y, -yz], [-xz, -yz, I_z]])
    # Axes of the yoke and of the dish in deck coordinates, as columns: azimuth clockwise, elevation lifts x to z.
    yoke = sympy.Matrix([[sympy.cos(A), sympy.sin(A), 0], [-sympy.sin(A), sympy.cos(A), 0], [0, 0, 1]])
    lifted = yoke * sympy.Matrix([[sympy.cos(E), 0, -sympy.sin(E)], [0, 1, 0], [sympy.sin(E), 0, sympy.cos(E)]])
    of_yoke = w + sympy.Matrix([0, 0, -A.diff(t)])
    omega = lifted.T * (of_yoke + yoke * sympy.Matrix([0, -E.diff(t), 0]))
    T = (omega.T * dish * omega)[0] / 2 + (210 - I_z) * of_yoke[2] ** 2 / 2
    q = [T.diff(x.diff(t)).diff(t) - T.diff(x) for x in (A, E)]
    names = sympy.symbols('a e da de dda dde w0 w1 w2 dw0 dw1 dw2')
    values = [A, E, A.diff(t), E.diff(t), A.diff(t, 2), E.diff(t, 2), *w, *w.diff(t)]
    for value, name in sorted(zip(values, names), key=lambda pair: -pair[0].count(sympy.Derivative)
                              - (pair[0].derivative_count if pair[0].is_Derivative else 0)):
        q = [x.subs(value, name) for x in q]
    return sympy.lambdify(names, q)


@compiled
def _torques(constants, x):
    """Return the torques [Nm] on both axes at x: A, E, their rates and accelerations, w (3,), w' (3,)."""
    c = constants[0].bodies
    M_AA, M_AE = gimbal.inertia(c, x[1])
    h_A, h_E = gimbal.gyroscopic(c, (x[0], x[1]), (x[2], x[3]), x[6:9], x[9:12])
    return M_AA * x[4] + M_AE * x[5] + h_A, M_AE * x[4] + c.I[1, 1] * x[5] + h_E


def test_newton_and_euler_agree_with_lagrange(lagrange):
    constants = drive_unit.constants(build(AduParameters, BODIES))
    for x in np.random.default_rng(1).uniform(-2.0, 2.0, (50, 12)):
        assert _torques(constants, x) == pytest.approx(lagrange(*x), rel=1e-9, abs=1e-9)


def test_a_ball_feels_only_the_deck():
    """Equal moments, no products: nothing gyroscopic, and the inertial torques of an axis alone."""
    p = build(AduParameters, {'elevating.about_beam': 150.0, 'elevating.about_lift': 150.0})
    w_dot = np.array([0.3, -0.5, 0.7])
    h = _torques(drive_unit.constants(p), np.array([0.9, 0.4, 1.0, -0.7, 0.0, 0.0, 0.0, 0.0, 0.0, *w_dot]))
    assert h == pytest.approx([-x for x in drive_unit.inertial_torques(0.9, 210.0, 150.0, *w_dot)], rel=1e-12)


LOOSE = {f'{axis}.{key}': value for axis in ('azimuth', 'elevation') for key, value in {
    'gear_train.stiffness': 1e3, 'gear_train.damping': 0.0, 'gear_train.lash': 0.05, 'friction.coulomb': 0.01,
    'friction.breakaway': 0.01, 'friction.stiffness': 1.0, 'friction.damping': 0.0, 'load.viscous': 0.0,
    'load.unbalance': 0.0, 'bias.schedule': 'off',
    'faults.encoder_disagreement': 1.0}.items()} | {'period': 1e-3, 'initial_elevation': 0.5}
"""Loads that nothing holds for the third of a second that they turn inside their lash."""


def test_loads_let_go_keep_energy_and_momentum(drive):
    """Free bodies on a fixed deck: kinetic energy and the momentum about the azimuth axis stay, the rates do not."""
    d = drive(build(AduParameters, LOOSE | BODIES))
    d.state['azimuth']['omega'], d.state['elevation']['omega'] = 0.06, 0.05
    d.state['last_rate'] = 0.06, 0.05
    c = d.constants['bodies'][0]

    def kept(E, A_dot, E_dot):
        M_AA, M_AE = _inertia(d.constants, E)
        return (0.5 * (M_AA * A_dot ** 2 + 2.0 * M_AE * A_dot * E_dot + c['I'][1, 1] * E_dot ** 2),
                M_AA * A_dot + M_AE * E_dot)
    path = d.run(0.3).log
    first, last = (kept(path['elevation']['load_position'][k], path['azimuth']['load_velocity'][k],
                        path['elevation']['load_velocity'][k]) for k in (0, -1))
    assert last == pytest.approx(first, rel=2e-3)
    assert abs(path['azimuth']['load_velocity'][-1] / 0.06 - 1.0) > 1e-3


@compiled
def _inertia(constants, E):
    return gimbal.inertia(constants[0].bodies, E)


@pytest.mark.parametrize('E', [0.0, 0.8, 1.5])
def test_azimuth_accelerates_as_its_inertia_at_that_elevation(drive, E):
    """The share of a feed-forward torque that the load takes, rotors beside it; friction taken off by a second run."""
    def rate(torque):
        p = build(AduParameters, BODIES | {'initial_elevation': E, 'azimuth.speed_loop.proportional': 0.0,
                                           'azimuth.speed_loop.integral': 0.0})
        d = drive(p)
        d.run(0.15, azimuth=0.0, elevation=0.0, torque=torque)
        return d.log['azimuth']['load_velocity'][-1]
    M_AA = 110.0 + 130.0 * math.sin(E) ** 2 + 100.0 * math.cos(E) ** 2 + 9.0 * math.sin(2.0 * E)
    assert _inertia(drive_unit.constants(build(AduParameters, BODIES)), E)[0] == pytest.approx(M_AA, rel=1e-12)
    slow, fast = rate(1500.0), rate(3000.0)
    assert fast - slow == pytest.approx(1500.0 * 0.15 / (M_AA + 2.0 * 0.0085 * 64.0 ** 2), rel=0.03)


@pytest.mark.parametrize('values, said', [
    ({'elevating.about_beam': 130.0}, 'about_lift = 0'), ({**BODIES, 'elevating.about_beam': 300.0}, 'no body'),
    ({**BODIES, 'elevating.product_xy': 90.0}, 'no body')])
def test_an_inertia_that_no_body_has_is_refused(values, said):
    with pytest.raises(ParameterError, match=said):
        build(AduParameters, values)
