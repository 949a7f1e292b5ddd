# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What each solver would do from an instant on: processes that yield to all others."""

import asyncio
from collections.abc import Callable
import json
from pathlib import Path
import sys
from tempfile import TemporaryDirectory
from typing import Any

from dp_swing_ros.console.client import Client
from dp_swing_ros.console.requests import Request, RequestError
from dp_swing_ros.errors import one_line

AT_ONCE = 2     # in all
LINE = 1 << 24  # [bytes] of what a process says, at most

MakeBag = Callable[[Path], Path]   # in an empty folder, or one that is elsewhere


class Branches:
    """At most one for each client, AT_ONCE in all; used in the thread of the server."""

    def __init__(self) -> None:
        """Begin with none."""
        self._tasks: dict[Client, asyncio.Task[None]] = {}

    def begin(self, client: Client, request: Request, make_bag: MakeBag,
              origin: float) -> None:
        """
        Begin one for a client, in place of that before; raises RequestError.

        Times are those of the stamps less an origin [s].
        """
        self.end(client)
        if len(self._tasks) >= AT_ONCE:
            raise RequestError(f'{AT_ONCE} branches are being followed already; wait a little')
        task = asyncio.ensure_future(self._follow(client, request, make_bag, origin))
        self._tasks[client] = task
        task.add_done_callback(lambda _: self._forget(client, task))

    def end(self, client: Client) -> None:
        """End that of a client."""
        task = self._tasks.pop(client, None)
        if task is not None:
            task.cancel()

    def _forget(self, client: Client, task: 'asyncio.Task[None]') -> None:
        if self._tasks.get(client) is task:
            del self._tasks[client]

    async def _follow(self, client: Client, request: Request, make_bag: MakeBag,
                      origin: float) -> None:
        def send(message: dict[str, Any]) -> None:
            client.send({'kind': 'branch', 'id': request.get('id'), 'at': request['at'],
                         **message})

        send({'progress': 0.0, 'trajectories': None, 'text': ''})
        with TemporaryDirectory(prefix='dp_swing_ros_branch_') as folder:
            try:
                bag = await asyncio.to_thread(make_bag, Path(folder, 'bag'))
                await _run(bag, (request['at'], request['duration'], origin), send)
            except Exception as error:
                send({'progress': 1.0, 'trajectories': None, 'text': one_line(error)})


async def _run(bag: Path, times: tuple[float, ...],
               send: Callable[[dict[str, Any]], None]) -> None:
    """Follow the solvers in a process, and send on what it says."""
    process = await asyncio.create_subprocess_exec(
        'nice', '-n', '19', sys.executable, '-m', 'dp_swing_ros.console.branch', str(bag),
        *map(repr, times), stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE, limit=LINE, start_new_session=True)
    try:
        assert process.stdout is not None
        async for line in process.stdout:
            send(json.loads(line))
        if await process.wait() != 0:
            send({'progress': 1.0, 'trajectories': None, 'text': 'the solvers failed; the console '
                  'has printed why'})
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
