"""The generated tables and numbers of README.md and docs/ are what the code and docs/rows.json make of them."""
import pathlib

import pytest
from tools import pages, reference
from tools.numbers import claims, published

import pedestal_studies
from pedestal import cli

ROOT = pathlib.Path(__file__).parent.parent


MARKED = pages.marked(ROOT)


@pytest.mark.parametrize('name', MARKED)
def test_tables_and_numbers_are_up_to_date(name):
    text = (ROOT / name).read_text()
    assert reference.with_tables(text, published.read(ROOT)) == text, 'run `make docs`'


def test_every_table_stands_in_one_place():
    """In a page of the reference; the headline results are in README.md."""
    places = [(name, page) for page in MARKED for name in pages.TABLE_PATTERN.findall((ROOT / page).read_text())]
    assert sorted(name for name, _ in places) == sorted((*reference.REFERENCE_TABLES, *published.TABLES))
    assert {name for name, page in places if not page.startswith('docs/reference/')} == {'headline results'}


def test_every_verb_has_one_place_in_the_groups_of_commands():
    assert sorted(verb for verbs in reference.VERB_GROUPS.values() for verb in verbs) == sorted(cli.VERBS)
    text = (ROOT / 'docs' / 'reference' / 'commands.md').read_text()
    for group, verbs in reference.VERB_GROUPS.items():
        section = text.partition(f'\n## {group.capitalize()}\n')[2].partition('\n## ')[0]
        assert all(f'    pedestal {verb}' in section for verb in verbs), group


def test_the_rows_of_tables_and_numbers_are_all_that_is_kept():
    rows = published.read(ROOT)
    published.note_used(rows, ROOT)
    assert rows.used.keys() == rows.keys()
    assert {study for study, *_ in rows} <= {*pedestal_studies.STUDY_NAMES}


def test_what_is_random_is_never_of_one_seed():
    """servo, backlash, bode and what has no noise have plain values; every other row is one of 30 runs or more."""
    rows = published.read(ROOT)
    assert all(row['runs'] >= 30 for row in rows.values() if 'runs' in row)
    assert {study for study, *_ in rows if study not in ('servo', 'backlash', 'bode')} == {
        study for (study, *_), row in rows.items() if 'runs' in row}


def test_a_number_that_no_paper_prints_is_in_no_paper_column():
    """The number of the paper may stand beside another case, such as our own controller, and beside both readings of
    the sine of figure 6 of Ma 2023."""
    def measured(study, metric):
        return study, metric.replace('sine_0p4rads', 'sine_0p4hz')
    printed = {measured(claim.study, claim.metric)
               for of in claims.CLAIMS_BY_PAPER.values() for claim in of if '(no number)' not in claim.claim}
    for (study, case, metric), row in published.read(ROOT).items():
        if row['paper'] is not None:
            assert measured(study, metric) in printed, (study, case, metric)
