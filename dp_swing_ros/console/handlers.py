# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is answered to a browser: the page, its parts and recordings, to those who may look."""

import os
from typing import Any

from tornado.web import HTTPError, RequestHandler, StaticFileHandler

from dp_swing_ros.console.access import Access
from dp_swing_ros.errors import one_line

PAGE_POLICY = ("default-src 'self'; connect-src 'self' ws://{host} wss://{host}; "   # for Safari
               "frame-ancestors 'none'; base-uri 'none'")
# a report brings a policy of its own, too; whatever else lies there may do nothing here
RECORDING_POLICY = ("sandbox allow-scripts; default-src 'none'; img-src data: 'self'; "
                    "style-src 'unsafe-inline'; script-src 'unsafe-inline'")
COOKIE = 'dp_swing_ros_console'


class Guarded(RequestHandler):
    """A request that is answered only to those who may look."""

    policy = PAGE_POLICY
    why = ''   # it was refused

    def set_default_headers(self) -> None:
        """Forbid the browser what no page of ours does."""
        self.set_header('X-Content-Type-Options', 'nosniff')
        self.set_header('Referrer-Policy', 'no-referrer')
        self.set_header('Cache-Control', 'no-store')
        self.clear_header('Server')

    @property
    def access(self) -> Access:
        """Return who may look."""
        access: Access = self.settings['access']
        return access

    def prepare(self) -> None:
        """Refuse who may not look."""
        access, request = self.access, self.request
        origin = request.headers.get('Origin')
        if not access.is_ours(request.host):
            self.refuse(403, f'the host {request.host[:80]!r} is not this console')
        if origin is not None and not access.is_own_origin(origin):
            self.refuse(403, f'the origin {origin[:80]!r} is not this console')
        self.set_header('Content-Security-Policy', self.policy.format(host=request.host))
        given = self.get_query_argument('token', '', strip=False)
        cookie = f'{COOKIE}_{access.port}'   # a browser does not tell ports apart
        if not access.is_known(given, self.get_cookie(cookie) or ''):
            self.refuse(403, 'no token, or a wrong one; the console prints its address with one')
        if given and access.token:
            self.set_cookie(cookie, access.cookie, httponly=True, samesite='Strict')

    def refuse(self, status: int, why: str) -> None:
        """End a request with a reason; raises HTTPError."""
        self.why = why
        raise HTTPError(status)

    def send_error(self, status_code: int = 500, **details: Any) -> None:
        """Answer what nobody can make sense of, or open, as the mistake of whoever asks."""
        error = details.get('exc_info', (None, None))[1]
        if isinstance(error, (OSError, ValueError)):   # such as a NUL in the path
            status_code = 404 if isinstance(error, OSError) else 400
            self.why = one_line(error)
        super().send_error(status_code, **details)

    def log_exception(self, *error: Any) -> None:
        """Say nothing: `_log_refusal` of the server has a line for each answer."""

    def write_error(self, status_code: int, **_: Any) -> None:
        """Say why in plain text."""
        self.set_header('Content-Type', 'text/plain; charset=utf-8')
        self.finish(f'{status_code} {self.why}\n')


class Page(Guarded, StaticFileHandler):
    """The page and what it is made of."""


class Nothing(Guarded):
    """What is not there."""

    def prepare(self) -> None:
        """Refuse it."""
        super().prepare()
        self.refuse(404, 'there is nothing')


class Recordings(Guarded, StaticFileHandler):
    """Bags and their reports, in one folder and nowhere else."""

    policy = RECORDING_POLICY

    @classmethod
    def get_absolute_path(cls, root: str, path: str) -> str:
        """Return where a path leads, also by links; tornado refuses it outside of the folder."""
        return os.path.realpath(os.path.join(root, path))
