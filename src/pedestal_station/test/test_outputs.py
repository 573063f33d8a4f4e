"""The outputs of a night: each is read by another program, says the same, and repeats to the byte."""
import csv
import datetime
import html.parser
import io
import json
import math
import pathlib
import re
import shutil

import icalendar
import numpy as np
import pytest

from pedestal import console
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_station.night import Choice, Loss, Night, Object, Pass, Prediction, Refusal, Share, Window
from pedestal_station.outputs import calendar, page, rows, words

CHROMIUM = shutil.which('chromium')
BEGIN = datetime.datetime(2026, 11, 30, 22, 30)
NAN = math.nan
STRANGE = 'A<b>&"; \\ ,\u00e9\u4e2d ' + 'x' * 60
"""Name with the characters that are special in HTML, CSV and iCalendar, and longer than a line of a calendar."""


class Line:
    """An orbit: a straight line at a height over the station, nearest at a time."""

    def __init__(self, nearest, age=0.0, height=500e3, offset=100e3):
        self.nearest, self.age, self.height, self.offset = nearest, age, height, offset
        self.low = height < 2e6

    def enu(self, times):
        t = np.asarray(times) - self.nearest
        return np.stack((7e3 * t, np.full_like(t, self.offset), np.full_like(t, self.height)), axis=-1)

    def elements_age(self, t):
        return self.age + t


def made_pass(name, number, rise, end, line=1, priority=1.0, age=0.0, height=500e3, losses=(), endless=False):
    top = 0.5 * (rise + end)
    planned = Object(name, '25544', pathlib.Path('x.tle'), line, Line(top, age, height), priority)
    window = Window(rise, (top,), top, end, math.atan2(height, 100e3), endless)
    return Pass(planned, number, window, Prediction(
        (math.radians(-80.0), math.radians(80.0)), (0.1, 0.1), (2.0, 3.0), math.radians(160.0),
        (math.radians(4.0), math.radians(0.5)), (0.02, 0.01), False, tuple(losses), 510e3, (NAN, NAN), 0.0,
        age + top))


def made_night():
    """Five passes: a whole one, one with a loss and a trim, one that lost to both, an endless one, a strange name."""
    passes = (made_pass('ISS', 1, 0.0, 600.0), made_pass('NOAA 19', 1, 500.0, 1300.0, 3, losses=(
                  Loss('keyhole', 880.0, 892.5),), age=4 * 86400.0),
              made_pass('ISS', 2, 550.0, 900.0), made_pass('GEO', 1, 0.0, 86400.0, 7, height=36e6, endless=True),
              made_pass(STRANGE, 1, 7000.0, 7600.0, 9, priority=2.0))
    whole = Share(True, 0.0, 600.0, (), '')
    last = Share(True, 7000.0, 7600.0, (), '')
    shares = (whole, Share(True, 660.0, 1300.0, ('ISS/1',), 'begins 160.0 s late after ISS/1'),
              Share(False, NAN, NAN, ('ISS/1', 'NOAA 19/1'), 'shorter than 60 s'),
              Share(False, NAN, NAN, (), 'no window'), last)
    order = (0, 3, 1, 2, 4)
    passes, shares = tuple(passes[i] for i in order), tuple(shares[i] for i in order)
    greedy = tuple(Share(False, NAN, NAN, (), 'overlaps ISS/1') if each.case == 'NOAA 19/1' else share
                   for each, share in zip(passes, shares))
    return Night(BEGIN, 86400.0, StationParameters(), None, 'leo_pass', passes, Choice(shares, 2440.0, 2500.0, False),
                 Choice(greedy, 1800.0, 2500.0, False),
                 (Refusal(pathlib.Path('bad.tle'), 4, 'DEAD', 'has <decayed>'),))


FIRST_METRICS = ['rise_s', 'culmination_s', 'set_s', 'max_elevation_deg', 'peak_azimuth_rate_deg_s', 'loss_s', 'taken']


@pytest.fixture
def night():
    return made_night()


def at(seconds):
    return (BEGIN + datetime.timedelta(seconds=seconds)).replace(tzinfo=datetime.timezone.utc)


def test_rows_are_those_of_the_interface(night):
    content = json.loads(json.dumps(rows.json_content(night), allow_nan=False))
    assert all(set(row) == {'case', 'metric', 'value', 'unit', 'paper', 'target'} for row in content['rows'])
    of_passes = {}
    for row in content['rows']:
        of_passes.setdefault(row['case'], {})[row['metric']] = row['value']
    assert list(of_passes) == [each.case for each in night.passes]
    assert all(list(values)[:len(FIRST_METRICS)] == FIRST_METRICS for values in of_passes.values())
    noaa = of_passes['NOAA 19/1']
    assert [noaa[name] for name in FIRST_METRICS] == [500.0, 900.0, 1300.0, pytest.approx(78.69, abs=0.01), 4.0, 12.5,
                                                      1]
    assert (noaa['begin_s'], noaa['greedy_begin_s'], noaa['keyhole_loss_s'], noaa['min_cn0_dbhz']) == (
        660.0, None, 12.5, None)
    assert [values['taken'] for values in of_passes.values()] == [1, 0, 1, 0, 1]


def test_the_table_of_numbers_is_read_by_any_program(night):
    lines = list(csv.DictReader(io.StringIO(rows.csv_text(night))))
    assert [line['case'] for line in lines] == [each.case for each in night.passes]
    assert [line['plan'] for line in lines] == ['whole', 'dropped', 'trimmed', 'dropped', 'whole']
    assert lines[2]['rise_utc'] == '2026-11-30T22:38:20.000Z' and lines[3]['lost_to'] == 'ISS/1; NOAA 19/1'
    assert float(lines[2]['begin_s']) == 660.0 and lines[3]['begin_s'] == ''


def test_the_calendar_is_read_by_a_library(night):
    content = calendar.text(night)
    assert all(len(line.encode()) <= 75 for line in content.split('\r\n')) and '\n' not in content.replace('\r\n', '')
    events = icalendar.Calendar.from_ical(content).walk('VEVENT')
    assert [(event.decoded('dtstart'), event.decoded('dtend')) for event in events] == [
        (at(0), at(600)), (at(660), at(1300)), (at(7000), at(7600))]
    assert [str(event['summary']) for event in events] == ['ISS/1', 'NOAA 19/1', f'{STRANGE}/1']
    assert {event.decoded('dtstamp') for event in events} == {at(0)}
    assert len({str(event['uid']) for event in events}) == 3 and 'late after ISS/1' not in str(events[0])
    assert 'ISS/1' in str(events[1]['description'])


def test_equal_nights_give_equal_bytes():
    for output in (rows.csv_text, calendar.text, lambda night: page.text(night, 'pedestal plan'),
                   lambda night: json.dumps(rows.json_content(night))):
        assert output(made_night()) == output(made_night())


def test_the_table_fits_a_narrow_terminal_and_says_what_it_leaves_out(night, capsys, monkeypatch):
    short = night._replace(passes=night.passes[:4], exact=night.exact._replace(shares=night.exact.shares[:4]),
                           greedy=night.greedy._replace(shares=night.greedy.shares[:4]))
    said = {}
    for width in (80, 150):
        monkeypatch.setenv('COLUMNS', str(width))
        console.show_night(short)
        said[width] = capsys.readouterr().out
        assert max(len(line) for line in said[width].splitlines()[1:] if 'not shown' not in line) <= width
    assert 'not shown for lack of space' in said[80] and 'not shown' not in said[150]
    for text in ('22:41:00-22:51:40', 'ISS/1 +1', 'no window', 'whole'):
        assert text in said[80], text
    endless, warning = words.warnings(night)
    assert endless == 'x.tle: line 7: GEO/1: does not set; choose its times with --window NAME=UTC/UTC'
    assert warning.startswith('x.tle: line 3: NOAA 19/1: elements 4.0 days')
    assert '2 whole, 1 trimmed, 2 dropped' in words.verdict(night) and 'at most 2500 s' in words.verdict(night)


class Page(html.parser.HTMLParser):
    """Tags and texts of a page."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.open, self.text = [], [], ''
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag != 'meta':
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def test_the_page_is_one_file_with_a_chart_and_the_sky_of_each_pass(night):
    content = page.text(night, 'pedestal plan <x>')
    found = Page(content)
    assert found.open == [] and found.tags.count('svg') == 1 + len(night.passes)
    assert not re.search(r'(?:src|href|url)\s*[=(]', content) and 'nan' not in content.replace('NaN', 'nan')
    for text in (f'{STRANGE}/1', 'has <decayed>', 'pedestal plan <x>', '22:41:00-22:51:40: ISS/1; keyhole 12.5 s'):
        assert text in found.text


@pytest.mark.thorough
@pytest.mark.skipif(CHROMIUM is None, reason='chromium is not installed')
@pytest.mark.parametrize('scheme', ('light', 'dark'))
def test_the_page_in_a_browser(night, scheme, tmp_path):
    from playwright.sync_api import sync_playwright
    file = tmp_path / 'plan.html'
    file.write_text(page.text(night, 'pedestal plan'), encoding='utf-8')
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=['--no-sandbox', '--disable-gpu'])
        shown = browser.new_page(viewport={'width': 1000, 'height': 800}, color_scheme=scheme)
        requests, errors = [], []
        shown.on('request', lambda request: requests.append(request.url))
        shown.on('pageerror', lambda error: errors.append(str(error)))
        shown.goto(file.as_uri())
        assert shown.evaluate('document.documentElement.scrollWidth') <= 1000
        outside = shown.evaluate("""() => [...document.querySelectorAll('svg :is(text, rect, line)')].filter(part => {
            const box = part.getBoundingClientRect(), svg = part.closest('svg').getBoundingClientRect();
            return box.left < svg.left - 1 || box.right > svg.right + 1 || box.top < svg.top - 1
                || box.bottom > svg.bottom + 1 }).map(part => part.outerHTML)""")
        ink = shown.evaluate("getComputedStyle(document.querySelector('.chart .name')).fill")
        browser.close()
    assert (outside, errors, requests) == ([], [], [file.as_uri()])
    assert (sum(map(int, re.findall(r'\d+', ink))) > 384) == (scheme == 'dark')
