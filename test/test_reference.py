"""The tables of README.md and docs/ are what the tables of the code make of them."""
import pathlib

import pytest
from tools import reference
from tools.numbers import claims, published

import pedestal_studies

ROOT = pathlib.Path(__file__).parent.parent


@pytest.mark.parametrize('name', reference.GENERATED_PAGES)
def test_tables_are_up_to_date(name):
    text = (ROOT / name).read_text()
    assert reference.with_tables(text, published.read(ROOT)) == text, 'run `make docs`'


def test_every_table_stands_somewhere():
    texts = ''.join((ROOT / name).read_text() for name in reference.GENERATED_PAGES)
    assert all(f'<!-- table {name} -->' in texts for name in (*reference.REFERENCE_TABLES, *published.TABLES))


def test_the_rows_of_the_tables_are_all_that_is_kept_and_say_what_studies_say():
    rows = published.read(ROOT)
    for table in published.TABLES.values():
        table(rows)
    assert rows.used.keys() == rows.keys()
    assert {study for study, *_ in rows} <= {*pedestal_studies.STUDY_NAMES}


def test_what_is_random_is_never_of_one_seed():
    """servo, backlash and what has no noise have plain values; every other row is one of 30 runs or more."""
    rows = published.read(ROOT)
    assert all(row['runs'] >= 30 for row in rows.values() if 'runs' in row)
    assert {study for study, *_ in rows if study not in ('servo', 'backlash')} == {
        study for (study, *_), row in rows.items() if 'runs' in row}


def test_a_number_that_no_paper_prints_is_in_no_paper_column():
    printed = {(claim.study, claim.case, claim.metric)
               for of in claims.CLAIMS_BY_PAPER.values() for claim in of if '(no number)' not in claim.claim}
    for key, row in published.read(ROOT).items():
        if row['paper'] is not None:
            assert key in printed, key
