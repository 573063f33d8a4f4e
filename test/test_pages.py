"""The pages of the documentation: they have the length of their table, and every link and anchor exists. `make quick`
runs this, because it needs nothing of the product."""
import pathlib

import pytest
from tools import pages

ROOT = pathlib.Path(__file__).parents[1]
TEXTS = {page.path: (ROOT / page.path).read_text() for page in pages.PAGES
         if page.path.endswith('.md') and (ROOT / page.path).is_file()}
COUNTED = [page for page in pages.PAGES if page.words is not None]


def test_every_page_is_in_the_table_and_every_page_of_the_table_exists():
    there = {str(path.relative_to(ROOT)) for path in (ROOT / 'docs').rglob('*.*') if path.suffix in ('.md', '.ipynb')}
    table = [page.path for page in pages.PAGES]
    assert len(table) == len({*table})
    assert {*table} == {'README.md', 'CONTRIBUTING.md', 'CHANGELOG.md', *pages.BUILT_PAGES, *there}


@pytest.mark.parametrize('page', [page for page in COUNTED if page.path in TEXTS], ids=lambda page: page.path)
def test_a_page_has_no_more_words_than_its_budget(page):
    """A page over its budget has a reason in the table, and a page within it has none."""
    words = pages.word_count(TEXTS[page.path])
    assert page.reason or words <= pages.BUDGET_MARGIN * page.words, f'{words} words of {page.words}, no reason'
    assert not page.reason or words > page.words, f'{words} words of {page.words}: no reason is needed'


def test_the_book_has_no_more_words_than_its_budget():
    assert sum(pages.word_count(TEXTS[page.path]) for page in COUNTED if page.path in TEXTS) <= pages.MAX_WORDS


@pytest.mark.parametrize('path', TEXTS)
def test_every_link_and_anchor_exists(path):
    broken = []
    for target in pages.links(TEXTS[path]):
        file, anchor = pages.resolved(path, target)
        if not (ROOT / file).exists() or anchor and anchor not in pages.anchors((ROOT / file).read_text()):
            broken.append(target)
    assert broken == []


def test_the_map_of_the_book_links_to_every_page():
    """Except to itself, README.md, the notebooks (the library links to them), and pages that the book makes."""
    linked = {pages.resolved('docs/index.md', target)[0] for target in pages.links(TEXTS['docs/index.md'])}
    apart = {'README.md', 'docs/index.md', *pages.BUILT_PAGES}
    assert {page.path for page in pages.PAGES if page.path.endswith('.md')} - apart <= {str(path) for path in linked}


def test_the_navigation_has_every_page_in_the_order_of_the_table(tmp_path):
    places = [place for page in pages.PAGES if (place := pages.book_path(page.path))]
    for place in places:
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).touch()

    def listed(entries):
        for entry in entries:
            for value in entry.values():
                yield from [value] if isinstance(value, str) else listed(value)
    assert list(listed(pages.nav(tmp_path))) == places
    (tmp_path / places[-1]).unlink()
    assert list(listed(pages.nav(tmp_path))) == places[:-1]


PAGE = """# A *page* of `code`

Two words<!-- number a b c 1 .0f -->7<!-- end --> deg | - |

    four words of code

- an item

      code of the item

```text
more code
```

<!-- table verbs, all -->
| many | words |
<!-- end -->

## What it is, and why
"""


def test_words_are_those_of_the_prose():
    """Of PAGE 'A page of code', 'Two words7 deg', 'an item', and 'What it is, and why'."""
    assert pages.word_count(PAGE) == 4 + 3 + 2 + 5


def test_anchors_are_those_of_github_and_of_mkdocs():
    assert pages.anchors(PAGE) == {'a-page-of-code', 'what-it-is-and-why'}
    assert pages.anchors('# A & B\n') == set()      # GitHub: a--b, mkdocs: a-b


def test_a_link_of_the_book_goes_to_the_place_in_the_book():
    files = {'docs/index.md', 'docs/operate/page.md', 'CONTRIBUTING.md', 'docs/a.ipynb', 'docs/a.png'}
    for path, text, expected in (
            ('docs/operate/page.md', '[c](../../CONTRIBUTING.md#tests)', '[c](../contributing.md#tests)'),
            ('docs/operate/page.md', '[home](../index.md), [here](#areas)', '[home](../index.md), [here](#areas)'),
            ('CONTRIBUTING.md', '[p](docs/operate/page.md), [m](Makefile)', '[p](operate/page.md), m'),
            ('docs/index.md', '[n](a.ipynb) ![p](a.png) [w](https://a.b)', '[n](a.md) ![p](a.png) [w](https://a.b)')):
        assert pages.for_book(text, path, files) == expected
