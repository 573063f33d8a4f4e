"""Access to the server of the page by token, name of the host and origin of the request. No ROS, no server.

A token stands for a role. It arrives once in the address of the page, then in a cookie. No script can read the cookie,
and the browser sends it to this site only. `Host` must be a name of this server. This avoids that a foreign site lets
its own name point here (DNS rebinding). `Origin` must be this page for every request that can command the antenna.
"""
import hmac
import ipaddress
import secrets
import typing
from http import cookies

from pedestal_operator import state

PAGE_ROLES = ('operator', 'monitor', 'supervisor')
"""Roles: an operator sends commands; a monitor may send `stop` only; a supervisor may take control from others."""

UNRESTRICTED_VERBS = ('stop',)
"""Commands that every role may send."""

SUPERVISOR_REQUESTS = (('take', 'role', 'supervisor'),)
"""(command, argument, value) for supervisors only."""


class Refused(Exception):  # noqa: N818  no error of the server
    """A refused request. status: of HTTP; reason: one line."""

    def __init__(self, status, reason):
        super().__init__(reason)
        self.status, self.reason = status, reason


class Request(typing.NamedTuple):
    """Parts of a request that decide about access.

    path: without the query; token: of the query; asks: True for a web socket, and for all methods except GET and HEAD.
    """
    host: str
    origin: str
    cookie: str
    token: str
    path: str
    asks: bool


class Access:
    """New tokens of a server at an address and port. names: further names of the server."""

    def __init__(self, address, port, names=()):
        self.tokens = {role: secrets.token_urlsafe(24) for role in PAGE_ROLES}
        self.cookie = f'pedestal_page_{port}'
        known = {address, *names}
        if is_loopback(address):
            known |= {'127.0.0.1', 'localhost', '::1'}
        self._hosts = {f'{_bracketed(name)}:{port}'.lower() for name in known}
        self._here = _bracketed(address), port

    def url(self, role):
        """Return the address of the page for a role, with its token."""
        host, port = self._here
        return f'http://{host}:{port}/?token={self.tokens[role]}'

    def role(self, request):
        """Return the role of a Request. Raises Refused: 400 wrong host, 403 foreign page, 401 no valid token."""
        if request.host.lower() not in self._hosts:
            raise Refused(400, 'unknown name of this server: open the address that the server printed at its start')
        if request.origin.lower() != f'http://{request.host.lower()}' and (request.origin or request.asks):
            raise Refused(403, 'the request comes from another page than that of this server')
        given = request.token if request.path == '/' and request.token else self._of_cookie(request.cookie)
        for role, token in self.tokens.items():
            if hmac.compare_digest(token.encode(), given.encode(errors='replace')):
                return role
        raise Refused(401, 'missing or wrong token: open the address that the server printed at its start')

    def _of_cookie(self, header):
        try:
            jar = cookies.SimpleCookie(header)
        except cookies.CookieError:
            return ''
        return jar[self.cookie].value if self.cookie in jar else ''


def refusal_reason(role, verb, arguments) -> str:
    """Return the reason why a role may not send a command with {argument: value}, '' if it may."""
    if verb in UNRESTRICTED_VERBS:
        return ''
    if role == 'monitor':
        return 'the role monitor may send stop only'
    if role != 'supervisor' and any(verb == name and str(arguments.get(argument)) == value
                                    for name, argument, value in SUPERVISOR_REQUESTS):
        return 'only the role supervisor may take control from others'
    return ''


def refusals(role) -> dict:
    """Return {command: reason} of the commands of an operator that a role may not send."""
    return {command: reason for command in state.OPERATOR_COMMANDS if (reason := refusal_reason(role, command, {}))}


def is_loopback(address):
    """Return True if an address is reachable from this machine only."""
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return address == 'localhost'


def _bracketed(name):
    return f'[{name}]' if ':' in name else name


def headers(host):
    """Return the headers [(name, value)] of every answer: content of this site only, revalidated, without frames."""
    return [('content-security-policy',
             "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
             f"connect-src 'self' ws://{host}; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"),
            ('cache-control', 'no-cache'), ('x-content-type-options', 'nosniff'), ('x-frame-options', 'DENY'),
            ('referrer-policy', 'no-referrer'), ('cross-origin-resource-policy', 'same-origin'),
            ('cross-origin-opener-policy', 'same-origin')]
