"""The control unit as a node sees it: its diagnosis, its program track, its requests."""
import numpy as np
import pytest

from acu_tracker.params import AcuParameters
from acu_tracker.unit import COMMAND, DRIVE, JOINTS, MODE, PROGRAM, Acu
from pedestal_common import messages, records
from pedestal_common.commands import Command


def test_diagnostics_show_whether_the_filter_is_honest():
    unit = Acu(AcuParameters(), ())
    outputs = unit.memory.record['outputs']
    outputs['gated'], outputs['rates_gated'], outputs['ranges_gated'] = 3, 5, 7
    outputs['innovation'], outputs['nis'] = [(np.radians(0.0123456), np.nan)], [(1.23456, np.nan)]
    values = dict(unit.diagnose().values)
    assert [values[f'{name} gated'] for name in ('errors', 'rates', 'ranges')] == ['3', '5', '7']
    assert (values['azimuth innovation_deg'], values['azimuth nis']) == ('0.01235', '1.235')
    assert (values['elevation innovation_deg'], values['elevation nis']) == ('nan', 'nan')
    assert (values['blocked'], values['keyhole']) == ('0', 'none')


def test_a_request_is_judged_by_what_the_drive_says_now():
    unit = Acu(AcuParameters(), ())
    unit.inputs[JOINTS]['stamp'] = 0
    unit.step(np.zeros(1, np.int64), unit.inputs, unit.outputs)
    assert unit.encode(MODE, int(unit.outputs[0][MODE])) == 'standby' and unit.outputs[COMMAND]['stamp'] == 0
    assert unit.request('acu/stow') == (True, 'mode is stow')
    unit.take_text(DRIVE, 'stopping')
    assert unit.request('acu/preset') == (False, 'refused: drive not ready; mode is standby')
    assert dict(unit.diagnose().values)['drive'] == 'stopping'


def test_a_program_track_without_the_axes_is_refused():
    message = messages.template(PROGRAM)
    message.joint_names = ['azimuth', 'polarisation']
    with pytest.raises(ValueError, match='must hold azimuth and elevation'):
        Acu(AcuParameters(), ()).decode(PROGRAM, message)
    assert records.is_text(MODE)


def test_a_command_that_is_asked_again_is_replied_to_again_and_obeyed_once():
    """Whoever has heard no reply asks again under the same number; it may have been obeyed."""
    unit = Acu(AcuParameters(), ())
    take, release = Command('take', 'anna', '7-1'), Command('release', 'anna', '7-2')
    first = unit.command(take)
    assert first.granted and unit.command(release).granted
    assert unit.command(take) == first and unit.command(Command('take', 'bert', '7-1')).granted
    assert [command.who for command, _ in unit.answered] == ['anna', 'anna', 'anna', 'bert']
    assert not unit.command(take._replace(verb='dance')).granted           # another one under a number once used
