import math

import numpy as np
import pytest

from pedestal_common.geometry import blockage
from pedestal_common.parameters import ParameterError


def test_a_sector_is_hidden_on_every_turn_up_to_its_top():
    """Against membership by complex numbers: turning the low edge to 1, the angle of the direction."""
    table = blockage.sectors('2.9 3.5 0.4; -0.1 0.05 1.2')
    rng = np.random.default_rng(3)
    for azimuth, elevation in zip(rng.uniform(-9.0, 9.0, 3000), rng.uniform(-0.5, 1.5, 3000)):
        inside = any(np.angle(np.exp(1j * (azimuth - low))) % (2 * math.pi) <= high - low and elevation <= top
                     for low, high, top in ((2.9, 3.5, 0.4), (-0.1, 0.05, 1.2)))
        assert blockage.blocked(table, azimuth, elevation) == inside


def test_none_and_not_a_number_are_not_hidden():
    assert not blockage.blocked(blockage.sectors(''), 0.0, -1.0)
    everywhere = blockage.sectors(f'0 {2 * math.pi} 1.5')
    assert blockage.blocked(everywhere, 123.0, 0.0)
    assert not blockage.blocked(everywhere, math.nan, 0.0) and not blockage.blocked(everywhere, 0.0, math.nan)


@pytest.mark.parametrize('text', ['1 2', '1 2 x', '2 1 0.5', '0 7 0.5', '0 1 2', '0 nan 1', ';'.join(['0 1 1'] * 9)])
def test_what_is_no_sector_is_refused(text):
    with pytest.raises(ParameterError, match='blockage = .*must be'):
        blockage.sectors(text)
