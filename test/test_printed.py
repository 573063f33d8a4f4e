"""A page shows what its Python code prints. A change of a filter or a law can make the page wrong."""
import contextlib
import io
import itertools
import pathlib
import re

import pytest

from pedestal import cli

pytestmark = [pytest.mark.thorough, pytest.mark.every_case]

DOCS = pathlib.Path(__file__).parents[1] / 'docs'
BLOCK = re.compile(r'(?ms)^```(python|text)\n(.*?)^```$')
NUMBER = re.compile(r'-?\d+(?:\.\d+)?')


def check_equal(shown, said):
    """The words are equal, and the numbers within 1 % or one unit of the last digit."""
    assert NUMBER.sub('#', shown) == NUMBER.sub('#', said)
    for there, here in zip(NUMBER.findall(shown), NUMBER.findall(said)):
        unit = 10.0**-len(there.partition('.')[2])
        assert float(here) == pytest.approx(float(there), rel=0.01, abs=1.001 * unit), (shown, said)


@pytest.mark.parametrize(('page', 'count'), (('start/library.md', 2), ('design/budget.md', 1)))
def test_a_page_shows_what_its_code_prints(page, count, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(['samples']) == 0
    blocks = BLOCK.findall((DOCS / page).read_text())
    for _, code in blocks:
        if "savetxt('angles.csv'" in code:      # the file that the other code reads
            exec(compile(code, page, 'exec'), {})
    pairs = [(code, shown) for (kind, code), (other, shown) in itertools.pairwise(blocks)
             if (kind, other) == ('python', 'text')]
    assert len(pairs) == count
    for code, shown in pairs:
        with contextlib.redirect_stdout(io.StringIO()) as said:
            exec(compile(code, page, 'exec'), {})
        check_equal(shown, said.getvalue())
    for shown in (text for _, text in blocks if text.startswith('59.9')):
        check_equal(shown, (tmp_path / 'filtered.csv').read_text().splitlines()[-1] + '\n')
