"""EasyComm: requests in the lines of clients of Hamlib, and their answers."""
import pytest

from pedestal_operator.rotator import easycomm
from pedestal_operator.rotator.easycomm import LineRequest, answer, read


@pytest.mark.parametrize(('line', 'asked'), (
    ('AZ EL ', LineRequest(queries=('AZ', 'EL'))), ('AZ', LineRequest(queries=('AZ',))),
    ('AZ10.0 EL20.0', LineRequest(azimuth=10.0, elevation=20.0)), ('EL-5', LineRequest(elevation=-5.0)),
    ('AZ10.0 EL20.0 UP000 XXX DN000 XXX', LineRequest(azimuth=10.0, elevation=20.0)),
    ('SA SE ', LineRequest(verb='stop')), ('RESET', LineRequest(verb='acu/reset_faults')),
    ('PARK', LineRequest(verb='stow')),
    ('ML', LineRequest(rates=(-1, 0))), ('VR0500', LineRequest(rates=(0.5, 0.0), scaled=False)),
    (';GS', LineRequest(queries=('GS',))),
    ('VE', LineRequest(queries=('VE',))), ('ST26:11:22:06:00:00', LineRequest()), ('AZnan', LineRequest()),
    ('AZ1e9 EL' + '9' * 99, LineRequest()),
    ('', LineRequest()), ('VU99999999', LineRequest())))
def test_a_line_is_read(line, asked):
    assert read(line) == asked


def test_answers():
    assert answer(read('AZ EL '), (-10.0, 20.04), 1, 0, 'x') == b'AZ350.0 EL20.0\n'
    assert answer(read('AZ'), (359.99, 0.0), 1, 0, 'x') == b'AZ0.0\n'
    assert answer(read('GS'), (0.0, 0.0), easycomm.STATUS_MOVING, 0, 'x') == b'GS2\n'
    assert answer(read('GE VE'), (0.0, 0.0), 1, 0, 'pedestal') == b'GE0 VEpedestal\n'
    assert answer(read('AZ1 EL2'), (0.0, 0.0), 1, 0, 'x') == b''
