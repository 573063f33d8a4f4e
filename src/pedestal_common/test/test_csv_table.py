"""Tables of every dialect hold the same rows; columns are taken by their whole names; content that is no text."""
import bz2
import gzip
import io
import lzma
import zipfile

import pytest

from pedestal_common.text_files import columns, csv_table, files

PLAIN = 'time_s,roll_deg,note\n0,1.25,a\n1,-2.5,b\n2,3.75,c\n'
ROWS = [[0.0, 1.25], [1.0, -2.5], [2.0, 3.75]]
COLUMNS = {'time_s': (-1e12, 1e12), 'roll_deg': (-80.0, 80.0)}
EUROPEAN = PLAIN.replace('.', ';').replace(',', 'C').replace(';', ',').replace('C', ';')


def read(tmp_path, data, **options):
    path = tmp_path / 'table.csv'
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return csv_table.read(path, COLUMNS, **options).numbers.tolist()


def refused(tmp_path, data, **options):
    with pytest.raises(csv_table.TableError) as raised:
        read(tmp_path, data, **options)
    assert str(raised.value).startswith(f'{tmp_path}/table.csv: ') and '\n' not in str(raised.value)
    return str(raised.value)


DIALECTS = {
    'plain': PLAIN, 'crlf': PLAIN.replace('\n', '\r\n'), 'mark': '\ufeff' + PLAIN, 'blanks': PLAIN.replace(',', ' , '),
    'semicolon': PLAIN.replace(',', ';'), 'tab': PLAIN.replace(',', '\t'), 'bar': PLAIN.replace(',', '|'),
    'columns of blanks': PLAIN.replace(',', '   '), 'comma': EUROPEAN, 'comma and tab': EUROPEAN.replace(';', '\t'),
    'sep': 'sep=;\n' + EUROPEAN, 'capitals': PLAIN.upper(), 'quotes': '"time_s", "roll_deg","note"\n' + PLAIN[21:],
    'comment': '# a logger; of mine\n\n' + PLAIN, 'percent': '% a\n' + PLAIN, 'end': PLAIN + '\n,,\n  \n# the end\n',
    'title': 'Report of a ship\n\n' + PLAIN,
    'camel': PLAIN.replace('time_s', 'timeSec').replace('roll_deg', 'RollDeg'),
    'trailing comma': PLAIN.replace('\n', ',\n'), 'names in a comment': '# made by numpy\n# ' + PLAIN,
    'units': PLAIN.replace('time_s', 'Time [s]').replace('roll_deg', 'Roll (°)'),
    'utf-16': PLAIN.encode('utf-16'), 'utf-16 big': b'\xfe\xff' + PLAIN.encode('utf-16-be'),
    'windows': PLAIN.replace('_deg', ' [°]').encode('cp1252'),
    'milliseconds': PLAIN.replace('time_s', 'time_ms').replace('\n1,', '\n1000,').replace('\n2,', '\n2000,')}


@pytest.mark.parametrize('name', DIALECTS)
def test_each_dialect_holds_the_same_rows(tmp_path, name):
    assert read(tmp_path, DIALECTS[name]) == ROWS


@pytest.mark.parametrize('data, message', [
    (PLAIN.replace('roll', 'pitch'), "line 1: column 'roll_deg' is missing; columns found: 'time_s', 'pitch_deg', "
                                     "'note' (separator ',')"),
    (PLAIN.replace('roll_deg', 'roll'), "line 1: column 'roll': must end with a known unit to be taken as roll_deg: "
                                        "deg, rad or mrad; columns found: "),
    (PLAIN.replace('roll_deg', 'roll_gon'), "column 'roll_gon': must end with a known unit"),
    (PLAIN.replace('note', 'Roll [rad]'), "line 1: columns 'roll_deg' and 'Roll [rad]': only one of them may be the "
                                          'roll_deg'),
    (PLAIN.replace('note', 'roll_deg'), "columns 'roll_deg' and 'roll_deg'"),
    ('# one\n\n' + PLAIN.replace('-2.5', 'x'), "line 5: roll_deg = 'x': must be a number"),
    (EUROPEAN.replace(';', ','), "line 2: 4 cells, must be 3 as in line 1 (separator ',')"),
    (PLAIN.replace('1.25', '1_25'), "line 2: roll_deg = '1_25': must be a number"),
    (PLAIN.replace('1.25', '"1,25"'), "line 2: roll_deg = '1,25': must be a number"),
    (EUROPEAN.replace('-2,5', '-2.5'), "line 3: roll_deg = '-2.5': must have the decimal sign of line 2, roll_deg = "
                                       "'1,25'"),
    (PLAIN.replace('_deg', '_rad'), 'line 3: roll_rad = -2.5: must be -1.39626 to 1.39626'),
    ('', "column 'time_s' is missing; columns found: none"), ('# nothing\n', "line 2: column 'time_s' is missing"),
    (b'\x00\x01', 'line 1: byte 0x00: must be text in UTF-8, UTF-16 or Windows-1252 (latin-1)'),
    (PLAIN.encode() + b'\x81', 'line 5: byte 0x81: must be text'),
    (b'\xff\xfe0', 'line 1: byte 0x30: must be text')])
def test_a_table_that_is_refused(tmp_path, data, message):
    assert message in refused(tmp_path, data)


def zipped():
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, 'w') as archive:
        archive.writestr('table.csv', PLAIN)
    return stream.getvalue()


@pytest.mark.parametrize('data, message', [
    (gzip.compress(PLAIN.encode(), mtime=0), 'compressed by gzip: unpack it with gunzip'),
    (zipped(), 'a zip archive, as are .kmz'),
    (bz2.compress(PLAIN.encode()), 'compressed by bzip2'), (lzma.compress(PLAIN.encode()), 'compressed by xz'),
    (b'\x28\xb5\x2f\xfd' + b'1' * 50, 'compressed by zstd'), (b'\x04\x22\x4d\x18dp', 'compressed by lz4'),
    (b'\x1f\x9d\x90ab', 'compressed by compress'), (b'Rar!\x1a\x07', 'a rar archive'), (b'PAR1\x15', 'a Parquet file'),
    (b'%PDF-1.4\n', 'a PDF document')])
def test_a_packed_file_is_named(tmp_path, data, message):
    assert message in refused(tmp_path, data)


def test_an_optional_column_is_zero_or_has_its_unit(tmp_path):
    heave = {'heave_m': (-100.0, 100.0)}
    assert read(tmp_path, PLAIN, optional=heave)[1] == [1.0, -2.5, 0.0]
    assert read(tmp_path, PLAIN.replace('note', 'heave_rate').replace('b', '7'), optional=heave)[1] == [1.0, -2.5, 0.0]
    text = PLAIN
    for note, value in (('a', '100'), ('b', '200'), ('c', '300')):
        text = text.replace(f',{note}', f',{value}')
    assert read(tmp_path, text.replace('note', 'Heave [cm]'), optional=heave)[1] == [1.0, -2.5, 2.0]
    for name in ('heave', 'heave_fathoms'):
        assert f"column '{name}': must end with a known unit" in refused(
            tmp_path, text.replace('note', name), optional=heave)


@pytest.mark.parametrize('name, unit', [
    ('time', 's'), ('Time [min]', 'min'), ('time/h', 'h'), ('time_utc', 'UTC'), ('Time (UTCG)', 'UTC'),
    ('Date__(UT)__HR:MN:SC.fff', 'UTC'), ('time_local', ''), ('time_tai', ''), ('timestamp', None), ('at', None)])
def test_the_whole_name_of_a_time_is_read(name, unit):
    wanted = columns.Quantity('time', {'time': 's', 'date': 'UTC'}, 's')
    assert columns.named([name], wanted) == (unit is not None)
    if unit:
        assert columns.find([name], wanted).unit == unit
    elif unit == '':
        with pytest.raises(columns.ColumnError, match=f"column '{name}': must end with a known unit"):
            columns.find([name], wanted)
    else:
        assert columns.find([name], wanted) is None


def test_other_quantities_do_not_hide_the_wanted_one():
    wanted = columns.Quantity('azimuth', {'azimuth': 'deg', 'az': 'deg'}, 'deg')
    assert columns.find(['az_rate', 'az_error', 'AZ', 'azimuth_command'], wanted) == ('AZ', 'deg', 1.0)


@pytest.mark.parametrize('comment, names', [
    ('# az el time', ('az', 'el', 'time')), ('az el time', ('az', 'el', 'time')),
    ('# a list', ('time', 'azimuth', 'elevation')), ('#time,el,az', ('time', 'el', 'az'))])
def test_names_above_the_rows_count(comment, names):
    bare = 'time', 'azimuth', 'elevation'
    assert csv_table.Table('', f'{comment}\n0,1,2\n', bare).fieldnames == names


def test_the_beginning_of_a_text():
    assert files.beginning('ü<gpx'.encode('utf-16')) == 'ü<gpx'
    assert files.beginning(b'\xef\xbb\xbfa\xfc') == 'a\ufffd'
