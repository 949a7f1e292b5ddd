# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The plant: the pendulum with its actuator, its track and its sensors.

It is finer and less kind than the model of the controllers: it integrates in steps of 5 ms under
a held force, saturates, has end stops, and where asked the disturbances of docs/model.md. The node
runs the same class.
"""

from collections import deque
import dataclasses
import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.parameters import parameter, ParameterError
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import ROUNDING, steps_in
from dp_swing_ros.pendulum.parameters import (
    at_equilibrium, DriveParameters, EQUILIBRIA, GIVEN, LimitParameters, PendulumParameters,
    RhythmParameters, VELOCITY)
from dp_swing_ros.pendulum.state import Array, from_joints, hanging, SIZES, to_joints
from dp_swing_ros.simulation.engines import ENGINES, Motor
from dp_swing_ros.streams import Stream, stream


STOPPABLE = 'start the plant with lockstep:=true, or all by `make play LOCKSTEP=1`'
VELOCITIES = ('exact', 'differenced', 'none')
PULLEY = 0.2   # [m] of the cart's way in a turn of its encoder


@dataclasses.dataclass(frozen=True)
class PlantParameters(RhythmParameters):
    """The plant beside the pendulum and its limits: schedule, start, integrator, disturbances."""

    start: str = parameter(
        GIVEN, 'equilibrium to start in, link 1 first, whose angles stand for those of the '
        'initial state (given: the initial state as it is)', choices=lambda: EQUILIBRIA)
    initial_state: tuple[float, ...] = parameter(
        tuple(hanging().tolist()), 'state at the start and after a reset [x, θ1 …, ẋ, θ̇1 …]',
        unit='m, rad, m/s, rad/s', size=SIZES)
    physics_step: float = parameter(0.005, 'longest step of the integrator', unit='s',
                                    minimum=1e-5, maximum=1.0, scaled=True)
    integrator: str = parameter(
        'rk4', 'integrator of the plant', choices=lambda: list(INTEGRATORS))
    engine: str = parameter(
        'own', 'what moves the pendulum: our own equations, or MuJoCo, which shares nothing with '
        'the models of the controllers', choices=lambda: list(ENGINES))
    encoder_counts: int = parameter(
        0, 'counts a turn of the encoders at the joints, and on a pulley of the cart that makes '
        'a turn in 0.2 m (0: exact)', minimum=0)
    joint_backlash: float = parameter(
        0.0, 'play between each joint and its encoder, whose shaft stays behind until the joint '
        'has crossed it', unit='rad', minimum=0.0)
    velocities: str = parameter(
        'exact', 'measured velocities: exact, but for their noise; differenced: what measured '
        'positions differ by from state to state; none', choices=lambda: list(VELOCITIES))
    pace: float = parameter(
        0.0, 'simulated seconds in a second, at most (0: as fast as the controller; in lockstep '
        'only)', minimum=0.0, maximum=100.0)
    duration: float = parameter(0.0, 'the plant ends itself after this time (0: never)', unit='s',
                                minimum=0.0)
    command_timeout: float = parameter(
        0.2, 'without a command for this long the force is zero (real time only)', unit='s',
        minimum=1e-3)
    position_noise: float = parameter(
        0.0, 'standard deviation of the measured positions', unit='m, rad', minimum=0.0)
    velocity_noise: float = parameter(
        0.0, 'standard deviation of the measured velocities', unit='m/s, rad/s', minimum=0.0)
    force_noise: float = parameter(
        0.0, 'standard deviation of what is added to a command, drawn once a period', unit='N',
        minimum=0.0)
    actuator_response: float = parameter(
        1.0, 'share k of the way to the commanded force that the actuator goes in a physics step; '
        'above 1 it overshoots', minimum=1e-3, maximum=2.0)
    command_jitter: float = parameter(
        0.0, 'a command acts late by a time drawn from 0 to this', unit='s', minimum=0.0,
        maximum=1.0)
    command_loss: float = parameter(
        0.0, 'probability that a command is lost', minimum=0.0, maximum=1.0)
    state_loss: float = parameter(
        0.0, 'probability that a state is lost', minimum=0.0, maximum=1.0)
    seed: int = parameter(0, 'seed of all noises, losses and latenesses', minimum=0)

    def __post_init__(self) -> None:
        """Check also what concerns several at once; raises ParameterError."""
        super().__post_init__()
        if self.pace and not self.lockstep:
            raise ParameterError(
                f"parameter 'pace' is {self.pace:g}; expected 0 in real time, which has its own: "
                f'{STOPPABLE}')


class Measurement(NamedTuple):
    """A state as it was measured: when [s], and what (2n + 2,)."""

    t: float
    x: Array


class Command(NamedTuple):
    """A force [N], the time at which it begins to act, and for how long it does [s]."""

    acts_at: float
    force: float
    lasts: float


class Commands:
    """
    The force that the actuator obeys, and the commands on their way to it.

    A command is never obeyed after a newer one: what would begin later than a newer one is stale.
    """

    def __init__(self, parameters: PlantParameters, delay: float = 0.0) -> None:
        """Take how commands fare, the seed of their fates, and how late they act [s]."""
        self.parameters, self.delay = parameters, delay
        self.loss = stream(parameters.seed, Stream.COMMAND_LOSS)
        self.lateness = stream(parameters.seed, Stream.COMMAND_JITTER)
        self.force = 0.0            # [N] held until the next
        self.expires = math.inf     # [s] when it no longer is
        self.expired = False        # whether the force is zero for want of a command
        self.coming: deque[Command] = deque()   # in the order in which they will act

    def send(self, now: float, force: float, lasts: float = math.inf) -> bool:
        """Send a force [N] that acts for a time [s] at most, and return whether it will arrive."""
        # drawn whether needed or not, so that one fault does not change the numbers of another
        acts_at = now + self.delay + self.lateness.uniform(0.0, self.parameters.command_jitter)
        if self.loss.random() < self.parameters.command_loss:
            return False
        while self.coming and self.coming[-1].acts_at >= acts_at:
            self.coming.pop()
        self.coming.append(Command(acts_at, force, lasts))
        return True

    def next_change(self) -> float:
        """Return when the force changes next [s], infinity if it does not."""
        return min(self.coming[0].acts_at if self.coming else math.inf, self.expires)

    def change(self) -> None:
        """Let the change happen: the next command acts, or the present one expires."""
        if self.coming and self.coming[0].acts_at <= self.expires:
            acts_at, self.force, lasts = self.coming.popleft()
            self.expires, self.expired = acts_at + lasts, False
        else:
            self.force, self.expires, self.expired = 0.0, math.inf, True


class Plant:
    """The pendulum itself: obeys a force, can be pushed, and is measured."""

    def __init__(self, physical: PendulumParameters, limits: LimitParameters,
                 parameters: PlantParameters, drive: DriveParameters = DriveParameters()) -> None:
        """
        Take the physical parameters, what actuator and track allow, the disturbances, the drive.

        Raises ParameterError where the initial state is that of another number of links.
        """
        self.drive = drive
        self.physical, self.limits, self.parameters = physical, limits, parameters
        if len(parameters.initial_state) != SIZES[physical.links]:
            raise ParameterError(
                f'parameter initial_state has {len(parameters.initial_state)} numbers; expected '
                f'{SIZES[physical.links]} for links {physical.links}')
        if parameters.actuator_response != 1 and drive.motor_time_constant > 0:
            raise ParameterError(
                f'parameters actuator_response {parameters.actuator_response:g} and '
                f'motor_time_constant {drive.motor_time_constant:g} both make the force lag; '
                'expected one of them')
        self.initial = at_equilibrium('start', parameters.start, parameters.initial_state)
        self.engine = ENGINES[parameters.engine](physical, limits, parameters.integrator)
        self.reset()

    def reset(self) -> None:
        """Go back to the initial state, at rest from all commands, noise from its beginning."""
        seed = self.parameters.seed
        self.sensor_noise = stream(seed, Stream.SENSOR_NOISE)
        self.force_noise = stream(seed, Stream.FORCE_NOISE)
        self.state_loss = stream(seed, Stream.STATE_LOSS)
        self.commands = Commands(self.parameters, self.drive.actuation_delay)
        self.seen: Measurement | None = None                # the last measurement
        self.seen_until = -math.inf                         # [s] it is measured no more till then
        self.shafts: Array | None = None                    # of the encoders, in their play
        self.t = 0.0                                        # [s]
        self.x = self.initial.copy()
        self.force = 0.0                                    # [N] of the actuator in the last step
        self.past: deque[Measurement] = deque([Measurement(0.0, self.x.copy())])
        self.begin_period(0.0)

    def reconfigure(self, other: 'Plant') -> None:
        """
        Go on with the parameters of another plant, which is not used any more.

        State, time and the commands on their way stay; so do the noises, unless the seed is
        another.
        """
        if other.parameters.seed != self.parameters.seed:
            self.sensor_noise, self.force_noise = other.sensor_noise, other.force_noise
            self.state_loss = other.state_loss
            self.commands.loss, self.commands.lateness = (
                other.commands.loss, other.commands.lateness)
        if other.parameters.delay > self.parameters.delay and self.seen is not None:
            self.seen_until = self.seen.t   # what was measured is not measured again
        self.physical, self.limits, self.drive = other.physical, other.limits, other.drive
        self.parameters, self.initial = other.parameters, other.initial
        self.commands.parameters = other.parameters
        self.commands.delay = other.drive.actuation_delay
        self.engine = other.engine

    def place(self, x: Array) -> None:
        """Put the pendulum in another state (2n + 2,), while time and forces go on."""
        self.x = np.array(x, dtype=float)
        self.past[-1] = Measurement(self.t, self.x.copy())
        self.shafts = None

    def begin_period(self, push: float) -> None:
        """Draw the noise of a new period, and push the cart through it [N]."""
        self.noise = self.force_noise.normal(0.0, self.parameters.force_noise)
        self.push = push
        self.period_began = self.t
        self.acted = 0.0         # [s] of integration since then
        self.mean_force = 0.0    # [N] of the actuator since the period began

    def obey(self, force: float, lasts: float = math.inf) -> bool:
        """Take a command [N] for a time [s] at most, and return whether it was received."""
        return self.commands.send(self.t, force, lasts)

    def advance(self, duration: float) -> None:
        """Integrate for a time [s] under the commands as they come."""
        while (wait := self.next_event() - self.t) < duration - ROUNDING:
            self.hold(max(wait, 0.0))
            duration -= max(wait, 0.0)
            while self.commands.next_change() <= self.t + ROUNDING:
                self.commands.change()
        self.hold(duration)

    def next_event(self) -> float:
        """Return when the commands change next, or a state is met that will be measured [s]."""
        delay, rate = self.parameters.delay, self.parameters.rate
        change = self.commands.next_change()
        if delay == 0.0:
            return change
        # the state a delay before the end of a period is measured then, as old as was asked
        ends = math.floor((self.t + delay + ROUNDING) * rate) + 1
        return min(change, ends / rate - delay)

    def hold(self, duration: float) -> None:
        """Integrate for a time [s] under one command."""
        physics_step = self.parameters.physics_step
        steps = steps_in(duration, min(physics_step, self.engine.longest_step))
        if steps < 1:
            return
        limit = self.limits.input_limit(self.physical.drive)
        follows = self.physical.drive == VELOCITY
        largest = self.limits.cart_speed_limit if follows else limit
        response = self.parameters.actuator_response
        # two halves of a physics step make what the whole one would; an actuator that overshoots
        # does so in a step of any length
        if response < 1:
            response = 1 - (1 - response) ** (duration / steps / physics_step)
        target = min(max(self.commands.force + self.noise, -largest), largest)
        # without a command a driven cart is brought to rest, and does not go on at its speed
        motor = Motor(response, self.drive.motor_time_constant, limit, self.drive.force_gain,
                      follows or self.physical.is_driven and self.commands.expired)
        self.force, mean = self.engine.advance(
            self.x, motor, self.force, target, self.push + self.drive.force_bias,
            duration / steps, steps)
        self.t += duration
        self.acted += duration
        # in steps, so that the mean of one and the same force is that force to the bit
        self.mean_force += (mean - self.mean_force) * (duration / self.acted)
        self.past.append(Measurement(self.t, self.x.copy()))
        while len(self.past) > 1 and self.past[1].t <= self.t - self.parameters.delay + ROUNDING:
            self.past.popleft()

    def is_seen(self) -> bool:
        """Return whether a delay has passed, so that the first measurement can have arrived."""
        return self.seen_until + ROUNDING < self.past[0].t <= (
            self.t - self.parameters.delay + ROUNDING)

    def measure(self) -> Measurement | None:
        """Return the noisy state of a delay ago; None where it is lost, or cannot be here yet."""
        t, x = self.past[0]
        x = self.behind(x) if self.parameters.joint_backlash > 0 else x
        noise = np.repeat((self.parameters.position_noise, self.parameters.velocity_noise),
                          len(x) // 2)
        measured = self.sensed(t, x + self.sensor_noise.normal(0.0, noise))
        lost = self.state_loss.random() < self.parameters.state_loss
        return measured if self.is_seen() and not lost else None

    def behind(self, x: Array) -> Array:
        """
        Return a state with the angles of the encoders' shafts, which the joints push along.

        At first each is in the middle of its play. A turn and back between two states is not seen.
        """
        q, v = np.split(x, 2)
        joints, half = to_joints(q), self.parameters.joint_backlash / 2
        before = joints if self.shafts is None else self.shafts
        self.shafts = np.concatenate(   # that of the cart has no play
            (joints[:1], np.clip(before[1:], joints[1:] - half, joints[1:] + half)))
        return np.concatenate((from_joints(self.shafts), v))

    def sensed(self, t: float, x: Array) -> Measurement:
        """Return a state as encoders give it, with the velocities that there are."""
        counts, before = self.parameters.encoder_counts, self.seen
        q, v = np.split(x, 2)
        if counts > 0:
            unit = np.array([PULLEY, *[2 * math.pi] * (len(q) - 1)]) / counts
            q = from_joints(np.round(to_joints(q) / unit) * unit)
        if self.parameters.velocities == 'none':
            v = np.full_like(v, math.nan)
        elif self.parameters.velocities == 'differenced':
            v = np.zeros_like(v)
            if before is not None and t > before.t:
                v = (q - before.x[:len(q)]) / (t - before.t)
        self.seen = Measurement(t, np.concatenate((q, v)))
        return self.seen
