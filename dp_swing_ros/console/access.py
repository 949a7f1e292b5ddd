# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who may look: names of this server by which a browser may call it, and the token."""

from hashlib import sha256
import hmac
import ipaddress
import secrets
from urllib.parse import quote, urlsplit

LOCAL = ('127.0.0.1', 'localhost', '[::1]')


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
        bound = f'[{address}]' if ':' in address else address
        self.hosts = {bound, *(LOCAL if self.local or self.everywhere else ())}
        self.token = token or ('' if self.local else secrets.token_urlsafe(24))
        host = LOCAL[0] if self.everywhere else bound
        self.cookie = sha256(self.token.encode()).hexdigest()   # what a browser keeps instead
        self.address = f'http://{host}:{port}/' + (
            f'?token={quote(self.token, safe="")}' if self.token else '')

    def is_ours(self, host: str) -> bool:
        """Return whether a host with its port is this server."""
        name, _, port = host.rpartition(':')
        if port != str(self.port):
            return False
        return name.lower() in self.hosts or self.everywhere and is_number(name.strip('[]'))

    def is_own_origin(self, origin: str) -> bool:
        """Return whether an Origin is of a page of this server."""
        parts = urlsplit(origin)
        return parts.scheme in ('http', 'https') and self.is_ours(parts.netloc)

    def is_known(self, token: str, cookie: str) -> bool:
        """Return whether one of them is right, in a time that tells nothing of how wrong."""
        return not self.token or any(
            hmac.compare_digest(given.encode(), right.encode())
            for given, right in ((token, self.token), (cookie, self.cookie)))


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
