# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The console: a page in the browser that shows the pendulum, its plan, and lets hands on it.

It acts through topics, services and parameters alone, so that a bag records what was done. The
page is served by a thread of its own; requests come from there and are obeyed here.
"""

from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path
import time
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rclpy.client import Client as Service
from rclpy.task import Future
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

from dp_swing_ros.console.client import Client
from dp_swing_ros.console.pulls import Hold, Pull, Pulls
from dp_swing_ros.console.requests import Request, RequestError
from dp_swing_ros.console.scene import CONTROLLER, HEARD, PLANT, Scene
from dp_swing_ros.console.server import Options, Server
from dp_swing_ros.nodes.connections import owners, publish, subscribe
from dp_swing_ros.nodes.parameters import ConsoleParameters, named
from dp_swing_ros.nodes.partners import Partner
from dp_swing_ros.nodes.process import ProcessNode, run
from dp_swing_ros.nodes.ros_parameters import declare, let_change
from dp_swing_ros.pendulum.parameters import GIVEN
from dp_swing_ros.provenance import package_version
from dp_swing_ros.topics import (
    DIAGNOSTICS, DISTURBANCE, FAULTS_JOINT_STATES, JOINT_STATES, PLAN, Topic)

LOOK_PERIOD = 0.5     # [s] between two looks for nodes
CALLS = 1000          # requests at most that wait for the thread of the node
STATUS_PERIOD = 0.2   # [s] between two looks at what diagnostics say
SENSORS = (JOINT_STATES, PLAN, DIAGNOSTICS)   # of which the newest counts
# whose owner is which node
SIGNS = {PLANT: JOINT_STATES, CONTROLLER: PLAN, 'faults': FAULTS_JOINT_STATES}
SERVICES = {'plant/reset': Trigger, 'mpc/reset': Trigger, 'mpc/enable': SetBool,
            'plant/pause': SetBool, 'plant/step': Trigger}


class ConsoleNode(ProcessNode):
    """The node: hears what the page shows, and does what the page asks for."""

    def __init__(self) -> None:
        """Read the parameters, and bind to the address."""
        super().__init__('console')
        fields = named(ConsoleParameters)
        self.values = declare(self, fields, live=True)
        let_change(self, fields, self.values, self.on_change)
        self.parameters = ConsoleParameters(**self.values)
        self.scene = Scene(self.resolve_topic_name(JOINT_STATES.name))
        self.pulls = Pulls()
        self.kick = 0.0          # [N] once
        self.pushed = False      # since the last state
        self.partners: dict[str, Partner] = {}   # plant, mpc, faults
        self.calls = deque[Callable[[], None]]()
        self.called = self.create_guard_condition(self.on_calls)
        self.disturbances = publish(self, DISTURBANCE)
        self.clients_of = {name: self.create_client(kind, name)
                           for name, kind in SERVICES.items()}
        self.server = Server(Options(
            self.parameters.address, self.parameters.port, self.parameters.token,
            self.parameters.read_only, Path(self.parameters.recordings).expanduser()),
            self, self.get_logger().warning)
        for topic in HEARD:
            subscribe(self, topic, partial(self.hear, topic), sensor=topic in SENSORS)
        self.create_subscription(ParameterEvent, '/parameter_events', self.on_parameters, 100)
        self.every(LOOK_PERIOD, self.look)
        self.every(STATUS_PERIOD, self.publish_status)

    def prepare(self) -> None:
        """Serve the page."""
        self.look()
        self.server.start()
        self.get_logger().info(f'the page is at {self.server.access.address}')

    def close(self) -> None:
        """End the server."""
        self.server.stop()

    def on_change(self, values: dict[str, Any]) -> None:
        """Pull otherwise from now on."""
        self.parameters = ConsoleParameters(**values)

    # what is heard

    def hear(self, topic: Topic, message: Any) -> None:
        """Take a message; the page is shown each state, and what comes after it a little later."""
        self.scene.hear(topic, message)
        if topic is JOINT_STATES:
            self.pushed = False
            self.push()
            self.server.poke()
        else:
            self.server.poke(trailing=True)

    def push(self) -> None:
        """Publish the sum of all hands, once for each state."""
        if self.pushed or self.scene.x is None:
            return
        force = self.kick + self.pulls.force(
            time.monotonic(), self.scene.x, self.scene.physical.lengths,
            self.parameters.pull_stiffness)
        limit = min(self.parameters.pull_limit,
                    self.scene.value(PLANT, 'disturbance_limit', float('inf')))
        self.kick = 0.0
        if force:
            self.pushed = True
            self.disturbances.publish(Float64(data=min(max(force, -limit), limit)))

    def look(self) -> None:
        """Find the nodes that are there, and tell the page."""
        for role, topic in SIGNS.items():
            found = sorted(owners(self, topic))
            before = self.partners.get(role)
            if before is None or before.name not in found:
                self.partners.pop(role, None)
                if found:
                    self.partners[role] = Partner(
                        self, found[0], partial(self.publish_parameters, role))
                if found or before:
                    self.publish_parameters(role)
        for partner in self.partners.values():
            partner.look()
        self.publish_hello()

    def on_parameters(self, event: ParameterEvent) -> None:
        """Take the news of parameters that anybody has changed."""
        for partner in self.partners.values():
            if partner.name == event.node:
                partner.on_event(event)

    def publish_parameters(self, role: str) -> None:
        """Tell the page the parameters of a node; none where it is gone."""
        partner = self.partners.get(role)
        self.server.publish(f'parameters of {role}', {
            'kind': 'parameters', 'node': role,
            'parameters': list(partner.described.values()) if partner else []})

    def publish_hello(self) -> None:
        """Tell the page what there is."""
        self.server.publish('hello', {
            'kind': 'hello', 'version': package_version(), 'read_only': self.parameters.read_only,
            'replay': False, 'nodes': {role: self.partners[role].name if role in self.partners
                                       else None for role in (PLANT, CONTROLLER)},
            **self.scene.about(), 'solvers': self.choices('solver'),
            # an equilibrium is named by one word for each link
            'goals': [name for name in self.choices('goal') if name != GIVEN
                      and len(name.split('_')) == self.scene.physical.links],
            'presets': [], 'pausable': self.clients_of['plant/pause'].service_is_ready(),
            'duration': None})

    def choices(self, name: str) -> list[str]:
        """Return what a parameter of the mpc may be."""
        mpc = self.partners.get(CONTROLLER)
        found = mpc.described.get(name) if mpc else None
        return (found['choices'] or []) if found else []

    def publish_status(self) -> None:
        """Tell the page what diagnostics say."""
        self.server.publish('status', self.scene.status())

    # what the server asks for, in its own thread

    def frame(self) -> dict[str, Any] | None:
        """Return the newest frame."""
        return self.scene.frame()

    def joined(self, client: Client) -> None:
        """Take a new client, who knows all already."""

    def left(self, client: Client) -> None:
        """Let go for a client who is gone."""
        self.call(partial(self.pulls.release, client))

    def ask(self, client: Client, request: Request) -> None:
        """Hand a request over to the thread of the node."""
        if len(self.calls) >= CALLS:
            raise RequestError('too many requests at once')
        self.call(partial(self.obey, client, request))

    def call(self, function: Callable[[], None]) -> None:
        """Call a function in the thread of the node."""
        self.calls.append(function)
        self.called.trigger()

    def on_calls(self) -> None:
        """Do what was asked for."""
        while self.calls:
            self.calls.popleft()()

    # requests

    def obey(self, client: Client, request: Request) -> None:
        """Do what a page asks for."""
        try:
            getattr(self, f'do_{request["do"]}', self.do_not)(client, request)
        except RequestError as error:
            client.answer(request, False, str(error))

    def do_not(self, client: Client, request: Request) -> None:
        """Refuse what is for bags."""
        raise RequestError(f'{request["do"]} is for a recorded run; this one is live')

    def do_pull(self, client: Client, request: Request) -> None:
        """Pull by a spring."""
        self.take(client, Pull(request['body'], min(max(request['along'], 0.0), 1.0),
                               tuple(request['to'])))

    def do_hold(self, client: Client, request: Request) -> None:
        """Pull by a force."""
        self.take(client, Hold(request['force']))

    def take(self, client: Client, pull: Pull | Hold) -> None:
        """Let the hand of a client pull, at once if it has not been felt since the last state."""
        self.pulls.take(client, pull, time.monotonic())
        self.push()

    def do_release(self, client: Client, request: Request) -> None:
        """Let go."""
        self.pulls.release(client)

    def do_push(self, client: Client, request: Request) -> None:
        """Push for one period."""
        self.kick += request['force']
        self.push()

    def do_set(self, client: Client, request: Request) -> None:
        """Change parameters of a node."""
        self.set(client, request, request['node'], request['parameters'])

    def do_goal(self, client: Client, request: Request) -> None:
        """Choose an equilibrium."""
        self.set(client, request, CONTROLLER, {'goal': request['name']})

    def do_reference(self, client: Client, request: Request) -> None:
        """Choose a place for the cart."""
        found = self.partner(CONTROLLER).described.get('reference')
        if found is None:
            raise RequestError('the mpc has no reference')
        self.set(client, request, CONTROLLER,
                 {'reference': [float(request['x']), *found['value'][1:]]})

    def do_pace(self, client: Client, request: Request) -> None:
        """Let simulated time go faster or slower."""
        self.set(client, request, PLANT, {'pace': request['pace']})

    def set(self, client: Client, request: Request, role: str,   # noqa: A003
            values: dict[str, Any]) -> None:
        """Change parameters of a node, and answer."""
        self.partner(role).set(values, lambda ok, why: client.answer(
            request, ok, why or ', '.join(f'{name} is {value}' for name, value in values.items())))

    def partner(self, role: str) -> Partner:
        """Return a node that is there; raises RequestError."""
        if role not in self.partners:
            raise RequestError(f'there is no {role[:80]}')
        return self.partners[role]

    def do_reset(self, client: Client, request: Request) -> None:
        """Reset plant or mpc."""
        self.ask_service(client, request, f'{request["node"]}/reset', Trigger.Request())

    def do_enable(self, client: Client, request: Request) -> None:
        """Let the mpc act, or not."""
        self.ask_service(client, request, 'mpc/enable', SetBool.Request(data=request['on']))

    def do_pause(self, client: Client, request: Request) -> None:
        """Let simulated time stand still, or go on."""
        self.ask_service(client, request, 'plant/pause', SetBool.Request(data=request['on']))

    def do_step(self, client: Client, request: Request) -> None:
        """Let a period pass."""
        self.ask_service(client, request, 'plant/step', Trigger.Request())

    def ask_service(self, client: Client, request: Request, name: str, asked: Any) -> None:
        """Call a service, and answer with its words."""
        service: Service | None = self.clients_of.get(name)
        if service is None or not service.service_is_ready():
            raise RequestError(f'nobody offers {name[:80]}')

        def on_done(future: Future) -> None:
            response = future.result()
            client.answer(request, response.success, response.message)

        service.call_async(asked).add_done_callback(on_done)


main = partial(run, ConsoleNode)
