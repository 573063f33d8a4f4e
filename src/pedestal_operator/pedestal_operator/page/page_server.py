"""Web server of the page of the operator: the files of the page, and a web socket for each open page. No ROS here.

The server runs in its own thread. A section is a named part of the state, as JSON, with the number of its last change.
A message to a page has the sections that changed since its last message, and a number that the page acknowledges. A
page with MAX_UNSEEN_MESSAGES unacknowledged messages receives no further message, then the newest sections. Therefore
no queue grows, except the short queue of replies. A page without an acknowledgement for PAGE_TIMEOUT_S is dropped.
"""
import asyncio
import collections
import contextlib
import json
import math
import pathlib
import queue
import threading
import time
from collections.abc import Callable, Iterable, Mapping, MutableMapping
from typing import NamedTuple

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from pedestal_common.quantities import Json, Seconds
from pedestal_common.stream import listen
from pedestal_operator.page import page_security
from pedestal_operator.page.page_security import Refused

STATIC_FOLDER = pathlib.Path(__file__).parents[1] / 'static'

MAX_UNSEEN_MESSAGES = 4  # largest number of unacknowledged messages to a page
PAGE_TIMEOUT_S = 5.0  # time without an acknowledgement after which a page is dropped [s]
MAX_MESSAGE_BYTES = 4096  # largest message from a page [bytes]
MAX_QUEUED_REQUESTS, MAX_QUEUED_REPLIES = 200, 50  # of all pages, to a page
REQUEST_BURST_LIMIT, REQUEST_BURST_PERIOD_S = 40, 1.0  # most messages of a page in a time; a jog needs five in 1 s
SHUTDOWN_TIMEOUT_S = 1  # grace period of the pages when the server ends, in whole seconds for uvicorn [s]


class PageMessage(NamedTuple):
    """Message from a page."""
    client: 'Client'
    message: dict[str, Json] | None     # its content, None when the page has left
    age: Seconds                        # of the last state that the page acknowledged


class Client:
    """An open page."""
    name: str                           # of its user
    role: str                           # one of page_security.PAGE_ROLES
    address: str                        # of its host
    replies: collections.deque[str]     # messages that wait to be sent, as JSON
    _revisions: dict[str, int]          # {section: revision that the page has}
    _message_times: collections.deque[Seconds]  # of the last messages from the page
    _sent: dict[int, Seconds]           # {number of an unacknowledged message: time of its sending}

    def __init__(self, name: str, role: str, address: str) -> None:
        self.name, self.role, self.address = name, role, address
        self.replies = collections.deque(maxlen=MAX_QUEUED_REPLIES)
        self.wake = asyncio.Event()
        self._revisions, self._message_times = {}, collections.deque(maxlen=REQUEST_BURST_LIMIT)
        self._number, self._sent, self._acknowledged = 0, {}, time.monotonic()

    def __str__(self) -> str:
        return f'{self.name}@page {self.address}'

    def newest(self, sections: Mapping[str, tuple[int, str]]) -> str:
        """Return the next message: replies, and the changed ones of the sections {name: (revision, JSON)}."""
        self._number += 1
        self._sent[self._number] = time.monotonic()
        parts = [f'"number":{self._number}', *(f'"{name}":{text}' for name, (revision, text) in sections.items()
                                               if self._revisions.get(name) != revision)]
        self._revisions = {name: revision for name, (revision, _) in sections.items()}
        if self.replies:
            parts.append(f'"replies":[{",".join(self.replies)}]')
            self.replies.clear()
        return '{' + ','.join(parts) + '}'

    def acknowledge(self, number: Json) -> None:
        """Take the acknowledgement of a message by its number."""
        if type(number) is int and number in self._sent:
            self._acknowledged = self._sent[number]
            self._sent = {other: at for other, at in self._sent.items() if other > number}
            self.wake.set()

    @property
    def busy(self) -> bool:
        """True while the page may receive no further message."""
        return len(self._sent) >= MAX_UNSEEN_MESSAGES

    @property
    def gone(self) -> bool:
        """True if MAX_UNSEEN_MESSAGES are unacknowledged and the oldest of these is older than PAGE_TIMEOUT_S."""
        return self.busy and time.monotonic() - next(iter(self._sent.values())) > PAGE_TIMEOUT_S

    @property
    def age(self) -> Seconds:
        """Age of the last acknowledged state."""
        return time.monotonic() - self._acknowledged

    def too_fast(self) -> bool:
        """Count a message. Return True above REQUEST_BURST_LIMIT messages in REQUEST_BURST_PERIOD_S."""
        self._message_times.append(time.monotonic())
        times = self._message_times
        return len(times) == REQUEST_BURST_LIMIT and times[-1] - times[0] < REQUEST_BURST_PERIOD_S


class PageServer:
    """A server that runs from its construction to `close`. Raises OSError if the address and port are not available.
    history(): past of the charts for a new page; called in a thread of the server."""
    requests: queue.Queue[PageMessage]      # for the node
    pages: int                              # number of open pages
    # Only the thread of the server uses _clients and _sections. Only the thread of the node uses _published.
    _clients: set[Client]
    _sections: dict[str, tuple[int, str]]   # {name: (revision, JSON)}
    _published: dict[str, str]              # {name of a section: JSON}

    def __init__(self, address: str, port: int, names: Iterable[str], most: int,
                 history: Callable[[], Iterable[object]]) -> None:
        self.pages, self.requests = 0, queue.Queue(MAX_QUEUED_REQUESTS)
        self._socket = listen(address, port)
        self.access = page_security.Access(address, self._socket.getsockname()[1], names)
        self._most, self._history = most, history
        self._clients, self._sections, self._revision, self._named = set(), {}, 0, 0
        self._published = {}
        app = Starlette(routes=[Route('/', self._index), Route('/history', self._history_answer),
                                WebSocketRoute('/socket', self._serve_page),
                                Mount('/', StaticFiles(directory=STATIC_FOLDER))])
        self._server = uvicorn.Server(uvicorn.Config(
            self._guarded(app), log_config=None, log_level='critical', access_log=False, lifespan='off', http='h11',
            ws='websockets-sansio', ws_max_size=MAX_MESSAGE_BYTES, ws_per_message_deflate=False, proxy_headers=False,
            server_header=False, timeout_graceful_shutdown=SHUTDOWN_TIMEOUT_S))
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name='page_server', daemon=True)
        self._thread.start()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        with contextlib.closing(self._loop):
            self._loop.run_until_complete(self._server.serve([self._socket]))

    def publish(self, sections: Mapping[str, object]) -> None:
        """Send the changed sections of {name: content} to every page; called from the thread of the node."""
        texts = {name: encoded(content) for name, content in sections.items()}
        fresh = {name: text for name, text in texts.items() if self._published.get(name) != text}
        self._published |= fresh
        self._call(self._update_sections, fresh)

    def reply(self, client: Client, message: Mapping[str, object]) -> None:
        """Send a message to one page; called from the thread of the node."""
        self._call(self._queue_reply, client, json.dumps(message))

    def _call(self, function: Callable[..., None], *arguments: object) -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed after the end of the server
            self._loop.call_soon_threadsafe(function, *arguments)

    def _update_sections(self, sections: Mapping[str, str]) -> None:
        self._revision += 1
        self._sections |= {name: (self._revision, text) for name, text in sections.items()}
        for client in self._clients:
            client.wake.set()

    @staticmethod
    def _queue_reply(client: Client, text: str) -> None:
        client.replies.append(text)
        client.wake.set()

    def close(self) -> None:
        """Close the connections to all pages, by force after SHUTDOWN_TIMEOUT_S."""
        self._server.should_exit = True
        self._thread.join(3.0 * SHUTDOWN_TIMEOUT_S)

    def _guarded(self, app: ASGIApp) -> ASGIApp:
        """Return an ASGI app that checks each request before `app` answers, and adds headers to each answer."""
        async def guarded(scope: Scope, receive: Receive, send: Send) -> None:
            request = _request(scope)
            try:
                scope['role'] = self.access.role(request)
            except Refused as refused:
                answer = PlainTextResponse(f'{refused.reason}\n', refused.status)
                await answer(scope, receive, _adding(send, 'none'))
                return
            await app(scope, receive, _adding(send, request.host))
        return guarded

    async def _index(self, request: Request) -> Response:
        """An address with a token only sets the cookie; the token stays out of the history."""
        if 'token' not in request.query_params:
            return await StaticFiles(directory=STATIC_FOLDER).get_response('index.html', request.scope)
        answer = RedirectResponse('/', 303)
        answer.set_cookie(self.access.cookie(request.headers['host']), self.access.tokens[request.scope['role']],
                          httponly=True, samesite='strict')
        return answer

    async def _history_answer(self, _: Request) -> Response:
        return Response(await asyncio.to_thread(lambda: encoded(list(self._history()))), media_type='application/json')

    async def _serve_page(self, websocket: WebSocket) -> None:
        if len(self._clients) >= self._most:
            await websocket.send_denial_response(PlainTextResponse(
                f'too many pages: must be at most {self._most}\n', 503))
            return
        self._named += 1
        role = websocket.scope['role']
        client = Client(_name(websocket.query_params.get('name', '')) or f'{role}-{self._named}', role,
                        websocket.client.host if websocket.client else '')
        client.replies.append(json.dumps({'you': client.name, 'role': role, 'refused': page_security.refusals(role)}))
        await websocket.accept()
        self._clients.add(client)
        self.pages = len(self._clients)
        client.wake.set()
        tasks = [asyncio.ensure_future(self._send_states(websocket, client)),
                 asyncio.ensure_future(self._receive(websocket, client))]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._clients.discard(client)
            self.pages = len(self._clients)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self._put(PageMessage(client, None, client.age))

    async def _send_states(self, websocket: WebSocket, client: Client) -> None:
        while not client.gone:
            await client.wake.wait()
            client.wake.clear()
            if not client.busy:
                await asyncio.wait_for(websocket.send_text(client.newest(self._sections)), PAGE_TIMEOUT_S)

    async def _receive(self, websocket: WebSocket, client: Client) -> None:
        with contextlib.suppress(WebSocketDisconnect):
            while True:
                message = _parsed(await websocket.receive())
                if message is None:
                    self._queue_reply(client, json.dumps({'error': 'unknown message: must be a JSON object'}))
                elif 'seen' in message:
                    client.acknowledge(message['seen'])
                elif client.too_fast():
                    self._queue_reply(client, json.dumps({
                        'error': f'more than {REQUEST_BURST_LIMIT} messages in {REQUEST_BURST_PERIOD_S:g} s'}))
                elif not self._put(PageMessage(client, message, client.age)):
                    self._queue_reply(client, json.dumps({
                        'error': f'too many waiting commands: must be at most {MAX_QUEUED_REQUESTS}'}))

    def _put(self, message: PageMessage) -> bool:
        """Return True if the queue had room."""
        try:
            self.requests.put_nowait(message)
        except queue.Full:
            return False
        return True


def encoded(value: object) -> str:
    """Return a value as JSON, with null for a number that is not finite, because JSON has no NaN."""
    return json.dumps(_plain(value), separators=(',', ':'), allow_nan=False)


def _plain(value: object) -> object:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, (list, tuple)) else value


def _request(scope: Scope) -> page_security.Request:
    given: dict[str, str] = {}
    for key, value in scope['headers']:
        given.setdefault(key.decode('latin-1'), value.decode('latin-1'))
    query = dict(part.split('=', 1) for part in scope['query_string'].decode('latin-1').split('&') if '=' in part)
    changes_state = scope['type'] == 'websocket' or scope['method'] not in ('GET', 'HEAD')
    return page_security.Request(given.get('host', ''), given.get('origin', ''), given.get('cookie', ''),
                                 query.get('token', ''), scope['path'], changes_state)


def _adding(send: Send, host: str) -> Send:
    extra = [(name.encode(), value.encode('latin-1')) for name, value in page_security.headers(host)]

    async def adding(message: MutableMapping[str, Json]) -> None:
        if message['type'].endswith('http.response.start'):
            message = {**message, 'headers': [*message.get('headers', ()), *extra]}
        await send(message)
    return adding


def _name(text: str) -> str:
    return ''.join(letter for letter in text if letter.isalnum() or letter in '.-_')[:32]


def _parsed(message: Mapping[str, Json]) -> dict[str, Json] | None:
    if message['type'] == 'websocket.disconnect':
        raise WebSocketDisconnect(message.get('code', 1005))
    try:
        content = json.loads(message.get('text') or '')
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None
