"""Calibration of the drive: a changed drive is identified within its intervals, and the twin predicts the recording.

The runs are in memory, of the pedestal of leo_pass, by the command line.
"""
import json

import numpy as np
import pytest

from acu_tracker.operating.command_table import ACU_COMMANDS
from pedestal import cli
from pedestal_analysis.calibration.drive import estimates, identified, motion_data, motions, twin
from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import scenario
from pedestal_common.parameters import as_dict
from pedestal_common.wire import commands

TRUE = {'azimuth.load.inertia': 273.0, 'azimuth.friction.coulomb': 90.0, 'azimuth.friction.breakaway': 120.0,
        'azimuth.gear_train.lash': 2e-3, 'azimuth.encoder.error.eccentricity_sin': 4e-5,
        'elevation.load.inertia': 195.0, 'elevation.structure.inertia_share': 0.3,
        'elevation.structure.frequency': 6.0}
"""Changed parameters of adu: inertia + 30 %, friction x 1.5, twice the lash, an encoder off its centre, a soft
structure."""
TOLERANCES = {'azimuth.load.inertia': 0.01, 'azimuth.friction.coulomb': 0.01, 'azimuth.friction.breakaway': 0.03,
              'azimuth.gear_train.lash': 0.03, 'azimuth.encoder.error.eccentricity_sin': 0.05,
              'elevation.load.inertia': 0.01, 'elevation.structure.inertia_share': 0.02,
              'elevation.structure.frequency': 0.003}
"""Largest relative errors [-]."""


@pytest.fixture(scope='module')
def result(tmp_path_factory):
    """Return (exit code, content of --json, parameter file, page) of a drive with the parameters TRUE."""
    folder = tmp_path_factory.mktemp('drive')
    given = [part for name, value in TRUE.items() for part in ('--param', f'adu.{name}={value}')]
    paths = [folder / name for name in ('rows.json', 'drive.yaml', 'page.html')]
    code = cli.main(['calibrate', 'drive', '--scenario', 'leo_pass', *given, '--json', str(paths[0]), '--output',
                     str(paths[1]), '--report', str(paths[2])])
    return code, json.loads(paths[0].read_text()), paths[1], paths[2]


def test_the_changed_drive_is_identified(result):
    code, content, *_ = result
    assert code == 0 and content['verified']
    for name, tolerance in TOLERANCES.items():
        found = content['parameters']['adu'][name]
        print(f'{name}: {found:.6g}, true {TRUE[name]:g}')
        assert found == pytest.approx(TRUE[name], rel=tolerance), name
    rows = {row['metric']: row for row in content['rows']}
    for metric, name in (('azimuth_inertia', 'azimuth.load.inertia'), ('azimuth_coulomb', 'azimuth.friction.coulomb'),
                         ('azimuth_breakaway', 'azimuth.friction.breakaway'),
                         ('azimuth_lash', 'azimuth.gear_train.lash'), ('elevation_inertia', 'elevation.load.inertia'),
                         ('elevation_frequency', 'elevation.structure.frequency')):
        assert rows[metric]['ci_low'] < TRUE[name] < rows[metric]['ci_high'], metric
    assert rows['azimuth_bias']['value'] == pytest.approx(12.0, abs=0.01)
    assert 'azimuth_frequency' not in rows and 'elevation_eccentricity_sin' not in rows
    assert any('structure: no mode' in text for text in content['remarks']['azimuth'])


def test_the_twin_predicts_the_torques(result):
    rows = {row['metric']: row['value'] for row in result[1]['rows']}
    for name in ('azimuth', 'elevation'):
        before, after = rows[f'{name}_torque_error_before_percent'], rows[f'{name}_torque_error_percent']
        print(f'{name}: torque of the twin off by {before:.1f} % before, {after:.1f} % after')
        assert before > 20.0 and after < 3.0


def test_the_file_is_for_control_unit_and_plant(result):
    """The feed-forward has the inertia of load and motors, and the friction of the load."""
    _, content, file, page = result
    chosen = scenario.load('leo_pass', scenario.file_overrides(file), duration=1.0)
    acu, drive = chosen.node_parameters('acu'), as_dict(chosen.node_parameters('adu'))
    assert acu.azimuth.feedforward.inertia == pytest.approx(273.0 + 64.0**2 * 2.0 * 0.0085, rel=0.01)
    assert acu.azimuth.feedforward.friction == pytest.approx(90.0, rel=0.01)
    assert {name: drive[name] for name in content['parameters']['adu']} == content['parameters']['adu']
    assert page.read_text().count('<svg') == 3
    assert cli.main(['calibrate', 'drive', '--scenario', 'leo_pass', '--output', str(file)]) == 1


def test_the_plan_stays_inside_the_stated_limits(tmp_path, capfd):
    """The positions and rates of the run, not only of the commands."""
    file = tmp_path / 'plan.yaml'
    assert cli.main(['calibrate', 'drive', '--scenario', 'leo_pass', '--plan', str(file)]) == 0
    assert 'at most 1.15 rad/s' in capfd.readouterr().out
    chosen = scenario.load('leo_pass', scenario.file_overrides(file))
    run = memory_recording.record(chosen)
    joints, acu = run.table('joint_states'), chosen.node_parameters('acu')
    for name in ('azimuth', 'elevation'):
        axis, angle, rate = getattr(acu, name), joints[f'{name}.position'], joints[f'{name}.velocity']
        travel = axis.limits.high - axis.limits.low
        assert angle.min() > axis.limits.low + 0.04 * travel and angle.max() < axis.limits.high - 0.04 * travel
        assert np.ptp(angle) > 0.5 * min(travel, 2.0 * np.pi)
        # A step of the rate overshoots a little in the loops of the drive.
        assert 0.95 * motions.MAX_RATE_SHARE < np.abs(rate).max() / axis.shaper.rate < 1.8 * motions.MAX_RATE_SHARE
    states = run.table('adu/state')['data']
    assert set(states) == {'enabled'}


def test_the_plan_of_a_short_travel_stays_inside():
    acu = scenario.load('leo_pass', ('acu.azimuth.limits.low=-0.5', 'acu.azimuth.limits.high=0.5')).node_parameters(
        'acu')
    at = [command.arguments for _, command in commands.schedule('acu.commands', motions.plan(acu).commands,
                                                                ACU_COMMANDS)]
    starts = np.array([float(given['azimuth']) for given in at])
    ways = np.array([float(given.get('azimuth_rate', 0.0)) * float(given.get('moves', 0.0)) for given in at])
    assert np.abs(starts).max() <= 0.45 + 1e-6 and np.abs(starts + ways).max() <= 0.45 + 1e-6


def test_friction_is_fitted_to_computed_torques():
    """Without noise the four terms, gravity and a constant torque come out; one direction alone is refused."""
    rng = np.random.default_rng(1)
    v = np.repeat([s * r for r in (0.5e-3, 1e-3, 2e-3, 4e-3, 0.02, 0.1, 0.4) for s in (1.0, -1.0)], 4)
    theta = rng.uniform(0.0, 1.4, v.size)
    torque = estimates.friction_torque(v, 60.0, 80.0, 2e-3, 20.0) + 40.0 * np.cos(theta) + 5.0
    found = estimates.friction(np.column_stack((v, torque, theta)), True)
    expected = {'coulomb': 60.0, 'breakaway': 80.0, 'stribeck_rate': 2e-3, 'viscous': 20.0, 'unbalance': 40.0,
                'offset': 5.0}
    assert {name: value for name, (value, *_) in found.items()} == pytest.approx(expected, rel=1e-4)
    with pytest.raises(ValueError, match='all rates have one sign'):
        estimates.friction(np.column_stack((np.abs(v), torque, theta)), True)
    with pytest.raises(ValueError, match='must be at least 12 at 3'):
        estimates.friction(np.column_stack((v, torque, theta))[:8], True)


def test_lash_needs_both_flanks():
    """Two motors that never change the sign of their torque show no lash."""
    rng = np.random.default_rng(2)
    n, ratio, lash, k = 2000, 64.0, 1e-3, 5e6
    torque = np.column_stack((rng.uniform(5.0, 40.0, n), -rng.uniform(5.0, 40.0, n)))
    motion = motion_data.Motion(*(np.zeros(n),) * 4, *(np.zeros((n, 2)),) * 4)

    def found(torque):
        angle = 0.5 * lash * np.sign(torque) + ratio * torque / k + (0.1, -0.2)
        moved = motion_data.Motion(**{**motion.__dict__, 'motor_angle': angle})
        return estimates.lash(moved, torque, ratio)

    assert found(torque) == {}
    torque[::2] *= -1.0
    value, low, high = found(torque)['lash']
    assert value == pytest.approx(lash, rel=1e-9) and low <= value <= high
    assert found(torque)['stiffness'][0] == pytest.approx(k, rel=1e-9)


@pytest.mark.parametrize('given, message', [
    (['--bag', 'x', '--plan', 'p.yaml'], '--plan: has no effect with --bag'),
    (['--bag', 'x', '--param', 'adu.azimuth.load.inertia=1'], '--param: has no effect with --bag'),
    (['--scenario', 'leo_pass', '--plan', 'p.yaml', '--output', 'o.yaml'], '--output: has no effect with --plan'),
    (['--bag', '/no/bag'], '/no/bag')])
def test_wrong_options_are_refused(capfd, given, message):
    assert cli.main(['calibrate', 'drive', *given]) == 1
    assert message in capfd.readouterr().err


def test_recordings_without_the_motions_are_refused():
    chosen = scenario.load('leo_pass', duration=5.0)
    recording = twin.read(memory_recording.record(chosen), chosen.node_parameters('adu'))
    with pytest.raises(ValueError, match='pieces of constant rate at .* run the motions of --plan'):
        identified.calibrate([recording], 'leo_pass')
    with pytest.raises(motion_data.MotionError, match='not enabled all the time'):
        chosen = scenario.load('leo_pass', ('adu.initially_enabled=false',), duration=2.0)
        twin.read(memory_recording.record(chosen), chosen.node_parameters('adu'))
