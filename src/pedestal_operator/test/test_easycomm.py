"""EasyComm: what the lines of Hamlib's clients ask for, how they are answered."""
import pytest

from pedestal_operator.rotator import easycomm
from pedestal_operator.rotator.easycomm import Asked, read, told


@pytest.mark.parametrize(('line', 'asked'), (
    ('AZ EL ', Asked(tells=('AZ', 'EL'))), ('AZ', Asked(tells=('AZ',))),
    ('AZ10.0 EL20.0', Asked(azimuth=10.0, elevation=20.0)), ('EL-5', Asked(elevation=-5.0)),
    ('AZ10.0 EL20.0 UP000 XXX DN000 XXX', Asked(azimuth=10.0, elevation=20.0)),
    ('SA SE ', Asked(verb='stop')), ('RESET', Asked(verb='acu/reset_faults')), ('PARK', Asked(verb='stow')),
    ('ML', Asked(rates=(-1, 0))), ('VR0500', Asked(rates=(0.5, 0.0), scaled=False)), (';GS', Asked(tells=('GS',))),
    ('VE', Asked(tells=('VE',))), ('ST26:11:22:06:00:00', Asked()), ('AZnan', Asked()),
    ('AZ1e9 EL' + '9' * 99, Asked()),
    ('', Asked()), ('VU99999999', Asked())))
def test_a_line_is_read(line, asked):
    assert read(line) == asked


def test_answers():
    assert told(read('AZ EL '), (-10.0, 20.04), 1, 0, 'x') == b'AZ350.0 EL20.0\n'
    assert told(read('AZ'), (359.99, 0.0), 1, 0, 'x') == b'AZ0.0\n'
    assert told(read('GS'), (0.0, 0.0), easycomm.MOVING, 0, 'x') == b'GS2\n'
    assert told(read('GE VE'), (0.0, 0.0), 1, 0, 'pedestal') == b'GE0 VEpedestal\n'
    assert told(read('AZ1 EL2'), (0.0, 0.0), 1, 0, 'x') == b''
