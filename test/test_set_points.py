"""Set-points as gpredict sends them, through the server's protocol to the closed loop: passes that are followed."""
import importlib.util
import math
import pathlib

import numpy as np
import pytest

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_common.wire.commands import Command
from pedestal_operator.rotator import pointing
from pedestal_operator.rotator.controller import Controller

_SPEC = importlib.util.spec_from_file_location('rotator_passes',
                                               pathlib.Path(__file__).parents[1] / 'docs' / 'rotator' / 'passes.py')
passes = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(passes)


@pytest.mark.parametrize(('name', 'setting', 'rms', 'off'), (
    ('north', (0.1, 0.1), 0.3, 2.5), ('zenith', (0.1, 0.1), 0.5, 6.0), ('north', (5.0, 1.0), 5.0, 30.0)))
def test_the_middle_of_a_pass_is_followed(name, setting, rms, off):
    """With the threshold and cycle that the documentation asks for, and with gpredict's own, which cannot be precise:
    neither turns the azimuth the other way round. In the first seconds gpredict is not engaged yet."""
    row = passes.measured('leo_pass', passes.PASSES[name], setting, 30.0)
    assert row['antenna deg'] < row['satellite deg'] + setting[0] + 2.0 and row['reversals'] == 0
    assert row['rms deg'] < rms and row['off s'] < off


def test_refusals_of_the_control_unit_are_distinguished():
    """By the parts of their texts in commands.py, whatever their words are."""
    loop = closed_loop.Loop(scenario.load('leo_pass', passes.IDLE, None, 1.0, 'lockstep'))
    outcomes_of, acu = {}, loop.units['acu']

    def watch(step):
        remote = passes.Remote(acu)
        control = Controller(remote)
        first = control.do('a', 'preset', 0.0)
        first.look(remote, 0.0)
        outcomes_of['other'] = Controller(remote).stop('b', 0.0).look(remote, 0.0)
        outcomes_of['busy'] = Controller(remote).do('b', 'stow', 0.0).look(remote, 0.0)
        outcomes_of['limits'] = control._request('a', 0.0, lambda: remote.request('preset', {
            'azimuth': 0.0, 'elevation': 3.0})).look(remote, 0.0)
        outcomes_of['range'] = control.jog('a', (1e6, 0.0), 0.0).look(remote, 0.0)
        outcomes_of['refused'] = control.do('a', 'program', 0.0).look(remote, 0.0)
        return 1000
    loop.run(watch=watch)
    assert outcomes_of == {'other': pointing.OUTCOME_DONE, 'busy': pointing.OUTCOME_REFUSED,
                           'limits': pointing.OUTCOME_OUT_OF_REACH, 'range': pointing.OUTCOME_OUT_OF_REACH,
                           'refused': pointing.OUTCOME_REFUSED}


def test_a_pass_is_taken_by_permission_or_by_the_parameter():
    """A program that was refused sends its next set-point, which takes control once an operator has allowed it."""
    loop = closed_loop.Loop(scenario.load('leo_pass', (), None, 2.0, 'lockstep'))
    acu, outcomes = loop.units['acu'], []

    def watch(step):
        remote = passes.Remote(acu)
        if remote.texts['acu/mode'] in ('program', 'autotrack') and not outcomes:
            control, old = Controller(remote), Controller(remote, 'operator')
            for _ in range(2):
                outcomes.append(control.do('a 1 from h:5', 'preset', 0.0).look(remote, 0.0))
            assert remote.texts['acu/mode'] != 'preset' and control.holder == ''
            acu.command(Command('allow', 'anna'))
            outcomes.append(control.do('a 1 from h:6', 'preset', 0.0).look(remote, 0.0))
            control.release(0.0)
            acu.command(Command('program', 'anna'))
            outcomes.append(old.do('b', 'preset', 0.0).look(remote, 0.0))
        return 50
    loop.run(watch=watch)
    assert outcomes == [pointing.OUTCOME_REFUSED] * 2 + [pointing.OUTCOME_DONE] * 2


@pytest.mark.parametrize('connects_anew', (False, True))
def test_set_points_at_a_pace_are_met_without_jerk(connects_anew):
    """One each 0.8 s, 1 deg/s through north: from the eighth second on the axis goes at this rate, also where each
    set-point comes on a connection of its own."""
    loop = closed_loop.Loop(scenario.load('leo_pass', (
        *passes.IDLE, f'adu.initial_azimuth={math.radians(-7.0)}', f'adu.initial_elevation={math.radians(45.0)}'),
        None, 16.0, 'lockstep'))
    remote = passes.Remote(loop.units['acu'])
    control = Controller(remote)

    def watch(step):
        number, since = divmod(step, 160)
        control.look(step / 200)
        if step and since == 0:
            client = f'rotctld 4533 from 127.0.0.1:{5000 + number * connects_anew}'
            pending = control.go(client, (353.0 + 0.8 * number) % 360.0, 45.0, step / 200)
            assert pending.look(remote, step / 200) == pointing.OUTCOME_DONE
            if connects_anew:
                control.leave(client)
        return 10
    run = loop.run(watch=watch)
    joints, reference = run.table('joint_states'), run.table('acu/reference')
    late = joints['t'] > 8.0
    np.testing.assert_allclose(joints['azimuth.velocity'][late], math.radians(1.0), atol=1e-3)
    assert np.abs(reference['azimuth.acceleration'][reference['t'] > 8.0]).max() < 0.1
