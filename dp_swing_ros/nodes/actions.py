# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a page asks for, done through topics, services and parameters alone."""

from collections.abc import Callable, Mapping
from functools import partial
import math
from pathlib import Path
import time
from typing import Any

from rclpy.client import Client as Service
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

from dp_swing_ros.console.client import Client
from dp_swing_ros.console.history import answer, Entry, History, KEPT, scene_of, write
from dp_swing_ros.console.presets import presets
from dp_swing_ros.console.pulls import bounded, Hold, Pull, Pulls
from dp_swing_ros.console.recorder import LOGGER, Recorder
from dp_swing_ros.console.requests import Request, RequestError
from dp_swing_ros.console.scene import Scene
from dp_swing_ros.console.server import Server
from dp_swing_ros.messages.configuration import CONTROLLER, PLANT
from dp_swing_ros.nodes.connections import message_class, publish
from dp_swing_ros.nodes.partners import Partner
from dp_swing_ros.nodes.process import ProcessNode
from dp_swing_ros.parameters.console import ConsoleParameters
from dp_swing_ros.pendulum.parameters import acting_unit
from dp_swing_ros.topics import DISTURBANCE, TOPICS

SERVICES = {'plant/reset': Trigger, 'mpc/reset': Trigger, 'mpc/enable': SetBool,
            'plant/pause': SetBool, 'plant/step': Trigger}
DEFAULTS = 'defaults'   # the preset that every pendulum has
SWITCH = 'enabled'      # which no preset touches
ANSWERED = 60.0         # [s] for nodes to answer: in lockstep an mpc compiles first what is new
PATIENCE = 60.0         # [s] for a logger to start, and to hear everything
MEETING = 1.5           # [s] for publishers to find a logger that is seen here


class Actions:
    """Does what pages ask for, as far as there are nodes to do it; in the thread of the node."""

    def __init__(self, node: ProcessNode, server: Server, scene: Scene, history: History,
                 partners: Mapping[str, Partner], parameters: ConsoleParameters) -> None:
        """Take the node that acts, what it has heard, and the nodes that are there by roles."""
        self.node, self.server, self.scene, self.history = node, server, scene, history
        self.partners, self.parameters = partners, parameters
        self.pulls = Pulls()
        self.kick = 0.0        # [N] once
        self.pushed = False    # since the last state
        self.disturbances = publish(node, DISTURBANCE)
        self.services = {name: node.create_client(kind, name) for name, kind in SERVICES.items()}
        self.presets = presets()
        self.recorder = Recorder(Path(parameters.recordings).expanduser())
        self.waiting: list[tuple[float, Callable[[bool, str], None], str]] = []   # for nodes
        self.starting: tuple[Client, Request, float] | None = None   # a recording, until when
        self.seen = 0.0   # [s] when its logger did not hear all yet

    def obey(self, client: Client, request: Request) -> None:
        """Do what a page asks for."""
        act = getattr(self, f'do_{request["do"]}', self.do_not)
        client.attempt(request, partial(act, client, request))

    def do_not(self, client: Client, request: Request) -> None:
        """Refuse what is for bags."""
        raise RequestError(f'{request["do"]} is for a recorded run; this one is live')

    # forces

    def on_state(self) -> None:
        """Let all hands be felt in the period that begins."""
        self.pushed = False
        self.push()

    def push(self) -> None:
        """Publish the sum of all hands, once for each state."""
        if self.pushed or self.scene.x is None:
            return
        limit = min(self.parameters.pull_limit,
                    self.scene.value(PLANT, 'disturbance_limit', math.inf))
        force = self.pulls.force(
            time.monotonic(), self.scene.x, self.scene.physical.lengths,
            self.parameters.pull_stiffness, limit, self.kick, self.scene.scale)
        self.kick = 0.0
        if force and math.isfinite(force):   # a state may be no number
            self.pushed = True
            self.disturbances.publish(Float64(data=force))

    def do_pull(self, client: Client, request: Request) -> None:
        """Pull by a spring."""
        x, z = request['to']
        self.take(client, Pull(request['body'], min(max(request['along'], 0.0), 1.0), (x, z)))

    def do_hold(self, client: Client, request: Request) -> None:
        """Pull by a force."""
        self.take(client, Hold(request['force']))

    def take(self, client: Client, pull: Pull | Hold) -> None:
        """Let the hand of a client pull, at once if nothing was felt since the last state."""
        self.pulls.take(client, pull, time.monotonic())
        self.push()

    def do_release(self, client: Client, request: Request) -> None:
        """Let go."""
        self.pulls.release(client)

    def do_push(self, client: Client, request: Request) -> None:
        """Push for one period."""
        if self.scene.x is None or PLANT not in self.partners:   # it would hit who comes later
            raise RequestError('no plant sends states; there is nothing to push')
        force = bounded(request['force'], self.parameters.pull_limit)
        self.kick += force
        self.push()
        unit = acting_unit(self.scene.physical.drive)
        client.answer(request, True, f'{force:g} {unit} for a period')

    # parameters

    def do_set(self, client: Client, request: Request) -> None:
        """Change parameters of a node."""
        self.set_all(client, request, {request['node']: request['parameters']})

    def do_goal(self, client: Client, request: Request) -> None:
        """Choose an equilibrium."""
        self.set_all(client, request, {CONTROLLER: {'goal': request['name']}})

    def do_reference(self, client: Client, request: Request) -> None:
        """Choose a place for the cart."""
        found = self.partner(CONTROLLER).described.get('reference')
        if found is None or found['type'] != 'double[]':
            raise RequestError('the mpc has no reference')
        self.set_all(client, request, {CONTROLLER: {
            'reference': [float(request['x']), *found['value'][1:]]}})

    def do_pace(self, client: Client, request: Request) -> None:
        """Let simulated time go faster or slower."""
        self.set_all(client, request, {PLANT: {'pace': request['pace']}})

    def do_preset(self, client: Client, request: Request) -> None:
        """Change all that a parameter file says, as far as it can change in a run."""
        name, changes, stay = request['name'], {}, []
        if name != DEFAULTS and name not in self.presets:
            raise RequestError(f'there is no preset {name[:80]!r}')
        for role in (PLANT, CONTROLLER):
            if role in self.partners:
                asked = self.partners[role].defaults() if name == DEFAULTS \
                    else self.presets[name][role]
                changes[role], fixed = self.partners[role].changes(
                    {name: value for name, value in asked.items() if name != SWITCH})
                stay += fixed
        self.set_all(client, request, {role: found for role, found in changes.items() if found},
                     name + (f', but for {", ".join(stay)}, which stay in a run' if stay else ''))

    def set_all(self, client: Client, request: Request, changes: Mapping[str, dict[str, Any]],
                text: str = '') -> None:
        """Change parameters of nodes, of each all or none, and answer in their words."""
        refused, missing = list[str](), len(changes)
        calls = [self.partner(role).prepared(values) for role, values in changes.items()]
        finish = self.once(client, request, ' and '.join(changes))

        def on_done(ok: bool, why: str) -> None:
            nonlocal missing
            missing -= 1
            if not ok:
                refused.append(why)
            if missing == 0:
                finish(not refused, '; '.join(refused) or text or ', '.join(
                    f'{name} is {value}' for values in changes.values()
                    for name, value in values.items()))

        if not changes:
            finish(True, f'{text}: as it is')
        for call in calls:
            call(on_done)

    def once(self, client: Client, request: Request, whose: str) -> Callable[[bool, str], None]:
        """Return what answers a request: when it is called, or for somebody who is silent."""
        def finish(ok: bool, text: str) -> None:
            if waiting in self.waiting:
                self.waiting.remove(waiting)
                client.answer(request, ok, text)

        waiting = time.monotonic() + ANSWERED, finish, whose
        self.waiting.append(waiting)
        return finish

    def partner(self, role: str) -> Partner:
        """Return a node that is there; raises RequestError."""
        if role not in self.partners:
            raise RequestError(f'there is no {role[:80]}')
        return self.partners[role]

    # services

    def do_reset(self, client: Client, request: Request) -> None:
        """Reset plant or mpc."""
        self.ask(client, request, f'{request["node"]}/reset', Trigger.Request())

    def do_enable(self, client: Client, request: Request) -> None:
        """Let the mpc act, or not."""
        self.ask(client, request, 'mpc/enable', SetBool.Request(data=request['on']))

    def do_pause(self, client: Client, request: Request) -> None:
        """Let simulated time stand still, or go on."""
        self.ask(client, request, 'plant/pause', SetBool.Request(data=request['on']))

    def do_step(self, client: Client, request: Request) -> None:
        """Let a period pass."""
        self.ask(client, request, 'plant/step', Trigger.Request())

    def ask(self, client: Client, request: Request, name: str, asked: Any,
            text: str = '') -> None:
        """Call a service, and answer with a text or its own words."""
        service: Service | None = self.services.get(name)
        if service is None or not service.service_is_ready():
            raise RequestError(f'nobody offers {name[:80]}')

        finish = self.once(client, request, name)

        def on_done(future: Future) -> None:
            response = future.result()
            finish(response.success, text or response.message)

        service.call_async(asked).add_done_callback(on_done)

    # the past

    def do_history(self, client: Client, request: Request) -> None:
        """Send what was in the last minute."""
        rows = list(self.history.rows)
        self.server.call(lambda: client.send({**answer(rows), 'id': request.get('id')}))

    def do_past(self, client: Client, request: Request) -> None:
        """Send the frame of an instant of the last minute; made in the thread of the server."""
        entries = self.history.until(request['at'])

        def send() -> None:
            frame = scene_of(entries, self.scene.joint_states, decoded).frame()
            if frame is None:
                raise RequestError(f'nothing is kept of {request["at"]:g} s; expected a time of '
                                   'the last minute, as `history` has them')
            client.send({'kind': 'past', 'id': request.get('id'), 'frame': frame})

        self.server.call(client.attempt, request, send)

    def do_branch(self, client: Client, request: Request) -> None:
        """Let each solver take over at an instant of the last minute."""
        names = {topic.name: self.node.resolve_topic_name(topic.name) for topic in KEPT}
        entries = self.history.entries()

        def make_bag(folder: Path) -> Path:
            write(entries, folder, names)
            return folder

        self.server.branch(client, request, make_bag)

    # recordings

    def do_record(self, client: Client, request: Request) -> None:
        """Start a logger, or end it."""
        if not request['on']:
            if self.starting is not None:
                raise RequestError('the logger is still starting; stop it when it records')
            client.answer(request, True, f'recorded to {self.recorder.stop()}')
            return
        self.recorder.start([self.node.resolve_topic_name(topic.name) for topic in TOPICS])
        self.seen = time.monotonic()
        self.starting = client, request, self.seen + PATIENCE

    def poll(self, log: Callable[[str], object]) -> None:
        """Go on with recordings, and answer for those who are silent."""
        for until, finish, whose in list(self.waiting):
            if time.monotonic() > until:
                finish(False, f'{whose} has not answered in {ANSWERED:g} s')
        failure = self.recorder.poll()
        if failure:
            log(failure)
        if self.starting is None:
            return
        client, request, until = self.starting
        if failure or time.monotonic() > until:
            self.starting = None
            client.answer(request, False, failure or 'the logger does not hear all topics; it '
                          'goes on with what it hears')
        elif not self.logger_hears_all():
            self.seen = time.monotonic()
        elif time.monotonic() > self.seen + MEETING:
            self.starting = None
            self.begin_record(client, request)

    def logger_hears_all(self) -> bool:
        """Return whether the logger is on each topic that somebody publishes."""
        def subscribed(name: str) -> bool:
            return any(each.node_name == LOGGER
                       for each in self.node.get_subscriptions_info_by_topic(name))
        names = [self.node.resolve_topic_name(topic.name) for topic in TOPICS]
        return all(subscribed(name) for name in names if self.node.count_publishers(name))

    def begin_record(self, client: Client, request: Request) -> None:
        """Reset the mpc, so that `verify` can repeat what follows from the recording alone."""
        text = f'recording to {self.recorder.folder}'
        if self.services['mpc/reset'].service_is_ready():
            self.ask(client, request, 'mpc/reset', Trigger.Request(), text)
        else:
            client.answer(request, True, text)

    def close(self) -> None:
        """End recordings."""
        self.recorder.close()


def decoded(entry: Entry) -> Any:
    """Return the message that was kept; raises RuntimeError where it is none."""
    return deserialize_message(entry.data, message_class(entry.topic.type))
