"""The study night: the contacts of its plan, explained losses, and a contact behind the hidden sector in the loop."""
import math
from types import SimpleNamespace

import numpy as np
import pytest

from pedestal_results import intervals
from pedestal_station.night import Share
from pedestal_studies.system import night as study


@pytest.mark.every_case
@pytest.mark.parametrize('announced, lost, left', [
    (0.0, 0.2, 0.0), (0.0, 1.2, 1.0), (10.0, 11.9, 0.0), (10.0, 13.0, 1.0), (10.0, 7.0, 1.0), (0.5, 0.75, 0.05)])
def test_a_loss_within_a_fifth_or_a_fifth_of_a_second_is_explained(announced, lost, left):
    assert study.unexplained(np.array([announced]), np.array([lost])) == pytest.approx([left])


def contact(case, announced):
    return study.Contact(case, (('omm', '{}'),), 0.0, 10.0, (0.0, 0.0), 100.0, 200.0, (0.0, 0.0), announced)


def test_rows_count_every_contact_once():
    table = study.rows({contact('A/1', 0.0): np.array([[0.0, 100.0], [0.1, 99.9]]),
                        contact('B/1', 10.0): np.array([[9.0, 91.0], [11.0, 89.0]]),
                        contact('C/1', 0.0): np.array([[0.0, 100.0], [5.0, 95.0]])})
    found = {(each['case'], each['metric']): each['value'] for each in table}
    assert [found['night', name] for name in ('contacts', 'without_loss', 'with_explained_loss',
                                              'with_unexplained_loss')] == [3, 1, 1, 1]
    assert found['night', 'loss_s'] == pytest.approx(12.55) and found['C/1', 'unexplained_s'] == pytest.approx(2.4)
    assert [each['case'] for each in table if intervals.missed(each)] == ['C/1', 'night']


@pytest.mark.thorough
def test_the_plan_of_the_night_and_a_contact_behind_the_hidden_sector():
    contacts = study.contacts()
    assert {each.case.partition('/')[0] for each in contacts} == {each.partition(',')[0] for each in study.SATELLITES}
    ends = [each.end for each in contacts]
    assert all(each.begin - each.lead >= end - 1e-3 for each, end in zip(contacts[1:], ends))
    hidden = min((each for each in contacts if 1.0 < each.announced < 0.5 * (each.end - each.begin)),
                 key=lambda each: each.end - each.begin)
    lost, tracked = study.measured(hidden, 0)
    assert lost == pytest.approx(hidden.announced, rel=0.02)
    assert tracked == pytest.approx(100.0 * (1.0 - lost / (hidden.end - hidden.begin)), abs=0.1)


def test_a_long_contact_is_cut_about_its_culmination():
    known = SimpleNamespace(window=SimpleNamespace(culmination=5000.0))
    share = Share(True, 0.0, 10000.0, (), '')
    half = 0.5 * study.MAX_CONTACT_S
    assert study._cut(known, share)[1:3] == (5000.0 - half, 5000.0 + half)
    known.window.culmination = -1e4
    assert study._cut(known, share)[1:3] == (0.0, 2.0 * half)
    dropped = Share(False, math.nan, math.nan, (), '')
    assert study._cut(known, dropped) is dropped
