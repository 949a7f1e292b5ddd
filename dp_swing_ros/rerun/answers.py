# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a controller was given at a tick, and how another one answers it."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
import math
from typing import Any, NamedTuple

from dp_swing_ros.control import controllers
from dp_swing_ros.control.commands import SentVelocity
from dp_swing_ros.control.planner import Planner, Search
from dp_swing_ros.control.receding_horizon import RecedingHorizon
from dp_swing_ros.control.starts import solved
from dp_swing_ros.pendulum.parameters import VELOCITY
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan


class Tick(NamedTuple):
    """What a controller was given at a tick, and what came of it."""

    number: int        # of the forces that it has sent
    stamp: int         # [ns] of the state, or of the time at which none had come
    t: float           # [s] when it was measured, by the controller's clock
    x: Array | None    # as it was measured; None where none came
    time_noise: float  # [s] by which that may be off
    delay: float       # [s] from the stamp until the force would act
    real_time: bool
    reset: bool        # it was reset before
    enabled: bool      # else the force was zero
    stopping: bool     # the cart was braked
    solves: tuple[int, ...]  # iterations
    status: str
    cost: float
    force: float       # [N] sent
    again: int = 0     # forces before it that repeat that of the tick before
    changed: dict[str, Any] | None = None   # all parameters, where they changed before it


def answer(controller: RecedingHorizon, tick: Tick, counted: bool = True) -> Plan:
    """
    Let a controller answer a tick, as the node did.

    If `counted`, in as many iterations where a deadline may have ended them.
    """
    if tick.changed is not None:
        controller.reconfigure(controllers.controller(tick.changed))
    if tick.reset:
        controller.reset()
        if controller.commands.sent is None and controller.nominal.physical.drive == VELOCITY:
            # what was sent before the bag begins is what the drive goes on from
            controller.commands.sent = SentVelocity(tick.t, tick.force, tick.force, 0.0, 0.0)
    if not tick.stopping:
        controller.enable(tick.enabled)
    elif not tick.solves:   # else it is the controller that begins to stop
        controller.stop('as recorded')
    if tick.x is None:
        return controller.fallback(tick.t + tick.delay)
    usual = controller.planner.search
    if counted and tick.real_time and tick.solves:
        controller.planner.search = repeated(tick.solves)
    plan = respond(controller, tick.t, tick.x, tick.delay, tick.time_noise)
    controller.planner.search = usual
    return plan


def repeated(solves: Sequence[int]) -> Search:
    """Return a search that takes so many iterations from each start, none where it is zero."""
    def search(planner: Planner, x_0: Array, starts: Iterable[Plan],
               deadline: float) -> list[Plan]:
        plans = []
        for iterations, start in zip(solves, starts):
            build = partial(planner.build, parameters=replace(
                planner.solver_parameters,
                **({'iterations': iterations} if iterations else {})))
            plans.append(solved(build(planner.problem), planner.problem, x_0, start,
                                math.inf if iterations else -math.inf, build))
        return plans
    return search


def respond(controller: RecedingHorizon, t: float, x: Array, delay: float,
            time_noise: float = 0.0) -> Plan:
    """Return the plan for a state, or where it is not finite, one without it."""
    try:
        return controller.update(t, x, delay, time_noise=time_noise)
    except ValueError:
        return controller.fallback(t + delay)
