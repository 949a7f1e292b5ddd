# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The server of the page: a thread of its own, which nobody waits for."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from functools import partial
import json
import os
from pathlib import Path
import threading
from typing import Any, NamedTuple, Protocol

from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application, RequestHandler

from dp_swing_ros.console.access import Access
from dp_swing_ros.console.branches import Branches, MakeBag
from dp_swing_ros.console.client import Client
from dp_swing_ros.console.handlers import Nothing, Page, Recordings
from dp_swing_ros.console.requests import Request
from dp_swing_ros.errors import one_line, UserError

PAGE = Path(__file__).parent / 'page'
FRAME_PERIOD = 1 / 60   # [s] at least between two frames
TRAILING = 0.1          # [s] after the last state: what came after its frame is shown, too
ALIVE = 1.0             # [s] between two signs of life, by which a page knows a dead console
LARGEST = 1 << 16       # [bytes] of a request
IDLE = 60.0             # [s] a connection may stand idle
GRACE = 2.0             # [s] for the thread to end


class Options(NamedTuple):
    """How to serve."""

    address: str
    port: int
    token: str
    read_only: bool
    recordings: Path | None


class Source(Protocol):
    """What the page looks at; asked in the server's thread."""

    def frame(self) -> dict[str, Any] | None:
        """Return the newest frame for all clients."""

    def joined(self, client: Client) -> None:
        """Take a new client."""

    def ask(self, client: Client, request: Request) -> None:
        """Do what a client asks for; raises RequestError where that is refused at once."""

    def left(self, client: Client) -> None:
        """Forget a client."""


class Server:
    """Serves the page of a source; `publish`, `poke`, `call` and `stop` are for any thread."""

    def __init__(self, options: Options, source: Source, log: Callable[[str], object]) -> None:
        """
        Bind to the address, so that whoever calls afterwards is heard.

        log takes a line for each thing that was refused. Raises UserError where the address
        cannot be had.
        """
        self.source, self.log, self.read_only = source, log, options.read_only
        # without a folder nothing is in it
        self.recordings = os.path.realpath(options.recordings or os.devnull)
        try:
            self._sockets = bind_sockets(options.port, options.address)
        except OSError as error:
            raise UserError(
                f'cannot serve at {options.address}:{options.port}: {error.strerror}; give '
                'another port or address') from None
        self.access = Access(options.address, self._sockets[0].getsockname()[1], options.token)
        self.clients, self._branches = set[Client](), Branches()
        self._standing: dict[str, str] = {}   # what each new client is sent first
        self._sent_at = 0.0
        self._timer: asyncio.TimerHandle | None = None
        self._loop, self._ended = asyncio.new_event_loop(), asyncio.Event()
        self._thread = threading.Thread(target=self.run, daemon=True)

    def start(self) -> None:
        """Begin to serve, in a thread of its own."""
        self._thread.start()

    def stop(self) -> None:
        """Close all clients and end the thread."""
        self.call(self._ended.set)
        if self._thread.is_alive():
            self._thread.join(GRACE)

    def run(self) -> None:
        """Serve until `stop`."""
        self._loop.set_exception_handler(self._on_error)
        self._loop.run_until_complete(self._serve())
        self._loop.close()

    def _on_error(self, _: object, context: dict[str, Any]) -> None:
        error = context.get('exception')
        self.log(f'the server goes on after {context["message"]}'
                 + (f': {type(error).__name__}: {one_line(error)}' if error else ''))

    async def _serve(self) -> None:
        server = HTTPServer(
            Application([
                (r'/()', Page, {'path': PAGE, 'default_filename': 'index.html'}),
                (r'/static/(.+)', Page, {'path': PAGE}),
                (r'/recordings/(.+)', Recordings, {'path': self.recordings}),
                (r'/socket', Client)],
                default_handler_class=Nothing, log_function=self._log_refusal,
                websocket_max_message_size=LARGEST, host=self, access=self.access),
            max_header_size=LARGEST, max_body_size=LARGEST, idle_connection_timeout=IDLE,
            body_timeout=IDLE)
        server.add_sockets(self._sockets)
        await self._live()
        server.stop()
        for client in list(self.clients):
            client.close(1001, 'the console ends')
        await server.close_all_connections()

    async def _live(self) -> None:
        """Give signs of life until the end."""
        while True:
            with suppress(asyncio.TimeoutError):   # which is another one in Python 3.10
                await asyncio.wait_for(self._ended.wait(), ALIVE)
                return
            for client in list(self.clients):
                client.send_text(json.dumps({'kind': 'alive'}))

    def _log_refusal(self, handler: RequestHandler) -> None:
        if handler.get_status() >= 400:
            self.log(f'{handler.request.remote_ip}: {handler.get_status()} for '
                     f'{handler.request.method} {handler.request.path[:80]!r}: '
                     + getattr(handler, 'why', ''))

    def call(self, function: Callable[..., object], *arguments: Any) -> None:
        """Call a function in the server's thread."""
        try:
            self._loop.call_soon_threadsafe(function, *arguments)
        except RuntimeError:   # it has ended
            pass

    def publish(self, name: str, message: dict[str, Any]) -> None:
        """Send all clients, and those to come, a message of which the newest counts."""
        self.call(self._publish, name, json.dumps(message, allow_nan=False))

    def _publish(self, name: str, text: str) -> None:
        if self._standing.get(name) != text:
            self._standing[name] = text
            for client in list(self.clients):
                client.send_text(text)

    def poke(self, delay: float = TRAILING) -> None:
        """Let the newest frame be sent after a delay [s], unless another is before."""
        if self.clients:
            self.call(self._poke, delay)

    def _poke(self, delay: float) -> None:
        due = max(self._loop.time() + delay, self._sent_at + FRAME_PERIOD)
        if self._timer is not None:
            if self._timer.when() <= due:
                return
            self._timer.cancel()
        self._timer = self._loop.call_at(due, self._send_frame)

    def _send_frame(self) -> None:
        self._timer, self._sent_at = None, self._loop.time()
        frame = self.source.frame()
        if frame is not None:
            text = json.dumps(frame, allow_nan=False)
            for client in list(self.clients):
                client.send_frame(text)

    def welcome(self, client: Client) -> None:
        """Send a new client all that there is to know."""
        self.clients.add(client)
        for text in self._standing.values():
            client.send_text(text)
        self.source.joined(client)
        self._poke(0.0)

    def ask(self, client: Client, request: Request) -> None:
        """Hand a request on; raises RequestError."""
        self.source.ask(client, request)

    def branch(self, client: Client, request: Request, make_bag: MakeBag,
               origin: float = 0.0) -> None:
        """Let all solvers take over in a bag that is made first; from any thread."""
        self.call(client.attempt, request, partial(
            self._branches.begin, client, request, make_bag, origin))

    def farewell(self, client: Client) -> None:
        """Forget a client."""
        self.clients.discard(client)
        self._branches.end(client)
        self.source.left(client)
