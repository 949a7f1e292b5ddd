# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Learning over running nodes: whatever publishes states, and an mpc.

A node of its own sends random forces first. Then an mpc plans with what was learned of them, and
this node hears states and forces, learns from all of them, and sets the mpc's model.
"""

from argparse import Namespace
from collections.abc import Callable, Mapping
from functools import partial
import math
from pathlib import Path
import time
from typing import Any

import numpy as np
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_msgs.msg import Float64

from dp_swing_ros.control import controllers
from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.errors import UserError
from dp_swing_ros.identification.recorded import APART
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.learner import Explorer, LEARNING
from dp_swing_ros.learning.models import FEWEST, Online
from dp_swing_ros.learning.recorded import stretches_of
from dp_swing_ros.learning.trials import held_for, Trial
from dp_swing_ros.messages.fields import BILLION, seconds, to_state
from dp_swing_ros.messages.states import States
from dp_swing_ros.nodes.connections import owners, publish, QUEUE, sender_of, subscribe
from dp_swing_ros.nodes.taking import Executor
from dp_swing_ros.parameters import group
from dp_swing_ros.parameters.files import locate
from dp_swing_ros.pendulum.model import ROUNDING
from dp_swing_ros.pendulum.sensors import SensorParameters
from dp_swing_ros.pendulum.state import Array, deviation
from dp_swing_ros.problem.parameters import ANALYTIC, LEARNED
from dp_swing_ros.tools.command_lines import given
from dp_swing_ros.tools.processes import Crew
from dp_swing_ros.topics import FORCE_COMMAND, FORCE_COMMAND_STAMPED, JOINT_STATES

MPC = 'mpc'
POLL = 0.05      # [s]
DELIVERY = 0.3   # [s] at most for a last force to arrive
DISCOVERY = 1.0    # [s] for nodes to find each other
SILENCE = 10.0   # [s] without a state, after which nobody seems to send any
COMPILING = 120.0   # [s] the same, until the mpc acts
LONGEST = 0.5    # [s] between two states; beyond, it is no experience


class LiveLearner:
    """Hears states and forces, sends random ones until it has learned, and keeps a model."""

    def __init__(self, node: Node, values: Mapping[str, Any]) -> None:
        """Take a node and the parameters of the mpc; raises ParameterError."""
        self.node, values = node, controllers.MPC.complete(values)
        self.problem = controllers.problem({**values, 'dynamics': ANALYTIC, 'model': 'rk4'})
        self.links, self.sensors = values['links'], group(SensorParameters, values)
        self.scale = self.problem.scale
        self.explorer = Explorer(
            self.problem.u_max, np.random.default_rng(values['seed']), self.scale)
        self.online = Online(self.links, self.scale)
        Online(self.links).model(some(self.links))   # compiles
        self.model: LearnedModel | None = None
        self.explores = self.acts = False   # itself, and the mpc
        self.t, self.X = list[float](), list[Array]()             # of the states [s]
        self.at = list[float]()                                   # [s] of experience until each
        self.sent, self.commands = list[float](), list[float]()   # of the forces [s], [N]
        self.learned = 0.0                                        # [s] of experience
        self.is_simulated = False                                 # the time of the stamps
        self.answer: Future | None = None
        self.newest: tuple[Any, Mapping[str, int]] | None = None   # state, and what came with it
        self.states = States(self.sensors.joint_names, node.get_logger().warning,
                             partial(sender_of, node, JOINT_STATES))
        self.forces = publish(node, FORCE_COMMAND)
        self.client = node.create_client(SetParametersAtomically,
                                         f'{MPC}/set_parameters_atomically')
        subscribe(node, FORCE_COMMAND_STAMPED, self.on_force, depth=QUEUE)
        subscribe(node, JOINT_STATES, self.on_message, depth=QUEUE, sensor=True)
        self.executor = Executor(context=node.context)
        self.executor.add_node(node)
        self.heard = time.monotonic()

    def on_message(self, message: Any, info: Mapping[str, Any]) -> None:
        """Take a message on the topic of the states."""
        if self.states.picks(message, info['publisher_gid'], info['publication_sequence_number'],
                             time.monotonic(), asked_again=True):
            self.on_state(message, info)

    def on_state(self, message: Any, info: Mapping[str, int]) -> None:
        """Keep a state that is followed by a force; at first a random one answers it."""
        self.heard, self.newest = time.monotonic(), (message, info)
        t = seconds(message.header.stamp)
        if not (self.explores or self.acts):
            return
        if self.t and t < self.t[-1] - LONGEST:
            raise UserError(f'the states begin again, at {t:g} s after {self.t[-1]:g} s: the '
                            'plant was reset, or started anew')
        if self.t and t < self.t[-1]:
            return
        if self.t and t == self.t[-1]:   # in lockstep, one again that nobody has answered
            if self.explores:
                self.forces.publish(Float64(data=self.commands[-1]))
            return
        try:
            x = to_state(message, self.links, self.sensors)
        except ValueError as error:
            raise UserError(f'{error}; give the number of links, and what else differs from the '
                            'defaults, by --params') from None
        if not np.all(np.isfinite(x)):
            raise UserError(f'the state is {x}; to learn while it runs takes positions and '
                            'speeds that are measured')
        passed = t - self.t[-1] if self.t else 0.0
        self.at.append(self.duration + (passed if passed < LONGEST else 0.0))
        self.t.append(t)
        self.X.append(x)
        # a stamp may be of simulated time: then a force counts from the state that it answers
        self.is_simulated = abs(info['source_timestamp'] / BILLION - t) > APART
        if self.explores:
            force = self.explorer.force(x, passed or math.inf)
            self.forces.publish(Float64(data=force))
            self.keep(t, time.time(), force)

    def on_force(self, message: Any, info: Mapping[str, int]) -> None:
        """Keep a force of the mpc."""
        self.acts = True
        self.keep(seconds(message.header.stamp), info['source_timestamp'] / BILLION,
                  message.effort[0])

    def keep(self, answered: float, sent: float, force: float) -> None:
        """Keep a force [N] that was sent at a time [s] and answers the state of another."""
        self.sent.append(answered if self.is_simulated else sent)
        self.commands.append(force)

    def listen(self, duration: float) -> None:
        """Take what comes for a time [s]; raises UserError where no states do."""
        end = time.monotonic() + duration
        while (left := end - time.monotonic()) > 0:
            self.executor.spin_once(timeout_sec=left)
        # a plant in lockstep waits for an mpc, which at its first start compiles
        silence = SILENCE if self.explores or self.acts else COMPILING
        if time.monotonic() - self.heard > silence:
            raise UserError(f'no state on {JOINT_STATES.name} for {silence:g} s; start a plant, '
                            'in the same ROS domain')

    def explore(self) -> None:
        """Send random forces from now on, in answer to the last state, too."""
        self.explores = True
        if self.newest is not None:   # a plant in lockstep waits
            self.on_state(*self.newest)

    def stop(self) -> None:
        """End the random forces, with zero."""
        self.explores = False
        self.forces.publish(Float64(data=0.0))
        self.forces.wait_for_all_acked(Duration(seconds=DELIVERY))

    def masters(self) -> set[str]:
        """Return the nodes that send forces, too."""
        return owners(self.node, FORCE_COMMAND) - {self.node.get_fully_qualified_name()}

    @property
    def duration(self) -> float:
        """Return how long the experience is [s]."""
        return self.at[-1] if self.at else 0.0

    def experience(self) -> Experience:
        """Return what there is to learn from; raises UserError where there is nothing."""
        t, X, sent, commands = map(np.array, (self.t, self.X, self.sent, self.commands))
        return Experience.joined(stretches_of(t, X, sent, commands,
                                              self.problem.parameters.limits.track_limit,
                                              scale=self.scale))

    def learn(self) -> LearnedModel | None:
        """Return a new model of all that was heard, if that is due."""
        if self.duration - self.learned < self.scale.sized(LEARNING, 's') - ROUNDING:
            return None
        self.learned, seen = self.duration, self.experience()
        try:
            self.model = self.online.model(seen)
        except (FloatingPointError, np.linalg.LinAlgError):
            return None   # more experience will tell
        return self.model

    def hand_over(self, model: LearnedModel) -> None:
        """Set the model of the mpc, unless that is still at the one before."""
        if self.answer is not None:
            if not self.answer.done():
                return
            result = self.answer.result().result
            if not result.successful:
                raise UserError(f'the mpc refused a model: {result.reason}')
        if self.client.service_is_ready():
            self.answer = self.client.call_async(SetParametersAtomically.Request(parameters=[
                Parameter('model', value=model.to_text()).to_parameter_msg()]))

    def so_far(self) -> Trial:
        """Return what came of all experience so far, of two states at least."""
        X = np.array(self.X)
        off = deviation(X, self.problem.x_r)
        period = float(np.median(np.diff(self.t)))
        return Trial(1, np.array(self.at), X, off, held_for(off, period),
                     np.empty(0) if self.model is None else self.model.noise)


def some(links: int) -> Experience:
    """Return a little experience, of nothing."""
    X = np.random.default_rng(0).normal(size=(FEWEST, 2 * links + 2))
    return Experience(X, X, np.zeros(FEWEST), np.full(FEWEST, 0.05))


def learning(learner: LiveLearner, arguments: Namespace, folder: Path,
             show: Callable[[float, float], object]) -> Trial:
    """
    Learn as the arguments of `learn` ask, until it is held; return what came of it.

    Raises UserError where somebody else sends forces, or where nobody sends states.
    """
    learner.listen(DISCOVERY)
    if others := learner.masters():
        raise UserError(f'{" and ".join(sorted(others))} on {FORCE_COMMAND.name}, too; end it, '
                        'for there is to be one master')
    learner.explore()
    try:
        while learner.duration < arguments.first:
            learner.listen(POLL)
            if learner.t:
                show(learner.duration, float(deviation(learner.X[-1], learner.problem.x_r)))
    finally:
        learner.stop()
    model = learner.learn()
    if model is None:
        raise UserError('the random forces say too little of what they move; give it more of '
                        'them (--first)')
    first = folder / 'first_model.json'
    first.write_text(model.to_text(), encoding='utf-8')
    with Crew() as crew:
        mpc = crew.start(MPC, {'dynamics': LEARNED, 'model': str(first.resolve()),
                               **given(arguments, 'solver', 'seed')},
                         folder / 'mpc.log', map(locate, arguments.params))
        trial = learner.so_far()
        while trial.held < arguments.hold and learner.duration < arguments.total:
            learner.listen(POLL)
            mpc.check()
            if learner.acts and (model := learner.learn()):
                learner.hand_over(model)
            trial = learner.so_far()
            show(learner.duration, float(trial.deviation[-1]))
    return trial
