"""The table of results: what a run is measured by stands in it once, and only there."""
import math
import pathlib

import pytest

from pedestal_bringup import console
from pedestal_bringup.again import what_if
from pedestal_bringup.analysis import results
from pedestal_bringup.bags import bag

REFERENCES = pathlib.Path(__file__).parents[3] / 'bags' / 'reference'


@pytest.mark.parametrize('table', [results.RESULTS, what_if.NUMBERS], ids=['results', 'old against new'])
def test_a_name_stands_once_with_a_sentence(table):
    documented = results.documented(table)
    assert len({name for name, *_ in documented}) == len(table) == len(documented)
    assert all(sentence.endswith('.') and '\n' not in sentence for _, _, sentence, _ in documented)


def test_the_parts_of_a_recording_decide_its_rows():
    """Ashore there is neither isolation nor an INS; a row's unit and target are those of the table."""
    ashore, ship = (results.measured(results.of_bag(bag.read(REFERENCES / name)))
                    for name in ('leo_pass', 'ship_pass'))
    kinds = {name: results.BY_NAME[name].part for name in ship}
    assert set(kinds.values()) == {'motors', 'encoders', 'tracking', 'filter', 'attitude'}    # no isolation: too short
    assert list(ashore) == [name for name in ship if kinds[name] != 'attitude']
    rows = results.rows('leo_pass', {**ashore, 'loss_s': (math.nan, 's')})
    assert [(row['metric'], row['unit'], row['target']) for row in rows] == [
        (result.name, result.unit, result.target) for result in results.RESULTS if result.name in ashore]
    assert {row['metric'] for row in rows if row['value'] is None} == {'loss_s'}


def test_a_title_is_no_markup(capsys):
    console.show_results('run: [/bold] [red]', [''], [{'x': (1.0, 'deg')}], {'lost_steps': (5309.0, 'of 12001')})
    printed = capsys.readouterr().out
    assert 'run: [/bold] [red]' in printed
    assert [line.split() for line in printed.splitlines() if 'lost_steps' in line] == [
        ['\u2502', 'lost_steps', '\u2502', '5309', '\u2502', 'of', '12001', '\u2502']]
