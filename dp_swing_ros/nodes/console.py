# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The console: a page in the browser that shows the pendulum and its plan, and lets hands on it.

It acts through topics, services and parameters alone, so that a bag records what was done, and
any plant and mpc will do. The page is served by a thread of its own; what it asks for is done in
that of the node.
"""

from collections import deque
from collections.abc import Callable
from functools import partial
import os
from pathlib import Path
import time
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message

from dp_swing_ros.console.access import given_token
from dp_swing_ros.console.client import Client
from dp_swing_ros.console.history import Entry, History, KEPT, SEEN
from dp_swing_ros.console.requests import Request, RequestError
from dp_swing_ros.console.scene import HEARD, Scene
from dp_swing_ros.console.server import Options, Server, TRAILING
from dp_swing_ros.console.silence import Silence
from dp_swing_ros.errors import one_line
from dp_swing_ros.messages.configuration import CONTROLLER, PLANT, role_of
from dp_swing_ros.nodes.actions import Actions, DEFAULTS
from dp_swing_ros.nodes.connections import message_class, NAMELESS, owners, subscribe
from dp_swing_ros.nodes.partners import Partner
from dp_swing_ros.nodes.process import ProcessNode, run
from dp_swing_ros.nodes.ros_parameters import allow_changes, declare, overrides
from dp_swing_ros.parameters import named
from dp_swing_ros.parameters.console import ConsoleParameters
from dp_swing_ros.pendulum.parameters import GIVEN
from dp_swing_ros.provenance import package_version
from dp_swing_ros.topics import (
    CONFIGURATION, DIAGNOSTICS, JOINT_STATES, PLAN, Topic)

LOOK_PERIOD = 0.5     # [s] between two looks for nodes
NICE = 5              # an mpc comes first
ANSWERED = 0.9        # of the period, by when a state is shown without its answer
ANSWER = 0.012        # [s] the same, where there is nobody to report one
POLL_PERIOD = 0.2     # [s] between two looks at diagnostics and recordings
CALLS = 1000          # requests at most that wait for the thread of the node
SENSORS = (JOINT_STATES, PLAN, DIAGNOSTICS)   # of which the newest counts
# whose owner is which node
SIGNS = {PLANT: JOINT_STATES, CONTROLLER: PLAN}


class ConsoleNode(ProcessNode):
    """The node: hears what the page shows, and is the `Source` of its server."""

    def __init__(self) -> None:
        """Read the parameters, and bind to the address."""
        super().__init__('console')
        self.fields = fields = named(ConsoleParameters)
        values = declare(self, fields, live=True)
        allow_changes(self, fields, values, self.on_change)
        # what nobody has said, and goes with the pendulum
        self.scaled = {name: value for name, value in values.items()
                       if fields[name].metadata['scaled'] and name not in overrides(self)}
        parameters = ConsoleParameters(**values)
        self.scene = Scene(self.resolve_topic_name(JOINT_STATES.name))
        self.partners: dict[str, Partner] = {}   # plant, mpc
        self.known: dict[str, Partner] = {}      # by name, also those that are gone
        self.complained = set[Topic]()   # of which something was none of this pendulum
        self.calls = deque[Callable[[], None]]()
        self.called = self.create_guard_condition(self.on_calls)
        self.server = Server(Options(
            parameters.address, parameters.port,
            given_token(parameters.token, parameters.token_file), parameters.read_only,
            Path(parameters.recordings).expanduser()), self, self.get_logger().warning)
        self.opened = False   # a page, once
        self.history, self.silence = History(), Silence()
        self.actions = Actions(
            self, self.server, self.scene, self.history, self.partners, parameters)
        for topic in HEARD:
            subscribe(self, topic, partial(self.hear, topic), sensor=topic in SENSORS, raw=True,
                      sparing=topic is CONFIGURATION)
        self.create_subscription(ParameterEvent, '/parameter_events', self.on_parameters, 100)
        self.every(LOOK_PERIOD, self.look)
        self.every(POLL_PERIOD, self.poll)

    def prepare(self) -> None:
        """Serve the page."""
        os.nice(NICE)
        self.look()
        self.server.start()
        # not by the logger, whose words are published, as a token that was made is a secret
        print(f'the page is at {self.server.access.address}', flush=True)

    def close(self) -> None:
        """End the server, and what it started."""
        self.server.stop()
        self.actions.close()

    def on_change(self, values: dict[str, Any]) -> None:
        """Pull otherwise from now on."""
        self.actions.parameters = ConsoleParameters(**values)

    def hear(self, topic: Topic, data: bytes, info: dict[str, int]) -> None:
        """Take a message; the page is shown each state with its answer, if that is in time."""
        before, was_answered = self.scene.stamp, self.scene.is_answered
        scale = self.scene.scale
        try:
            message = deserialize_message(data, message_class(topic.type))
            self.scene.hear(topic, message)
        except (RuntimeError, ValueError) as error:
            if topic not in self.complained:   # once, however many come
                self.get_logger().warning(f'{one_line(error)}; going on without it')
            self.complained.add(topic)
            return
        if self.scene.scale != scale:
            self.rescale()
        if topic is JOINT_STATES and self.scene.stamp != before:
            self.history.keep_state(self.scene)
            self.actions.on_state()
        self.silence.hear(topic, message, self.scene, time.monotonic())
        if topic is JOINT_STATES:   # its answer is shown with it
            self.server.poke(min(ANSWERED * self.scene.period, TRAILING) if self.scene.tick
                             else ANSWER)
        else:
            answered = self.scene.is_answered and not was_answered
            if answered:
                self.history.keep_answer(self.scene)
            self.server.poke(0.0 if answered else TRAILING)
        if topic in (*KEPT, *SEEN):
            self.keep(topic, message, data, info)

    def rescale(self) -> None:
        """Pull at a pendulum of another size as at the default one, but for what somebody set."""
        scale, usual = self.scene.scale, vars(ConsoleParameters())
        self.scaled = {name: scale.sized(usual[name], self.fields[name].metadata['unit'])
                       for name, value in self.scaled.items()
                       if self.get_parameter(name).value == value}
        self.set_parameters([Parameter(name, value=value) for name, value in self.scaled.items()])

    def keep(self, topic: Topic, message: Any, data: bytes, info: dict[str, int]) -> None:
        """Keep a message of the last minute."""
        whose = topic.name if topic.latched else ''
        found = self.scene.announced
        if topic is CONFIGURATION and found is not None:
            whose = found.node
            if role_of(found) in SIGNS and found.revision == found.resets == 0:
                self.history.begin()   # it was started again
        self.history.keep(Entry(self.scene.time_of(topic, message), topic, whose, data,
                                info['received_timestamp'], info['source_timestamp']))

    def look(self) -> None:
        """Find the nodes that are there, and send the page what they are."""
        for role, topic in SIGNS.items():
            found = sorted(name for name in owners(self, topic) if NAMELESS not in name)
            before = self.partners.get(role)
            if before is None or before.name not in found:
                self.partners.pop(role, None)
                if found:
                    self.partners[role] = self.partner_of(found[0], role)
                if found or before:
                    self.publish_parameters(role)
        for partner in self.partners.values():
            partner.look()
        self.publish_hello()

    def partner_of(self, name: str, role: str) -> Partner:
        """Return the node of a name, which may have been here before."""
        if name not in self.known:
            self.known[name] = Partner(self, name, partial(self.publish_parameters, role))
        self.known[name].reset()
        return self.known[name]

    def on_parameters(self, event: ParameterEvent) -> None:
        """Take the news of parameters that anybody has changed."""
        for partner in self.partners.values():
            if partner.name == event.node:
                partner.on_event(event)

    def poll(self) -> None:
        """Tell the page what diagnostics say, and what has become of recordings."""
        self.actions.poll(self.get_logger().warning)
        silent = self.silence.lasts(self.scene, time.monotonic(), PLANT in self.partners)
        self.server.publish('silence', {'kind': 'silence', 'silent': silent})
        self.server.publish('status', self.scene.status(silent))
        self.server.publish('recording', self.actions.recorder.state())

    def publish_parameters(self, role: str) -> None:
        """Tell the page the parameters of a node; none where it is gone."""
        partner = self.partners.get(role)
        self.server.publish(f'parameters of {role}', {
            'kind': 'parameters', 'node': role,
            'parameters': list(partner.described.values()) if partner else []})

    def publish_hello(self) -> None:
        """Tell the page what there is."""
        self.server.publish('hello', {
            'kind': 'hello', 'version': package_version(), 'read_only': self.server.read_only,
            'replay': False, 'nodes': {role: self.partners[role].name if role in self.partners
                                       else None for role in (PLANT, CONTROLLER)},
            **self.scene.about(), 'solvers': self.choices('solver'),
            # an equilibrium is named by one word for each link
            'goals': [name for name in self.choices('goal') if name != GIVEN
                      and len(name.split('_')) == self.scene.physical.links],
            'presets': [DEFAULTS, *self.actions.presets],
            'pausable': self.scene.about()['lockstep']
            and self.actions.services['plant/pause'].service_is_ready(), 'duration': None})

    def choices(self, name: str) -> list[str]:
        """Return what a parameter of the mpc may be."""
        mpc = self.partners.get(CONTROLLER)
        found = mpc.described.get(name) if mpc else None
        return (found['choices'] or []) if found else []

    def frame(self) -> dict[str, Any] | None:
        """Return the newest frame; in the server's thread, as the following."""
        return self.scene.frame()

    def joined(self, client: Client) -> None:
        """Say that the first page is open, as `play` waits for; the client knows all already."""
        if not self.opened:
            self.opened = True
            print('a page is open', flush=True)

    def left(self, client: Client) -> None:
        """Let go for a client who is gone."""
        self.call(partial(self.actions.pulls.release, client))

    def ask(self, client: Client, request: Request) -> None:
        """Hand a request over to the thread of the node."""
        if len(self.calls) >= CALLS:
            raise RequestError('too many requests at once')
        self.call(partial(self.actions.obey, client, request))

    def call(self, function: Callable[[], None]) -> None:
        """Call a function in the thread of the node."""
        self.calls.append(function)
        self.called.trigger()

    def on_calls(self) -> None:
        """Do what was asked for."""
        while self.calls:
            self.calls.popleft()()


main = partial(run, ConsoleNode)
