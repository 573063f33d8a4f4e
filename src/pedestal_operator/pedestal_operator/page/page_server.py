"""The server of the page: its files, and a web socket for each page, in a thread of its own. No ROS here.

What a page is sent is a state in sections, each with a revision. Messages are numbered, and a page says which one it
has seen. While MAX_UNSEEN_MESSAGES of them are on their way it gets no other; then one with the sections that have
changed since, so
the newest wins: nothing is queued for anybody but the few replies to what he asked. A page that sees nothing for
PAGE_TIMEOUT_S is dropped.
"""
import asyncio
import collections
import contextlib
import json
import math
import pathlib
import queue
import socket
import threading
import time
import typing

import uvicorn
from starlette.applications import Starlette
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocketDisconnect

from pedestal_operator.page import page_security
from pedestal_operator.page.page_security import Refused

STATIC_FOLDER = pathlib.Path(__file__).parents[1] / 'static'

MAX_UNSEEN_MESSAGES = 4
"""Messages that a page has not seen yet at the most."""

PAGE_TIMEOUT_S = 5.0
"""Time [s] for which a page may see nothing before it is dropped."""

MAX_MESSAGE_BYTES = 4096
"""Bytes of a message from a page at the most."""

MAX_QUEUED_REQUESTS, MAX_QUEUED_REPLIES = 200, 50
"""Asks of all pages that wait for the node, and replies that wait for a page, at the most."""

REQUEST_BURST_LIMIT, REQUEST_BURST_PERIOD_S = 40, 1.0
"""So many asks of a page are heard in this time [s]; a jog takes five."""

SHUTDOWN_TIMEOUT_S = 1.0
"""Time [s] that the pages are given when the server ends."""


class PageMessage(typing.NamedTuple):
    """What a page has asked: a dict, None where it has left; age: of the newest state that it has seen [s]."""
    client: 'Client'
    message: dict | None
    age: float


class Client:
    """A page. name: of its user; role: of page_security.ROLES; address: of its host."""

    def __init__(self, name, role, address):
        self.name, self.role, self.address = name, role, address
        self.replies = collections.deque(maxlen=MAX_QUEUED_REPLIES)
        self.wake = asyncio.Event()
        self._revisions, self._asked = {}, collections.deque(maxlen=REQUEST_BURST_LIMIT)
        self._number, self._sent, self._seen = 0, {}, time.monotonic()

    def __str__(self):
        return f'{self.name}@page {self.address}'

    def newest(self, sections):
        """The message of what has changed for it: JSON; sections: {name: (revision, JSON)}."""
        self._number += 1
        self._sent[self._number] = time.monotonic()
        parts = [f'"number":{self._number}', *(f'"{name}":{text}' for name, (revision, text) in sections.items()
                                               if self._revisions.get(name) != revision)]
        self._revisions = {name: revision for name, (revision, _) in sections.items()}
        if self.replies:
            parts.append(f'"replies":[{",".join(self.replies)}]')
            self.replies.clear()
        return '{' + ','.join(parts) + '}'

    def see(self, number):
        """It has seen the message of a number."""
        if type(number) is int and number in self._sent:
            self._seen = self._sent[number]
            self._sent = {other: at for other, at in self._sent.items() if other > number}
            self.wake.set()

    @property
    def busy(self):
        """Whether it has enough to see."""
        return len(self._sent) >= MAX_UNSEEN_MESSAGES

    @property
    def gone(self):
        """Whether it has seen nothing for PAGE_TIMEOUT_S."""
        return self.busy and time.monotonic() - next(iter(self._sent.values())) > PAGE_TIMEOUT_S

    @property
    def age(self):
        """Age [s] of the newest state that it has seen."""
        return time.monotonic() - self._seen

    def too_fast(self):
        """Whether it asks more than REQUEST_BURST_LIMIT times in REQUEST_BURST_PERIOD_S."""
        self._asked.append(time.monotonic())
        return len(self._asked) == REQUEST_BURST_LIMIT and self._asked[-1] - self._asked[0] < REQUEST_BURST_PERIOD_S


class PageServer:
    """Serves from when it is made until `close`. asked: a queue of Asked, for the node; pages: how many there are.

    history() -> what a new page draws of the past; called in a thread of the server. Raises OSError where the
    address and port cannot be had.
    """

    def __init__(self, address, port, names, most, history):
        self.pages, self.asked = 0, queue.Queue(MAX_QUEUED_REQUESTS)
        family = socket.AF_INET6 if ':' in address else socket.AF_INET
        self._socket = socket.create_server((address, port), family=family)
        self.access = page_security.Access(address, self._socket.getsockname()[1], names)
        self._most, self._history = most, history
        self._clients, self._sections, self._revision, self._named = set(), {}, 0, 0
        self._published = {}
        app = Starlette(routes=[Route('/', self._index), Route('/history', self._past),
                                WebSocketRoute('/socket', self._talk),
                                Mount('/', StaticFiles(directory=STATIC_FOLDER))])
        self._server = uvicorn.Server(uvicorn.Config(
            self._guarded(app), log_config=None, log_level='critical', access_log=False, lifespan='off', http='h11',
            ws='websockets-sansio', ws_max_size=MAX_MESSAGE_BYTES, ws_per_message_deflate=False, proxy_headers=False,
            server_header=False, timeout_graceful_shutdown=SHUTDOWN_TIMEOUT_S))
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name='page_server', daemon=True)
        self._thread.start()

    def _run(self):
        asyncio.set_event_loop(self._loop)
        with contextlib.closing(self._loop):
            self._loop.run_until_complete(self._server.serve([self._socket]))

    def publish(self, sections):
        """Tell every page those of {name: content} that are not as they were; from the node's thread."""
        texts = {name: encoded(content) for name, content in sections.items()}
        fresh = {name: text for name, text in texts.items() if self._published.get(name) != text}
        self._published |= fresh
        self._call(self._take, fresh)

    def reply(self, client, message):
        """Tell one page; from the node's thread."""
        self._call(self._say, client, json.dumps(message))

    def _call(self, function, *arguments):
        with contextlib.suppress(RuntimeError):  # the loop is closed: the server has ended
            self._loop.call_soon_threadsafe(function, *arguments)

    def _take(self, sections):
        self._revision += 1
        self._sections |= {name: (self._revision, text) for name, text in sections.items()}
        for client in self._clients:
            client.wake.set()

    @staticmethod
    def _say(client, text):
        client.replies.append(text)
        client.wake.set()

    def close(self):
        """End: every page is told, and those that do not listen are left after SHUTDOWN_TIMEOUT_S."""
        self._server.should_exit = True
        self._thread.join(3.0 * SHUTDOWN_TIMEOUT_S)

    def _guarded(self, app):
        """The app behind page_security; its answers carry the headers."""
        async def guarded(scope, receive, send):
            request = _judged(scope)
            try:
                scope['role'] = self.access.role(request)
            except Refused as refused:
                answer = PlainTextResponse(f'{refused.reason}\n', refused.status)
                await answer(scope, receive, _adding(send, 'none'))
                return
            await app(scope, receive, _adding(send, request.host))
        return guarded

    async def _index(self, request):
        """The page; the address with the token only sets the cookie, so that the token stays out of the history."""
        if 'token' not in request.query_params:
            return await StaticFiles(directory=STATIC_FOLDER).get_response('index.html', request.scope)
        answer = RedirectResponse('/', 303)
        answer.set_cookie(self.access.cookie, self.access.tokens[request.scope['role']], httponly=True,
                          samesite='strict')
        return answer

    async def _past(self, _):
        return Response(await asyncio.to_thread(lambda: encoded(list(self._history()))), media_type='application/json')

    async def _talk(self, websocket):
        """A page as long as it is there."""
        if len(self._clients) >= self._most:
            await websocket.send_denial_response(PlainTextResponse(f'there are {self._most} pages already\n', 503))
            return
        self._named += 1
        role = websocket.scope['role']
        client = Client(_name(websocket.query_params.get('name', '')) or f'{role}-{self._named}', role,
                        websocket.client.host)
        client.replies.append(json.dumps({'you': client.name, 'role': role}))
        await websocket.accept()
        self._clients.add(client)
        self.pages = len(self._clients)
        client.wake.set()
        tasks = [asyncio.ensure_future(self._tell(websocket, client)),
                 asyncio.ensure_future(self._hear(websocket, client))]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._clients.discard(client)
            self.pages = len(self._clients)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self._ask(PageMessage(client, None, client.age))

    async def _tell(self, websocket, client):
        while not client.gone:
            await client.wake.wait()
            client.wake.clear()
            if not client.busy:
                await asyncio.wait_for(websocket.send_text(client.newest(self._sections)), PAGE_TIMEOUT_S)

    async def _hear(self, websocket, client):
        with contextlib.suppress(WebSocketDisconnect):
            while True:
                message = _parsed(await websocket.receive())
                if message is None:
                    self._say(client, json.dumps({'error': 'that was no message of this page'}))
                elif 'seen' in message:
                    client.see(message['seen'])
                elif client.too_fast():
                    self._say(client,
                              json.dumps({'error': f'more than {REQUEST_BURST_LIMIT} messages in {REQUEST_BURST_PERIOD_S:g} s'}))
                elif not self._ask(PageMessage(client, message, client.age)):
                    self._say(client, json.dumps({'error': 'too many asks wait for the antenna'}))

    def _ask(self, asked):
        """Hand an ask to the node; whether there was room."""
        try:
            self.asked.put_nowait(asked)
        except queue.Full:
            return False
        return True


def encoded(value):
    """JSON of a value; a number that is none is null, which JSON has and browsers read."""
    return json.dumps(_plain(value), separators=(',', ':'), allow_nan=False)


def _plain(value):
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, (list, tuple)) else value


def _judged(scope):
    """The page_security.Request of an ASGI scope."""
    given = {}
    for key, value in scope['headers']:
        given.setdefault(key.decode('latin-1'), value.decode('latin-1'))
    query = dict(part.split('=', 1) for part in scope['query_string'].decode('latin-1').split('&') if '=' in part)
    asks = scope['type'] == 'websocket' or scope['method'] not in ('GET', 'HEAD')
    return page_security.Request(given.get('host', ''), given.get('origin', ''), given.get('cookie', ''),
                                 query.get('token', ''), scope['path'], asks)


def _adding(send, host):
    """send, with page_security.headers added to the start of an answer."""
    extra = [(name.encode(), value.encode('latin-1')) for name, value in page_security.headers(host)]

    async def adding(message):
        if message['type'].endswith('http.response.start'):
            message = {**message, 'headers': [*message.get('headers', ()), *extra]}
        await send(message)
    return adding


def _name(text):
    """A user's name as he gave it, without what does not belong into one."""
    return ''.join(letter for letter in text if letter.isalnum() or letter in '.-_')[:32]


def _parsed(message):
    """The dict in a message of a web socket, None where there is none. Raises WebSocketDisconnect at its end."""
    if message['type'] == 'websocket.disconnect':
        raise WebSocketDisconnect(message.get('code', 1005))
    try:
        content = json.loads(message.get('text') or '')
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None
