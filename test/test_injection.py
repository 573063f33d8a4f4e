"""Injected faults through the graph, by parameter in lockstep, recorded and recomputed; by topic: test_realtime."""

import numpy as np
import pytest

from pedestal.console import EXIT_FAILED_RUN
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_common.wire import commands, messages
from pedestal_recording import bag as bags

SECONDS = 4.0
FAULTS = ['adu.inject=2.2 gust torque=-3000 duration=0.3; 3 encoder_jump axis=elevation size=0.02',
          'tracking_receiver.inject=2 noise sigma=0.01 duration=0.2; 2.5 fade depth=60 duration=0.5',
          'ship_motion.inject=2.1 bias axis=x rate=0.02 duration=0.2', 'ins.inject=2.6 ins_jump heading=0.02']


def replies(path, topic):
    """[(step [s], Command, Reply)] of a recording."""
    bag = bags.read(path)
    return [(log / 1e9, *commands.of_reply(messages.deserialize(data, 'diagnostic_msgs/msg/DiagnosticStatus')))
            for _, log, _, data in bag.raw(topic)]


@pytest.fixture(scope='module')
def injected(start_run):
    params = [word for fault in FAULTS for word in ('--param', fault)]
    run = start_run('ship_pass', '--duration', str(SECONDS), *params)
    result = run.finish()
    assert result.returncode == EXIT_FAILED_RUN, result.stderr
    assert 'drive fault elevation encoder disagreement at 3' in result.stdout
    return run.bag


@pytest.mark.thorough
def test_a_lockstep_run_with_faults_is_the_closed_loop_to_the_last_bit(injected, differences):
    run = closed_loop.Loop(scenario.load('ship_pass', FAULTS, duration=SECONDS)).run()
    assert differences(run, bags.read(injected)) == {}
    plain = closed_loop.Loop(scenario.load('ship_pass', duration=SECONDS)).run()
    other = np.array([a.tobytes() != b.tobytes() for a, b in zip(run.steps, plain.steps)])
    assert np.flatnonzero(other)[0] == 400
    assert list(bags.read(injected).table('adu/state')['data']) == [
        'enabled', 'fault: elevation encoder disagreement']


@pytest.mark.thorough
def test_each_node_tells_of_its_faults_in_their_steps(injected):
    told = [(at, command.verb, command.who, reply) for at, command, reply in replies(injected, 'adu/injected')]
    assert told == [
        (2.2, 'gust', 'scenario', (True, 'gust from the step after 2.195000 s on, for 0.3 s')),
        (3.0, 'encoder_jump', 'scenario', (True, 'encoder_jump from the step after 2.995000 s on'))]
    for node, verbs in (('tracking_receiver', ['noise', 'fade']), ('ship_motion', ['bias']), ('ins', ['ins_jump'])):
        assert [command.verb for _, command, _ in replies(injected, f'{node}/injected')] == verbs


@pytest.mark.thorough
@pytest.mark.parametrize('node', ('adu', 'tracking_receiver', 'ins'))
def test_a_node_with_faults_is_recomputed(injected, node, pedestal):
    code, said, _ = pedestal('recompute', injected, '--node', node, '--absolute', 0, '--relative', 0)
    assert code == 0 and said.splitlines()[-1] == f'{node}: identical'


@pytest.mark.parametrize(('inject', 'said'), (
    ('ins.inject=2 drop', 'ins: inject: drop of ins: the INS publishes no attitude; every lockstep node would wait'),
    ('adu.inject=2 gost', "inject = '2 gost': unknown command 'gost'; did you mean 'gust'?")))
def test_a_fault_that_cannot_be_is_refused_before_anything_runs(inject, said, pedestal):
    code, _, errors = pedestal('run', 'ship_pass', '--param', inject)
    assert code == 2 and said in errors
