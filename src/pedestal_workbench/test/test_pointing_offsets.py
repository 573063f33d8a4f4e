"""Files of pointing offsets: valid files of each format, and broken files, whose error names place and range."""
import json

import katpoint
import numpy as np
import pytest

from pedestal import cli
from pedestal_bringup.scenario import files, scenario
from pedestal_common.geometry import pointing_report
from pedestal_common.text_files import csv_table
from pedestal_workbench.calibration import offsets, terms

NAMES = 'az_deg', 'el_deg', 'cross_elevation_deg', 'elevation_deg', 'sigma_deg'
TERMS = {'P1': .1, 'P3': .02, 'P4': .03, 'P5': .015, 'P6': -.01, 'P7': .05, 'P8': -.04}
ROWS = [(350.0, 20.0, 0.05, 0.04, 0.002), (12.5, 70.0, -0.01, 0.03, 0.003), (-100.0, 45.0, 0.02, -0.02, 0.002)]


def table(rows=ROWS, names=NAMES, separator=','):
    return '\n'.join(separator.join(map(str, cells)) for cells in (names, *rows)) + '\n'


def read(tmp_path, content):
    path = tmp_path / 'offsets.csv'
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return offsets.read(path)


@pytest.mark.parametrize('content', [
    table(), table(separator=';'), table(separator='\t'), '\ufeff' + table(), table().replace('\n', '\r\n'),
    table(separator=';').replace('.', ','), '# measured 2026-11-26\n' + table(), table().encode('utf-16'),
    table(separator=' '), table([(*row, 'a') for row in ROWS], (*NAMES, 'note')),
    table(names=('az', 'el', 'd_xel', 'd_el', 'sigma'), separator=' '),
    table(names=('az_deg', 'el_deg', 'Cross-Elevation [deg]', 'elevation_deg', 'sigma_deg')),
    table([tuple(np.radians(row)) for row in ROWS], [name.replace('deg', 'rad') for name in NAMES])])
def test_each_dialect_gives_the_same_offsets(tmp_path, content):
    found = read(tmp_path, content)
    np.testing.assert_allclose(np.column_stack((found.directions, found.values, found.sigma[:, 0])), ROWS, atol=1e-12)
    assert found.has_sigma and found.format == 'CSV'


def test_a_file_without_sigma_has_equal_weights(tmp_path):
    found = read(tmp_path, table([row[:4] for row in ROWS], NAMES[:4]))
    assert not found.has_sigma and np.all(found.sigma == 1.0)


def changed(column, value, line=3):
    rows = [list(row) for row in ROWS]
    rows[line - 2][NAMES.index(column)] = value
    return table(rows)


@pytest.mark.parametrize('content, message', [
    ('', 'the file is empty; it must have a line with the names of the columns'), ('\n \n', 'the file is empty'),
    (table([]), '0 offsets, must be at least 1'),
    (changed('el_deg', 'nan'), 'line 3: el_deg = nan: must be -5 to 90'),
    (changed('az_deg', 'inf'), 'line 3: az_deg = inf: must be -360 to 540'),
    (changed('az_deg', 1000), 'line 3: az_deg = 1000: must be -360 to 540'),
    (changed('el_deg', 90.5), 'line 3: el_deg = 90.5: must be -5 to 90'),
    (changed('el_deg', 'high'), "line 3: el_deg = 'high': must be a number"),
    (changed('elevation_deg', ''), "line 3: elevation_deg = '': must be a number"),
    (changed('cross_elevation_deg', 120), 'line 3: cross_elevation_deg = 120: must be -5 to 5'),
    (changed('sigma_deg', 0), 'line 3: sigma_deg = 0: must be 1e-09 to 5'),
    (changed('sigma_deg', -0.1), 'line 3: sigma_deg = -0.1: must be 1e-09 to 5'),
    (table().replace('\n12.5,70.0,-0.01,0.03,0.003', '\n12.5,70.0'), 'line 3: the row ends before the column '
                                                                     "'cross_elevation_deg'"),
    (table().replace('0.003\n', '0.003,7\n'), 'line 3: 6 cells, must be 5'),
    (table([row[:3] for row in ROWS], NAMES[:3]), "line 1: column 'elevation_deg' is missing; columns found: "
                                                  "'az_deg'"),
    (table(names=('azimuth', *NAMES[1:])), "line 1: column 'azimuth': must end with a known unit to be taken as "),
    (table(names=('az_arcsec', *NAMES[1:])), "column 'az_arcsec': must end with a known unit"),
    (table(names=(*NAMES[:4], 'az_rad')), "columns 'az_deg' and 'az_rad': only one of them may be the az_deg"),
    (table([*ROWS, ROWS[1]]), 'line 5: az_deg = 12.5, el_deg = 70, offsets -0.01 and 0.03 deg: repeats line 3'),
    (table([(0.1 * i, 0.05 * i, 0.01, 0.01, 0.001) for i in range(1, 20)]), 'the angles are radians'),
    (b'PK\x03\x04' + bytes(60), 'offsets.csv: '), (b'\xff\xd8\xff\xe0' + bytes(range(60)), 'offsets.csv: ')])
def test_a_broken_file_is_refused_with_the_place(tmp_path, content, message):
    with pytest.raises(csv_table.TableError) as raised:
        read(tmp_path, content)
    assert message in str(raised.value) and str(raised.value).startswith(f'{tmp_path}/offsets.csv: ')
    assert '\n' not in str(raised.value)


KATPOINT = """# antenna = ant1, -30:43:17.3, 21:24:38.5, 1038.0, 12.0, 18.4 -8.7 0.0, , 1.22
dataset, target, timestamp_ut, azimuth, elevation, delta_azimuth, delta_azimuth_std, delta_elevation, \
delta_elevation_std, data_unit
1337890, Virgo A, 2012-05-24 20:05:31.000, 30.0, 60.0, 0.0600000, 0.0020000, -0.0100000, 0.0010000, Jy
1337891, Hydra A, 2012-05-25 01:12:02.000, -45.0, 25.0, 0.0500000, 0.0030000, 0.0200000, 0.0010000, Jy
"""


def test_a_file_of_katpoint_holds_offsets_of_the_axes(tmp_path):
    found = read(tmp_path, KATPOINT)
    assert (found.format, found.date, found.has_sigma) == ('katpoint', '2012-05-25', True)
    cosine = np.cos(np.radians([60.0, 25.0]))
    np.testing.assert_allclose(found.directions, [[30.0, 60.0], [-45.0, 25.0]])
    np.testing.assert_allclose(found.values, np.column_stack((cosine * [0.06, 0.05], [-0.01, 0.02])))
    np.testing.assert_allclose(found.sigma, np.column_stack((cosine * [0.002, 0.003], [0.001, 0.001])))
    assert found.places == ['line 3', 'line 4']


@pytest.mark.parametrize('content, message', [
    (KATPOINT.replace('60.0, 0.06', '91.0, 0.06'), 'line 3: elevation = 91: must be -5 to 90'),
    (KATPOINT.replace('0.0020000', 'nan'), 'line 3: delta_azimuth_std = nan: must be 0 to 10'),
    (KATPOINT.replace('0.0020000', '0.0'), 'line 3: delta_azimuth_std or delta_elevation_std = 0: must be above 0')])
def test_a_broken_file_of_katpoint_is_refused(tmp_path, content, message):
    with pytest.raises(csv_table.TableError, match=message):
        read(tmp_path, content)


def test_a_file_of_katpoint_without_estimated_sigma_has_equal_weights(tmp_path):
    zero = KATPOINT.replace('0.0020000', '0').replace('0.0030000', '0').replace('0.0010000', '0')
    assert not read(tmp_path, zero).has_sigma


TPOINT = """! Caption record:
7 m station
: ALTAZ
! Run parameters: latitude
47 21 36.0 2026 11 26
30.0 60.0 30.06 59.99 12.0
350.0 25.0 -9.95 25.02
END
after the end
"""


def test_a_file_of_tpoint_holds_sky_and_mount(tmp_path):
    found = read(tmp_path, TPOINT)
    assert (found.format, found.date, found.places) == ('TPOINT', '2026-11-26', ['line 6', 'line 7'])
    cosine = np.cos(np.radians([60.0, 25.0]))
    np.testing.assert_allclose(found.directions, [[30.0, 60.0], [-10.0, 25.0]])
    np.testing.assert_allclose(found.values, np.column_stack((cosine * [0.06, 0.05], [-0.01, 0.02])))


def test_a_file_of_tpoint_may_count_the_azimuth_from_south(tmp_path):
    found = read(tmp_path, '! South = 0, East = 90\n' + TPOINT)
    np.testing.assert_allclose(found.directions[:, 0], [150.0, 190.0])
    np.testing.assert_allclose(found.values[:, 0], np.cos(np.radians([60.0, 25.0])) * [-0.06, -0.05])


@pytest.mark.parametrize('comment, begin', [
    ('rms residual s = 0.4 arcsec', 'north, because no comment'), ('wind from s=0 m/s', 'north, because no comment'),
    ('n = 0 rejected', 'north, because no comment'), ('seen south = 0.5 mm of rain', 'north, because no comment'),
    ('azimuth is measured from south', 'south, as line 1'), ('Az: N=0, E=90', 'north, as line 1'),
    ('converted (South = 0, East=90)', 'south, as line 1'), ('S = 0, W = 90', 'south, as line 1'),
    ('North = 0 deg', 'north, as line 1')])
def test_only_a_comment_on_the_azimuth_states_where_it_begins(tmp_path, comment, begin):
    found = read(tmp_path, f'! {comment}\n' + TPOINT)
    assert found.directions[0, 0] == pytest.approx(150.0 if begin.startswith('south') else 30.0)
    assert found.notes[0].startswith(f'TPOINT: the azimuth counts from {begin}')


def test_the_mount_of_a_file_of_tpoint_states_the_turn_of_the_wrap(tmp_path):
    found = read(tmp_path, TPOINT.replace('30.0 60.0 30.06', '30.0 60.0 390.06'))
    assert found.directions[0, 0] == pytest.approx(390.0)


def test_a_date_in_the_future_is_no_date_of_the_measurement(tmp_path):
    path = tmp_path / 'offsets.csv'
    path.write_text('# measured 2026-11-20\n# next service 2030-05-01\n' + table())
    assert offsets.read(path, '2026-11-26').date == '2026-11-20'
    with pytest.raises(ValueError, match='must not be later than today, 2026-11-26'):
        offsets.valid_date('2026-11-27', '2026-11-26')


@pytest.mark.parametrize('content, message', [
    ('! South = 0\n! azimuth is measured from north\n' + TPOINT, 'from north by line 2 and from south by line 1'),
    (TPOINT.replace('47 21 36.0 2026 11 26\n', ''), 'line 5: begins with 30.0 60.0 30.06: the first line of numbers '
                                                    'must be the run parameters'),
    (TPOINT.replace('ALTAZ', 'EQUAT'), 'must have the option `: ALTAZ`, .*; options found: EQUAT'),
    (TPOINT.replace('30.0 60.0 30.06 59.99 12.0', '30.0 60.0 30.06'), 'line 6: 3 numbers, must be at least 4'),
    (TPOINT.replace('59.99', '71.0'), 'line 6: elevation of the mount minus that on the sky = 11 deg: must be -5 to'),
    (TPOINT.replace('59.99 12.0', '59.99 rad'), "line 6: 'rad': must be a number; all angles are in deg"),
    (TPOINT.replace('60.0', 'nan'), 'line 6: elevation = nan: must be -5 to 90'),
    (TPOINT.replace('30.06', 'east'), "line 6: azimuth of the mount = 'east': must be a number"),
    ('! only a comment\n: ALTAZ\n', '0 offsets, must be at least 1')])
def test_a_broken_file_of_tpoint_is_refused(tmp_path, content, message):
    with pytest.raises(csv_table.TableError, match=message):
        read(tmp_path, content)


def station(count=40):
    """Return rows of offsets that katpoint computes for TERMS."""
    rng = np.random.default_rng(1)
    az, el = rng.uniform(0.0, 360.0, count), rng.uniform(10.0, 80.0, count)
    values = np.zeros(22)
    values[[int(name[1:]) - 1 for name in TERMS]] = np.radians(list(TERMS.values()))
    d_az, d_el = katpoint.PointingModel(values).offset(np.radians(az), np.radians(el))
    noise = 0.002 * rng.normal(size=(count, 2))
    return [(*row, 0.002) for row in np.column_stack((
        az, el, np.degrees(d_az) * np.cos(np.radians(el)) + noise[:, 0], np.degrees(d_el) + noise[:, 1])).tolist()]


def test_the_verb_prints_rows_and_writes_a_parameter_file(tmp_path, capfd):
    file = tmp_path / 'offsets.csv'
    file.write_text(table(station()))
    given = ['calibrate', 'pointing', '--offsets', str(file), '--json', '-', '--date', '2026-11-26', '--antenna',
             'dish', '--output', str(tmp_path / 'model.yaml'), '--report', str(tmp_path / 'page.html')]
    assert cli.main(given) == 0
    content = json.loads(capfd.readouterr().out)
    rows = {row['metric']: row for row in content['rows']}
    assert {row['case'] for row in content['rows']} == {'pointing'}
    for name, value in TERMS.items():
        row = rows[name]
        assert row['unit'] == 'deg' and row['ci_low'] < row['value'] < row['ci_high'] and row['runs'] == 40
        assert abs(row['value'] - value) < 2.0 * (row['ci_high'] - row['ci_low'])
    assert 0.001 < rows['residual_rms_deg']['value'] < rows['leave_one_out_rms_deg']['value'] < 0.003
    changes = files.file_overrides(tmp_path / 'model.yaml')
    model = scenario.load('station_new', changes).node_parameters('acu').pointing
    assert abs(model.p1 - rows['P1']['value']) < 1e-8 and model.p22 == 0.0
    assert (model.file, model.date, model.antenna) == ('model.yaml', '2026-11-26', 'dish')
    assert abs(model.rms - rows['residual_rms_deg']['value']) < 1e-8
    residuals = np.array(pointing_report.residual_rows(model.residuals))
    assert residuals.shape == (40, 4) and np.ptp(residuals[:, 0]) > 200.0
    assert np.sqrt((residuals[:, 2:]**2).mean()) == pytest.approx(model.rms, abs=5e-5)
    page = (tmp_path / 'page.html').read_text()
    assert page.count('<svg') == 3 and 'P8' in page and 'src=' not in page
    assert cli.main(given) == 2      # the files are not overwritten
    assert 'model.yaml: exists already; the file is not overwritten' in capfd.readouterr().err


@pytest.mark.parametrize('given, message', [
    (['--terms', 'P2'], '--terms P2: P2 does not exist for this mount'),
    (['--terms', 'P23'], '--terms P23: must be one of'),
    (['--terms', ''], '--terms: must name at least one of'), (['--terms', 'P1,p1'], '--terms P1: is given twice'),
    (['--date', '26.11.2026'], '--date 26.11.2026: must be a date such as 2026-11-26'),
    (['--scenario', 'leo_pass'], '--scenario: has no effect with --offsets'),
    (['--output', '/no/such/folder/a.yaml'], 'must be a file in a directory that exists')])
def test_a_wrong_option_is_refused(tmp_path, capsys, given, message):
    file = tmp_path / 'offsets.csv'
    file.write_text(table(station()))
    assert cli.main(['calibrate', 'pointing', '--offsets', str(file), *given]) == 2
    assert message in capsys.readouterr().err


def test_no_output_replaces_measurements_or_another_output(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / 'offsets.csv'
    file.write_text(table(station()))
    for given, message in ((('--json', './offsets.csv'), '--json offsets.csv: exists already and holds no JSON'),
                           (('--output', 'x', '--report', './x'), '--output x: is also the file of --report'),
                           (('--output', 'x', '--json', tmp_path / 'x'), '--output x: is also the file of --json'),
                           (('--output', '-'), '--output -: must be the name of a file')):
        assert cli.main(['calibrate', 'pointing', '--offsets', str(file), *map(str, given)]) == 2
        assert message in capsys.readouterr().err
    assert file.read_text() == table(station()) and list(tmp_path.iterdir()) == [file]
    assert cli.main(['calibrate', 'pointing', '--offsets', str(file), '--json', 'x']) == 0
    assert cli.main(['calibrate', 'pointing', '--offsets', str(file), '--json', 'x']) == 0      # it holds JSON


def test_the_encoder_of_p12_counts_the_turns(tmp_path, capsys):
    file = tmp_path / 'offsets.csv'
    file.write_text(table(station()))
    assert cli.main(['calibrate', 'pointing', '--offsets', str(file), '--terms', '1,4,5,6,7,12', '--keep-all']) == 0
    assert 'P12: the azimuths must state the turn of the wrap' in capsys.readouterr().out


def test_too_few_offsets_are_refused_with_the_file(tmp_path, capsys):
    file = tmp_path / 'offsets.csv'
    file.write_text(table(station(6)))
    assert cli.main(['calibrate', 'pointing', '--offsets', str(file)]) == 2
    assert f'pedestal: error: {file}: 6 points, must be at least 10 for 7 terms' in capsys.readouterr().err
    assert cli.main(['calibrate', 'pointing', '--offsets', str(tmp_path / 'none.csv')]) == 2
    assert 'none.csv: No such file or directory' in capsys.readouterr().err


def test_a_plan_stays_within_the_travel_of_a_scenario(tmp_path, capsys):
    assert cli.main(['calibrate', 'pointing', '--plan', '20', '--scenario', 'station_real']) == 0
    head, names, *rows = capsys.readouterr().out.splitlines()
    assert head.startswith('# 20 directions') and names == 'az_deg,el_deg' and len(rows) == 20
    assert cli.main(['calibrate', 'pointing', '--plan', '20', '--output', str(tmp_path / 'plan.csv')]) == 0
    assert len((tmp_path / 'plan.csv').read_text().splitlines()) == 22
    assert cli.main(['calibrate', 'pointing', '--plan', '9']) == 2
    assert '--plan 9: must be 10 to 500' in capsys.readouterr().err


def test_the_terms_of_the_fit_are_those_of_the_law():
    from pedestal_common.geometry import pointing_model
    assert tuple(name.lower() for name in terms.TERM_BY_NAME) == pointing_model.TERMS
    assert tuple(term.name.lower() for term in terms.TERMS if term.factor) == pointing_model.FACTORS
