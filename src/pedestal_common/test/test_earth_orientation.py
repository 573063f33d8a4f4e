"""The file finals2000A of the IERS: its values, its leap seconds, its ends, its gaps, and files that are none."""
import numpy as np
import pytest

from pedestal_common.geometry.earth_orientation import ARCSECOND_RAD, EarthOrientationParameters, load
from pedestal_common.parameters import ParameterError


def row(mjd, ut1, flag='I', x=0.1, y=0.3):
    return (f'{"":7}{mjd:8.2f} {flag} {x:9.6f}{0:9.6f} {y:9.6f}{0:9.6f}  {flag}{ut1:10.7f}{0:10.7f}'.ljust(187))


@pytest.fixture
def written(tmp_path):
    def write(*rows):
        file = tmp_path / 'finals2000A.all'
        file.write_text('\n'.join(rows) + '\n')
        return EarthOrientationParameters(file=str(file))
    return write


def test_values_are_interpolated(written):
    orientation = load(written(row(58827.0, -0.1), row(58828.0, -0.2, x=0.2, y=0.1), row(58829.0, -0.3, 'P')))
    ut1, pole = orientation.at(np.array([58827.0, 58827.5, 58828.25]))
    assert ut1 == pytest.approx([-0.1, -0.15, -0.225])
    assert pole / ARCSECOND_RAD == pytest.approx(np.array([[0.1, 0.3], [0.15, 0.2], [0.175, 0.15]]))
    assert orientation.problem(58827.5, 10.0) == ''
    assert orientation.description(58828.5) == ('finals2000A.all, measured until 2019-12-11, age 0.5 d, predicted '
                                                'until 2019-12-12')


def test_a_leap_second_is_not_interpolated(written):
    """The leap second at the end of 2016: UT1 - UTC jumps from -0.408 s to 0.591 s."""
    orientation = load(written(row(57753.0, -0.4078), row(57754.0, 0.5913), row(57755.0, 0.5904)))
    ut1, _ = orientation.at(np.array([57753.0, 57753.9999, 57754.0, 57755.0]))
    assert ut1 == pytest.approx([-0.4078, -0.4087, 0.5913, 0.5904], abs=1e-5)


def test_outside_the_file_the_nearest_row_holds_and_is_named(written):
    orientation = load(written(row(58827.0, -0.1), row(58828.0, -0.2, x=0.2)))
    ut1, pole = orientation.at(np.array([50000.0, 58827.0, 58828.0, 58828.001, 70000.0]))
    assert ut1.tolist() == [-0.1, -0.1, -0.2, -0.2, -0.2]
    assert pole[-1, 0] == pole[2, 0]
    assert orientation.problem(58826.0, 60.0) == ('finals2000A.all begins on 2019-12-10, in the future; its first row '
                                                  'holds')
    assert orientation.problem(58830.0, 60.0) == 'finals2000A.all expired on 2019-12-11; its last row holds'


def test_a_gap_and_an_old_measurement_are_named(written):
    orientation = load(written(row(58827.0, -0.1), row(58831.0, -0.2), row(58832.0, -0.2, 'P'),
                               row(58990.0, 0.0, 'P')))
    assert orientation.problem(58827.5, 60.0) == ('finals2000A.all has no rows between 2019-12-10 and 2019-12-14; the '
                                                  'values are interpolated')
    assert orientation.at(np.array([58829.0]))[0] == pytest.approx([-0.15])
    assert orientation.problem(58831.5, 60.0) == ''
    old = load(written(row(58830.0, -0.1), *(row(58830.0 + i, -0.1, 'P') for i in range(1, 100))))
    assert old.age(58900.5) == 70.5
    assert old.problem(58900.5, 60.0) == ('finals2000A.all is measured until 2019-12-13, 70.5 d ago, must be at most '
                                          '60 d; its predicted rows are used')


def test_days_without_values_are_left_out(written):
    assert load(written(row(58827.0, -0.1), row(58828.0, -0.2), f'{"":7}58829.00'.ljust(187))).mjd.tolist() == [
        58827.0, 58828.0]


@pytest.mark.parametrize('rows, text', [
    (['time,ut1,x,y'], "line 1: MJD '1,x,y': must be 41000 to 100000 in columns 8 to 15 of finals2000A"),
    ([row(58827.0, -0.1), row(58828.0, -0.2)[:50]], 'line 2: .* is no whole row'),
    ([row(58827.0, -0.1), row(58828.0, 7.0)], "line 2: UT1 - UTC '7.0000000': must be -1 to 1 s"),
    ([row(58827.0, float('nan')), row(58828.0, 0.1)], "line 1: UT1 - UTC 'nan': must be -1 to 1 s"),
    ([row(58827.0, -0.1, x=5.0), row(58828.0, 0.1)], "line 1: polar motion x '5.000000': must be -2 to 2 arcsec"),
    ([row(58827.0, -0.1).replace('58827', 'ab827'), row(58828.0, 0.1)], "MJD 'ab827.00': must be 41000 to 100000"),
    ([row(58828.0, -0.1), row(58828.0, -0.1)], 'line 2: MJD 58828: must be after 58828'),
    ([row(58828.0, -0.1)], '1 rows, .* must have at least 2 rows'),
    ([row(58828.0, -0.1, 'P'), row(58829.0, -0.1, 'P')], 'one of them measured')])
def test_a_file_that_is_none_is_refused_by_name(written, rows, text):
    with pytest.raises(ParameterError, match=text):
        load(written(*rows))


def test_a_file_that_is_missing_or_no_text_is_refused(tmp_path):
    with pytest.raises(ParameterError, match='earth_orientation.file = .*: No such file'):
        load(EarthOrientationParameters(file=str(tmp_path / 'none')))
    with pytest.raises(ParameterError, match='not a regular file'):
        load(EarthOrientationParameters(file=str(tmp_path)))
    (tmp_path / 'binary').write_bytes(b'\xff\xfe' * 200)
    with pytest.raises(ParameterError, match='is no text'):
        load(EarthOrientationParameters(file=str(tmp_path / 'binary')))
    assert load(EarthOrientationParameters()) is None


def test_a_changed_file_is_read_again(written):
    first = load(written(row(58827.0, -0.1), row(58828.0, -0.2)))
    assert load(written(row(58827.0, -0.1), row(58828.0, -0.2))).name == first.name
    assert len(load(written(row(58827.0, -0.1), row(58828.0, -0.2), row(58829.0, -0.3))).mjd) == 3
