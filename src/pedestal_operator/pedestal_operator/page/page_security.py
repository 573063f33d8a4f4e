"""Who may talk to the page's server: by token, by the name it was called by, and from which page. No ROS, no server.

A token stands for a role. It comes once, in the address of the page, and from then on in a cookie that no script can
read and that the browser sends to its own site only. `Host` must be a name of this server, or a foreign site could
make its own name point here (DNS rebinding); `Origin` must be our own page for whatever is asked.
"""
import hmac
import ipaddress
import secrets
import typing
from http import cookies

PAGE_ROLES = ('operator', 'monitor', 'supervisor')
"""A monitor looks and may stop; an operator asks; a supervisor takes control away from others."""

UNRESTRICTED_VERBS = ('stop',)
"""Verbs that every role may ask for."""

SUPERVISOR_REQUESTS = (('take', 'role', 'supervisor'),)
"""(verb, argument, value) for supervisors only."""


class Refused(Exception):  # noqa: N818  no error of the server
    """A request that is not served. status: of HTTP; reason: one line."""

    def __init__(self, status, reason):
        super().__init__(reason)
        self.status, self.reason = status, reason


class Request(typing.NamedTuple):
    """What is judged of a request. path: without the query; token: of the query; asks: whether it is a web socket or
    anything but GET and HEAD."""
    host: str
    origin: str
    cookie: str
    token: str
    path: str
    asks: bool


class Access:
    """The tokens of a server at an address and port, made anew with it. names: by which it is called beside that."""

    def __init__(self, address, port, names=()):
        self.tokens = {role: secrets.token_urlsafe(24) for role in PAGE_ROLES}
        self.cookie = f'pedestal_page_{port}'
        known = {address, *names}
        if is_loopback(address):
            known |= {'127.0.0.1', 'localhost', '::1'}
        self._hosts = {f'{_bracketed(name)}:{port}'.lower() for name in known}
        self._here = _bracketed(address), port

    def url(self, role):
        """Where the page is for a role, its token in it."""
        host, port = self._here
        return f'http://{host}:{port}/?token={self.tokens[role]}'

    def role(self, request):
        """The role of a Request. Raises Refused: 400 of a wrong host, 403 of a foreign page, 401 without a token."""
        if request.host.lower() not in self._hosts:
            raise Refused(400, 'this server is not called by that name')
        if request.origin.lower() != f'http://{request.host.lower()}' and (request.origin or request.asks):
            raise Refused(403, 'not asked by our own page')
        given = request.token if request.path == '/' and request.token else self._of_cookie(request.cookie)
        for role, token in self.tokens.items():
            if hmac.compare_digest(token.encode(), given.encode(errors='replace')):
                return role
        raise Refused(401, 'no token, or a wrong one: open the address that was printed when the page was started')

    def _of_cookie(self, header):
        try:
            jar = cookies.SimpleCookie(header)
        except cookies.CookieError:
            return ''
        return jar[self.cookie].value if self.cookie in jar else ''


def refusal_reason(role, verb, arguments) -> str:
    """'' where a role may ask for a verb with {argument: value}, else why not."""
    if verb in UNRESTRICTED_VERBS:
        return ''
    if role == 'monitor':
        return 'this page may only look, and stop'
    if role != 'supervisor' and any(verb == name and str(arguments.get(argument)) == value
                                    for name, argument, value in SUPERVISOR_REQUESTS):
        return 'only a supervisor takes control away'
    return ''


def is_loopback(address):
    """Whether an address is reached from this machine only."""
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return address == 'localhost'


def _bracketed(name):
    return f'[{name}]' if ':' in name else name


def headers(host):
    """[(name, value)] of every answer: nothing is loaded from elsewhere, kept, framed or guessed."""
    return [('content-security-policy',
             "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
             f"connect-src 'self' ws://{host}; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"),
            ('cache-control', 'no-cache'), ('x-content-type-options', 'nosniff'), ('x-frame-options', 'DENY'),
            ('referrer-policy', 'no-referrer'), ('cross-origin-resource-policy', 'same-origin'),
            ('cross-origin-opener-policy', 'same-origin')]
