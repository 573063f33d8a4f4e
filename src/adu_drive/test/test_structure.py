"""The flexible structure against closed forms of the two-mass system, and what the drive then sees of it."""
import math

import numba
import numpy as np
import pytest
from scipy import linalg

from adu_drive import axis, drive_unit
from adu_drive.plant import mechanics
from drive_law.params import AduParameters
from pedestal_common.parameters import build

H, J = 50e-6, 210.0


def free(share, frequency, damping, seconds, omega_dish=1e-3):
    """Twist [rad] and energy [J] of dish and free base after a blow on the dish."""
    J_dish = share * J
    J_base = J - J_dish
    k, c = mechanics.spring_and_damper(J_dish, frequency, damping)
    dish = theta = omega = 0.0
    rows = []
    for _ in range(round(seconds / H)):
        dish, omega_dish, twist = mechanics.swing(dish, omega_dish, theta, omega, 0.0, k, c, H, H / J_dish)
        omega += H / J_base * twist
        theta += H * omega
        rows.append((dish - theta, 0.5 * (J_dish * omega_dish ** 2 + J_base * omega ** 2 + k * (dish - theta) ** 2),
                     J_dish * omega_dish + J_base * omega))
    return np.array(rows).T


@pytest.mark.parametrize('share, frequency, damping', [(0.3, 8.0, 0.01), (0.5, 25.0, 0.01), (0.7, 12.0, 0.05)])
def test_frequency_and_decrement_of_the_free_system(share, frequency, damping):
    """f / sqrt(1 - share), damping ratio zeta / sqrt(1 - share); the momentum stays."""
    twist, _, momentum = free(share, frequency, damping, 1.5)
    w, zeta = 2.0 * math.pi * frequency / math.sqrt(1.0 - share), damping / math.sqrt(1.0 - share)
    up = np.flatnonzero((twist[:-1] < 0.0) & (twist[1:] >= 0.0))
    crossings = (up + twist[up] / (twist[up] - twist[up + 1])) * H
    period = np.diff(crossings).mean()
    assert 2.0 * math.pi / period == pytest.approx(w * math.sqrt(1.0 - zeta ** 2), rel=zeta * w * H)
    peaks = [twist[a:b].max() for a, b in zip(up, up[1:])]
    decrement = -np.polyfit(np.arange(len(peaks)), np.log(peaks), 1)[0]
    assert decrement == pytest.approx(2.0 * math.pi * zeta / math.sqrt(1.0 - zeta ** 2), rel=0.01)
    assert momentum == pytest.approx(share * J * 1e-3, rel=1e-9)


def test_no_energy_from_nowhere():
    """Undamped: within the first-order ripple of the integration and without a trend over 500 swings."""
    _, energy, _ = free(0.4, 12.0, 0.0, 40.0)
    ripple = 2.0 * math.pi * 12.0 / math.sqrt(0.6) * H
    assert np.abs(energy / energy.mean() - 1.0).max() < ripple
    assert energy[-20000:].mean() == pytest.approx(energy[:20000].mean(), rel=1e-5)


def flexible(**values):
    return build(AduParameters, {'initial_elevation': 0.7, 'azimuth.structure.inertia_share': 0.4,
                                 'azimuth.structure.frequency': 15.0, **values})


def test_dish_hangs_in_the_wind(drive):
    """At rest the dish is twisted by T / k from the angle the encoder reads."""
    k, _ = mechanics.spring_and_damper(0.4 * J, 15.0, 0.01)
    d = drive(flexible(**{'wind.azimuth': 800.0})).run(1.0, azimuth=0.0)
    a = d.log['azimuth']
    assert np.ptp(a['load_position']) < 1e-5
    assert a['load_position'][-1] - a['position'][-1] == pytest.approx(800.0 / k, rel=0.01)


def test_deck_acceleration_acts_on_dish_and_base_alike(drive):
    """The whole inertia loads the motors, only the dish's own twists the structure."""
    k, _ = mechanics.spring_and_damper(0.4 * J, 15.0, 0.01)
    d = drive(flexible(**{'azimuth.structure.damping': 0.3}))
    d.inputs['base_acceleration'] = 0.0, 0.0, 8.0
    a = d.run(2.0, azimuth=0.0).log['azimuth']
    assert a['load_position'][-1] - a['position'][-1] == pytest.approx(0.4 * J * 8.0 / k, rel=0.01)
    assert a['torque'][-1] == pytest.approx(-J * 8.0, abs=90.0)


@numba.njit
def ring(state, constants, log):
    """Plant alone, both motors clamped: the dish and the base on the meshes after a blow on the dish."""
    s, c = state[0].azimuth, constants[0].azimuth
    axis.begin_period(s, c, False)
    s.omega_dish = 0.02
    for k in range(len(log)):
        s.motor_1.omega = s.motor_2.omega = 0.0
        s.motor_1.v_q, s.motor_2.v_q = 1.0, -1.0        # keeps the meshes closed
        theta_1, theta_2 = s.motor_1.theta, s.motor_2.theta
        axis.plant_step(s, c, 0.0)
        s.motor_1.theta, s.motor_2.theta = theta_1, theta_2
        log[k] = s.dish


def test_modes_on_the_meshes(drive):
    """Spectrum of the dish's ringing against the eigenvalues of the two masses on the mesh springs."""
    p = flexible(**{'azimuth.gear_train.damping': 50.0, 'azimuth.bias.torque': 60.0, 'azimuth.bias.hold': 14.0,
                    'azimuth.friction.coulomb': 0.01, 'azimuth.friction.breakaway': 0.01,
                    'azimuth.friction.stiffness': 1.0, 'azimuth.friction.damping': 0.0, 'azimuth.load.viscous': 0.0})
    log = np.zeros(2 ** 16)
    ring(drive_unit.initial_state(p), drive_unit.constants(p), log)
    k, _ = mechanics.spring_and_damper(0.4 * J, 15.0, 0.0)
    expected = np.sqrt(linalg.eigh([[k, -k], [-k, k + 1e7]], np.diag([0.4 * J, 0.6 * J]), eigvals_only=True)) \
        / (2.0 * math.pi)
    spectrum = np.abs(np.fft.rfft((log - log.mean()) * np.hanning(len(log))))
    f = np.fft.rfftfreq(len(log), H)
    for mode in expected:
        near = (f > 0.8 * mode) & (f < 1.2 * mode)
        assert f[near][np.argmax(spectrum[near])] == pytest.approx(mode, abs=2.0 * f[1])


def test_off_is_the_rigid_load_to_the_bit(drive):
    rigid, off = (drive(build(AduParameters, {'initial_elevation': 0.7, 'azimuth.structure.frequency': f}))
                  .run(0.3, azimuth=1.0).log for f in (12.0, 3.0))
    assert rigid.tobytes() == off.tobytes()
    assert rigid['azimuth']['load_position'][-1] != drive(flexible()).run(0.3, azimuth=1.0).log['azimuth'][
        'load_position'][-1]
