# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A page that is open, as the server sees it.

What it sends is checked once, in `on_message`; whatever then fails ends in `attempt`.

Whoever is slow to read is sent fewer frames: one at most is on its way, and only the newest waits.
What else it is sent is bounded; beyond that it is closed.
"""

import asyncio
from collections.abc import Callable
import json
import math
import socket
from typing import Any, Protocol

from tornado.iostream import IOStream, StreamClosedError
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from dp_swing_ros.console.handlers import Guarded
from dp_swing_ros.console.requests import check, LOOKS, parse, Request, RequestError
from dp_swing_ros.errors import one_line

CLIENTS = 32            # at most
BACKLOG = 4 << 20       # [bytes] that may wait for a client beside frames
BUFFER = 1 << 16        # [bytes] of the kernel's for a client: what waits there grows old


class Host(Protocol):
    """The server, as a client needs it."""

    clients: set['Client']
    read_only: bool
    log: Callable[[str], object]

    def call(self, function: Callable[..., object], *arguments: Any) -> None:
        """Call a function in the server's thread, from any."""

    def welcome(self, client: 'Client') -> None:
        """Send a new client all that there is to know."""

    def ask(self, client: 'Client', request: Request) -> None:
        """Do what a client asks for; raises RequestError where that is refused at once."""

    def farewell(self, client: 'Client') -> None:
        """Forget a client."""


class Client(Guarded, WebSocketHandler):
    """A page that is open; `answer` and `send` are for any thread."""

    @property
    def host(self) -> Host:
        """Return the server."""
        host: Host = self.settings['host']
        return host

    def prepare(self) -> None:
        """Refuse also one too many."""
        super().prepare()
        if len(self.host.clients) >= CLIENTS:
            self.refuse(503, f'{CLIENTS} pages are open already; close one')

    def check_origin(self, origin: str) -> bool:
        """Return whether the page that calls is ours."""
        return self.access.is_own_origin(origin)

    def open(self) -> None:
        """Send it what there is."""
        self.complained = False
        self._frame = ''         # that waits
        self._sending = False    # a frame
        self._waiting = 0.0      # [bytes] beside frames
        self._tasks = set[asyncio.Task[None]]()
        stream = self._stream()
        if stream is not None:
            stream.set_nodelay(True)
            stream.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER)
        self.host.welcome(self)

    def _stream(self) -> IOStream | None:
        return None if self.ws_connection is None else self.ws_connection.stream

    def on_close(self) -> None:
        """Forget it."""
        self.host.farewell(self)

    def on_message(self, message: str | bytes) -> None:
        """Do what it asks for; what is no request at all ends it."""
        try:
            request = parse(message)
        except RequestError as error:
            self.complain(str(error))
            self.close(1007, 'not a request')
            return
        self.attempt(request, lambda: self._ask(check(request)))

    def _ask(self, request: Request) -> None:
        if self.host.read_only and request['do'] not in LOOKS:
            raise RequestError('this console is read-only')
        self.host.ask(self, request)

    def attempt(self, request: Request, act: Callable[[], None]) -> None:
        """Act for a request; whatever goes wrong is told who sent it, and harms nobody else."""
        try:
            act()
        except RequestError as error:
            self.complain(str(error))
            self.answer(request, False, str(error))
        except Exception as error:
            text = f'{request["do"]} failed: {type(error).__name__}: {one_line(error)}'
            self.host.log(f'{self.request.remote_ip}: {text}')
            self.answer(request, False, text)

    def complain(self, text: str) -> None:
        """Say in the log what was refused, once for each client however much there is."""
        if not self.complained:
            self.host.log(f'{self.request.remote_ip}: {text}')
        self.complained = True

    def answer(self, request: Request, ok: bool, text: str) -> None:
        """Answer a request, if it wants an answer."""
        if 'id' in request:
            self.send({'kind': 'answer', 'id': request['id'], 'ok': ok, 'text': text})

    def send(self, message: dict[str, Any]) -> None:
        """Send it a message."""
        self.host.call(self.send_text, json.dumps(message, allow_nan=False))

    def send_text(self, text: str) -> None:
        """Send it a message; one that does not read them is closed."""
        if self._waiting > BACKLOG:
            return   # it is being closed
        self._waiting += len(text)
        if self._waiting > BACKLOG:
            self.host.log(f'{self.request.remote_ip}: closed, for it does not read')
            self._waiting = math.inf   # whatever of it is still sent
            self._abort()
        else:
            self._begin(self._send(text))

    def send_frame(self, text: str) -> None:
        """Send it a frame as soon as the one before is gone."""
        self._frame = text
        if not self._sending:
            self._begin(self._send_frames())

    def _begin(self, work: Any) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)   # asyncio itself keeps none
        task.add_done_callback(self._tasks.discard)

    async def _send(self, text: str) -> None:
        if await self._write(text):
            self._waiting -= len(text)

    async def _send_frames(self) -> None:
        self._sending = True
        while self._frame:
            text, self._frame = self._frame, ''
            await self._write(text)
        self._sending = False

    async def _write(self, text: str) -> bool:
        try:
            await self.write_message(text)
            return True
        except (StreamClosedError, WebSocketClosedError):
            return False

    def _abort(self) -> None:
        """Close it without waiting for it to hear so."""
        stream = self._stream()
        if stream is not None:
            stream.close()
