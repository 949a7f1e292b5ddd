# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who may look: names of this server by which a browser may call it, and the token."""

from hashlib import sha256
import hmac
import ipaddress
import os
from pathlib import Path
import secrets
import socket
from urllib.parse import urlsplit

from dp_swing_ros.errors import UserError
from dp_swing_ros.parameters.console import TOKEN_VARIABLE

LOCAL = ('127.0.0.1', 'localhost', '[::1]')
LONGEST = 1000   # [characters] of a token
HTTP = 80        # the port that browsers leave out


class Access:
    """
    What is asked of a request: a Host that is ours, an Origin that is ours, and a token.

    A page of another site cannot call the server then: not by its own name (Origin), and not by a
    name that it has made to lead here (Host). The token is for addresses that others can reach.
    """

    def __init__(self, address: str, port: int, token: str) -> None:
        """Take where the server is bound; without a token one is made where it is needed."""
        self.port, self.local = port, is_local(address)
        self.everywhere = address in ('', '0.0.0.0', '::')
        bound = f'[{ipaddress.ip_address(address)}]' if ':' in address else address.lower()
        self.hosts = {bound, *(LOCAL if self.local or self.everywhere else ()),
                      *(own_names() if self.everywhere else ())}
        self.token = token or ('' if self.local else secrets.token_urlsafe(24))
        host = LOCAL[0] if self.everywhere else bound
        self.cookie = sha256(self.token.encode()).hexdigest()   # what a browser keeps instead
        # whoever has given a token knows it; the log need not
        self.address = f'http://{host}:{port}/' + (
            ' with ?token= and the token that was given' if token else
            f'?token={self.token}' if self.token else '')

    def is_ours(self, host: str) -> bool:
        """Return whether a host, and its port where a browser names it, is this server."""
        try:
            parts = urlsplit(f'//{host}')
            name, port = parts.hostname or '', parts.port or HTTP
        except ValueError:
            return False
        if port != self.port or parts.netloc != host or '@' in host:
            return False
        shown = f'[{name}]' if ':' in name else name
        return shown in self.hosts or self.everywhere and is_number(name)

    def is_own_origin(self, origin: str) -> bool:
        """Return whether an Origin is of a page of this server; raises ValueError for none."""
        parts = urlsplit(origin)
        return parts.scheme in ('http', 'https') and self.is_ours(parts.netloc)

    def is_known(self, token: str, cookie: str) -> bool:
        """Return whether one of them is right, in a time that tells nothing of how wrong."""
        return not self.token or any(
            hmac.compare_digest(given.encode(), right.encode())
            # a plus sign in an address stands for a blank
            for given, right in ((token, self.token), (cookie, self.cookie),
                                 (token.replace(' ', '+'), self.token)))


def given_token(token: str, file: str) -> str:
    """
    Return a token as it is given: itself, in a file, or in the environment; empty where it is not.

    Raises UserError where the file cannot be read, or what is given is no token.
    """
    where = 'parameter token' if token else 'token_file' if file else TOKEN_VARIABLE
    found = token or (_content(Path(file).expanduser()) if file
                      else os.environ.get(TOKEN_VARIABLE, ''))
    if len(found) > LONGEST or not found.isprintable() or file and not found:
        raise UserError(f'{where} has no token; expected 1 to {LONGEST} characters in one line')
    return found


def _content(file: Path) -> str:
    try:
        if not file.is_file():   # a pipe might never end
            raise UserError(f'token_file {str(file)!r} is no regular file; give one')
        with file.open(encoding='utf-8', errors='surrogateescape') as text:
            return text.read(LONGEST + 2).strip()
    except (OSError, ValueError) as error:
        raise UserError(f'cannot read token_file {str(file)!r}: {error}') from None


def own_names() -> tuple[str, str]:
    """Return by which names others on the network call this machine."""
    name = socket.gethostname().lower()
    return name, f'{name}.local'


def is_local(address: str) -> bool:
    """Return whether an address is of this machine alone."""
    return address == 'localhost' or is_number(address) and \
        ipaddress.ip_address(address).is_loopback


def is_number(address: str) -> bool:
    """Return whether an address is a number, which no name server can make lead elsewhere."""
    try:
        ipaddress.ip_address(address)
    except ValueError:
        return False
    return True
