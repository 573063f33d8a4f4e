"""The pages of the documentation: their titles, their places in the book, and the number of words that each may have.

PAGES is the only table of the pages. The navigation of the book (tools/book_hooks.py), the pages that tools/book.py
copies, and the test of the lengths (test/test_pages.py) follow it. This module imports nothing of the product.
"""
import os
import pathlib
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

TABLE_PATTERN = re.compile(r'(?s)<!-- table ([\w ,]+) -->\n.*?<!-- end -->')
"""A generated table: its name, then the table."""
NUMBER_PATTERN = re.compile(r'(?s)<!-- number ([^>]+?) -->.*?<!-- end -->')
"""A generated number of prose: study, case, metric, factor and format, then the number."""
CODE_PATTERN = re.compile(r'(?ms)^ *(```|~~~).*?^ *\1[^\n]*$')
"""A block of code between fences."""


class Page(NamedTuple):
    """A page of the documentation."""
    path: str               # in the checkout
    title: str              # in the navigation of the book
    words: int | None       # largest number of words, within BUDGET_MARGIN; None without a limit
    reason: str = ''        # why the page has more words than that


SECTIONS = {
    '': (
        Page('README.md', '', 900),
        Page('docs/index.md', 'Home', 300)),
    'Start': (
        Page('docs/start/install.md', 'Install, upgrade, remove', 500),
        Page('docs/start/first-run.md', 'The demo, picture by picture', 700),
        Page('docs/start/tonight.md', 'Your satellite tonight', 900),
        Page('docs/start/dish.md', 'Your dish with a rotator', 1200),
        Page('docs/start/library.md', 'The Python library', 900),
        Page('docs/start/buy.md', 'What to buy', 900)),
    'Design': (
        Page('docs/design/antenna.md', 'From a data sheet to loops', 900),
        Page('docs/design/budget.md', 'The error budget', 900),
        Page('docs/design/trials.md', 'Many runs, two settings, a limit', 1200),
        Page('docs/design/filters.md', 'Which filter', 1100),
        Page('docs/choose_a_filter.ipynb', 'Notebook: choose a filter', None),
        Page('docs/size_a_drive.ipynb', 'Notebook: size a drive', None)),
    'Hardware': (
        Page('docs/hardware/index.md', 'Real equipment', 1000,
             'the table of the values that only the owner of an antenna knows'),
        Page('docs/hardware/servo-drives.md', 'Servo drives', 1600,
             'the objects on the bus and ten steps of a power-up stand nowhere else'),
        Page('docs/hardware/your-drive.md', 'Your own drive', 600, 'drives in realtime and in lockstep'),
        Page('docs/hardware/rotators.md', 'Rotators', 800),
        Page('docs/hardware/receiver.md', 'Your receiver', 1000,
             'receivers of angle errors and of a level alone, and the lines of four devices'),
        Page('docs/hardware/iq.md', 'I/Q samples', 1600,
             'the calibration matrix and the equations of the errors stand nowhere else'),
        Page('docs/hardware/ins.md', 'Your INS', 1100, 'three kinds of sources, each with its frames'),
        Page('docs/hardware/ship.md', 'On a ship', 900)),
    'Calibrate': (
        Page('docs/calibrate/pointing.md', 'The pointing', 1800),
        Page('docs/calibrate/receiver-drive-gt.md', 'Receiver, drive, sensitivity', 1500)),
    'Operate': (
        Page('docs/operate/operating.md', 'Operate the antenna', 1600),
        Page('docs/operate/page.md', "The operator's page", 900),
        Page('docs/operate/programs.md', 'Other programs', 1000),
        Page('docs/operate/acquisition.md', 'Find, lock, lose, find again', 900),
        Page('docs/operate/sky.md', 'Satellite, sun and the air', 900),
        Page('docs/operate/tracks.md', 'A track from a file', 1300),
        Page('docs/operate/plan.md', 'A night of passes', 800),
        Page('docs/operate/station.md', 'A permanent station', 1200),
        Page('docs/operate/station-night.md', 'A night by itself', 800),
        Page('docs/operate/acceptance.md', 'Acceptance', 800),
        Page('docs/operate/recordings.md', 'Recordings', 1200),
        Page('docs/operate/faults.md', 'Inject a fault', 600),
        Page('docs/operate/troubleshooting.md', 'Troubleshooting', 2400)),
    'Understand': (
        Page('docs/understand/architecture.md', 'Architecture', 1600),
        Page('docs/understand/time.md', 'Time', 900, 'foreign publishers and several hosts are part of it'),
        Page('docs/understand/evidence.md', 'Evidence', 1300),
        Page('docs/understand/papers.md', 'The five papers', 1800),
        Page('docs/glossary.md', 'Glossary', 1200)),
    'Develop': (
        Page('CONTRIBUTING.md', 'Contributing', 1100, 'the rules of code and language in full'),
        Page('docs/develop/extending.md', 'Extend the system', 1000),
        Page('docs/develop/decisions.md', 'Decisions', 1000, 'fourteen decisions, not nine'),
        Page('CHANGELOG.md', 'Changes', None)),
    'Reference': (
        Page('docs/reference/commands.md', 'Commands', None),
        Page('docs/reference/verbs.md', 'Options of every verb', None),
        Page('docs/reference/parameters.md', 'Parameters', None),
        Page('docs/reference/nodes.md', 'Nodes, topics, services', None),
        Page('docs/reference/modes.md', 'Modes, alarms, drive faults', None),
        Page('docs/reference/faults.md', 'Injected faults', None),
        Page('docs/reference/acceptance.md', 'Methods of acceptance', None),
        Page('docs/reference/results.md', 'Results, exit codes, studies', None),
        Page('docs/reference/scenarios.md', 'Scenarios', None),
        Page('docs/reference/tracks.md', 'Files of tracks', None),
        Page('docs/reference/papers.md', 'Claims of the papers', None),
        Page('docs/reference/budget.md', 'Tables of the error budget', None),
        Page('docs/reference/filters.md', 'Tables of the filters', None),
        Page('docs/reference/measured.md', 'Measured accuracy', None),
        Page('docs/reference/laws.md', 'Laws', None))}
"""{section of the navigation: its pages}; '': the pages before the first section."""
PAGES = tuple(page for pages in SECTIONS.values() for page in pages)
BUILT_PAGES = ('docs/reference/verbs.md', 'docs/reference/laws.md')
"""Pages that only the book has, because tools/book.py makes them. No page of the checkout has a link to them."""
MAX_WORDS = 45_000 + 3 * 800  # largest number of words: of 39 pages, of two of a night of passes, and of acceptance
BUDGET_MARGIN = 1.1  # factor of its limit up to which a page needs no reason


def book_path(path: str) -> str | None:
    """Return the path of a page in the book; path: its path in the checkout. None: the page is not in the book."""
    if path == 'README.md':
        return None
    place = path.removeprefix('docs/') if path.startswith('docs/') else path.lower()
    return re.sub(r'\.ipynb$', '.md', place)


def nav(folder: str | pathlib.Path) -> list[dict[str, Any]]:
    """Return the navigation of the book for mkdocs: the pages of the table that are in a folder, in its order."""
    entries: list[dict[str, Any]] = []
    for section, pages in SECTIONS.items():
        places = [(page.title, book_path(page.path)) for page in pages]
        there = [{title: place} for title, place in places if place and pathlib.Path(folder, place).is_file()]
        entries += there if not section else [{section: there}] if there else []
    return entries


def marked(root: str | pathlib.Path = '.') -> list[str]:
    """Return the paths of the pages with generated tables or numbers: of README.md and of all files in docs/."""
    root = pathlib.Path(root)
    files = [root / 'README.md', *sorted((root / 'docs').rglob('*.md'))]
    return [str(file.relative_to(root)) for file in files
            if any(pattern.search(file.read_text()) for pattern in (TABLE_PATTERN, NUMBER_PATTERN))]


def prose(text: str) -> str:
    """Return a Markdown text without its blocks of code, generated tables and comments."""
    text = re.sub(r'<!--.*?-->', '', TABLE_PATTERN.sub('', text), flags=re.DOTALL)
    text = CODE_PATTERN.sub('', text)
    lines, after_blank = [], True
    for line in text.splitlines():
        code = line.startswith('    ') and after_blank and not re.match(r'\s*([-*+]|\d+\.)\s', line)
        if not code:
            lines.append(line)
        after_blank = not line.strip() or code
    return '\n'.join(lines)


def word_count(text: str) -> int:
    """Return the number of words of a Markdown text without its blocks of code, generated tables and comments. A word
    has a letter or a digit."""
    return sum(bool(re.search(r'\w', word)) for word in prose(text).split())


def anchors(text: str) -> set[str]:
    """Return the anchors of the headings of a Markdown text, as GitHub and as mkdocs name them. A second heading of
    the same text has none."""
    found = set()
    for heading in re.findall(r'(?m)^#+ +(.*?)\s*#*$', CODE_PATTERN.sub('', text)):
        plain = re.sub(r'[^\w\s-]', '', re.sub(r'\[([^]]*)\]\([^)]*\)', r'\1', heading)).strip().lower()
        found |= {re.sub(r'\s', '-', plain)} & {re.sub(r'[-\s]+', '-', plain)}
    return found


def links(text: str) -> Iterator[str]:
    """Yield the target of each link and picture of a Markdown text, except those in code and those to web sites."""
    text = re.sub(r'`[^`\n]*`', '', CODE_PATTERN.sub('', text))
    for target in re.findall(r'\]\(([^)\s]+)[^)]*\)', text):
        if not re.match(r'\w+:', target):
            yield target


def resolved(path: str, target: str) -> tuple[str, str]:
    """Return (path in the checkout, anchor) of the target of a link. path: that of the page with the link."""
    file, _, anchor = target.partition('#')
    return os.path.normpath(os.path.join(os.path.dirname(path), file)) if file else path, anchor


def for_book(text: str, path: str, files: set[str]) -> str:
    """Return the text of a page with the links that it needs in the book. path: that of the page in the checkout;
    files: paths in the checkout of the files in the book. A link to a file that is not in the book becomes plain
    text."""
    place = book_path(path) or ''

    def link(match: re.Match[str]) -> str:
        label, target = match[1], match[2]
        if re.match(r'\w+:|#', target):
            return match[0]
        file, anchor = resolved(path, target)
        there = book_path(file)
        if file not in files or there is None:
            return label
        relative = os.path.relpath(there, os.path.dirname(place) or '.')
        return f'[{label}]({relative}{"#" * bool(anchor)}{anchor})'
    return re.sub(r'(?<!!)\[((?:[^][]|\[[^][]*\])*)\]\(([^)\s]+)\)', link, text)
