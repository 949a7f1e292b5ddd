# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The closed loop of plant and controller without ROS."""

from collections.abc import Mapping
from typing import Callable, Protocol

import numpy as np

from dp_swing_ros.pendulum.state import Array, is_state
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.simulation.episode import Episode, Ticks
from dp_swing_ros.simulation.plant import Plant
from dp_swing_ros.simulation.stepper import Observation, Stepper


class Controller(Protocol):
    """What closes the loop: a plan for each state, and one without."""

    def update(self, t: float, x: Array, delay: float) -> Plan:
        """
        Return the plan that begins with the force to send now.

        t is the time of the measurement x [s], delay its age [s]. Shapes: x (2n + 2,).
        """

    def fallback(self, acts_at: float) -> Plan:
        """Return a plan from a time [s] on where no state came."""


def simulate(plant: Plant, controller: Controller, duration: float, solver: str = '',
             on_tick: Callable[[float, Plan], None] | None = None,
             pushes: Array | None = None,
             resets: Mapping[int, Array] | None = None, goal: Array | None = None) -> Episode:
    """
    Run the closed loop for a time [s] in lockstep, and return the true states and forces.

    The first tick is when the first measurement can have arrived; before, the force is zero.
    on_tick is called with the time and the plan of every tick; pushes are the forces [N] on the
    cart beside the actuator's, one for each period; resets are states (2n + 2,) that somebody puts
    the pendulum in, by the number of the period that begins there; goal is the state (2n + 2,)
    that the controller is to hold, upright where none is given. Raises ValueError where pushes are
    not that many.
    """
    stepper = Stepper(plant)
    count = round(duration / stepper.period)
    if pushes is None:
        pushes = np.zeros(count)
    if np.shape(pushes) != (count,) or not np.all(np.isfinite(pushes)):
        raise ValueError(f'pushes of shape {np.shape(pushes)}: {pushes}; expected {count} finite '
                         f'forces [N], one for each period of {stepper.period:g} s')
    t, X, U, plans = [plant.t], [plant.x.copy()], [], []
    for n in range(count):
        if resets and n in resets:
            plant.place(resets[n])
            X[-1] = plant.x.copy()
        plan = answer(plant, stepper.begin(float(pushes[n])), controller)
        stepper.finish(None if plan is None else plan.command(
            plant.limits.input_limit(plant.physical.drive)))
        t.append(plant.t)
        X.append(plant.x.copy())
        U.append(plant.mean_force)
        if plan is not None:
            plans.append(plan)
            if on_tick is not None:
                on_tick(plant.t, plan)
    first = count - len(plans)
    ticks = ticks_of(t[first:-1], plans, stepper.period)
    return Episode(np.array(t), np.array(X), np.array(U), ticks, solver, plant.physical,
                   plant.limits, goal=goal)


def answer(plant: Plant, measured: Observation | None, controller: Controller) -> Plan | None:
    """Return the plan for a state as it was measured, or for one lost; None before the first."""
    if not plant.is_seen():
        return None
    # the nodes publish the time in whole nanoseconds, and this is to be their run to the bit
    if measured is None or not is_state(measured.x):   # the mpc does not believe it, either
        return controller.fallback(plant.t)
    return controller.update(round(measured.t * 1e9) / 1e9, measured.x, plant.parameters.delay)


def ticks_of(t: list[float], plans: list[Plan], period: float) -> Ticks:
    """Collect the reports of the solves; in lockstep the latency is the solve's time."""
    stats = [plan.stats for plan in plans]
    times = np.array([s.solve_time for s in stats])
    return Ticks(t=np.array(t), cost=np.array([s.cost for s in stats]),
                 iterations=np.array([s.iterations for s in stats]), solve_time=times,
                 latency=times, late=times > period, status=[s.status.name for s in stats])
