# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The plant, and the closed loop around it without ROS.

The plant is finer and less kind than the model of the controllers: it integrates in steps of 5 ms
under a held force, saturates, has end stops, and where asked noise and delay. The node runs the
same class.
"""

from collections import deque
import math
from typing import Callable, NamedTuple

import numpy as np

from dp_swing_ros.dynamics import MODELS, Pendulum
from dp_swing_ros.dynamics.pendulum import stop
from dp_swing_ros.dynamics.trajectory import step
from dp_swing_ros.episode import Episode, Ticks
from dp_swing_ros.kernels import kernel
from dp_swing_ros.mpc import RecedingHorizon
from dp_swing_ros.parameters import LimitParameters, PendulumParameters, PlantParameters
from dp_swing_ros.plan import Plan
from dp_swing_ros.state import Array

ROUNDING = 1e-9  # a time [s] or a share of a step that is none


class Measurement(NamedTuple):
    """A state as it was measured: when [s], and what (6,)."""

    t: float
    x: Array


@kernel
def integrate(model, track_limit, x, u, steps):
    """
    Advance the state in place by some steps under a held force, between the end stops.

    Shapes: x (6,).
    """
    for _ in range(steps):
        step(model, x, u, x)
        stop(model.pendulum, track_limit, x)


class Plant:
    """The pendulum itself: obeys a force, can be pushed, and is measured."""

    def __init__(self, bodies: PendulumParameters, limits: LimitParameters,
                 parameters: PlantParameters) -> None:
        """Take the bodies, what actuator and track allow, and the disturbances."""
        self.bodies, self.limits, self.parameters = bodies, limits, parameters
        self.pendulum = Pendulum.of(bodies)
        self.reset()

    def reset(self) -> None:
        """Go back to the initial state, at rest from all commands, noise from its beginning."""
        self.t = 0.0                                        # [s]
        self.x = np.array(self.parameters.initial_state)
        self.command = 0.0                                  # [N] held until the next
        self.random = np.random.default_rng(self.parameters.seed)
        self.past: deque[Measurement] = deque([Measurement(0.0, self.x.copy())])
        self.begin_period(0.0)

    def begin_period(self, push: float) -> None:
        """Draw the noise of a new period, and push the cart through it [N]."""
        self.noise = self.random.normal(0.0, self.parameters.force_noise)
        self.push = push
        self.period_began = self.t
        self.acted = 0.0         # [s] of integration since then
        self.mean_force = 0.0    # [N] of the actuator since the period began

    @property
    def force(self) -> float:
        """Return the force [N] that the actuator applies now."""
        limit = self.limits.force_limit
        return min(max(self.command + self.noise, -limit), limit)

    def advance(self, duration: float) -> None:
        """Integrate for a time [s] under the force as it is."""
        steps = math.ceil(duration / self.parameters.physics_step - ROUNDING)
        if steps < 1:
            return
        model = MODELS[self.parameters.integrator].of(self.pendulum, duration / steps)
        integrate(model, self.limits.track_limit, self.x, self.force + self.push, steps)
        self.t += duration
        self.acted += duration
        # in steps, so that the mean of one and the same force is that force to the bit
        self.mean_force += (self.force - self.mean_force) * (duration / self.acted)
        self.past.append(Measurement(self.t, self.x.copy()))
        while len(self.past) > 1 and self.past[1].t <= self.t - self.parameters.delay + ROUNDING:
            self.past.popleft()

    def measure(self) -> Measurement:
        """Return the state as it was a delay ago, with the noise of the sensors."""
        t, x = self.past[0]
        noise = np.repeat((self.parameters.position_noise, self.parameters.velocity_noise), 3)
        return Measurement(t, x + self.random.normal(0.0, noise))


def simulate(plant: Plant, controller: RecedingHorizon, duration: float,
             solver: str = '', on_tick: Callable[[float, Plan], None] | None = None) -> Episode:
    """
    Run the closed loop for a time [s] in lockstep, and return the true states and forces.

    on_tick is called with the time and the plan of every tick.
    """
    period = 1 / plant.parameters.rate
    t, X, U, plans = [plant.t], [plant.x.copy()], [], []
    for n in range(round(duration / period)):
        measured = plant.measure()
        plan = controller.update(measured.t, measured.x, plant.t - measured.t)
        plant.command = plan.control(0.0, plan.X[0])
        plant.begin_period(0.0)
        plant.advance((n + 1) * period - plant.t)
        t.append(plant.t)
        X.append(plant.x.copy())
        U.append(plant.mean_force)
        plans.append(plan)
        if on_tick is not None:
            on_tick(plant.t, plan)
    return Episode(np.array(t), np.array(X), np.array(U), ticks_of(t[:-1], plans, period),
                   solver, plant.bodies, plant.limits)


def ticks_of(t: list[float], plans: list[Plan], period: float) -> Ticks:
    """Collect what the plans say of their solves; in lockstep the latency is the solve's time."""
    stats = [plan.stats for plan in plans]
    times = np.array([s.solve_time for s in stats])
    return Ticks(t=np.array(t), cost=np.array([s.cost for s in stats]),
                 iterations=np.array([s.iterations for s in stats]), solve_time=times,
                 latency=times, late=times > period, status=[s.status.name for s in stats])
