"""A satellite and a station of one's own, from the command line into the recording."""
import datetime
import re

import numpy as np
import pytest
import yaml

import pedestal
from acu_tracker.modes import Mode
from pedestal import cli, satellite
from pedestal.verbs import run as run_verb
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.program import Plan
from pedestal_recording import bag as bags
from tracking_receiver_sim import target
from tracking_receiver_sim.params import LeoPassParameters

UTC = '2019-12-10T12:30'
NOW = datetime.datetime(2019, 12, 10)


def test_passes_are_listed(capsys):
    assert cli.main(['run', 'leo_pass', '--pass', 'list', '--station=-33.9,18.4,10']) == 0
    old, head, _, *rows = capsys.readouterr().out.splitlines()
    assert old.startswith('the TLE of satellite 25544 is of 2019-12-09') and 'height 10 m' in head
    assert head.endswith('passes that culminate above 10 deg; rise and set are at 0 deg')
    assert [row.split()[0] for row in rows] == [str(n) for n in range(1, 1 + len(rows))] and len(rows) > 10


def test_trials_of_a_pass_of_a_tle_file(pedestal, tmp_path):
    """The pass of all trials is chosen once, as that of `pedestal run`; the command of a trial names it."""
    (tmp_path / 'iss.tle').write_text(f'ISS\n{LeoPassParameters().line_1}\n{LeoPassParameters().line_2}\n')
    given = ('trials', 'leo_pass', '--tle', 'iss.tle', '--station', '47.5,8.4,600', '--pass')
    code, output, errors = pedestal(*given, UTC, '--runs', '1', '--duration', '2', '--workers', '1')
    assert code == 0 and 'highest 5' in output and 'UTC on, 2 s' in output, errors
    assert re.search(r'--duration 2.0 .*start_time=\"2019-12-10T12:3\d:\d\dZ\"', output)
    code, _, errors = pedestal(*given, 'list')
    assert code == 2 and '--pass list: must be next, N or a UTC; pedestal run --pass list prints' in errors


@pytest.mark.thorough
def test_a_short_run_of_a_pass_of_a_tle_file_is_about_its_culmination(start_run, tmp_path):
    tle = tmp_path / 'iss.tle'
    tle.write_text(f'ISS\n{LeoPassParameters().line_1}\n{LeoPassParameters().line_2}\n')
    run = start_run('leo_pass', '--tle', tle, '--station', '47.5,8.4,600', '--pass', UTC, '--duration', '1')
    done = run.finish()
    assert done.returncode == 0, done.stderr
    line = re.search(r'rises 2019-12-10 12:3\d:\d\d UTC in azimuth \d+ deg, highest (5\d\.\d) deg .*; the run is '
                     r'from (12:3\d:\d\d) UTC on, 1 s', done.stdout)
    assert line and f'0 s is 2019-12-10 {line[2]} UTC; the satellite is highest in this run, {line[1]}' in done.stdout
    sections = yaml.safe_load(bags.read(run.bag).configuration['scenario'])
    assert 'scenario.program.time_offset = 0 s in place of 0.2 s, which belongs to the satellite of leo_pass' in (
        done.stdout.splitlines())
    assert sections['scenario']['ros__parameters']['program.time_offset'] == 0.0
    made = sections['tracking_receiver']['ros__parameters']
    assert made['target.leo_pass.start_time'] == f'2019-12-10T{line[2]}Z'
    assert made['target.station.latitude_deg'] == 47.5
    known = sections['acu']['ros__parameters']
    assert known['prediction.line_1'] == LeoPassParameters().line_1                   # mode tle knows it too
    assert known['prediction.start_time'] == f'2019-12-10T{line[2]}Z'
    assert known['prediction.station.latitude_deg'] == 47.5


def test_own_elements_end_the_prediction_errors_of_the_scenario_but_no_given_one(tmp_path, capsys):
    tle = tmp_path / 'iss.tle'
    tle.write_text(f'ISS\n{LeoPassParameters().line_1}\n{LeoPassParameters().line_2}\n')
    for scenario_name, change, expected in (
            ('leo_pass', '0.5', (0.5, 0.0, 0.0)), ('geo_station', '', (0.0, 0.0, 0.0))):
        given = ('--param', f'scenario.program.time_offset={change}') if change else ()
        options = cli._parser().parse_args(['run', scenario_name, '--tle', str(tle), '--pass', UTC, *given])
        program = run_verb._chosen(options).header.program
        assert (program.time_offset, program.azimuth_offset, program.elevation_offset) == expected
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith('scenario.')]
    assert lines == [f'scenario.program.{axis}_offset = 0 rad in place of {value} rad, which belongs to the satellite '
                     'of geo_station' for axis, value in (('azimuth', '0.003'), ('elevation', '-0.002'))]


@pytest.mark.thorough
def test_a_pass_is_tracked_until_it_sets():
    """From the second in which it rises; the receiver locks as soon as the satellite is near enough."""
    pass_of = satellite.PassSelection(scenario.draft('leo_pass'), NOW)
    start, duration, line = pass_of.choose('2')
    assert 'the run is' not in line
    run = closed_loop.Loop(scenario.load('leo_pass', start, duration=duration)).run()
    east, north, up = run['target/truth']['position'].T
    elevation = np.degrees(np.arctan2(up, np.hypot(east, north)))
    assert abs(elevation[0]) < 0.1 and -0.1 < elevation[-1] < 0.05 and elevation.max() > 30.0
    tracked = run['acu/mode'] == Mode.AUTOTRACK
    assert tracked[elevation > 20.0].mean() > 0.99 and tracked.mean() > 0.4


PASS = ('2019-12-10T10:56:30', '2019-12-10T11:01:44', '2019-12-10T11:07:02')
"""Rise, culmination and set of pass 3 of the list of leo_pass [UTC, cut to seconds]."""


@pytest.mark.parametrize('which, duration, start, begin, length', [
    ('3', None, None, PASS[0], 633.0), ('3', 700.0, None, PASS[0], 700.0),
    ('3', 60.0, None, '2019-12-10T11:01:14', 60.0), ('3', 630.0, None, '2019-12-10T10:56:30', 630.0),
    ('2019-12-10T10:00', 60.0, None, '2019-12-10T11:01:14', 60.0),
    ('2019-12-10T11:03', 60.0, None, '2019-12-10T11:03:00', 60.0),
    ('2019-12-10T11:03', None, None, '2019-12-10T11:03:00', 243.0),
    ('3', 60.0, '+280', '2019-12-10T11:01:10', 60.0), ('3', None, '+280', '2019-12-10T11:01:10', 353.0),
    (None, 60.0, '2019-12-10T11:03', '2019-12-10T11:03:00', 60.0),
    ('3', 400.0, '2019-12-10T10:50', '2019-12-10T10:50:00', 400.0)])
def test_a_run_of_a_pass_begins_where_it_matters(which, duration, start, begin, length):
    """`pedestal run` and the library choose the same run."""
    options = [part for name, value in (('--pass', which), ('--duration', duration), ('--start', start))
               if value is not None for part in (name, str(value))]
    chosen = run_verb._chosen(cli._parser().parse_args(['run', 'leo_pass', *options]))
    times = chosen.node_parameters('tracking_receiver').target.leo_pass.start_time
    assert (times[:19], chosen.header.duration) == (begin, length)
    assert pedestal.load('leo_pass', duration=duration, which=which, start=start).checked == chosen


def test_the_horizon_mask_of_the_receiver_is_that_of_rise_and_set():
    mask = ['tracking_receiver.receiver.horizon_mask=0.349065850']
    selection = satellite.PassSelection(scenario.draft('leo_pass').changed(mask), NOW)
    texts, duration, line = selection.choose('2019-12-10T12:00')
    run = pedestal.load('leo_pass', {'tracking_receiver.receiver.horizon_mask': np.radians(20.0)},
                        which='2019-12-10T12:00').checked
    assert f'start_time="{run.node_parameters("tracking_receiver").target.leo_pass.start_time}"' in texts[0]
    assert duration == run.header.duration == 251.0 and ' in azimuth 56 deg (at 20 deg)' in line
    built = Plan(run)
    _, elevation, _ = target.look_angles(built.targets[''], [0.0, duration])
    assert np.degrees(elevation) == pytest.approx([20.0, 20.0], abs=0.2)
    assert not any('rises' in text or 'sets' in text for text in built.announced())


@pytest.mark.parametrize('options, text', [
    (('--pass', '3', '--start', '+900'), 'a run from 2019-12-10 11:11:30 UTC on misses the pass, which rises'),
    (('--start', '2019-12-10T10:00', '--duration', '30'), 'and last until the rise'),
    (('--start', '2019-12-10T02:30'), 'at most 3600 s before the rise'),
    (('--pass', '3', '--start', '+x'), '--start +x: must be a UTC such as 2019-12-10T12:35, or +SECONDS after the'),
    (('--pass', '3', '--start', 'soon'), "--start = 'soon': must be UTC as ISO 8601, for example "
     '2019-12-10T06:00:00; or +SECONDS after the rise'),
    (('--start', '2019-12-10T11:03', '--param', 'tracking_receiver.target.leo_pass.start_time=2019-12-10T00:00'),
     '--start 2019-12-10T11:03: sets tracking_receiver.target.leo_pass.start_time, which is also given'),
    (('--pass', 'list', '--start', '+5'), '--start: has no effect with --pass list')])
def test_a_start_outside_the_pass_is_refused(options, text):
    with pytest.raises(ValueError, match=re.escape(text)):
        run_verb._chosen(cli._parser().parse_args(['run', 'leo_pass', *options]))


def test_a_program_track_is_that_of_its_station():
    from pedestal.verbs import operate
    tables = []
    for more in ((), ('--station', '47.4,8.5,500'), ('--station=-33.9,18.4,10',)):
        options = cli._parser().parse_args(['program', 'leo_pass', '--duration', '10', *more])
        tables.append(operate.program_plan(options).tables[''][1])
    assert np.array_equal(tables[0], tables[1]) and not np.allclose(tables[0], tables[2], atol=0.1)


def test_the_initial_mode_tle_waits_for_the_rise(tmp_path):
    """43 s after the start. A command before the rise is refused (test_stow_tle_sun.py)."""
    tle = tmp_path / 'iss.tle'
    tle.write_text(f'ISS\n{LeoPassParameters().line_1}\n{LeoPassParameters().line_2}\n')
    run = pedestal.run(pedestal.load('leo_pass', {'acu.initial_mode': 'tle', 'scenario.program.source': 'none'},
                                     tle=tle, start='2019-12-10T12:32:20', duration=45.0))
    [begun] = run['acu/mode']['t'][np.array(run['acu/mode']['data']) == 'tle']
    assert begun == pytest.approx(43.1, abs=0.1)
