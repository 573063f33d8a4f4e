"""A satellite and a station of one's own, from the command line into the recording."""
import datetime
import re

import numpy as np
import pytest
import yaml

from acu_tracker.modes import Mode
from pedestal import cli, satellite
from pedestal.verbs import run as run_verb
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_recording import bag as bags
from tracking_receiver_sim.params import LeoPassParameters

UTC = '2019-12-10T12:35'
NOW = datetime.datetime(2019, 12, 10)


def test_passes_are_listed(capsys):
    assert cli.main(['run', 'leo_pass', '--pass', 'list', '--station=-33.9,18.4,10']) == 0
    old, head, _, *rows = capsys.readouterr().out.splitlines()
    assert old.startswith('the TLE of satellite 25544 is of 2019-12-09') and 'height 10 m' in head
    assert [row.split()[0] for row in rows] == [str(n) for n in range(1, 1 + len(rows))] and len(rows) > 10


@pytest.mark.thorough
def test_a_pass_of_a_tle_file_is_run_from_its_rise(start_run, tmp_path):
    tle = tmp_path / 'iss.tle'
    tle.write_text(f'ISS\n{LeoPassParameters().line_1}\n{LeoPassParameters().line_2}\n')
    run = start_run('leo_pass', '--tle', tle, '--station', '47.5,8.4,600', '--pass', UTC, '--duration', '1')
    done = run.finish()
    assert done.returncode == 0, done.stderr
    rise = re.search(r'rises (2019-12-10) (12:3\d:\d\d) UTC in azimuth \d+ deg, highest (5\d\.\d) deg', done.stdout)
    assert rise and f'0 s is {rise[1]} {rise[2]} UTC' in done.stdout
    sections = yaml.safe_load(bags.read(run.bag).configuration['scenario'])
    assert 'scenario.program.time_offset = 0 s in place of 0.2 s, which belongs to the satellite of leo_pass' in (
        done.stdout.splitlines())
    assert sections['scenario']['ros__parameters']['program.time_offset'] == 0.0
    made = sections['tracking_receiver']['ros__parameters']
    assert made['target.leo_pass.start_time'] == f'{rise[1]}T{rise[2]}Z'
    assert made['target.station.latitude_deg'] == 47.5
    known = sections['acu']['ros__parameters']
    assert known['prediction.line_1'] == LeoPassParameters().line_1                   # mode tle knows it too
    assert known['prediction.start_time'] == f'{rise[1]}T{rise[2]}Z'
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
    start, duration, _ = pass_of.choose('2')
    run = closed_loop.Loop(scenario.load('leo_pass', start, duration=duration)).run()
    east, north, up = run['target/truth']['position'].T
    elevation = np.degrees(np.arctan2(up, np.hypot(east, north)))
    assert abs(elevation[0]) < 0.1 and -0.1 < elevation[-1] < 0.05 and elevation.max() > 30.0
    tracked = run['acu/mode'] == Mode.AUTOTRACK
    assert tracked[elevation > 20.0].mean() > 0.99 and tracked.mean() > 0.4
