"""Sequence of an acceptance in the closed loop: shared exercises, continuation, stops, and what the folder keeps."""
import json
import math
import pathlib

import numpy as np
import pytest

from pedestal_bringup.scenario.variant import Variant
from pedestal_results.intervals import Target
from pedestal_workbench.acceptance import sequence
from pedestal_workbench.acceptance.exercise import Action, BreachError, Exercise, LateError, Span, StoppedError
from pedestal_workbench.acceptance.in_loop import InLoop
from pedestal_workbench.acceptance.judgement import FAILED, INCONCLUSIVE, PASSED
from pedestal_workbench.acceptance.method import Measured, Method
from pedestal_workbench.acceptance.specification import Head, Requirement, Specification

SPAN = Span(-20.0, 60.0, 60.0)


def step(antenna, arguments):
    """Return a step in azimuth."""
    angle = math.radians(arguments['step'])
    return Exercise(1.5, (SPAN, SPAN), (Action(0.5, 'acu', f'preset azimuth={angle} elevation=0.5'),), (0.0, 0.5))


def last(performed, arguments):
    """Return the last azimuth."""
    return Measured(math.degrees(performed.recording.table('joint_states')['azimuth.position'][-1]), 0.0)


def largest(performed, arguments):
    """Return the largest rate."""
    return Measured(math.degrees(np.abs(performed.recording.table('joint_states')['azimuth.velocity']).max()), 0.0)


def unclear(performed, arguments):
    raise ValueError('no motion in the recording')


def requirement(name, measure=last, size=1.0, limit='1 +- 0.1', repetitions=1):
    method = Method(measure.__name__, '', 'deg', '+-', (), step, measure)
    return Requirement(name, method, {'step': size}, Target.parse(limit), repetitions, 0.95)


def specification(*requirements, text='text'):
    return Specification(Head('title', 'customer', 'antenna'), requirements, text)


class Noted(InLoop):
    """Closed loop that notes its exercises, and is stopped before one of them."""

    def __init__(self, stopped_at=''):
        super().__init__(Variant('uav_tracker_3m'))
        self.made, self.stopped_at = [], stopped_at

    def perform(self, name, exercise, seed):
        if name == self.stopped_at:
            raise StoppedError('an operator commanded stop')
        self.made.append((name, seed))
        return super().perform(name, exercise, seed)


def run(folder, performer, *requirements, text='text', seed=1):
    reported = []
    asked = specification(*requirements, text=text)
    results = sequence.run(asked, asked.exercises(performer), performer, folder, seed, reported.append)
    assert reported == results
    return results


def test_equal_exercises_are_made_once(tmp_path):
    performer = Noted()
    results = run(tmp_path, performer, requirement('angle', repetitions=2),
                  requirement('other', size=2.0, limit='<= 3'),
                  requirement('rate', largest, limit='>= 1', repetitions=3))
    assert performer.made == [('angle-1', 1), ('angle-2', 1001), ('other-1', 1), ('rate-3', 2001)]
    assert [len(kept.judged.repetitions) for kept in results] == [2, 1, 3]
    assert [kept.judged.verdict for kept in results] == [PASSED] * 3
    assert results[0].judged.value == pytest.approx(1.0, abs=0.01)


def test_a_stopped_sequence_continues_with_the_first_requirement_without_a_result(tmp_path):
    three = requirement('a'), requirement('b', size=2.0, limit='<= 3'), requirement('c', size=3.0, limit='<= 4')
    with pytest.raises(StoppedError, match='an operator'):
        run(tmp_path, Noted('b-1'), *three)
    (tmp_path / 'b-1').mkdir()      # as a killed run leaves it
    (tmp_path / 'b-1.log').write_text('log')
    performer = Noted()
    results = run(tmp_path, performer, *three)
    assert [name for name, _ in performer.made] == ['b-1', 'c-1']
    assert [(kept.name, kept.session) for kept in results] == [('a', 1), ('b', 2), ('c', 2)]
    assert sorted(path.name for path in tmp_path.glob('b-1*')) == ['b-1.interrupted-1', 'b-1.log.interrupted-1']
    _, (first, second), _ = sequence.read(tmp_path)
    assert (first.end, second.end) == ('stopped: an operator commanded stop', 'came to its end')
    assert first.parameters == second.parameters == performer.antenna.sha256
    finished = Noted()
    assert run(tmp_path, finished, *three) == results and finished.made == []


@pytest.mark.parametrize('own_runs', [True, False])
def test_a_breach_fails_its_requirement_and_ends_a_sequence_that_goes_on_with_the_same_graph(tmp_path, own_runs):
    class Breached(Noted):
        def perform(self, name, exercise, seed):
            if name == 'b-2':
                (tmp_path / name).mkdir()
                (tmp_path / name / 'b-2_0.mcap').write_text('recorded')
                raise BreachError('alarm azimuth motor lost')
            return super().perform(name, exercise, seed)
    Breached.own_runs = own_runs
    three = requirement('a'), requirement('b', size=2.0, repetitions=3), requirement('c', size=3.0, limit='<= 4')
    if own_runs:
        results = run(tmp_path, Breached(), *three)
    else:
        with pytest.raises(StoppedError, match='alarm azimuth motor lost'):
            run(tmp_path, Breached(), *three)
        performer = Noted()
        results = run(tmp_path, performer, *three)
        assert [name for name, _ in performer.made] == ['c-1']      # the failed line stays
        assert [one.end for one in sequence.read(tmp_path)[1]] == ['stopped: alarm azimuth motor lost',
                                                                    'came to its end']
    assert [kept.judged.verdict for kept in results] == [PASSED, FAILED, PASSED]
    failed = results[1].judged
    assert failed.breached and failed.reason == 'alarm azimuth motor lost' and len(failed.repetitions) == 1
    assert [name for name, _ in results[1].bags] == ['b-2/b-2_0.mcap']


@pytest.mark.parametrize('late', [2, sequence.MAX_RUNS])
def test_an_exercise_with_late_commands_is_made_again(tmp_path, late):
    class Late(Noted):
        def perform(self, name, exercise, seed):
            performed = super().perform(name, exercise, seed)
            if len(self.made) <= late:
                (tmp_path / name).mkdir()
                raise LateError('preset: 0.2 s late')
            return performed
    performer = Late()
    if late == sequence.MAX_RUNS:
        with pytest.raises(StoppedError, match='0.2 s late'):
            run(tmp_path, performer, requirement('a'))
    else:
        assert [kept.judged.verdict for kept in run(tmp_path, performer, requirement('a'))] == [PASSED]
        assert not (tmp_path / 'a-1').exists()
    assert performer.made == [('a-1', 1)] * min(late + 1, sequence.MAX_RUNS)
    assert len(list(tmp_path.glob('a-1.late-*'))) == min(late, sequence.MAX_RUNS - 1)


def test_the_folder_keeps_every_number(tmp_path):
    [kept] = run(tmp_path, Noted(), requirement('a', repetitions=2))
    [again] = run(tmp_path, Noted(), requirement('a', repetitions=2))
    assert again == kept and isinstance(again.judged.repetitions[0], Measured)


def test_another_specification_is_refused(tmp_path):
    run(tmp_path, Noted(), requirement('a'))
    with pytest.raises(ValueError, match='results of another specification'):
        run(tmp_path, Noted(), requirement('a'), text='another text')


@pytest.mark.parametrize('content', ['', '[]', '{"specification_sha256": 1, "sessions": [], "results": [1]}'])
def test_a_broken_file_of_results_is_named(tmp_path, content):
    (tmp_path / 'results.json').write_text(content)
    with pytest.raises(ValueError, match='results.json: is no file of results'):
        run(tmp_path, Noted(), requirement('a'))


def test_a_folder_has_one_acceptance_at_a_time(tmp_path):
    class Nested(Noted):
        def perform(self, name, exercise, seed):
            with pytest.raises(ValueError, match='another acceptance is using this folder'):
                run(tmp_path, Noted(), requirement('a'))
            return super().perform(name, exercise, seed)
    run(tmp_path, Nested(), requirement('a'))


def test_what_cannot_be_made_is_refused_before_anything_moves(tmp_path):
    class Refusing(Noted):
        def check(self, exercise):
            if 'azimuth=0.05' in exercise.actions[0].command:
                raise ValueError('gust of adu: the node is not simulated')
    performer = Refusing()
    with pytest.raises(ValueError, match="requirement 'far': gust of adu"):
        run(tmp_path, performer, requirement('near'), requirement('far', size=3.0))
    assert performer.made == [] and not list(tmp_path.iterdir())


def test_a_recording_that_cannot_be_judged_is_inconclusive(tmp_path):
    [kept] = run(tmp_path, Noted(), requirement('a', unclear))
    assert kept.judged.verdict == INCONCLUSIVE and kept.judged.reason == 'no motion in the recording'


def test_the_results_are_never_half_written(tmp_path, monkeypatch):
    """A loss of power during the write of the second result leaves the file with the first."""
    replace, count = sequence.files.replace_text, []

    def dies(path, text):
        count.append(text)
        if len(count) == 3:
            pathlib.Path(f'{path}.new').write_text(text[:100])
            raise SystemExit
        replace(path, text)
    monkeypatch.setattr(sequence.files, 'replace_text', dies)
    two = requirement('a'), requirement('b', size=2.0, limit='<= 3')
    with pytest.raises(SystemExit):
        run(tmp_path, Noted(), *two)
    monkeypatch.undo()
    assert [kept['name'] for kept in json.loads((tmp_path / 'results.json').read_text())['results']] == ['a']
    assert [kept.session for kept in run(tmp_path, Noted(), *two)] == [1, 2]
    assert [session.end for session in sequence.read(tmp_path)[1]] == ['interrupted', 'came to its end']
