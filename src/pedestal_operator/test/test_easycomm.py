"""EasyComm: requests in the lines of clients of Hamlib, and their answers."""
import re

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
    ('VE', LineRequest(queries=('VE',))), ('ST26:11:22:06:00:00', LineRequest()), ('', LineRequest()),
    ('AZ120,5 EL50,0', LineRequest(azimuth=120.5, elevation=50.0)), ('AZ120,5 EL50.', LineRequest(
        azimuth=120.5, elevation=50.0)), ('AZ99999', LineRequest(azimuth=99999.0)),
    ('ML MU', LineRequest(rates=(-1, 1))), ('VL0500 VD0250', LineRequest(rates=(-0.5, -0.25), scaled=False)),
    ('AZ1 EL2 UP145900000 FM-N DN436500000 USB', LineRequest(azimuth=1.0, elevation=2.0))))
def test_a_line_is_read(line, asked):
    assert read(line) == asked


@pytest.mark.parametrize(('line', 'word'), (
    ('AZ120.5EL30.0', 'AZ120.5EL30.0'), ('AZ=120.5', 'AZ=120.5'), ('AZ 120.5 EL 30.0', '120.5'), ('AZnan', 'AZNAN'),
    ('AZ1e999', 'AZ1E999'), ('AZ10 EL' + '9' * 99, '9' * 99), ('AZ10 ELx', 'ELX'), ('AZ1,5 EL3,0,1', 'EL3,0,1'),
    ('AZ10 EL20 FM', 'FM'), ('AZ10 EL20 30', '30'), ('VU99999999', 'VU99999999'), ('VR-5', 'VR-5'), ('VL0,5', 'VL0,5'),
    ('AZ10 AZ20', 'AZ20'), ('VL1 VR1', 'VR1'), ('ML MR', 'MR'), ('dance', 'DANCE'), ('AZ١', 'AZ١')))
def test_a_line_with_a_word_that_cannot_be_read_is_refused_as_a_whole(line, word):
    with pytest.raises(ValueError, match=re.escape(repr(word))):
        read(line)


@pytest.mark.parametrize('line', ('SA SE AZ10', 'ML AZ10', 'ML VU100', 'PARK SA', 'RESET EL5'))
def test_a_line_with_two_motions_is_refused(line):
    with pytest.raises(ValueError, match='more than one of'):
        read(line)


def test_answers():
    assert answer(read('AZ EL '), (-10.0, 20.04), 1, 0, 'x') == b'AZ350.0 EL20.0\n'
    assert answer(read('AZ'), (359.99, 0.0), 1, 0, 'x') == b'AZ0.0\n'
    assert answer(read('GS'), (0.0, 0.0), easycomm.STATUS_MOVING, 0, 'x') == b'GS2\n'
    assert answer(read('GE VE'), (0.0, 0.0), 1, 0, 'pedestal') == b'GE0 VEpedestal\n'
    assert answer(read('AZ1 EL2'), (0.0, 0.0), 1, 0, 'x') == b''
    assert answer(read('AZ EL'), None, 8, 0, 'x') == b'' and answer(read('AZ GS EL'), None, 8, 0, 'x') == b'GS8\n'
