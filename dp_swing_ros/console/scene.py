# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the page shows: the newest of everything that was heard, live or from a bag."""

from collections import deque
from collections.abc import Callable, Collection
from contextlib import suppress
import math
from typing import Any, NamedTuple, TypeGuard, TypeVar

import numpy as np

from dp_swing_ros.errors import one_line
from dp_swing_ros.messages.configuration import (
    Configuration, CONTROLLER, from_text, PLANT, role_of)
from dp_swing_ros.messages.fields import (
    from_diagnostics, from_trajectory, links_in, nanoseconds, Report, seconds, to_force, to_state)
from dp_swing_ros.messages.ticks import keys_of_state
from dp_swing_ros.parameters import group, named, ParameterError
from dp_swing_ros.pendulum.geometry import drawn_centres, drawn_scale
from dp_swing_ros.pendulum.parameters import (
    acting_unit, DriveParameters, DRIVES, LimitParameters, PendulumParameters)
from dp_swing_ros.pendulum.sensors import default_sensors, SensorParameters
from dp_swing_ros.pendulum.state import Array, links_of
from dp_swing_ros.pendulum.units import decimals
from dp_swing_ros.pendulum.urdf import from_urdf
from dp_swing_ros.topics import (
    COMMAND_TOPICS, CONFIGURATION, DIAGNOSTICS, DISTURBANCE, JOINT_STATES, PLAN,
    ROBOT_DESCRIPTION, Topic, TRIES)

CART = (0.44, 0.22)   # [m] scaled, as it is drawn
LASTS = 2 * 10 ** 9   # [ns] what the mpc says is shown, where nothing newer comes
STALE = 3             # level of a status that nobody renews
UNPLANNED = ('DISABLED', 'ZERO')   # statuses of ticks that follow no plan
POINTS = 60           # of a plan or a path at most
PATHS, STEPS = 2000, 10_000   # at most that are looked at, of somebody's
MOST = 500            # statuses of all nodes that are kept
DIGITS = 4            # after the point: a tenth of a millimetre
PATH_DIGITS = 3       # of a path [m], scaled
HEARD = (JOINT_STATES, *COMMAND_TOPICS, DISTURBANCE, PLAN, TRIES, DIAGNOSTICS, ROBOT_DESCRIPTION,
         CONFIGURATION)


Kept = TypeVar('Kept')


class Shown(NamedTuple):
    """What is shown of a message with a stamp [ns]."""

    stamp: int
    content: dict[str, Any] | None


class Scene:
    """
    The newest of everything; `hear` takes messages, the rest makes what the page is sent.

    Messages are checked and taken apart as they are heard: what is shown of them cannot fail.
    """

    def __init__(self, joint_states: str = '/joint_states') -> None:
        """Take the full name of the topic of the states, by which statuses are told apart."""
        self.joint_states = joint_states
        self.take(PendulumParameters(), LimitParameters())
        self.described = ''   # the newest robot description
        self.configurations: dict[str, Configuration] = {}   # of plant and mpc, by role
        self.announced: Configuration | None = None          # the newest, of any node
        self.statuses: dict[str, tuple[int, str]] = {}       # level and message by name
        self.x: Array | None = None
        self.stamp = 0            # [ns]
        self.origin = 0           # [ns] stamp at which the run began
        self.u = math.nan         # [N] applied over the period up to the newest state
        self.force = math.nan     # [N] the last command
        self.is_new_run = False       # a run, with the next state
        self.commanded = 0        # [ns] stamp of the newest state then
        self.push = self.coming_push = 0.0   # [N] that acts now, and in the next period
        # the last two, of which those are shown that belong to one tick
        self.plans, self.tries = deque[Shown](maxlen=2), deque[Shown](maxlen=2)
        self.ticks = deque[Report](maxlen=2)
        self.paused = False
        self._hear: dict[str, Callable[[Any], None]] = {
            JOINT_STATES.name: self._on_state,
            **{command.name: self._on_force for command in COMMAND_TOPICS},
            DISTURBANCE.name: self._on_disturbance, PLAN.name: self._on_plan,
            TRIES.name: self._on_tries, DIAGNOSTICS.name: self._on_diagnostics,
            ROBOT_DESCRIPTION.name: self._on_description,
            CONFIGURATION.name: self._on_configuration}

    def hear(self, topic: Topic, message: Any) -> None:
        """
        Take a message of one of the topics HEARD.

        Raises ValueError where it is none of this pendulum, and leaves all as it is.
        """
        try:
            self._hear[topic.name](message)
        except Exception as error:
            # what others send is wrong in as many ways as it has fields
            raise ValueError(f'a message on {topic.name} is none of this pendulum: '
                             f'{one_line(error)}') from None

    def take(self, physical: PendulumParameters, limits: LimitParameters) -> None:
        """Take the pendulum that is shown, and how large it looks."""
        self.physical, self.limits, self.scale = physical, limits, drawn_scale(physical)

    def _on_state(self, message: Any) -> None:
        sensors = self.sensors(links_in(message))
        x = to_state(message, len(sensors.joint_names) - 1, sensors)
        u = to_force(message, sensors.joint_names[0])
        if self.x is None or len(self.x) != len(x):
            self.plans.clear()   # of another pendulum
        if links_of(x) != self.physical.links:   # of which nobody has said anything else
            self.take(PendulumParameters(links=links_of(x)), self.limits)
        stamp = nanoseconds(message.header.stamp)
        if self.x is None or stamp < self.stamp or self.is_new_run:
            self.origin, self.is_new_run = stamp, False   # until the plant says more exactly
        self.stamp, self.x, self.u = stamp, x, u
        self.push, self.coming_push = self.coming_push, 0.0

    def _on_force(self, message: Any) -> None:
        self.force, self.commanded = message.data, self.stamp

    def _on_disturbance(self, message: Any) -> None:
        self.coming_push += message.data

    def _on_plan(self, message: Any) -> None:
        found = plan(message)
        if self.x is None or len(self.x) != len(found['X'][0]):
            raise ValueError('a plan of another state')
        self.plans.append(Shown(nanoseconds(message.header.stamp), found))

    def _on_tries(self, message: Any) -> None:
        self.tries.append(Shown(nanoseconds(message.header.stamp), tries(
            message, decimals(PATH_DIGITS, self.scale.length))))

    def _on_description(self, message: Any) -> None:
        self._settle(message.data)
        self.described = message.data

    def _settle(self, described: str) -> None:
        """Take the pendulum that is described, or where none is, as it is told to the mpc."""
        told = {} if PLANT in self.configurations else self.parameters(CONTROLLER)
        physical = group(PendulumParameters, told)
        if described:   # of a rig it may not name the drive
            self.take(*from_urdf(described, physical.drive))
        elif told:
            self.take(physical, group(LimitParameters, told))

    def _on_configuration(self, message: Any) -> None:
        found = self.announced = from_text(message.data)
        role = role_of(found)
        if role in (CONTROLLER, PLANT):
            before = self.configurations.get(role)
            # anew, or after a reset; all else is a change of parameters
            self.is_new_run |= role == PLANT and (
                before is None or found.resets != before.resets or found.revision == 0)
            if before is not None and before.node != found.node:   # which is gone
                self._forget(before.node.lstrip('/'))
            self.configurations[role] = found
            self._settle(self.described)

    def _forget(self, name: str) -> None:
        for each in [each for each in self.statuses if each.partition(':')[0] == name]:
            del self.statuses[each]

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            level = status.level[0] if isinstance(status.level, bytes) else status.level
            keep(self.statuses, status.name, (level, status.message))
        tick = from_diagnostics(message, self.node(CONTROLLER), self.joint_states)
        if tick is not None:
            self.ticks.append(tick)
        plant = from_diagnostics(message, self.node(PLANT), self.joint_states)
        if plant is not None:
            self.paused = bool(plant.values.get('paused', False))
            time = plant.values.get('time')   # since the start, or the last reset
            if is_figure(time) and math.isfinite(time):
                self.origin = plant.stamp - round(time * 1e9)

    def node(self, role: str) -> str:
        """Return the name of the node of a role in the statuses."""
        found = self.configurations.get(role)
        return found.node.lstrip('/') if found else role

    def sensors(self, links: int) -> SensorParameters:
        """Return how the sensors of a pendulum are read, of so many links if nobody says."""
        for node in (CONTROLLER, PLANT):
            links = self.value(node, 'links', links)
        told = self.parameters(CONTROLLER)
        with suppress(ParameterError):
            if told.get('links', links) == links:   # else those of a pendulum before
                return group(SensorParameters, {**default_sensors(links), **told})
        return group(SensorParameters, default_sensors(links))

    def parameters(self, node: str) -> dict[str, Any]:
        """Return what a node has said that it runs with."""
        return self.configurations[node].parameters if node in self.configurations else {}

    def value(self, node: str, name: str, otherwise: Any) -> Any:
        """Return a parameter of a node, if it has said so."""
        return self.parameters(node).get(name, otherwise)

    @property
    def t(self) -> float:
        """Return the time of the newest state [s]."""
        return self.stamp / 1e9

    def time_of(self, topic: Topic, message: Any) -> float:
        """Return the time of the state that a message was heard about [s], mostly the newest."""
        if topic not in (PLAN, TRIES, DIAGNOSTICS):
            return self.t
        stamp = nanoseconds(message.header.stamp)   # an answer may be heard before what it answers
        answers = topic is not DIAGNOSTICS or self.ticks and stamp == self.ticks[-1].stamp
        return stamp / 1e9 if answers and 0 < stamp - self.stamp < LASTS else self.t

    @property
    def time(self) -> float:
        """Return the time of the run [s]: since its first state, or the last reset."""
        return (self.stamp - self.origin) / 1e9

    @property
    def period(self) -> float:
        """Return the time between two states [s]."""
        return 1 / self.value(PLANT, 'rate', 20.0)

    def about(self) -> dict[str, Any]:
        """Return the pendulum, for `hello`."""
        margin = exact(self.value(CONTROLLER, 'track_margin', None))
        scale, drive = self.scale, self.physical.drive
        return {
            'units': {'force': acting_unit(drive), 'command': DRIVES[drive]},
            'links': self.physical.links, 'lengths': list(self.physical.lengths),
            'centres': drawn_centres(self.physical),
            'cart': [scale.sized(side, 'm') for side in CART],
            'scale': {'length': scale.length, 'time': scale.time, 'force': scale.factor('N')},
            'limits': {'track': number(self.limits.track_limit),
                       'margin': margin if is_figure(margin) else None,
                       'force': number(self.limits.applied_limit(drive)),
                       'disturbance': self.value(PLANT, 'disturbance_limit', None)},
            'estimated': [*named(PendulumParameters), *named(DriveParameters)],
            'period': self.period, 'lockstep': bool(self.value(PLANT, 'lockstep', False))}

    def frame(self) -> dict[str, Any] | None:
        """Return what changes from state to state; None before the first."""
        if self.x is None:
            return None
        tick = self.tick
        values = tick.values if tick else {}
        obeyed = values.get('status') not in UNPLANNED
        plan_, tries_ = (self._of(tick, found) if obeyed else None
                         for found in (self.plans, self.tries))
        estimate = [values.get(key) for key in keys_of_state('estimate', links_of(self.x))]
        force = values.get('force', self.force if self._counts(self.commanded) else math.nan)
        return {
            'kind': 'frame', 't': self.t, 'time': round(self.time, 6), 'x': numbers(self.x),
            'u': number(self.u), 'force': number(force) if is_figure(force) else None,
            'push': number(self.push),
            'estimate': numbers(np.array(estimate)) if all(map(is_figure, estimate)) else None,
            'plan': plan_ and {**plan_}, 'tries': tries_,
            'tick': {name: number(value) for name, value in values.items()} or None,
            'paused': self.paused}

    @property
    def tick(self) -> Report | None:
        """Return the newest tick whose plan was heard, too, or the newest of those that count."""
        ticks = [tick for tick in [*self.ticks] if self._counts(tick.stamp)]
        planned = {plan.stamp for plan in [*self.plans]}
        return next((tick for tick in ticks[::-1] if tick.stamp in planned),
                    ticks[-1] if ticks else None)

    @property
    def is_answered(self) -> bool:
        """Return whether the newest state has its tick."""
        return bool(self.ticks) and self.ticks[-1].stamp == self.stamp

    def _of(self, tick: Report | None, found: deque[Shown]) -> dict[str, Any] | None:
        """Return what was shown at a tick, or the newest where there are no ticks."""
        return next((each.content for each in [*found][::-1] if self._counts(each.stamp)
                     and (tick is None or each.stamp == tick.stamp)), None)

    def _counts(self, stamp: int) -> bool:
        """Return whether what answers a state [ns] is not too far from the newest."""
        return abs(stamp - self.stamp) <= LASTS

    def status(self, silent: Collection[str] = ()) -> dict[str, Any]:
        """Return all statuses; those are stale of roles that are silent, and without a plant."""
        stale = {self.node(role) for role in ((PLANT, CONTROLLER) if PLANT in silent else silent)}
        return {'kind': 'status', 'statuses': [
            {'name': name, 'level': STALE, 'message': f'silent; it was: {message}'}
            if name.partition(':')[0] in stale else
            {'name': name, 'level': level, 'message': message}
            for name, (level, message) in sorted(self.statuses.items())]}


def keep(found: dict[str, Kept], name: str, value: Kept) -> None:
    """Keep a value by its name, and the newest MOST."""
    found.pop(name, None)
    found[name] = value
    if len(found) > MOST:
        del found[next(iter(found))]


def is_figure(value: Any) -> TypeGuard[float]:
    """Return whether what somebody says is a number."""
    return isinstance(value, (int, float))


def number(value: Any) -> Any:
    """Return a number for JSON, which knows neither NaN nor infinity; a text as it is."""
    if isinstance(value, (int, str)):
        return value
    return float(f'{value:.6g}') if math.isfinite(value) else None


def exact(value: Any) -> Any:
    """Return the value of a parameter for JSON, not rounded; what is infinite is None."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, (bool, int, str)) or value is None:
        return value
    return [exact(each) for each in value]


def numbers(values: Array, digits: int = DIGITS) -> Any:
    """Return an array for JSON, with so many digits after the point."""
    rounded = np.round(values, digits) + 0.0   # and -0.0 is 0.0
    if np.isfinite(rounded).all():
        return rounded.tolist()
    return [numbers(each, digits) if each.ndim else None if not math.isfinite(each) else
            float(each) for each in rounded]


def plan(message: Any) -> dict[str, Any]:
    """Return a plan, thinned to POINTS; raises ValueError, and what else foreign ones lead to."""
    if not 2 <= len(message.points) <= STEPS:
        raise ValueError(f'a plan of {len(message.points)} points; expected 2 to {STEPS}')
    found = from_trajectory(message)
    step = math.ceil(len(found.t) / POINTS)
    return {'t': seconds(message.header.stamp), 'dt': float(found.t[1]) * step,
            'X': numbers(found.X[::step]), 'U': numbers(found.U[::step])}


def tries(message: Any, digits: int = PATH_DIGITS) -> dict[str, Any] | None:
    """Return the paths of the tip [m] with their weights, thinned to POINTS a path, or None."""
    if not message.width * message.height:
        return None
    if message.height > PATHS:
        raise ValueError(f'{message.height} paths; expected {PATHS} at most')
    kind = '>f4' if message.is_bigendian else '<f4'
    cloud = np.frombuffer(bytes(message.data), kind).reshape(message.height, message.width, -1)
    step = math.ceil(message.width / POINTS)
    return {'paths': numbers(cloud[:, ::step, [0, 2]].astype(float), digits),
            'weights': numbers(cloud[:, 0, 3].astype(float))}
