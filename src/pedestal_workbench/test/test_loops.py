"""`pedestal tune --loops`: the design against the drive as it comes, margins measured on the plant, refusals."""
import dataclasses
import math
import re

import pytest

from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import files, scenario
from pedestal_bringup.scenario.variant import Variant
from pedestal_results import results
from pedestal_results.recorded_run import RecordedRun
from pedestal_workbench.tuning import loops

SOFT = ('adu.azimuth.gear_train.stiffness=8e5', 'adu.azimuth.gear_train.damping=400')
"""A gear on which the load swings close to the position loop."""


SOFTER = ('adu.azimuth.gear_train.stiffness=2e4', 'adu.azimuth.gear_train.damping=10')


def test_the_plant_that_comes_with_the_product_gets_the_gains_it_has(pedestal, tmp_path):
    """Those were found by hand; the file is one that `pedestal run --params-file` takes."""
    code, output, errors = pedestal('tune', 'leo_pass', '--loops')
    assert (code, errors) == (0, '')
    chosen = scenario.load('leo_pass', files.file_overrides(tmp_path / 'leo_pass-loops.yaml'))
    before = scenario.load('leo_pass')
    for axis in loops.AXES:
        new, old = (getattr(each.node_parameters('adu'), axis) for each in (chosen, before))
        assert new.speed_loop.proportional == pytest.approx(old.speed_loop.proportional, rel=0.03)
        assert new.speed_loop.integral == pytest.approx(old.speed_loop.integral, rel=0.06)
        assert new.bias.torque == pytest.approx(old.bias.torque, rel=0.01)
        new, old = (getattr(each.node_parameters('acu'), axis) for each in (chosen, before))
        assert new.feedforward.bandwidth == pytest.approx(old.feedforward.bandwidth, rel=0.1)
        assert new.feedforward.inertia == pytest.approx(old.feedforward.inertia, rel=0.005)
    rows = [line for line in output.splitlines() if re.match(r'\w+ (speed|position) +[\d.]+ Hz', line)]
    assert len(rows) == 4 and all(line.count('(>= ') == 2 for line in rows)


@pytest.mark.thorough
def test_a_loop_slower_than_required_and_one_without_a_gain_margin_are_named(pedestal):
    """The speed loop of leo_pass crosses below 28 Hz. The soft gear needs a slower position loop for its margins.
    30 Hz is above an eighth of the speed loop. The current loops never reach -180 deg."""
    slower = r'azimuth {} loop: {} Hz required, [\d.]+ Hz reached: {}'
    for options, loop, wanted, reason in (
            ((), 'speed', '28', 'the gains are those of a rigid axis'),
            (('--param', SOFT[0], '--param', SOFT[1]), 'position', '3.5', 'a faster loop does not hold the required'),
            (('--position-bandwidth', '30', '--speed-bandwidth', '28'), 'position', '30',
             'a position loop has at most 1/8')):
        code, output, _ = pedestal('tune', 'leo_pass', '--loops', '--axis', 'azimuth', '--output',
                                   f'{loop}{wanted}.yaml', *options)
        assert code == 0 and re.search(slower.format(loop, wanted, reason), output)
        assert 'no gain margin of azimuth current: the open loop does not reach -180 deg' in output
        assert 'beyond' not in output


@pytest.mark.thorough
def test_a_soft_gear_makes_the_loop_slower_until_it_holds_its_margins():
    asked = loops.LoopRequirements()
    stiff, soft = (loops.Loops(Variant('leo_pass', tuple(changes))) for changes in ((), SOFT))
    key = 'acu.azimuth.feedforward.bandwidth'
    for each in (stiff, soft):
        rows = {(loop, axis): margins for loop, axis, _, margins in
                loops.design(each, ('azimuth',), asked, lambda share, text: None)}
        assert all(loops.meets_margins(rows[loop, 'azimuth'], asked) for loop in ('speed', 'position'))
    assert soft.gains[key] < 0.75 * stiff.gains[key]


@pytest.mark.thorough
def test_what_is_asked_is_the_crossover_of_the_position_loop():
    for asked in (1.5, 3.0):
        each = loops.Loops(Variant('leo_pass'))
        rows = {loop: margins for loop, _, _, margins in loops.design(
            each, ('azimuth',), loops.LoopRequirements(28.0, asked), lambda share, text: None)}
        assert rows['position']['crossover_hz'][0] == pytest.approx(asked, rel=0.12)


@pytest.mark.thorough
def test_teeth_that_pass_near_the_bandwidth_do_not_move_it():
    """The elevation of station_real passes a tooth at 1.15 Hz, near its bandwidth of 1.38 Hz."""
    with_teeth, without = (loops.Loops(Variant('station_real').with_(changes)).measured('position', 'elevation')
                           for changes in ({}, {'adu.elevation.gear_train.tooth_error': 0.0}))
    for metric in ('bandwidth_hz', 'crossover_hz'):
        assert with_teeth[metric][0] == pytest.approx(without[metric][0], rel=0.005)


@pytest.mark.thorough
def test_an_axis_slower_than_the_rate_of_the_measurement():
    """2 deg/s in azimuth, 1 deg/s in elevation: the same loops as of the fast axis. The friction of a motor that turns
    below 1 rad/s damps the speed loop by 2 to 5 deg more."""
    asked, slow = loops.LoopRequirements(), {'azimuth': math.radians(2.0), 'elevation': math.radians(1.0)}
    found = []
    for changes in ((), [f'adu.{axis}.limits.rate={rate}' for axis, rate in slow.items()]):
        each = loops.Loops(Variant('leo_pass', tuple(changes)))
        found.append([margins for *_, margins in loops.design(each, loops.AXES, asked, lambda share, text: None)])
        assert each.gains['acu.azimuth.feedforward.bandwidth'] == pytest.approx(22.0, rel=0.01)
    for fast, slow in zip(*found):
        assert slow['phase_margin_deg'][0] == pytest.approx(fast['phase_margin_deg'][0], abs=6.0)
        assert slow['crossover_hz'][0] == pytest.approx(fast['crossover_hz'][0], rel=0.05)


NINE_METRES = ('--mirror', '9', '--inertia-azimuth', '28000', '--inertia-elevation', '21000', '--ratio-azimuth', '700',
               '--ratio-elevation', '800', '--motor-torque', '25', '--rate-azimuth', '10', '--rate-elevation', '10')
"""A dish of 9 m whose structure is at 4 Hz."""


@pytest.mark.thorough
def test_a_flexible_dish_is_tracked_also_if_inertia_and_frequency_are_wrong(pedestal, tmp_path):
    """40 % of the dish swing at 4 Hz. The shaper of a rigid dish with these motors loses the target in a second."""
    assert pedestal('new', 'dish.yaml', *NINE_METRES, '--mode', '4', '--mode-share', '0.4')[0] == 0
    code, output, _ = pedestal('tune', 'dish.yaml', '--loops')
    assert code == 0 and sum('worst' in line for line in output.splitlines()) == 4
    tuned = files.file_overrides(tmp_path / 'dish-loops.yaml')

    def tracked(changes):
        overrides = [*tuned, *(f'{key}={value}' for key, value in changes.items())]
        chosen = scenario.load(tmp_path / 'dish.yaml', overrides, duration=60.0)
        return results.measured(RecordedRun(memory_recording.record(chosen)).parts)

    antenna = scenario.load(tmp_path / 'dish.yaml').node_parameters('tracking_receiver').antenna
    for inertia, mode in ((1.0, 1.0), (1.3, 0.8), (0.7, 0.8)):
        changes = {f'adu.{axis}.load.inertia': inertia * J for axis, J in (('azimuth', 28e3), ('elevation', 21e3))}
        found = tracked({**changes, **{f'adu.{axis}.structure.frequency': 4.0 * mode for axis in loops.AXES}})
        assert found['tracked_percent'][0] > 90.0 and found['loss_s'][0] == 0.0
        assert found['pointing_rms_deg'][0] < 0.01 * math.degrees(antenna.beamwidth)
    rigid = {'acceleration': 2.2, 'jerk': 300.0, 'h0': 0.02}
    lost = tracked({f'acu.{axis}.shaper.{key}': value for axis in loops.AXES for key, value in rigid.items()})
    assert lost['tracked_percent'][0] < 10.0


def test_the_shaper_of_a_flexible_dish_leaves_no_swing():
    """A dish on a spring, base accelerated to a with the jerk: after the rise it hangs back by a / w^2, and swings by
    nothing if its frequency is as declared, by a quarter of that if it is 20 % off."""
    declared = {'adu.azimuth.structure.inertia_share': 0.4, 'adu.azimuth.structure.frequency': 4.0}
    plant = loops.Loops(Variant('leo_pass').with_(declared)).plants['azimuth']
    gains = loops.shaper_gains(plant, 176.0)
    a, bend = gains['acceleration'], gains['acceleration'] / (2.0 * math.pi * 4.0)**2
    assert bend == pytest.approx(0.8e-3) and gains['h0'] == pytest.approx(0.2)
    for mode, swing in ((4.0, 0.01), (3.2, 0.26), (4.8, 0.26)):
        w, x, v, dt, after = 2.0 * math.pi * mode, 0.0, 0.0, 1e-4, []
        for k in range(20000):
            v += dt * (-w * w * x - min(gains['jerk'] * k * dt, a))
            x += dt * v
            if gains['jerk'] * k * dt > a:
                after.append(x + a / w**2)
        assert max(map(abs, after)) < swing * a / w**2


def test_the_control_unit_gets_the_structure_and_the_speed_loop_of_the_design():
    """By these it decides which models its filter may use. A speed loop of the gear's inertia alone is slower with the
    whole axis. A rigid dish has no structure to state."""
    plant = loops.Loops(Variant('leo_pass').with_({'adu.azimuth.structure.inertia_share': 0.4,
                                                   'adu.azimuth.structure.frequency': 4.0})).plants['azimuth']
    gains = loops.control_gains(plant, 100.0, 10.0)
    assert {key: value for key, value in gains.items() if key.startswith('structure.')} == {
        'structure.inertia_share': 0.4, 'structure.frequency': 4.0, 'structure.damping': 0.01}
    K_p = loops.drive_gains(plant, 100.0)['speed_loop.proportional']
    assert gains['adrc.rate_bandwidth'] == pytest.approx(K_p / plant.inertia)
    rigid = loops.control_gains(loops.Loops(Variant('leo_pass')).plants['azimuth'], 100.0, 10.0)
    assert not any('structure' in key or 'filter' in key for key in rigid)
    assert rigid['adrc.rate_bandwidth'] == pytest.approx(100.0)


def test_the_design_is_that_of_a_rigid_drive():
    """J dw/dt = T for one motor and its half of the load: crossover of K_p / (J s) at w_s."""
    plant = loops.Loops(Variant('leo_pass')).plants['azimuth']
    half = 0.0085 + 210.0 / 64.0**2 / 2.0
    assert plant.inertia == pytest.approx(half)
    gains = loops.drive_gains(plant, 100.0)
    assert abs(gains['speed_loop.proportional'] / (1j * 100.0 * half)) == pytest.approx(1.0)
    torque = plant.acceleration * plant.whole_inertia + 60.0
    assert torque == pytest.approx(2.0 * 90.0 * 64.0)
    assert math.isclose(loops.shaper_gains(plant, 100.0)['acceleration'], 0.5 * plant.acceleration)
    gears = dataclasses.replace(plant.axis.gear_train, lash=0.0)
    without = dataclasses.replace(plant, axis=dataclasses.replace(plant.axis, gear_train=gears))
    assert math.isclose(loops.shaper_gains(without, 100.0)['acceleration'], 0.75 * plant.acceleration)


@pytest.mark.parametrize('arguments, expected', [
    (('phased_array_sway',), 'an electronic beam has no loops to tune'),
    (('leo_pass', '--param', 'adu.elevation.load.unbalance=50000'), 'adu.elevation: the motors cannot move the axis'),
    (('leo_pass', '--phase-margin', '5'), 'phase_margin = 5 deg: must be 20 to 80'),
    (('leo_pass', '--filter', 'ca'), '--filter: cannot be combined with --loops'),
    (('leo_pass', '--speed-bandwidth', '300', '--phase-margin', '75'),
     'azimuth: the speed loop cannot be closed with 75 deg and 6 dB: at 50.2 Hz it has'),
    (('leo_pass', *(part for text in SOFTER for part in ('--param', text))),
     'azimuth: the position loop cannot be closed with 45 deg and 6 dB: at 0.586 Hz the drive trips'),
])
def test_refused(pedestal, tmp_path, arguments, expected):
    code, output, errors = pedestal('tune', *arguments, '--loops')
    assert (code, output) == (2, '') and expected in errors and errors.count('\n') == 1
    assert not list(tmp_path.iterdir())
