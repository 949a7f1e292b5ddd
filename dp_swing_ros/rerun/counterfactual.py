# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What each solver would have done from a recorded tick on.

Until then a solver is a shadow: it answers every recorded state, but the recorded force acts.
Then its forces do, on a plant with the recorded parameters. A cost to go is the running
cost ℓ(x, u) of the recorded problem over the states and forces that followed, in steps of the
prediction; what comes after the window counts for nothing, there is no terminal cost.
"""

from collections.abc import Callable, Iterator, Sequence
import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros import configuration
from dp_swing_ros.bags.episodes import Sample
from dp_swing_ros.control.receding_horizon import RecedingHorizon
from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.rerun.runs import Run, ScoredTrajectory
from dp_swing_ros.rerun.ticks import answer, respond, Tick
from dp_swing_ros.simulation.plant import Plant

ROUNDING = 100  # [ns] stamps are whole nanoseconds


class Counterfactual(NamedTuple):
    """A recorded tick, and what followed: as it was recorded, and as it would have been."""

    at: float             # [s] from the run's first state
    past: ScoredTrajectory
    recorded: ScoredTrajectory
    others: list[ScoredTrajectory]  # by solver

    def trajectories(self) -> dict[str, ScoredTrajectory]:
        """Return all that followed, by their names."""
        return {f'recorded {self.recorded.solver}': self.recorded,
                **{one.solver: one for one in self.others}}

    @property
    def least(self) -> float:
        """Return the least cost to go, whether the pendulum was held or not."""
        return float(np.nanmin([one.cost for one in (self.recorded, *self.others)]))

    def regret(self, trajectory: ScoredTrajectory) -> float:
        """Return how much more a trajectory cost than the cheapest."""
        return trajectory.cost - self.least


def counterfactual(run: Run, tick: Tick, solvers: Sequence[str], duration: float | None,
                   progress: Callable[[], object]) -> Counterfactual:
    """
    Let each solver take over at a tick, for a time [s] or the rest of the run.

    `progress` is called after each.
    """
    end = run.window(tick, duration)
    others = []
    for solver in solvers:
        others.append(run.scored(solver, take_over(run, tick, solver, end)))
        progress()
    return Counterfactual(run.time(tick.stamp), run.between(run.start, tick.stamp),
                          run.between(tick.stamp, end), others)


def take_over(run: Run, tick: Tick, solver: str, end: int) -> list[Sample]:
    """Return the states from a tick on under a solver, up to a stamp [ns]."""
    controller, answered = shadow(run, tick, solver)
    plan: Plan | None = answered
    plant = plant_at(run, tick)
    period = 1 / plant.parameters.rate
    samples = [Sample(tick.stamp, np.asarray(tick.x), math.nan)]
    count = round((end - tick.stamp) / BILLION / period)
    for now in stamps_after(tick, plant.parameters.delay, period, count):
        if plan is not None:
            plant.obey(plan.first_force(run.problem.u_max))
        plant.begin_period(0.0)
        plant.advance(period)
        measured = plant.measure()
        if measured is not None:
            age = plant.t - measured.t
            samples.append(Sample(now - round(age * BILLION), measured.x, plant.mean_force))
            plan = respond(controller, samples[-1].stamp / BILLION, measured.x,
                           age if tick.real_time else tick.delay)
        elif tick.real_time:
            plan = controller.fallback(now / BILLION)
        else:
            plan = None   # nobody answers, and the last force acts on
    return samples


def shadow(run: Run, until: Tick, solver: str) -> tuple[RecedingHorizon, Plan]:
    """
    Return the controller that a solver is after it saw every tick up to one, and its plan.

    That of the recorded solver stops its solves where the recorded ones stopped.
    """
    controller = configuration.controller({**run.mpc, 'solver': solver})
    for tick in run.record.ticks[:until.number]:
        plan = answer(controller, tick, counted=solver == run.solver)
        if tick.number < until.number:
            controller.forces.replace_last(tick.force)
    return controller, plan


def plant_at(run: Run, tick: Tick) -> Plant:
    """Return the plant when a tick's state arrives, its noise from the beginning of its seed."""
    plant = configuration.plant({**run.plant, 'initial_state': np.asarray(tick.x).tolist()})
    if tick.number > 1:
        # until then, and where the actuator lags or a command is lost, the one before acts
        plant.force = plant.commands.force = run.record.ticks[tick.number - 2].force
    delay = plant.parameters.delay
    plant.t = -delay
    plant.past[0] = plant.past[0]._replace(t=-delay)
    plant.advance(delay)
    return plant


def stamps_after(tick: Tick, delay: float, period: float, count: int) -> Iterator[int]:
    """Yield the times of the next periods' ends [ns] as the plant counts them, to the bit."""
    arrival = tick.stamp + round(delay * BILLION)
    epoch, now = arrival, 0.0
    if not tick.real_time:
        epoch = 0
        while round(now * BILLION) < arrival - ROUNDING:
            now += period
    for _ in range(count):
        now += period
        yield epoch + round(now * BILLION)
