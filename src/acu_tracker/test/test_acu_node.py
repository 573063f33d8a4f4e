import types

import numpy as np

from acu_tracker import control_unit
from acu_tracker.acu_node import AcuNode
from acu_tracker.params import AcuParameters


def test_diagnostics_show_whether_the_filter_is_honest():
    outputs = np.zeros(1, control_unit.OUTPUTS)
    outputs['gated'], outputs['rates_gated'], outputs['ranges_gated'] = 3, 5, 7
    outputs['innovation'], outputs['nis'] = [(np.radians(0.0123456), np.nan)], [(1.23456, np.nan)]
    state = control_unit.initial_state(AcuParameters())[0]
    node = types.SimpleNamespace(outputs=outputs, state=state, lookahead=state['lookahead'], invalid=0, refused='',
                                 drive_state='enabled', steps=types.SimpleNamespace(refused=0))
    values = dict(AcuNode.diagnose(node)[2])
    assert [values[f'{name} gated'] for name in ('errors', 'rates', 'ranges')] == ['3', '5', '7']
    assert (values['azimuth innovation_deg'], values['azimuth nis']) == ('0.01235', '1.235')
    assert (values['elevation innovation_deg'], values['elevation nis']) == ('nan', 'nan')
    assert (values['blocked'], values['keyhole']) == ('0', 'none')
