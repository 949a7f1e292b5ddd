# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded run on the page, without ROS; each page has a clock of its own."""

import asyncio
from bisect import bisect_right
from contextlib import suppress
import json
import math
from pathlib import Path
from typing import Any, NamedTuple

from dp_swing_ros.bags.mcap_reader import Entry
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.console.client import Client
from dp_swing_ros.console.history import answer, Row, row_of, thinned
from dp_swing_ros.console.requests import Request, RequestError
from dp_swing_ros.console.scene import exact, HEARD, number, Scene
from dp_swing_ros.console.server import Server
from dp_swing_ros.control.observer import is_of_another_run
from dp_swing_ros.declarations import DECLARATIONS
from dp_swing_ros.errors import BagError
from dp_swing_ros.messages.fields import nanoseconds
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.provenance import package_version
from dp_swing_ros.topics import CONFIGURATION, DIAGNOSTICS, JOINT_STATES, ROBOT_DESCRIPTION, Topic

PAUSE = 0.05      # [s] between two runs in one bag
BEFORE = 30    # states before one that is sought, of which what still counts may be
RATES = (0.01, 100.0)
TYPES = {bool: 'bool', int: 'integer', float: 'double', str: 'string'}


class Moment(NamedTuple):
    """A state of a bag, and all that came with it and until the next."""

    t: float    # [s] from the first state
    entries: list[tuple[Topic, Entry]]


class Tape:
    """The states of a bag in their order; raises BagError where it has none."""

    def __init__(self, bag: Bag) -> None:
        """Sort what the page shows by the states."""
        self.bag = bag
        # a logger that was busy received them topic by topic
        found = sorted(((topic, entry) for topic in HEARD if bag.has(topic)
                        for entry in bag.entries_of(topic)), key=lambda each: each[1].time)
        states = bag.entries_of(JOINT_STATES)
        self.joint_states = f'/{states[0].topic.lstrip("/")}'
        self.origin = bag.parse(self._stamp, states[0]) / 1e9   # [s]
        self.moments: list[Moment] = []
        waiting: list[tuple[Topic, Entry]] = []
        begun = shift = 0.0   # [s] of a run after a reset in lockstep, whose stamps begin anew
        for topic, entry in found:
            if topic is JOINT_STATES:
                t = bag.parse(self._stamp, entry) / 1e9 - self.origin
                last = self.moments[-1].t - shift if self.moments else -math.inf
                begins = is_of_another_run(t, begun, last)
                if t <= last and not begins:
                    continue   # it was sent again, or overtaken
                if begins:
                    begun, shift = t, self.moments[-1].t - t + PAUSE
                self.moments.append(Moment(t + shift, waiting))
                waiting = []
            (self.moments[-1].entries if self.moments else waiting).append((topic, entry))
        self.times = [moment.t for moment in self.moments]

    def _stamp(self, entry: Entry) -> int:
        return nanoseconds(self.bag.decoded(entry).header.stamp)

    @property
    def duration(self) -> float:
        """Return the time from the first state to the last [s]."""
        return self.times[-1]

    def hear(self, scene: Scene, moment: Moment, *topics: Topic) -> None:
        """Let a scene hear what came at a moment, of some topics or of all."""
        for topic, entry in moment.entries:
            if not topics or topic in topics:
                with suppress(BagError, ValueError):   # damaged, or of another robot
                    scene.hear(topic, self.bag.decoded(entry))

    def scene_at(self, index: int) -> Scene:
        """Return the newest of everything at a state."""
        scene = Scene(self.joint_states)
        begin = max(index - BEFORE, 0)
        for moment in self.moments[:begin]:
            self.hear(scene, moment, CONFIGURATION, ROBOT_DESCRIPTION)
        for moment in self.moments[begin:index + 1]:
            self.hear(scene, moment)
        return scene

    def rows(self) -> list[Row]:
        """Return the states for the page with what was thought at them, ROWS at most."""
        scene, rows = Scene(self.joint_states), []
        shown = {moment.t for moment in thinned(self.moments)}
        others = [topic for topic in HEARD if topic is not DIAGNOSTICS]   # which is slow to read
        for moment in self.moments:
            self.hear(scene, moment, *(() if moment.t in shown else others))
            if scene.x is not None and moment.t in shown:
                rows.append(row_of(scene)._replace(t=round(moment.t, 6)))
        return rows


class Reel:
    """A page's own clock on a tape."""

    def __init__(self, tape: Tape, client: Client) -> None:
        """Begin at the first state, and play."""
        self.tape, self.client = tape, client
        self.at, self.rate, self.playing = 0.0, 1.0, True   # [s]; times real time
        self._scene, self._index = tape.scene_at(0), 0
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._since, self._status = self._loop.time(), ''
        self.show()
        self._wait()

    def seek(self, at: float) -> None:
        """Go to a time [s]."""
        self._set(min(max(at, 0.0), self.tape.duration))

    def skip(self, states: int) -> None:
        """Stop, and go on or back by so many states."""
        self.playing = False
        index = min(max(self._index + states, 0), len(self.tape.times) - 1)
        self._set(self.tape.times[index])

    def play(self, on: bool, rate: float) -> None:
        """Play on at a rate, or stop."""
        self._advance()
        self.rate, self.playing = min(max(rate, RATES[0]), RATES[1]), on
        self._set(0.0 if on and self.at >= self.tape.duration else self.at)

    def stop(self) -> None:
        """End."""
        if self._timer is not None:
            self._timer.cancel()

    def show(self) -> None:
        """Send the frame of now."""
        frame = self._scene.frame()
        if frame is None:
            return
        t = self.tape.times[self._index]
        if frame['plan']:
            frame['plan']['t'] = round(t + frame['plan']['t'] - frame['t'], 6)
        frame['t'] = frame['time'] = round(t, 6)
        self.client.send_frame(json.dumps({**frame, 'paused': not self.playing}, allow_nan=False))
        status = json.dumps(self._scene.status(), allow_nan=False)
        if status != self._status:
            self.client.send_text(status)
        self._status = status

    def _set(self, at: float) -> None:
        self.at, self._since = at, self._loop.time()
        index = bisect_right(self.tape.times, at) - 1
        if not self._index <= index < self._index + BEFORE:
            self._scene = self.tape.scene_at(index)
        else:
            for moment in self.tape.moments[self._index + 1:index + 1]:
                self.tape.hear(self._scene, moment)
        self._index = index
        self.show()
        self._wait()

    def _advance(self) -> None:
        now = self._loop.time()
        if self.playing:
            self.at = min(self.at + (now - self._since) * self.rate, self.tape.duration)
        self._since = now

    def _wait(self) -> None:
        """Wait for the next state."""
        self.stop()
        if not self.playing:
            return
        if self._index + 1 >= len(self.tape.times):
            self.playing = False
            self.show()
            return
        # no more than sixty a second
        wait = max((self.tape.times[self._index + 1] - self.at) / self.rate, 1 / 60)
        self._timer = self._loop.call_later(wait, self._on_timer)

    def _on_timer(self) -> None:
        self._advance()
        self._set(self.at)


class Player:
    """The source of a server that plays a bag."""

    def __init__(self, bag: Bag) -> None:
        """Take the bag; raises BagError where it has no states."""
        self.tape = Tape(bag)
        self._reels: dict[Client, Reel] = {}
        self._rows: list[Row] = []
        self.server: Server | None = None

    def publish(self, server: Server) -> None:
        """Send all pages what there is in the bag."""
        self.server = server
        scene = self.tape.scene_at(len(self.tape.moments) - 1)
        names = {node: found.node for node, found in scene.configurations.items()}
        server.publish('hello', {
            'kind': 'hello', 'version': package_version(), 'read_only': server.read_only,
            'replay': True, 'nodes': {node: names.get(node) for node in DECLARATIONS},
            **scene.about(),
            'goals': [], 'solvers': [], 'presets': [], 'pausable': False,
            'duration': self.tape.duration})
        for node in DECLARATIONS:
            server.publish(f'parameters of {node}', {
                'kind': 'parameters', 'node': node,
                'parameters': parameters_of(node, scene.parameters(node))})
        server.publish('recording', {'kind': 'recording', 'folder': None, 'since': None,
                                     'finished': []})

    def frame(self) -> None:
        """Return nothing: each page has frames of its own."""

    def joined(self, client: Client) -> None:
        """Begin to play for a client."""
        self._reels[client] = Reel(self.tape, client)

    def left(self, client: Client) -> None:
        """Forget a client."""
        self._reels.pop(client).stop()

    def ask(self, client: Client, request: Request) -> None:
        """Do what a page asks for."""
        getattr(self, f'do_{request["do"]}', self.do_not)(client, request)

    def do_not(self, client: Client, request: Request) -> None:
        """Refuse what is for live runs."""
        raise RequestError(f'{request["do"]} is for a live run; this one is recorded')

    def do_seek(self, client: Client, request: Request) -> None:
        """Go to a time."""
        self._reels[client].seek(request['at'])

    def do_skip(self, client: Client, request: Request) -> None:
        """Go on or back by states."""
        self._reels[client].skip(round(request['states']))

    def do_play(self, client: Client, request: Request) -> None:
        """Play, or stop."""
        self._reels[client].play(request['on'], request['rate'])
        client.answer(request, True, 'playing' if request['on'] else 'stopped')

    def do_history(self, client: Client, request: Request) -> None:
        """Send the states of the whole run."""
        self._rows = self._rows or self.tape.rows()
        client.send({**answer(self._rows), 'id': request.get('id')})

    def do_branch(self, client: Client, request: Request) -> None:
        """Let each solver take over."""
        assert self.server is not None
        path: Path = self.tape.bag.path
        self.server.branch(client, request, lambda _: path, self.tape.origin)


def parameters_of(node: str, values: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what is known of the parameters that a node ran with, for the page."""
    try:
        fields = DECLARATIONS[node].fields_of_run(values)
    except ParameterError:
        fields = {}
    return [parameter(name, values[name], fields[name]) for name in sorted(values)
            if name in fields]


def parameter(name: str, value: Any, field: Any) -> dict[str, Any]:
    """Return all that is known of a parameter, as of a live node."""
    about, listed = field.metadata, isinstance(field.default, tuple)
    kind = type(field.default[0] if listed and field.default else field.default)
    choices = about['choices']
    return {'name': name, 'type': TYPES.get(kind, 'string') + '[]' * listed,
            'value': exact(value), 'default': exact(field.default), 'unit': about['unit'],
            'minimum': number(about['minimum']), 'maximum': number(about['maximum']),
            'choices': list(choices()) if choices else None,
            'description': about['description'], 'read_only': True}
