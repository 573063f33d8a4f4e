"""The tables of README.md and docs/ are what the tables of the code make of them."""
import pathlib

import pytest

from pedestal_bringup import reference

ROOT = pathlib.Path(__file__).parent.parent


@pytest.mark.parametrize('name', reference.FILES)
def test_tables_are_up_to_date(name):
    text = (ROOT / name).read_text()
    assert reference.written(text) == text, 'run `make docs`'


def test_every_table_stands_somewhere():
    texts = ''.join((ROOT / name).read_text() for name in reference.FILES)
    assert all(f'<!-- table {name} -->' in texts for name in reference.TABLES)
