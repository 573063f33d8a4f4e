"""Access control of the web server of the page: it checks token, `Host` and `Origin` of a request. No ROS, no server.

A token stands for a role. It arrives once in the address of the page, then in a cookie, which no script can read and
which the browser sends to this site only. `Host` must be a name of this server. This avoids that a foreign site lets
its own name point here (DNS rebinding). `Origin` must be this page for every request that can command the antenna.
Because a proxy or an ssh tunnel changes port and scheme, `Host` may have any port, and `Origin` may be http or https.
"""
import hmac
import ipaddress
import re
import secrets
from collections.abc import Iterable, Mapping
from http import cookies
from typing import NamedTuple

from pedestal_operator import state

PAGE_ROLES = ('operator', 'monitor', 'supervisor')
"""An operator sends commands; a monitor may send `stop` only; a supervisor may take control from others."""

UNRESTRICTED_VERBS = ('stop',)  # commands that every role may send
SUPERVISOR_REQUESTS = (('take', 'role', 'supervisor'),)  # (command, argument, value) for supervisors only


HOST = re.compile(r'(\[[0-9a-f:.]+\]|[^\[\]:]+)(?::(\d{1,5}))?')  # of a `Host` in small letters: name, port
MAX_SHOWN_CHARACTERS = 100  # longest part of a request in a refusal [characters]


class Refused(Exception):  # noqa: N818  no error of the server
    """A refused request. status: status code of HTTP; reason: one line."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status, self.reason = status, reason


class Request(NamedTuple):
    """Parts of an HTTP request that decide about access."""
    host: str               # header
    origin: str             # header
    cookie: str             # header
    token: str              # from the query
    path: str               # without the query
    changes_state: bool     # True for a web socket, and for all methods except GET and HEAD


class Access:
    """Access to a server at an address and port, with new tokens for each role. names: further names of the server.
    Raises ValueError for a name that is not the name of a host."""

    def __init__(self, address: str, port: int, names: Iterable[str] = ()) -> None:
        for name in names:
            if not _is_host(name):
                raise ValueError(f'names: {name}: must be names of hosts without scheme and port, separated by commas')
        self.tokens = {role: secrets.token_urlsafe(24) for role in PAGE_ROLES}
        known = {address, *names}
        if is_loopback(address):
            known |= {'127.0.0.1', 'localhost', '::1'}
        self._names = {_bracketed(name).lower() for name in known}
        self._url = f'http://{_bracketed(address)}:{port}/'

    def url(self, role: str) -> str:
        """Return the address of the page for a role, with its token."""
        return f'{self._url}?token={self.tokens[role]}'

    @staticmethod
    def cookie(host: str) -> str:
        """Return the name of the cookie for a `Host`, with its port, because browsers send a cookie to all ports."""
        return f'pedestal_page_{host.rpartition("]")[2].partition(":")[2]}'

    def role(self, request: Request) -> str:
        """Return the role of a request. Raises Refused: 400 wrong host, 403 foreign page, 401 no valid token."""
        host, origin = request.host.lower(), request.origin.lower()
        parts = HOST.fullmatch(host)
        if not parts or parts[1] not in self._names:
            raise Refused(400, f'unknown name of this server in Host, {shown(request.host)}: open {self._url}, or '
                               'list the name in the parameter `names` (-p names:=NAME)')
        if origin not in (f'http://{host}', f'https://{host}') and (origin or request.changes_state):
            raise Refused(403, f'the request comes from another page, {shown(request.origin)}, than that of this '
                               f'server, {shown(request.host)}; a proxy must pass on Host unchanged')
        given = request.token if request.path == '/' and request.token else self._of_cookie(host, request.cookie)
        for role, token in self.tokens.items():
            if hmac.compare_digest(token.encode(), given.encode(errors='replace')):
                return role
        raise Refused(401, 'missing or wrong token: open the address that the server printed at its start')

    def _of_cookie(self, host: str, header: str) -> str:
        try:
            jar = cookies.SimpleCookie(header)
        except cookies.CookieError:
            return ''
        name = self.cookie(host)
        return jar[name].value if name in jar else ''


def refusal_reason(role: str, verb: str, arguments: Mapping[str, object]) -> str:
    """Return the reason why a role may not send a command with {argument: value}, '' if it may."""
    if verb in UNRESTRICTED_VERBS:
        return ''
    if role == 'monitor':
        return 'the role monitor may send stop only'
    if role != 'supervisor' and any(verb == name and str(arguments.get(argument)) == value
                                    for name, argument, value in SUPERVISOR_REQUESTS):
        return 'only the role supervisor may take control from others'
    return ''


def refusals(role: str) -> dict[str, str]:
    """Return {command: reason} of the commands of an operator that a role may not send."""
    return {command: reason for command in state.OPERATOR_COMMANDS if (reason := refusal_reason(role, command, {}))}


def is_loopback(address: str) -> bool:
    """Return True if an address is reachable from this machine only."""
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return address == 'localhost'


def shown(text: str) -> str:
    """Return a part of a request for the text of a refusal: printable, and not longer than MAX_SHOWN_CHARACTERS."""
    return ascii(text)[1:-1][:MAX_SHOWN_CHARACTERS] or '(none)'


def _is_host(name: str) -> bool:
    try:
        return bool(re.fullmatch(r'[\w.-]+', name) or ipaddress.IPv6Address(name))
    except ValueError:
        return False


def _bracketed(name: str) -> str:
    return f'[{name}]' if ':' in name else name


def headers(host: str) -> list[tuple[str, str]]:
    """Return the headers of every answer: own content only, a checked cache, no frames. host: Host of the request."""
    return [('content-security-policy',
             "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
             f"connect-src 'self' ws://{host} wss://{host}; "
             "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"),
            ('cache-control', 'no-cache'), ('x-content-type-options', 'nosniff'), ('x-frame-options', 'DENY'),
            ('referrer-policy', 'no-referrer'), ('cross-origin-resource-policy', 'same-origin'),
            ('cross-origin-opener-policy', 'same-origin')]
