"""Calibration of the drive: a changed drive is identified within its intervals, and the twin predicts the recording.

The runs are in memory, of the pedestal of leo_pass, by the command line.
"""
import json

import numpy as np
import pytest

from acu_tracker.command_table import ACU_COMMANDS
from pedestal import cli
from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import files, scenario
from pedestal_common.graph.topics import AXES
from pedestal_common.parameters import as_dict
from pedestal_common.text_files import parameter_file
from pedestal_common.wire import commands
from pedestal_workbench.calibration.calibration import CalibrationError
from pedestal_workbench.calibration.drive import estimates, identified, motion_data, motions, twin

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


@pytest.mark.thorough
def test_the_changed_drive_is_identified(result):
    code, content, *_ = result
    assert code == 0 and content['verified']
    for name, tolerance in TOLERANCES.items():
        found = content['parameters']['adu'][name]
        print(f'{name}: {found:.6g}, true {TRUE[name]:g}')
        assert found == pytest.approx(TRUE[name], rel=tolerance), name
    rows = {row['metric']: row for row in content['rows']}
    nominal = as_dict(scenario.load('leo_pass').node_parameters('adu'))
    for metric, name in (('azimuth_inertia', 'azimuth.load.inertia'), ('azimuth_coulomb', 'azimuth.friction.coulomb'),
                         ('azimuth_breakaway', 'azimuth.friction.breakaway'),
                         ('azimuth_lash', 'azimuth.gear_train.lash'), ('elevation_inertia', 'elevation.load.inertia'),
                         ('elevation_frequency', 'elevation.structure.frequency'),
                         ('azimuth_stiffness', 'azimuth.gear_train.stiffness')):
        assert rows[metric]['ci_low'] < {**nominal, **TRUE}[name] < rows[metric]['ci_high'], metric
    assert rows['azimuth_bias']['value'] == pytest.approx(12.0, abs=0.01)
    assert 'azimuth_frequency' not in rows and 'elevation_eccentricity_sin' not in rows
    assert any('structure: no mode' in text for text in content['remarks']['azimuth'])


@pytest.mark.thorough
def test_the_twin_predicts_the_torques(result):
    rows = {row['metric']: row['value'] for row in result[1]['rows']}
    for name in ('azimuth', 'elevation'):
        before, after = rows[f'{name}_torque_error_before_percent'], rows[f'{name}_torque_error_percent']
        print(f'{name}: torque of the twin off by {before:.1f} % before, {after:.1f} % after')
        assert before > 20.0 and after < 3.0


def calibrated(folder, *given):
    """Return (exit code, content of --json, {metric: row}) of the verb, with --output in a folder."""
    code = cli.main(['calibrate', 'drive', *given, '--json', str(folder / 'rows.json'), '--output',
                     str(folder / 'drive.yaml')])
    content = json.loads((folder / 'rows.json').read_text())
    return code, content, {row['metric']: row for row in content['rows']}


@pytest.mark.thorough
def test_nominal_values_that_fit_better_are_kept(tmp_path):
    """An antenna whose dish swings for seconds: identified values are near the true nominal ones, which are kept."""
    antenna = tmp_path / 'my.yaml'
    assert cli.main(['new', str(antenna), *('--mirror 5.5 --frequency 8.2 --inertia-azimuth 2500 --inertia-elevation '
                     '1800 --ratio-azimuth 300 --ratio-elevation 320 --mode 4 --lash 0.8').split()]) == 0
    code, content, rows = calibrated(tmp_path, '--scenario', str(antenna))
    true = as_dict(scenario.load(str(antenna)).node_parameters('adu'))
    assert code == 0 and 'azimuth.friction.coulomb' in content['kept']['azimuth']
    assert content['parameters']['adu'] == {name: true[name] for name in content['parameters']['adu']}
    for name in ('azimuth', 'elevation'):
        assert content['remarks'][name][0].startswith('nominal values kept')
        assert not any('lash: not shown' in text for text in content['remarks'][name])
        assert rows[f'{name}_lash']['value'] == pytest.approx(8e-4, rel=0.01)
        assert rows[f'{name}_torque_error_percent']['value'] < 0.01
        assert rows[f'{name}_torque_error_identified_percent']['value'] < 2.0
        assert rows[f'{name}_frequency']['value'] == pytest.approx(4.0, rel=0.003)
        assert any(text.startswith('stiffness: not shown') for text in content['remarks'][name])
    for key, tolerance in (('unbalance', 5.0), ('viscous', 10.0)):
        assert rows[f'elevation_{key}']['value'] == pytest.approx(true[f'elevation.load.{key}'], abs=tolerance)


@pytest.mark.thorough
def test_a_rigid_structure_with_rattling_teeth_gets_no_mode(tmp_path):
    """The teeth of this station rattle without bias torque; its structure is rigid."""
    code, content, rows = calibrated(tmp_path, '--scenario', 'leo_station_7m')
    true = as_dict(scenario.load('leo_station_7m').node_parameters('adu'))
    assert code == 0 and not any('frequency' in metric for metric in rows)
    for name in AXES:
        assert content['parameters']['adu'][f'{name}.structure.inertia_share'] == 0.0
        assert rows[f'{name}_torque_error_identified_percent']['value'] < 2.0
        for key in ('inertia', 'coulomb', 'viscous', 'lash'):
            row = rows[f'{name}_{key}']
            assert row['ci_low'] < true[f'{name}.{twin.PARAMETER_NAMES[key]}'] < row['ci_high'], row['metric']


@pytest.mark.thorough
def test_a_result_that_is_not_verified_is_not_written(tmp_path, capfd):
    """The speed loop of the drive differs from its data."""
    code, content, _ = calibrated(tmp_path, '--scenario', 'leo_pass', '--param',
                                  'adu.azimuth.speed_loop.proportional=14')
    assert code == 4 and not content['verified'] and not (tmp_path / 'drive.yaml').exists()
    assert f'not written: {tmp_path / "drive.yaml"}, because the result is not verified' in capfd.readouterr().out


@pytest.mark.thorough
def test_the_file_is_for_control_unit_and_plant(result):
    """The feed-forward has the inertia of load and motors, and the friction of the load."""
    _, content, file, page = result
    chosen = scenario.load('leo_pass', files.file_overrides(file), duration=1.0)
    acu, drive = chosen.node_parameters('acu'), as_dict(chosen.node_parameters('adu'))
    assert acu.azimuth.feedforward.inertia == pytest.approx(273.0 + 64.0**2 * 2.0 * 0.0085, rel=0.01)
    assert acu.azimuth.feedforward.friction == pytest.approx(90.0, rel=0.01)
    assert {name: drive[name] for name in content['parameters']['adu']} == content['parameters']['adu']
    assert page.read_text().count('<svg') == 3
    table = np.array(content['encoder_map_deg']['azimuth'])
    expected = np.degrees(TRUE['azimuth.encoder.error.eccentricity_sin']) * np.sin(np.radians(table[:, 0]))
    assert np.abs(table[:, 1] - expected).max() < 2e-4 and np.ptp(table[:, 0]) >= 300.0
    assert cli.main(['calibrate', 'drive', '--scenario', 'leo_pass', '--output', str(file)]) == 2


def test_the_plan_stays_inside_the_stated_limits(tmp_path, capfd):
    """The positions and rates of the run, not only of the commands."""
    file = tmp_path / 'plan.yaml'
    assert cli.main(['calibrate', 'drive', '--scenario', 'leo_pass', '--plan', str(file)]) == 0
    assert 'at most 1.15 rad/s' in capfd.readouterr().out
    chosen = scenario.load('leo_pass', files.file_overrides(file))
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


def test_the_plan_prints_a_command_for_the_given_scenario(tmp_path, capfd):
    antenna = tmp_path / 'my antenna.yaml'
    antenna.write_text(parameter_file.text({'scenario': {'title': 'mine'}}))
    assert cli.main(['calibrate', 'drive', '--scenario', str(antenna), '--plan', str(tmp_path / 'plan.yaml')]) == 0
    assert f"pedestal run '{antenna}' --params-file {tmp_path / 'plan.yaml'} --bag" in capfd.readouterr().out


def test_the_plan_of_a_short_travel_stays_inside():
    acu = scenario.load('leo_pass', ('acu.azimuth.limits.low=-0.5', 'acu.azimuth.limits.high=0.5')).node_parameters(
        'acu')
    at = [command.arguments for _, command in commands.schedule('acu.commands', motions.plan(acu).commands,
                                                                ACU_COMMANDS)]
    starts = np.array([float(given['azimuth']) for given in at])
    ways = np.array([float(given.get('azimuth_rate', 0.0)) * float(given.get('moves', 0.0)) for given in at])
    assert np.abs(starts).max() <= 0.45 + 1e-6 and np.abs(starts + ways).max() <= 0.45 + 1e-6


def test_the_plan_stays_above_the_floor(tmp_path, capfd):
    """The elevation stays above the floor at every azimuth; a floor that leaves no travel is refused."""
    given = ['calibrate', 'drive', '--scenario', 'leo_pass', '--plan', str(tmp_path / 'plan.yaml'), '--param']
    low = [part for name in ('preset', 'stow', 'limits.high') for part in ('--param', f'acu.elevation.{name}=1.56')]
    assert cli.main([*given, 'acu.floor=-3 1.5; 0 1.5; 3 1.5', *low]) == 2
    assert 'acu.floor: leaves' in capfd.readouterr().err
    assert cli.main([*given, 'acu.floor=-3 0.5; 0 0.5; 3 0.5']) == 0
    assert 'elevation: 31.9 to 88.8 deg' in capfd.readouterr().out
    chosen = scenario.load('leo_pass', files.file_overrides(tmp_path / 'plan.yaml'))
    assert memory_recording.record(chosen).table('joint_states')['elevation.position'].min() > 0.5


def test_a_long_plan_is_remarked_or_refused(tmp_path, capfd):
    given = ['calibrate', 'drive', '--scenario', 'leo_pass', '--plan', str(tmp_path / 'plan.yaml'), '--param']
    assert cli.main([*given, 'acu.azimuth.shaper.rate=0.001']) == 0
    printed = capfd.readouterr().out
    assert 'motions of 10 h ' in printed and 'acu.azimuth.shaper.rate = 0.001 rad/s: azimuth needs 10 h' in printed
    (tmp_path / 'plan.yaml').unlink()
    assert cli.main([*given, 'acu.azimuth.shaper.rate=0.0001']) == 2
    assert 'for the motions; a run has at most 24 h 0 min' in capfd.readouterr().err


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
    motion = motion_data.Motion(5e-3 * np.arange(n), *(np.zeros(n),) * 3, *(np.zeros((n, 2)),) * 4)

    def found(torque):
        angle = 0.5 * lash * np.sign(torque) + ratio * torque / k + (0.1, -0.2)
        moved = motion_data.Motion(**{**motion.__dict__, 'motor_angle': angle})
        return estimates.lash([(moved, torque)], ratio)

    assert found(torque) == {}
    torque[n // 2:] *= -1.0
    value, low, high = found(torque)['lash']
    assert value == pytest.approx(lash, rel=1e-9) and low <= value <= high
    assert found(torque)['stiffness'][0] == pytest.approx(k, rel=1e-9)


def test_lash_shows_in_a_run_with_small_torques():
    """A run with a bias torque above all others does not hide the lash of a run without it."""
    n, ratio, lash = 2000, 300.0, 8e-4
    one_way = np.column_stack((np.full(n, 20.0), np.full(n, -20.0)))
    both_ways = np.repeat((1.0, -1.0), n // 2)[:, np.newaxis] * np.linspace(1.0, 2.0, n)[:, np.newaxis] * (1.0, 1.0)
    parts = []
    for torque in (one_way, both_ways):
        angle = 0.5 * lash * np.sign(torque) + ratio * torque / 6e7
        parts.append((motion_data.Motion(5e-3 * np.arange(n), *(np.zeros(n),) * 3, angle, *(np.zeros((n, 2)),) * 3),
                      torque))
    assert estimates.lash(parts, ratio)['lash'][0] == pytest.approx(lash, rel=1e-9)


@pytest.mark.parametrize('given, code, message', [
    (['--bag', 'x', '--plan', 'p.yaml'], 2, '--plan: has no effect with --bag'),
    (['--bag', 'x', '--param', 'adu.azimuth.load.inertia=1'], 2, '--param: has no effect with --bag'),
    (['--scenario', 'leo_pass', '--plan', 'p.yaml', '--output', 'o.yaml'], 2, '--output: has no effect with --plan'),
    (['--bag', '/no/bag'], 1, '/no/bag')])
def test_wrong_options_are_refused(capfd, given, code, message):
    assert cli.main(['calibrate', 'drive', *given]) == code
    assert message in capfd.readouterr().err


def test_recordings_without_the_motions_or_without_bias_torque_are_refused():
    for changes, end in (((), '--plan$'), (('adu.azimuth.bias.schedule=off', 'adu.elevation.bias.schedule=off'),
                                          'teeth rattle without bias torque: add the recording with it, ')):
        chosen = scenario.load('leo_pass', changes, duration=5.0)
        recording = twin.read(memory_recording.record(chosen), chosen.node_parameters('adu'))
        with pytest.raises(ValueError, match=f'azimuth: .* pieces of constant rate at .* run the motions of .*{end}'):
            identified.calibrate([recording], 'leo_pass')
    with pytest.raises(CalibrationError, match='not enabled all the time'):
        chosen = scenario.load('leo_pass', ('adu.initially_enabled=false',), duration=2.0)
        twin.read(memory_recording.record(chosen), chosen.node_parameters('adu'))
