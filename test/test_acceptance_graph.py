"""Exercises of an acceptance on processes: on graphs of their own, on a running graph, and after a kill."""
import contextlib
import dataclasses
import importlib.resources
import json
import math
import multiprocessing
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from shared import PATIENCE, PEDESTAL

from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph.steps import GraphError
from pedestal_results.intervals import Target
from pedestal_workbench.acceptance import sequence
from pedestal_workbench.acceptance.exercise import Action, BreachError, Exercise, Span, StoppedError, Track
from pedestal_workbench.acceptance.in_loop import InLoop
from pedestal_workbench.acceptance.method import Measured, Method
from pedestal_workbench.acceptance.own_graph import OwnGraph
from pedestal_workbench.acceptance.running_graph import RunningGraph
from pedestal_workbench.acceptance.specification import Head, Requirement, Specification

UAV = Variant('uav_tracker_3m')
SPAN = Span(-20.0, 60.0, 40.0)
REST = 0.0, 0.5
SLOW = 'acu.azimuth.shaper.rate=0.1', 'adu.initial_azimuth=0.01', 'adu.initial_elevation=0.5'   # of a running graph
# Alarms of a busy machine.
BUSY = 'steps lost', 'time jump', 'drive silent', 'azimuth encoder jump', 'elevation encoder jump'


def step(at=0.5, size=1.0, duration=2.0, **more):
    """Return a step in azimuth by `size` [deg]."""
    command = f'preset azimuth={math.radians(size)} elevation={REST[1]}'
    return Exercise(duration, (SPAN, SPAN), (Action(at, 'acu', command),), REST, **{'alarms': BUSY, **more})


def azimuth(performed, times):
    """Return the azimuth [deg] at times after the execution of the first action."""
    table = performed.recording.table('joint_states')
    begin = performed.begin + performed.executed[0].t
    return np.degrees(np.interp(times, table['t'] - begin, table['azimuth.position']))


def specification(*faults):
    """Return two requirements with exercises of their own, and one that shares the second. faults: during each."""
    def method(size):
        def exercise(antenna, arguments):
            made = step(size=size)
            return dataclasses.replace(made, actions=made.actions + faults)
        return Method('last', '', 'deg', '+-', (), exercise,
                      lambda performed, arguments: Measured(float(azimuth(performed, [1.4])[0]), 0.0))
    return Specification(Head('title'), tuple(
        Requirement(name, method(size), {}, Target.parse(f'{size} +- 0.1'), 1, 0.95)
        for name, size in (('one', 1.0), ('two', 2.0), ('two again', 2.0))), 'text')


@pytest.fixture
def domain(reserve_domain, monkeypatch):
    """A domain of its own for this process and its children."""
    number = reserve_domain()
    monkeypatch.setenv('ROS_DOMAIN_ID', str(number))
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    return number


def test_an_exercise_on_a_graph_is_that_of_the_closed_loop(domain, tmp_path):
    t = np.arange(0.0, 4.0, 0.1)
    track = Track(t, np.column_stack([0.0 * t, REST[1] + 0.0 * t]))
    stop = Action(1.0, 'adu', 'adu/emergency_stop')
    exercise = step(track=track, alarms=(*BUSY, 'emergency stop', 'drive fault'))
    exercise = dataclasses.replace(exercise, actions=(*exercise.actions, stop))
    with OwnGraph(UAV, tmp_path) as graph:
        on_nodes, in_memory = (performer.perform('step', exercise, 3) for performer in (graph, InLoop(UAV)))
    assert on_nodes.executed == in_memory.executed
    assert [(done.t, done.granted, done.action) for done in on_nodes.executed] == [
        (action.at, True, action) for action in exercise.actions]
    tables = (performed.recording.table('joint_states') for performed in (on_nodes, in_memory))
    assert all(np.array_equal(a, b) for a, b in zip(*(table.values() for table in tables)))


def results_in(folder):
    """Return the names of the requirements with a result."""
    return [kept['name'] for kept in json.loads((folder / 'results.json').read_text())['results']]


@pytest.mark.thorough
def test_a_killed_sequence_continues(domain, tmp_path, start_process):
    killed = start_process([sys.executable, __file__, tmp_path], ROS_DOMAIN_ID=str(domain))
    deadline = time.monotonic() + PATIENCE
    while not list((tmp_path / 'two-1').glob('*.mcap')) or len(results_in(tmp_path)) < 1:
        assert killed.poll() is None and time.monotonic() < deadline, killed.communicate()
        time.sleep(0.02)
    os.kill(killed.pid, signal.SIGKILL)
    assert results_in(tmp_path) == ['one']
    time.sleep(3.0)     # the kernel ends the graph of the killed process
    results = main(tmp_path)
    assert [(kept.name, kept.session, kept.judged.verdict) for kept in results] == [
        ('one', 1, 1.0), ('two', 2, 1.0), ('two again', 2, 1.0)]
    assert results[1].bags == results[2].bags != results[0].bags
    assert (tmp_path / 'two-1.interrupted-1').is_dir()


@pytest.mark.thorough
def test_a_killed_run_is_a_stop_and_no_wait_for_ever(domain, tmp_path):
    with OwnGraph(UAV, tmp_path) as graph:
        graph.expect([('killed', step(duration=600.0), 1)])
        deadline = time.monotonic() + PATIENCE
        while not (runs := multiprocessing.active_children()) or not (tmp_path / 'killed').exists():
            assert time.monotonic() < deadline
            time.sleep(0.05)
        for run in runs:
            run.kill()
        with pytest.raises(StoppedError, match='the run ended early: died by signal SIGKILL'):
            graph.perform('killed', step(duration=600.0), 1)


@pytest.mark.thorough
def test_an_antenna_outside_of_its_envelope_is_stopped(domain, tmp_path):
    narrow = dataclasses.replace(step(duration=30.0), envelope=(Span(-1.0, 0.5, 40.0), SPAN))
    outside = 'azimuth 0.5.* deg: outside its envelope, -1.000 to 0.500 deg'
    with OwnGraph(UAV, tmp_path) as graph, pytest.raises(BreachError, match=outside):
        graph.perform('narrow', narrow, 1)


@pytest.fixture
def running(domain, start_run, patient):
    changes = (*SLOW, 'acu.initial_mode=standby', 'acu.tracker.handover=false')
    return start_run('uav_tracker_3m', '--pacing', 'realtime', '--duration', '600', *patient,
                     *(word for change in changes for word in ('--param', change)), domain_id=domain)


def ask(*arguments):
    """Return the exit code of a command, and what it printed."""
    done = subprocess.run([*PEDESTAL, *arguments], capture_output=True, text=True, timeout=PATIENCE)
    return done.returncode, done.stdout + done.stderr


@contextlib.contextmanager
def connected(folder):
    """Connect to a graph that starts, as a context."""
    deadline = time.monotonic() + PATIENCE
    with contextlib.ExitStack() as stack:
        while True:
            with contextlib.suppress(GraphError):
                performer = stack.enter_context(RunningGraph(folder))
                break
            assert time.monotonic() < deadline
        yield performer


@pytest.mark.thorough
def test_a_running_graph(running, tmp_path):
    with connected(tmp_path) as performer:
        assert performer.antenna.period == 0.02 and performer.antenna.adu.initial_elevation != 0.0
        assert performer.antenna.simulated == ('adu', 'tracking_receiver')
        performer.check(step(changes={'acu.tracker.handover': False}))      # as it is
        with pytest.raises(ValueError, match='adu.period: must be 0.01 on the running graph'):
            performer.check(step(changes={'adu.period': 0.01}))
        asked = specification()
        results = sequence.run(asked, asked.exercises(performer), performer, tmp_path, 1, lambda kept: None)
        assert [kept.judged.verdict for kept in results] == [1.0] * 3
        expected = InLoop(UAV.with_(SLOW)).perform('one', step(), 1).recording.table('joint_states')
        assert results[0].judged.value == pytest.approx(np.degrees(expected['azimuth.position'][-1]), abs=0.005)
        threading.Timer(2.0, ask, ['stop']).start()
        with pytest.raises(StoppedError, match='commanded stop') as stop:
            performer.perform('stopped', step(duration=60.0), 1)
        assert stop.type is StoppedError        # no BreachError: an operator's stop fails no requirement
    lost, kept = tmp_path / 'lost', []
    with connected(lost) as performer, pytest.raises(StoppedError, match='alarm azimuth motor lost'):
        asked = specification(Action(1.0, 'adu', 'motor_loss'))
        sequence.run(asked, asked.exercises(performer), performer, lost, 1, kept.append)
    [failed] = kept
    assert failed.judged.verdict == 0.0 and 'alarm azimuth motor lost' in failed.judged.reason
    assert [name for name, _ in failed.bags] == ['one-1/one-1_0.mcap']
    assert ask('ask', 'take')[0] == 0       # control was released
    sample = importlib.resources.files('pedestal') / 'samples' / 'acceptance.yaml'
    code, said = ask('acceptance', str(sample), '--yes', '--output', str(tmp_path / 'other'))
    assert code == 1 and 'pedestal: error: acceptance cannot take control: refused: control is held by' in said


def main(folder):
    """Run the sequence on graphs of its own."""
    with OwnGraph(UAV, pathlib.Path(folder)) as performer:
        asked = specification()
        return sequence.run(asked, asked.exercises(performer), performer, pathlib.Path(folder), 1,
                            lambda kept: print(kept.name, flush=True))


if __name__ == '__main__':
    main(pathlib.Path(sys.argv[1]))
