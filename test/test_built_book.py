"""The book in a browser, from the disk: search, and pages that show their tables and code. `make book` runs this."""
import os
import pathlib
import shutil

import pytest
from shared import PATIENCE

if 'BOOK' not in os.environ:
    pytest.skip('`make book` runs this', allow_module_level=True)

BOOK = pathlib.Path(os.environ['BOOK']).resolve()
PAGES = sorted(path for path in BOOK.rglob('*.html') if path.name != '404.html')
CHROMIUM = shutil.which('chromium') or shutil.which('google-chrome')
DESK, LAPTOP, TELEPHONE = 1280, 1024, 390
"""Widths of a page [px]."""
TOO_WIDE = """() => {
    const clipped = element => {
        for (let box = element; box && box.tagName != 'ARTICLE'; box = box.parentElement)
            if (/auto|scroll/.test(getComputedStyle(box).overflowX)) return false
        return true
    }
    const wide = [...document.querySelectorAll('article pre > code, article table, article p > img, article svg')]
        .filter(element => {
            const box = element.closest('.md-typeset__scrollwrap, pre, p, article')
            return Math.max(element.scrollWidth, element.getBoundingClientRect().width) > box.clientWidth + 1
        })
    const name = element => element.tagName + ' ' + (element.textContent || element.src).trim().slice(0, 60)
    return {page: document.documentElement.scrollWidth, clipped: wide.filter(clipped).map(name), wide: wide.map(name)}
}"""
"""Width of the page [px], and its tables, pictures and blocks of code that are wider than their box: those that no
box scrolls, and all."""


@pytest.fixture(scope='module')
def browser():
    assert CHROMIUM, 'the check of the book needs Chromium or Google Chrome'
    from playwright.sync_api import sync_playwright
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=['--no-sandbox', '--disable-gpu'])
        yield browser
        browser.close()


def opened(browser, width):
    """A page of a width without a network; `requests` lists the addresses that it fetches."""
    page = browser.new_page(viewport={'width': width, 'height': 900})
    page.set_default_timeout(PATIENCE * 1e3)
    page.requests = []
    page.on('request', lambda request: page.requests.append(request.url))
    return page


def test_the_search_works_from_the_disk(browser):
    page = opened(browser, DESK)
    page.goto((BOOK / 'index.html').as_uri())
    page.locator('.md-search__input').fill('keyhole')
    found = page.locator('.md-search-result__link')
    found.first.wait_for()
    assert int(page.locator('.md-search-result__meta').inner_text().split()[0]) > 1
    found.first.click()
    page.wait_for_url(lambda url: not url.endswith('index.html'))
    assert 'keyhole' in page.locator('article').inner_text().lower()
    assert [url for url in page.requests if not url.startswith(('file:', 'data:', 'about:', 'blob:'))] == []


QUESTIONS = {
    'my satellite tonight': 'start/tonight', 'rotator does not move': 'start/dish',
    'what does acquire mean': 'operate/acquisition', 'which filter should I use': 'design/filters',
    'receiver never locks': 'operate/troubleshooting', 'exit code 3': 'reference/results',
    'calibrate the pointing': 'calibrate/pointing', 'which drive can I buy': 'start/buy',
    'inject a fault': 'operate/faults', 'recording with pandas': 'operate/recordings'}
"""{question as a user types it: the page that answers it}."""
FIRST_RESULTS = 5  # number of pages on the first screen of results


@pytest.mark.parametrize('question', QUESTIONS)
def test_the_search_answers_a_question_on_its_first_screen(browser, question):
    page = opened(browser, DESK)
    page.goto((BOOK / 'index.html').as_uri())
    page.locator('.md-search__input').fill(question)
    found = page.locator('.md-search-result__item > .md-search-result__link:first-child')
    found.first.wait_for()
    first = [href.partition('.html')[0] for href in found.evaluate_all(
        'links => links.map(link => link.href)')[:FIRST_RESULTS]]
    assert (BOOK / QUESTIONS[question]).as_uri() in first
    page.close()


@pytest.mark.parametrize('width', [DESK, LAPTOP, TELEPHONE])
def test_no_page_hides_a_table_or_code(browser, width):
    """On a desk tables and code fit; on a narrower screen a box scrolls what does not fit."""
    page, faults = opened(browser, width), {}
    for path in PAGES:
        page.goto(path.as_uri())
        found = page.evaluate(TOO_WIDE)
        hidden = found['wide'] if width == DESK else found['clipped']
        if hidden or found['page'] > width:
            faults[str(path.relative_to(BOOK))] = (found['page'], hidden)
    assert faults == {}


@pytest.mark.parametrize('name, figures, printed', [
    ('choose_a_filter', 2, '95 % interval), and wins'),
    ('size_a_drive', 2, 'rank_correlation(adu.wind.gust.azimuth): '),
])
def test_a_notebook_has_its_output(browser, name, figures, printed):
    page = opened(browser, DESK)
    page.goto((BOOK / f'{name}.html').as_uri())
    assert page.locator('article img').count() == figures
    assert all(page.locator('article img').evaluate_all('images => images.map(image => image.naturalWidth > 400)'))
    assert any(printed in text for text in page.locator('article pre code').all_inner_texts())
