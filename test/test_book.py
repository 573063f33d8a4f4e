"""The pages that are made of the code hold all of it, and every page of the table has a place in the book."""
import pathlib
import re
import xml.etree.ElementTree

import pytest
import yaml
from tools import book, book_hooks
from tools import pages as table

from pedestal import cli
from pedestal_bringup.scenario.sections import parameters_of
from pedestal_common import parameters
from pedestal_common.graph import nodes

pytestmark = pytest.mark.every_case

ROOT = pathlib.Path(__file__).parents[1]


@pytest.fixture(scope='module')
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp('book') / 'pages'
    assert book.main(folder, ROOT, execute=False) == 0
    return folder


def test_every_parameter_verb_and_law_is_there(pages):
    listed = (pages / 'reference' / 'parameters.md').read_text()
    for node in ('acu', 'adu', 'tracking_receiver', 'ship_motion', 'ins', 'beam_steering', 'scenario'):
        section = listed.partition(f'\n## {node}\n')[2].partition('\n## ')[0]
        assert all(f'| `{name}` |' in section for name in parameters.defaults(parameters_of(node)))
    verbs = (pages / 'reference' / 'verbs.md').read_text()
    assert all(f'\n## {name}\n' in verbs and f'usage: pedestal {name}' in verbs for name in cli.VERBS)
    laws = (pages / 'reference' / 'laws.md').read_text()
    for module, test in (('acu_tracker.estimation.filters.kalman', 'test_kalman.py'),
                         ('adu_drive.plant.mechanics', 'test_laws.py'),
                         ('ship_motion_sim.motion', 'test_motion.py')):
        section = laws.partition(f'\n### {module}\n')[2].partition('\n### ')[0]
        assert '```text' in section and f'`{test}`' in section


def test_the_navigation_of_mkdocs_is_that_of_the_table(pages):
    """Every page in the folder of the book is in it, and no other page is."""
    class Config:
        docs_dir = str(pages)
        nav = None

    def listed(entries):
        for entry in entries:
            for value in entry.values():
                yield from [value] if isinstance(value, str) else listed(value)
    settings = yaml.safe_load((ROOT / 'mkdocs.yml').read_text())
    assert 'nav' not in settings and settings['hooks'] == [str(pathlib.Path('tools', 'book_hooks.py'))]
    nav = list(listed(book_hooks.on_config(Config()).nav))
    places = [place for page in table.PAGES if (place := table.book_path(page.path))]
    assert nav == [place for place in places if (pages / place).is_file()]
    assert {*nav} == {str(path.relative_to(pages)) for path in pages.rglob('*.md')}


def test_every_law_has_a_sentence(pages):
    laws = (pages / 'reference' / 'laws.md').read_text()
    assert '- `step(' in laws and not any(line.endswith('`: ') for line in laws.splitlines())


def test_the_drawing_of_the_chain_has_the_nodes_and_topics_of_the_tables():
    drawing = xml.etree.ElementTree.parse(ROOT / 'docs' / 'pictures' / 'chain.svg').getroot()
    drawn = {element.get('data-node') for element in drawing.iter() if element.get('data-node')}
    arrows = {(element.text, element.get('data-from'), element.get('data-to')) for element in drawing.iter()
              if element.get('data-from')}
    links = nodes.links()
    not_drawn = {'recorder', 'weather_station', 'station'}
    assert drawn == set(nodes.NODE_NAMES) - not_drawn
    # An operator sends commands, and receives what no node of the chain subscribes to.
    for topic, writer, reader in arrows:
        assert writer in links[topic].writers or (writer, links[topic].rate) == ('operator', 'command')
        assert reader in links[topic].readers or (reader, links[topic].rate) == ('operator', 'change')
    assert arrows >= {(link.name, writer, reader) for link in links.values() if not link.flag
                      for writer in link.writers for reader in link.readers
                      if link.name != 'diagnostics' and writer not in not_drawn}


def test_every_picture_is_on_a_page_and_small():
    shown = {(page.parent / name).resolve() for page in (ROOT / 'README.md', *(ROOT / 'docs').rglob('*.md'))
             for name in re.findall(r'!\[[^]]*\]\(([^)]*)\)', page.read_text())}
    pictures = {file for kind in ('png', 'svg', 'jpg', 'gif') for file in (ROOT / 'docs').rglob(f'*.{kind}')}
    assert shown == pictures
    assert max(file.stat().st_size for file in pictures) <= 200_000
