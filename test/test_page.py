"""The operator's page in Debian's Chromium, on a running realtime graph and on a recording; and who is refused."""
import contextlib
import http.client
import importlib.resources
import json
import math
import os
import pathlib
import re
import shutil
import signal
import socket
import ssl
import statistics
import subprocess
import time
import urllib.parse

import limited
import pytest
from shared import NODE, PATIENCE, PEDESTAL, begins_with, free_port
from tunnel import Tunnel
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect as connect_web_socket

from pedestal_common.wire import commands, messages
from pedestal_recording import bag as bags

CHROMIUM = shutil.which('chromium')
REFERENCE = pathlib.Path(__file__).parents[1] / 'bags' / 'reference' / 'uav_flyby'
CHEAP = ('--headless', '--no-sandbox', '--disable-gpu', '--disable-software-rasterizer', '--disable-dev-shm-usage',
         '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-default-apps',
         '--disable-extensions', '--disable-sync', '--disable-quic', '--mute-audio',
         '--host-resolver-rules=MAP *.example 127.0.0.1')
"""Options of a Chromium that does nothing but show pages."""
SIZES = ((1280, 800), (1024, 768), (768, 1024), (390, 844))
"""Width and height of a desk, two tablets and a telephone [px]."""
LAYOUT_FAULTS = pathlib.Path(__file__).with_name('page_layout.js')
ACCESSIBILITY = ('wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa')
"""Rules of axe-core for WCAG 2.2 AA."""

needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason='chromium is not installed')


class Site:
    """The page's server as a client of it sees it. lines: what was printed when it started."""

    def __init__(self, lines):
        self.urls = {role: url for role, url in re.findall(r'page, (\w+): (http\S+)', lines)}
        parts = urllib.parse.urlsplit(self.urls['operator'])
        self.host, self.port, self.netloc = parts.hostname, parts.port, parts.netloc
        self.cookies = {role: self.get('/?' + urllib.parse.urlsplit(url).query).getheader('set-cookie').split(';')[0]
                        for role, url in self.urls.items()}

    def get(self, path, method='GET', **headers):
        connection = http.client.HTTPConnection(self.host, self.port, timeout=PATIENCE)
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        answer.text = answer.read().decode()
        return answer

    def open(self, role='operator', name='anna', **changes):
        """A web socket as a page of a role opens it."""
        wanted = {'origin': f'http://{self.netloc}', 'additional_headers': {'Cookie': self.cookies[role]}, **changes}
        return connect_web_socket(f'ws://{self.netloc}/socket?name={name}', open_timeout=PATIENCE, **wanted)


    def mute(self):
        """A connection with an open web socket whose messages nobody reads."""
        connection = socket.create_connection((self.host, self.port), PATIENCE)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.sendall((f'GET /socket HTTP/1.1\r\nHost: {self.netloc}\r\nOrigin: http://{self.netloc}\r\n'
                            f'Cookie: {self.cookies["monitor"]}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n'
                            'Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n'
                            ).encode())
        return connection


def hear(web_socket, wanted):
    """The first section of messages for which wanted(message) is true."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        message = json.loads(web_socket.recv(PATIENCE))
        web_socket.send(json.dumps({'seen': message['number']}))
        found = wanted(message)
        if found:
            return found
    raise AssertionError('not heard')


def reply(verb):
    def wanted(message):
        return [given for given in message.get('replies', ()) if given.get('verb') == verb]
    return wanted


@pytest.fixture(scope='module')
def lone(start_node):
    """(NodeProcess, Site) of a page without a graph."""
    page = start_node('page', '-p', 'port:=0', '-p', 'clients:=12')
    return page, Site(begins_with(page.process, 3))


def test_who_is_served(lone):
    _, site = lone
    good = {'Cookie': site.cookies['operator']}
    page = site.get('/', **good)
    assert page.status == 200 and page.getheader('cache-control') == 'no-cache'
    assert "default-src 'none'" in page.getheader('content-security-policy')
    assert 'HttpOnly' in site.get('/?token=' + good['Cookie'].partition('=')[2]).getheader('set-cookie')
    for path in ('/', '/page.js', '/history', '/uplot/LICENSE'):
        assert site.get(path).status == 401 and site.get(path, **good).status == 200
        assert site.get(path, **good, Host=f'antenna.example:{site.port}').status == 400
        assert site.get(path, **good, Origin='http://antenna.example').status == 403
    assert site.get('/', 'POST', **good).status == 403
    assert site.get('/?token=wrong').status == 401
    assert site.get('/../page_node.py', **good).status == 404
    for status, changes in ((403, {'origin': 'http://antenna.example'}), (403, {'origin': None}),
                            (401, {'additional_headers': {}}), (401, {'additional_headers': {'Cookie': 'a=b'}})):
        with pytest.raises(InvalidStatus) as refused:
            site.open(**changes)
        assert refused.value.response.status_code == status, changes


def test_a_monitor_may_only_look_and_an_operator_takes_nothing_away(lone):
    _, site = lone
    with site.open('monitor', '') as monitor, site.open() as operator:
        assert hear(monitor, lambda message: message.get('replies'))[0]['role'] == 'monitor'
        monitor.send(json.dumps({'ask': 'preset', 'id': 1}))
        assert 'may send stop only' in hear(monitor, reply('preset'))[0]['reply']
        monitor.send(json.dumps({'jog': [1, 0]}))
        assert 'may send stop only' in hear(monitor, reply('rate'))[0]['reply']
        operator.send(json.dumps({'ask': 'take', 'arguments': {'role': 'supervisor'}}))
        assert 'only the role supervisor' in hear(operator, reply('take'))[0]['reply']
        operator.send(json.dumps({'ask': 'stow'}))
        assert 'did not reply' in hear(operator, reply('stow'))[0]['reply']                  # there is no control unit


@pytest.mark.parametrize('text', ('', '[]', '{', 'null', '{"ask": 1}', '{"ask": "\\ud800"}', '{"jog": "x"}',
                                  '{"jog": [1e9, 0]}', '{"jog": [NaN, 0]}', '[' * 4000,
                                  '{"ask": "stow", "arguments": {"a": [1]}}', '{"jog": [true, 0]}'))
def test_what_is_no_message_is_answered_in_a_line(lone, text):
    server, site = lone
    with site.open() as page:
        page.send(text)
        given = hear(page, lambda message: [given for given in message.get('replies', ()) if 'you' not in given])[0]
        assert given.get('error') or not given['granted']
    assert server.process.poll() is None


@pytest.mark.thorough
def test_pages_that_never_read_are_dropped(lone):
    """Ten of them, and a page beside them is told as before; what they are sent is not kept."""
    server, site = lone
    mute = []
    with site.open() as page:
        mute += [site.mute() for _ in range(10)]
        hear(page, lambda message: message.get('now'))
        with pytest.raises(InvalidStatus) as refused:
            with site.open(), site.open():
                pass
        assert refused.value.response.status_code == 503                                 # there are twelve at the most
        before = _resident(server.process.pid)

        def room():
            with contextlib.suppress(InvalidStatus), site.open(), site.open():
                return True
        deadline = time.monotonic() + PATIENCE
        while not room():
            assert time.monotonic() < deadline
            hear(page, lambda message: message.get('now'))
        assert _resident(server.process.pid) - before < 20e6
    for connection in mute:
        connection.close()


def _resident(pid):
    return int(re.search(r'VmRSS:\s+(\d+)', pathlib.Path(f'/proc/{pid}/status').read_text())[1]) * 1024


@pytest.mark.thorough
def test_a_busy_port_is_said_in_one_line(lone, run_process, one_line):
    _, site = lone
    done = run_process([*NODE, 'operator_page', '--ros-args', '-p', f'port:={site.port}'],
                       PATIENCE)
    assert done.returncode == 1 and 'in use' in one_line(done.stderr)


def test_it_ends_without_a_word(lone):
    server, site = lone
    with site.open():
        server.process.send_signal(signal.SIGTERM)
        done = server.finish(PATIENCE)
    assert (done.returncode, done.stderr) == (0, '')


@pytest.fixture(scope='module')
def browser(tmp_path_factory):
    """(Process, playwright's Browser) of a Chromium."""
    from playwright.sync_api import sync_playwright
    folder = tmp_path_factory.mktemp('chromium')
    process = subprocess.Popen([CHROMIUM, *CHEAP, '--remote-debugging-port=0', f'--user-data-dir={folder}',
                                'about:blank'], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        port, deadline = folder / 'DevToolsActivePort', time.monotonic() + PATIENCE
        while not (port.exists() and port.read_text()):
            assert process.poll() is None and time.monotonic() < deadline, 'Chromium does not start'
            time.sleep(0.1)
        with sync_playwright() as playwright:
            yield process, playwright.chromium.connect_over_cdp(f'http://127.0.0.1:{port.read_text().split()[0]}',
                                                                timeout=PATIENCE * 1e3)
    finally:
        limited.kill_tree(process)


def opened(browser, url, requests=None):
    """A page of the browser; requests: where the addresses it asks for are put."""
    page = browser.new_context(viewport={'width': 1024, 'height': 700}, ignore_https_errors=True).new_page()
    page.set_default_timeout(PATIENCE * 1e3)
    page.errors = []
    page.on('pageerror', lambda error: page.errors.append(str(error)))
    if requests is not None:
        page.on('request', lambda request: requests.append(request.url))
        page.on('websocket', lambda opened: requests.append(opened.url))
    page.goto(url)
    return page


def reads(page, selector, text):
    """Wait until an element of the page says a text."""
    holds(page, '([s, t]) => document.querySelector(s)?.textContent.includes(t)', [selector, text])


def holds(page, condition, argument=None):
    """Wait until a condition holds in the page; it is looked at five times a second, as the page is drawn."""
    page.wait_for_function(condition, arg=argument, polling=200)


@pytest.fixture(scope='module')
def tls(tmp_path_factory):
    """A TLS context with a new certificate for antenna.example."""
    folder = tmp_path_factory.mktemp('tls')
    subprocess.run(['openssl', 'req', '-x509', '-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:prime256v1', '-nodes',
                    '-keyout', folder / 'key', '-out', folder / 'certificate', '-subj', '/CN=antenna.example'],
                   check=True, capture_output=True)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(folder / 'certificate', folder / 'key')
    return context


@pytest.fixture
def proxied(start_node):
    """Site of a page without a graph that serves one page, also as antenna.example."""
    page = start_node('page', '-p', 'port:=0', '-p', 'names:=antenna.example', '-p', 'clients:=1')
    return Site(begins_with(page.process, 3))


@pytest.mark.thorough
@needs_chromium
def test_a_page_through_a_tunnel_and_through_an_encrypting_proxy(proxied, browser, tls):
    """Its web socket opens and STOP arrives; a foreign name is refused in words, and so is a second page."""
    token = urllib.parse.urlsplit(proxied.urls['operator']).query
    for scheme, host, context in (('http', 'localhost', None), ('https', 'antenna.example', tls)):
        tunnel, requests = Tunnel(proxied.port, context), []
        page = opened(browser[1], f'{scheme}://{host}:{tunnel.port}/?{token}', requests)
        reads(page, '#link', 'no ACU')
        assert page.locator('#overlay').is_hidden() and page.locator('#stop.dead').count() == 0
        page.locator('#stop').click()
        reads(page, '#message', 'did not reply')                             # the server replied; there is no graph
        assert any(url.startswith(f'ws{scheme[4:]}://{host}:{tunnel.port}/socket') for url in requests)
        second = opened(browser[1], f'{scheme}://{host}:{tunnel.port}/?{token}')
        reads(second, '#overlay', 'too many pages are open')
        stops_in_vain(second)
        second.goto(f'{scheme}://foreign.example:{tunnel.port}/?{token}')
        reads(second, 'body', 'in the parameter `names`')
        tunnel.close()
        reads(page, '#banner', f'{host}:{tunnel.port} does not answer')
        stops_in_vain(page)
        assert page.errors == second.errors == []
        page.context.close()
        second.context.close()


def stops_in_vain(page):
    """STOP looks dead, and a press of it shows the emergency stop."""
    assert page.locator('#stop.dead').is_visible()
    page.locator('#stop').dispatch_event('click')
    reads(page, '#banner', 'STOP was not sent: no link. ')
    reads(page, '#banner', 'Use the emergency stop of the antenna.')


NIGHT_BEGIN = 1_900_000_000.0  # [s]


def night_of(states):
    """The text of station/night: passes of a minute in these states."""
    return json.dumps({'now': 'tracks ISS/2', 'passes': [
        {'case': f'<b>SAT</b> {i}/1', 'begin': NIGHT_BEGIN + 600.0 * i, 'end': NIGHT_BEGIN + 600.0 * i + 60.0,
         'max_elevation_deg': 30.4 + i, 'state': state, 'text': 'no signal' if state == 'failed' else ''}
        for i, state in enumerate(states)]})


@pytest.mark.thorough
@needs_chromium
def test_the_night_of_a_station_is_shown_while_the_station_is_there(start_node, connect, browser):
    """What runs comes first, then what is queued; the panel is hidden before the station, and after it."""
    server = start_node('page', '-p', 'port:=0')
    page = opened(browser[1], Site(begins_with(server.process, 3)).urls['operator'])
    reads(page, '#link', 'no ACU')
    assert page.locator('#night').is_hidden()
    client = connect(server.domain_id, 'station')
    client.write('station/night')

    def publish(text):
        client.publish('station/night', messages.String(data=text))
        client.spin(1.0)
    publish(night_of(['done', 'failed', 'running', 'queued', 'queued', 'dropped']))
    reads(page, '#night', 'tracks ISS/2')
    shown = page.locator('#night div[data-state]')
    assert [row.get_attribute('data-state') for row in shown.all()] == ['running', 'queued', 'queued', 'dropped',
                                                                        'failed', 'done']
    assert shown.first.inner_text() == 'running <b>SAT</b> 2/1 from 18:06 to 18:07, 32°'
    assert 'no signal' in page.locator('#night .warn').inner_text()
    publish(night_of(['done'] * 40))
    holds(page, '() => document.querySelectorAll("#night [data-state=done]").length === 40')
    for width, height in SIZES:     # a long list leaves the plot its place
        page.set_viewport_size({'width': width, 'height': height})
        assert page.locator('#sky-plot').bounding_box()['height'] > 150.0
        assert 60.0 < page.locator('#night').bounding_box()['height'] < 130.0
    publish('{"passes": 3}')
    holds(page, '() => document.querySelector("#night").hidden')
    publish(night_of(['running']))
    reads(page, '#night', 'running')
    client.close()
    holds(page, '() => document.querySelector("#night").hidden')
    assert page.errors == [] and server.process.poll() is None
    page.context.close()


@pytest.mark.thorough
@needs_chromium
def test_a_page_without_its_scripts_says_so(proxied, browser):
    page = browser[1].new_context().new_page()
    page.route('**/link.js', lambda route: route.abort())
    page.goto(proxied.urls['operator'])
    assert 'have not started' in page.locator('#overlay').text_content()
    assert 'Use the emergency stop' in page.locator('#overlay').inner_text()
    assert page.locator('#overlay').is_visible() and page.locator('#stop.dead').is_visible()
    page.context.close()


@pytest.mark.thorough
@needs_chromium
def test_a_recording_on_the_page(browser, start_process):
    port = free_port()
    player = start_process([*PEDESTAL, 'replay', REFERENCE, '--page', port, '--paused'])
    page = opened(browser[1], re.search(r'http\S+', begins_with(player, 1))[0])
    joints = bags.read(REFERENCE).table('joint_states')
    reads(page, '#link', 'recording')
    assert page.locator('#stop').is_disabled()
    reads(page, '#play', 'play')
    page.evaluate("""() => {
        window.texts = {};
        const write = CanvasRenderingContext2D.prototype.fillText;
        CanvasRenderingContext2D.prototype.fillText = function (text, ...place) {
            (texts[this.canvas.closest('[id^=chart-]').id] ??= new Set()).add(text);
            write.call(this, text, ...place);
        };
    }""")
    for moment in (3.0, 1.0):
        page.locator('#slider').fill(f'{moment:g}')
        row = int((joints['t'] - joints['t'][0] > moment + 1e-9).argmax()) - 1
        reads(page, '#az-actual', f'{math.degrees(joints["azimuth.position"][row]):.3f}')
        reads(page, '#position', f'{moment:.1f} of')
    written = "Object.entries(texts).map(([chart, texts]) => [chart, [...texts].filter((text) => text !== '')])"
    holds(page, f'() => {written}.length === 4')
    for chart, texts in page.evaluate(written):
        scale = {text for text in texts if not text.endswith(' s')}
        assert len(scale) >= 2 and {float(text) for text in scale} != {0.0}, (chart, texts)
        assert (scale != set(texts)) == (chart == 'chart-level')               # only the lowest chart has the times
    assert page.errors == []
    page.context.close()
    player.send_signal(signal.SIGINT)
    assert player.wait(PATIENCE) == 0


@pytest.mark.thorough
@needs_chromium
def test_the_scale_of_a_chart(lone, browser):
    """A slew leaves the scale, and at first it is on it. A scale has two or three different numbers."""
    page = opened(browser[1], lone[1].urls['monitor'])
    slewed = page.evaluate("""async () => {
        const t = Array.from({length: 200}, (_, i) => 0.5 * i);
        const rates = t.map((at) => at < 2 ? -130 : 0.2), missing = t.map(() => null);
        const pass = t.map((at) => at < 12 ? -10 : 0.2 + Math.exp(-(((at - 60) / 5) ** 2)));
        const {shownRange} = await import('./charts.js');
        return [shownRange(t, [rates, missing]), shownRange(t.slice(0, 20), [rates.slice(0, 20)]),
                shownRange(t, [missing]), shownRange(t, [pass, t.map((at) => (60 - at) / 60)])];
    }""")
    assert slewed[:3] == [[0.2, 0.2], [-130, 0.2], [None, None]]
    assert slewed[3] == pytest.approx([-0.66, 1.2], abs=0.01)               # a pass with its culmination stays on it
    ranges = [[-0.035, 0.028], [-4e-4, 3e-4], [-130, 10], [40.13, 40.24], [-1, 1], [0, 1e-5], [9, 41]]
    texts = page.evaluate("""async (ranges) => {
        const {ticks, tickTexts} = await import('./charts.js');
        return ranges.map((range) => tickTexts(ticks(...range)));
    }""", ranges)
    assert texts[0] == ['-0.02', '0.00', '0.02'] and texts[-1] == ['20', '40']
    for (low, high), numbers in zip(ranges, texts):
        assert 2 <= len(set(numbers)) == len(numbers) <= 3 and all(low <= float(number) <= high for number in numbers)
    page.context.close()


@pytest.mark.thorough
@needs_chromium
def test_the_residuals_of_the_model_in_force_as_a_sky_plot_and_as_arrows(browser, start_process, start_run):
    """The recording has a model with three residuals; the longest arrow is that of the largest."""
    run = start_run('leo_pass', '--duration', 2, '--param', 'acu.pointing.p1=0.001', '--param',
                    'acu.pointing.residuals=0 10 2 0; 90 45 0 4; 180 80 -1 -1')
    assert run.finish().returncode == 0
    player = start_process([*PEDESTAL, 'replay', run.bag, '--page', free_port(), '--paused'])
    page = opened(browser[1], re.search(r'http\S+', begins_with(player, 1))[0])
    page.locator('#slider').fill('1')
    page.wait_for_selector('#show-residuals:not([hidden])')
    assert page.locator('#sky-plot .residual').count() == 0
    page.locator('#show-residuals').press('Enter')
    reads(page, '#sky-frame', 'rms 0.0019°, longest arrow 0.0040°')
    arrows = [[[float(number) for number in point.split(',')] for point in arrow.get_attribute('points').split()]
              for arrow in page.locator('#sky-plot .residual').all()]
    (x, y), (to_x, to_y) = arrows[0][:2]
    assert (x, y) == pytest.approx((0.0, -85.3), abs=0.06)
    assert (to_x - x, to_y - y) == pytest.approx((12.0, 0.0), abs=0.2)
    (x, y), (to_x, to_y) = arrows[1][:2]
    # An elevation residual in the east points to the zenith, which is in the middle.
    assert (x, y) == pytest.approx((48.0, 0.0), abs=0.06)
    assert (to_x - x, to_y - y) == pytest.approx((-24.0, 0.0), abs=0.2)
    assert page.locator('#sky-plot .residual-place').count() == 3
    page.locator('#show-residuals').press('Enter')
    reads(page, '#sky-frame', 'north up')
    assert page.locator('#sky-plot .residual').count() == 0 and page.errors == []
    page.context.close()
    player.send_signal(signal.SIGINT)
    assert player.wait(PATIENCE) == 0


@pytest.fixture(scope='module')
def antenna(station):
    """(Run, Client of its graph, Site of its page); not even a serial line, which nobody closes, is in control."""
    station.client.read('acu/command_result')
    site = Site(station.said)
    with site.open('supervisor', 'dora') as page:
        for verb, arguments in (('take', {'role': 'supervisor'}), ('release', {})):
            page.send(json.dumps({'ask': verb, 'arguments': arguments}))
            assert hear(page, reply(verb))[0]['granted']
    yield station.run, station.client, site
    station.end()


def mode(client):
    return client.heard['acu/mode'][-1].data


def press(page, client, selector, done):
    """Press a button of the page, every 5 s again, until done(): what is refused while the machine is busy is asked
    for again, as a person would."""
    pressed = -math.inf

    def come():
        nonlocal pressed
        if done():
            return True
        if time.monotonic() - pressed > 5.0:
            pressed = time.monotonic()
            page.locator(selector).click()
        return False
    client.until(come, PATIENCE, lambda: f'{mode(client)}; the page says {page.locator("#message").text_content()!r}')


def enters(client, wanted):
    """Whether the antenna has entered a mode since this was called."""
    first = len(client.heard['acu/mode'])
    return lambda: any(said.data == wanted for said in client.heard['acu/mode'][first:])


def says(page, selector, text):
    return lambda: text in page.locator(selector).text_content()


def rates(client):
    return list(client.heard['joint_states'][-1].velocity)


@needs_chromium
def test_an_operator_at_the_page(antenna, browser):
    """Modes, preset, control, a greyed button's reason, an alarm acknowledged; nothing is asked of elsewhere."""
    run, client, site = antenna
    requests = []
    page = opened(browser[1], site.urls['operator'], requests)
    reads(page, '#link', 'live')
    reads(page, '#passes', 'position 47.40 N 8.50 E, 500 m: the default')
    page.locator('#name').fill('anna')
    page.locator('#name').press('Enter')
    reads(page, '#link', 'live')
    # Both at one moment: the target may fly through the beam of an antenna that stands.
    holds(page, """() => {
        const autotrack = document.querySelector("[data-verb=autotrack]");
        return autotrack.ariaDisabled === "true" && autotrack.title.includes("receiver not locked");
    }""")
    press(page, client, '#take', says(page, '#control', 'anna@page'))
    page.locator('[name=elevation]').fill('30')
    for text in ('', '0x10', '1e2', '1,000.5', 'NaN', '1 2'):
        page.locator('[name=azimuth]').fill(text)
        page.locator('#take').focus()
        page.evaluate('document.querySelector("#message").textContent = ""')
        press(page, client, '[data-verb=preset]', says(page, '#message', 'must be decimal numbers'))
    page.locator('[name=azimuth]').fill('+20,0')
    press(page, client, '[data-verb=preset]', enters(client, 'preset'))
    press(page, client, '[data-verb=preset]', says(page, '#az-actual', '20.000°'))
    page.locator('[name=elevation]').fill('150')
    press(page, client, '[data-verb=preset]', says(page, '#message', 'outside limits'))
    reads(page, '#log-list', 'anna@page')
    client.trigger('adu/emergency_stop')
    page.locator('[data-alarm="emergency stop"] button', has_text='ack').click()
    page.wait_for_selector('[data-alarm="emergency stop"][data-state=acknowledged]')
    reads(page, '#common-refusal', 'grey: drive not ready: ')
    assert 'drive not ready: ' in page.locator('[data-verb=program]').get_attribute('title')
    reads(page, '#urgent', 'emergency stop')
    client.trigger('adu/reset_faults')
    holds(page, '() => document.querySelector("[data-verb=program]").ariaDisabled === "false"')
    press(page, client, '[data-verb=program]', enters(client, 'program'))
    press(page, client, '#stop', enters(client, 'stop'))
    press(page, client, '#release', says(page, '#control', 'none'))
    assert {urllib.parse.urlsplit(url).netloc for url in requests} == {site.netloc}
    assert page.errors == []
    page.context.close()


@pytest.mark.thorough
@needs_chromium
def test_a_button_allows_a_program_at_rotctld_to_take_the_antenna(antenna, station, browser):
    _, client, site = antenna
    page = opened(browser[1], site.urls['operator'], [])
    assert page.locator('#allow').is_hidden()
    press(page, client, '#take', lambda: page.locator('#release').get_attribute('aria-disabled') == 'false')
    with socket.create_connection(('127.0.0.1', station.ports['rotctld']), 5.0) as program:
        program.settimeout(10.0)

        def asked():
            program.sendall(b'P 12 40\n')
            return program.recv(100)
        assert asked() == b'RPRT -9\n'
        page.locator('#allow', has_text='from 127.0.0.1 to take control').wait_for()
        press(page, client, '#allow', lambda: asked() == b'RPRT 0\n')
        reads(page, '#control', 'rotctld')
        assert page.locator('#allow').is_hidden()
        program.sendall(b'S\nq\n')
    reads(page, '#control', 'none')
    assert page.errors == []
    page.context.close()


@pytest.mark.excused_by(None)
@pytest.mark.thorough
def test_ten_pages_that_never_read_cost_the_control_unit_no_step(antenna):
    """Steps for which the drive had no command, in spans without and with such pages by turns, once these have what
    they are sent unread: the difference of the shares is not above its own scatter, which is the machine's."""
    _, client, site = antenna
    client.read('diagnostics')

    def drive():
        told = [status for array in client.heard['diagnostics'] for status in array.status if status.name == 'adu']
        values = {pair.key: pair.value for status in told for pair in status.values}
        return told and (int(values['step']), int(values['lost_steps']))

    def share_lost():
        client.heard['diagnostics'].clear()
        first, lost = client.until(drive)
        last, more = client.until(lambda: (now := drive())[0] > first + 150 and now)
        return (more - lost) / (last - first)
    differences = []
    for _ in range(6):
        without = share_lost()
        mute = [site.mute() for _ in range(10)]
        time.sleep(1.5)                                                  # opening them is work that others do as well
        differences.append(share_lost() - without)
        for connection in mute:
            connection.close()
    scatter = statistics.stdev(differences) / math.sqrt(len(differences))
    assert statistics.mean(differences) < 0.01 + 5.0 * scatter, differences


def moving(client):
    return abs(rates(client)[0]) > 0.004


def stands(client):
    return rates(client) == pytest.approx([0.0, 0.0], abs=1e-3)


def last_rate(client):
    """The last command of a jog that was replied to, None before."""
    heard = [status for status in client.heard['acu/command_result'] if status.name == 'rate']
    return commands.of_reply(heard[-1])[0] if heard else None


@pytest.mark.thorough
def test_a_jog_ends_with_its_page_or_its_silence(antenna):
    """Held on a web socket: while it is repeated the axis moves; silent but open, late, or gone, it stands."""
    _, client, site = antenna

    def hold(page):
        hear(page, lambda message: message.get('now'))
        page.send('{"jog": [0.5, 0]}')
        client.spin(0.02)
        return moving(client)
    for silent in (True, False):
        with site.open(name='bert') as page:
            client.until(lambda page=page: hold(page))
            if silent:
                client.until(lambda: stands(client))
        client.until(lambda: stands(client))
        client.until(lambda: (last := last_rate(client)) is not None and last.arguments['azimuth'] == '0')
        assert last_rate(client).who == 'bert@page 127.0.0.1'
    with site.open(name='bert') as page:
        time.sleep(0.6)                                                     # it has seen nothing for so long
        page.send('{"jog": [0.5, 0]}')
        assert 'the state on the page is' in hear(page, reply('rate'))[0]['reply']


@pytest.mark.thorough
@needs_chromium
def test_a_jog_by_keys(antenna, browser):
    """Space and Enter move the axis while they are held, and no longer than the button has the focus."""
    _, client, site = antenna
    page = opened(browser[1], site.urls['operator'])
    right = page.locator('[data-jog="1 0"]')
    for key, end in (('Space', lambda: page.keyboard.up('Space')), ('Enter', lambda: page.keyboard.up('Enter')),
                     ('Space', lambda: page.locator('#name').focus())):
        holds(page, '() => document.querySelector("[data-jog=\\"1 0\\"]").ariaDisabled === "false"')
        right.focus()
        page.keyboard.down(key)
        client.until(lambda: moving(client))
        page.keyboard.down(key)                                            # keys repeat themselves while they are held
        page.keyboard.down('ArrowLeft')
        page.keyboard.up('ArrowLeft')
        assert page.locator('button.held').count() == 1
        end()
        assert page.locator('button.held').count() == 0
        client.until(lambda: stands(client))
        page.keyboard.up(key)
    assert page.errors == []
    page.context.close()


@pytest.mark.thorough
@needs_chromium
def test_every_screen_passes_axe_in_health(antenna, browser):
    page, _ = tunnelled(antenna, browser)
    look_at_sizes(page)
    page.context.close()


@pytest.mark.thorough
@needs_chromium
def test_every_screen_keeps_what_a_fault_needs(antenna, browser):
    _, client, _ = antenna
    page, _ = tunnelled(antenna, browser)
    client.trigger('adu/emergency_stop')
    try:
        # On a machine short of time another alarm of the same priority may be older, and is then the first.
        reads(page, '#first-alarm', ' alarm: ')
        reads(page, '#first-alarm', '→ ')
        reads(page, '#alarm-list', 'find the cause of the stop')
        reads(page, '#common-refusal', 'drive not ready: ')
        look_at_sizes(page)
    finally:
        client.trigger('adu/reset_faults')
    page.context.close()


@pytest.mark.thorough
@needs_chromium
def test_a_page_that_loses_its_link_dims_and_counts_the_age_of_its_data(antenna, browser):
    page, tunnel = tunnelled(antenna, browser)
    figures = '[...document.querySelectorAll("svg, [id^=chart-]")].map((figure) => figure.ariaLabel)'
    holds(page, f'() => {figures}.every((label) => /: .*(\\d|no error signal)/.test(label))')
    bright = colour(page)
    tunnel.close()
    reads(page, '#banner', 'No link to the antenna')
    assert colour(page) != bright
    holds(page, '() => Number(document.querySelector("#banner-age").textContent.match(/\\d+/)[0]) >= 3')
    holds(page, f'() => {figures}.every((label) => / s ago: /.test(label))')
    look_at_sizes(page)
    stops_in_vain(page)
    assert page.errors == []
    page.context.close()


def tunnelled(antenna, browser):
    """(page of the antenna, Tunnel that it is reached through)."""
    site = antenna[2]
    tunnel = Tunnel(site.port)
    page = opened(browser[1], site.urls['operator'].replace(f':{site.port}', f':{tunnel.port}'))
    reads(page, '#link', 'live')
    return page, tunnel


def colour(page):
    return page.evaluate('getComputedStyle(document.querySelector("#az-actual")).color')


def look_at_sizes(page):
    """No part of the page is hidden, cut or small (page_layout.js), and axe-core finds no violation."""
    page.evaluate((importlib.resources.files('axe_playwright_python') / 'axe.min.js').read_text())
    for width, height in SIZES:
        page.set_viewport_size({'width': width, 'height': height})
        page.evaluate('() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))')
        assert page.evaluate(LAYOUT_FAULTS.read_text()) == [], (width, height)
        found = page.evaluate('(tags) => axe.run({runOnly: tags, resultTypes: ["violations"]})', ACCESSIBILITY)
        assert [(fault['id'], [node['html'] for node in fault['nodes']]) for fault in found['violations']] == []
        assert len(found['passes']) > 10


@pytest.mark.thorough
@needs_chromium
def test_a_jog_ends_with_its_browser(antenna, browser):
    """Chromium is killed while the button is held: the page can no longer do anything about it."""
    _, client, site = antenna
    page = opened(browser[1], site.urls['operator'])
    reads(page, '#link', 'live')
    holds(page, '() => document.querySelector("[data-jog=\\"1 0\\"]").ariaDisabled === "false"')
    page.locator('[data-jog="1 0"]').hover()
    page.mouse.down()
    client.until(lambda: moving(client))
    asked = [status for status in client.heard['acu/command_result'] if status.name == 'rate']
    client.until(lambda: len([status for status in client.heard['acu/command_result'] if status.name == 'rate'])
                 > len(asked) + 2)                                          # it goes on as long as it is held
    os.killpg(browser[0].pid, signal.SIGKILL)
    client.until(lambda: stands(client))
    assert mode(client) == 'rate'


@pytest.mark.thorough
def test_the_antenna_tracks_on_when_the_server_is_killed(antenna):
    run, client, site = antenna
    with site.open(name='carla') as page:
        hear(page, lambda message: message.get('status', {}).get('present'))
        page.send(json.dumps({'ask': 'program', 'id': 3}))
        assert hear(page, reply('program')) == [{'id': 3, 'verb': 'program', 'granted': True,
                                                 'reply': 'mode is program'}]
    [pid] = [int(process.name) for process in pathlib.Path('/proc').glob('[0-9]*')
             if f'port:={site.port}'.encode() in _arguments(process)]
    os.kill(pid, signal.SIGKILL)
    client.until(lambda: mode(client) == 'program')
    count = len(client.heard['joint_states'])
    client.until(lambda: len(client.heard['joint_states']) > count + 200)
    assert mode(client) == 'program' and run.process.poll() is None


def _arguments(process):
    try:
        return (process / 'cmdline').read_bytes().split(b'\0')
    except OSError:
        return []


@pytest.mark.thorough
def test_the_recording_says_who_asked_at_which_page(station):
    assert {'bert@page 127.0.0.1', 'carla@page 127.0.0.1'} <= {command.who for command in station.asked()}
