"""The study faults: its table of expectations, its measurements, its verdicts."""
import math

import numpy as np
import pytest

from acu_tracker import modes
from pedestal_common.injection import table
from pedestal_studies.system import faults as study
from pedestal_studies.system.faults import FAULT_EXPECTATIONS, LEVEL_MODE_ERRORS_DEG, Expectation


def test_every_fault_has_an_expectation_in_every_mode_of_the_study():
    assert set(FAULT_EXPECTATIONS) == {f'{node}.{fault.name}' for node, faults in table.INJECTED_FAULTS.items()
                                       for fault in faults}
    assert all(set(of_modes) == set(study.MODE_PARAMETERS) for of_modes in FAULT_EXPECTATIONS.values())
    assert len({case for case, *_ in study.cases()}) == len(study.cases()) == (
        len(FAULT_EXPECTATIONS) * len(study.MODE_PARAMETERS))


@pytest.mark.parametrize(('expected', 'mode', 'sentence'), (
    (Expectation(None, (), 0.1), 'stow', 'report not required, error at most 0.1 deg, ends in the same mode'),
    (Expectation(4, ('standby',), 0.5), 'standby', 'report within 0.02 s, error at most 0.5 deg, ends in standby'),
    (Expectation(60, ('standby', 'slave'), None), 'slave',
     'report within 0.3 s, error not limited, ends in the same mode or standby'),
    (Expectation(200, ('program',), 0.5), 'autotrack',
     'report within 1 s, error at most 0.5 deg, ends in program')))
def test_an_expectation_in_words(expected, mode, sentence):
    assert expected.sentence(mode) == sentence


@pytest.mark.thorough
@pytest.mark.parametrize('mode', study.MODE_PARAMETERS)
def test_without_a_fault_a_mode_is_kept_on_its_place(mode):
    run, reports = study.run_of(mode)
    off = study.errors(run, mode)
    first = round(study.FAULT_ONSET_S / 0.005)
    assert np.isnan(off[:first]).all() and np.isfinite(off[first:]).all()
    assert np.nanmax(off) < LEVEL_MODE_ERRORS_DEG.get(mode, 0.05)
    assert mode == modes.MODES[run['acu/mode'][first]]
    assert not [report for report in reports if report[1] == study.ALARM_SOURCE and report[0] > first]


def test_a_trip_is_seen_in_its_step_with_its_text_and_the_mode_it_ends_in():
    found = study.fault_outcome('program', 'adu.inject=10 encoder_jump duration=5', study.baseline_reports('program'))
    assert (found.report_steps, found.end) == (0, 'standby') and 'azimuth encoder jump' in found.alarms
    assert found.error < 0.1


@pytest.mark.thorough
@pytest.mark.parametrize(('heading', 'let_in', 'rel'), ((0.002, 0.002, 0.3), (0.01, 0.005, 0.1)))
def test_the_error_of_a_heading_fault_is_the_angle_that_is_let_in(heading, let_in, rel):
    """A heading error beyond 3 mrad is let in at 1 mrad/s."""
    found = study.fault_outcome('slave', f'ins.inject=10 ins_jump heading={heading} duration=5',
                                study.baseline_reports('slave'))
    assert found.error == pytest.approx(math.degrees(let_in) * math.cos(study.SLAVE_DIRECTION_RAD[1]), rel=rel)


@pytest.mark.thorough
@pytest.mark.parametrize('case', (
    'adu.freeze/program', 'adu.drop/autotrack', 'tracking_receiver.freeze/autotrack',
    'tracking_receiver.noise/autotrack',
    'ins.freeze/slave', 'ins.noise/autotrack', 'ins.ins_jump/autotrack',
    'ins.ins_jump/acquire'))
def test_a_wrong_input_leads_to_the_expected_mode_and_error(case):
    [(mode, inject, expected)] = [rest for name, *rest in study.cases() if name == case]
    found = study.fault_outcome(mode, inject, frozenset())
    end = [row for row in study.rows(case, found, mode, expected) if row['metric'] != 'told_after_steps']
    assert not any(map(study.missed, end)), found


@pytest.mark.parametrize(('report_steps', 'end', 'error', 'short'), (
    (4, 'standby', 0.1, []), (5, 'standby', 0.1, ['told_after_steps']), (None, 'standby', 0.1, ['told_after_steps']),
    (4, 'program', 0.1, ['ends_as_expected']), (4, 'standby', 0.6, ['largest_error_deg'])))
def test_verdicts(report_steps, end, error, short):
    expected = Expectation(4, ('standby',), 0.5)
    found = study.FaultOutcome(report_steps, 'adu: fault', (), end, error, np.zeros(1))
    rows = study.rows('adu.nan/program', found, 'program', expected)
    assert [row['metric'] for row in rows if study.missed(row)] == short
    assert ('MISSED' in study.line('adu.nan/program', found, 'program', expected, rows)) == bool(short)


def test_a_report_that_is_not_required_is_no_miss():
    expected = Expectation(None, (), None)
    for report_steps in (None, 7):
        found = study.FaultOutcome(report_steps, '', (), 'stow', 9.0, np.zeros(1))
        rows = study.rows('adu.gust/stow', found, 'stow', expected)
        assert not any(map(study.missed, rows))
