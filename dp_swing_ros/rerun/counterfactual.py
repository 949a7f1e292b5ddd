# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What each solver would have done from a recorded tick on.

Until then a solver answers every recorded state, but the recorded force acts.
Then its forces do, on a plant with the recorded parameters that is pushed as that one was. A cost
to go is the running cost ℓ(x, u) of the recorded problem over the states and forces that followed,
in steps of the prediction; what comes after the window counts for nothing, there is no terminal
cost.
"""

from bisect import bisect_left
from collections.abc import Callable, Sequence
from copy import copy
import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.bags.episodes import (
    check_run, completed, differenced, pushes_of, reports_of, Sample, samples_of, states_in)
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.control import controllers
from dp_swing_ros.control.receding_horizon import MpcParameters, RecedingHorizon
from dp_swing_ros.errors import UserError
from dp_swing_ros.evaluation.metrics import settling_time
from dp_swing_ros.messages.configuration import CONTROLLER, from_text, PLANT
from dp_swing_ros.messages.fields import BILLION, nanoseconds
from dp_swing_ros.pendulum.equations import errors_from_rest, Pendulum
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.cost import running
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.rerun.answers import answer, respond, Tick
from dp_swing_ros.rerun.ticks import configuration_of, own, record_of
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.plant import Plant
from dp_swing_ros.simulation.stepper import Stepper
from dp_swing_ros.topics import CONFIGURATION


class ScoredTrajectory(NamedTuple):
    """
    A trajectory as the plant published it, and how good it is.

    Shapes: t (N,) [s] from the run's first state, X (N, 2n + 2), U (N - 1,) [N].
    """

    solver: str
    t: Array
    X: Array
    U: Array
    cost: float
    settled: float   # [s] when the stay upright began that was held to the end; NaN without one


class Run:
    """A recorded run that can be taken over."""

    def __init__(self, bag: Bag) -> None:
        """
        Read the parameters of plant and controller, and what happened.

        Raises BagError where the bag lacks them, and ParameterError where they are unknown here.
        """
        self.bag = bag
        self.mpc = configuration_of(bag, CONTROLLER).parameters
        plant = configuration_of(bag, PLANT)
        self.plant = plant.parameters
        self.record = record_of(bag, anywhere=True)
        # speeds that no sensor measures are those that were estimated
        self.samples = differenced(completed(samples_of(bag), reports_of(bag)))
        self.states = {sample.stamp: sample.x for sample in self.samples}
        check_run(bag, self.samples)
        # when which state was sent [ns], and the plant's parameters that counted from then on
        self.sent = {nanoseconds(message.header.stamp): entry.time
                     for entry, message in states_in(bag)}
        self.pushes = pushes_of(bag)
        self.plants = [(entry.time, own(found)) for entry in bag.entries_of(CONFIGURATION)
                       if (found := from_text(bag.decoded(entry).data)).node == plant.node]
        self.stamps = [sample.stamp for sample in self.samples]
        self.start, self.end = self.stamps[0], self.stamps[-1]
        self.problem = controllers.problem(self.mpc)
        self.solver = str(self.mpc.get('solver', MpcParameters.solver))
        simulated = plants.plant(self.plant)
        self.limits = simulated.limits
        self.period = BILLION / simulated.parameters.rate   # [ns]

    def as_of(self, tick: Tick) -> 'Run':
        """Return the run with the parameters that controller and plant had at a tick."""
        run = copy(self)
        changed = [each.changed for each in self.record.up_to(tick) if each.changed is not None]
        values = changed[-1] if changed else self.mpc
        run.problem = controllers.problem(values)
        run.solver = str(values.get('solver', MpcParameters.solver))
        sent = self.sent.get(tick.stamp, 0)
        run.plant = [self.plant, *(values for since, values in self.plants if since <= sent)][-1]
        return run

    def lately(self, begin: int) -> 'Run':
        """Return the run without the ticks before a stamp [ns], which no solver sees then."""
        run = copy(self)
        before = [tick for tick in self.record.ticks if tick.stamp < begin]
        changed = [tick.changed for tick in before if tick.changed is not None]
        run.record = self.record._replace(ticks=self.record.ticks[len(before):])
        run.mpc = changed[-1] if changed else self.mpc
        return run

    def time(self, stamp: int) -> float:
        """Return the time of a stamp from the run's first state [s]."""
        return (stamp - self.start) / BILLION

    def tick_at(self, at: float, duration: float | None) -> Tick:
        """
        Return the first tick at a time [s] or later that can be followed for a duration [s].

        Raises UserError where there is none.
        """
        return self._followed(duration, f'at {at:g} s or later', round(at * BILLION))[0]

    def ticks_every(self, every: float, duration: float | None) -> list[Tick]:
        """Return a tick in every so many seconds; else as `tick_at`."""
        step = max(round(every * BILLION), 1)
        found: dict[int, Tick] = {}
        for tick in self._followed(duration, 'at all'):
            found.setdefault((tick.stamp - self.start) // step, tick)
        return list(found.values())

    def _followed(self, duration: float | None, when: str, since: int = 0) -> list[Tick]:
        """Return the ticks that answer a state, and after which the run takes that long [s]."""
        ticks = [tick for tick in self.record.ticks
                 if tick.x is not None and tick.enabled
                 and np.all(np.isfinite(self.states[tick.stamp]))
                 and tick.stamp - self.start >= since
                 and tick.stamp < self.window(tick, duration)
                 and tick.stamp + (duration or 0.0) * BILLION <= self.end + self.period / 2]
        if not ticks:
            gap = f'; {self.record.gap}' if self.record.gap else ''
            after = 'a state' if duration is None else f'{duration:g} s'
            raise UserError(f'there is no tick {when} with {after} after it: the run in '
                            f'{self.bag} takes {self.time(self.end):g} s{gap}')
        return ticks

    def window(self, tick: Tick, duration: float | None) -> int:
        """
        Return the stamp [ns] of the state closest to a time [s] after a tick.

        In real time states come a little early or late. Without a time it is the run's last.
        """
        if duration is None:
            return self.end
        end = tick.stamp + round(duration * BILLION)
        next_one = bisect_left(self.stamps, end)
        return min(self.stamps[max(next_one - 1, 0):next_one + 1],
                   key=lambda stamp: abs(stamp - end))

    def latency(self, age: float) -> float:
        """Return for how long [s] usual forces acted later than states of an age [s] came."""
        usual = float(np.median([tick.delay for tick in self.record.ticks]))
        return min(max(usual - age, 0.0), self.period / BILLION)

    def push(self, begin: int) -> float:
        """Return the recorded push [N] through the period that began about at a time [ns]."""
        return math.fsum(push for since, push in self.pushes.items()
                         if abs(since - begin) < self.period / 2)

    def scored(self, solver: str, samples: Sequence[Sample]) -> ScoredTrajectory:
        """Return the trajectory of states with its cost and its settling time."""
        stamps = np.array([sample.stamp for sample in samples])
        t = (stamps - self.start) / BILLION
        X = np.array([sample.x for sample in samples])
        U = np.array([sample.force for sample in samples[1:]])
        steps = np.diff(stamps) / BILLION / self.problem.dt
        cost = math.fsum(share * running(self.problem.cost, x, u)
                         for share, x, u in zip(steps, X, U))
        off = errors_from_rest(Pendulum.of(self.problem.physical), X,
                               self.problem.parameters.cost.x_r)
        return ScoredTrajectory(solver, t, X, U, cost,
                                settling_time(t, off, self.problem.scale))

    def between(self, begin: int, end: int) -> ScoredTrajectory:
        """Return what was recorded between two stamps [ns], both included."""
        return self.scored(self.solver, [sample for sample in self.samples
                                         if begin <= sample.stamp <= end])


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
    run, end = run.as_of(tick), run.window(tick, duration)
    others = []
    for solver in solvers:
        others.append(run.scored(solver, take_over(run, tick, solver, end)))
        progress()
    return Counterfactual(run.time(tick.stamp), run.between(run.start, tick.stamp),
                          run.between(tick.stamp, end), others)


def take_over(run: Run, tick: Tick, solver: str, end: int) -> list[Sample]:
    """Return the states from a tick on under a solver, up to a stamp [ns]."""
    controller, answered = controller_at(run, tick, solver)
    plan: Plan | None = answered
    plant = plant_at(run, tick)
    stepper = Stepper(plant)
    period = stepper.period
    samples = [Sample(tick.stamp, run.states[tick.stamp], math.nan)]
    count = round((end - tick.stamp) / BILLION / period)
    arrival = tick.stamp + round(plant.parameters.delay * BILLION)
    # in lockstep a force acts at once, else as long after a state as it did
    late = run.latency(plant.parameters.delay) if tick.real_time else 0.0
    # in lockstep the plant counts its periods from the first on: stamps are rounded from there
    before = 0 if tick.real_time else round(arrival / BILLION / period)
    epoch = arrival if tick.real_time else 0
    plant.begin_period(run.push(epoch + round(before * period * BILLION)))   # it is measured
    for n in range(before + 1, before + count + 1):
        stepper.finish(None if plan is None else plan.command(run.problem.u_max), late)
        now = epoch + round(n * period * BILLION)
        measured = stepper.begin(run.push(now))
        if measured is not None:
            age = plant.t - measured.t
            stamp = now - round(age * BILLION)
            plan = respond(controller, stamp / BILLION, measured.x,
                           age + late if tick.real_time else tick.delay)
            x = np.where(np.isnan(measured.x), controller.belief.x, measured.x)
            samples.append(Sample(stamp, x, measured.force))
        elif tick.real_time:
            plan = controller.fallback(now / BILLION + late)
        else:
            plan = None   # nobody answers, and the last force acts on
    return samples


def controller_at(run: Run, until: Tick, solver: str) -> tuple[RecedingHorizon, Plan]:
    """
    Return the controller that a solver is after it saw every tick up to one, and its plan.

    That of the recorded solver stops its solves where the recorded ones stopped.
    """
    controller = controllers.controller({**run.mpc, 'solver': solver})
    recorded = run.mpc.get('solver', MpcParameters.solver)
    for tick in run.record.up_to(until):
        if tick.changed is not None:
            recorded = tick.changed.get('solver', MpcParameters.solver)
            tick = tick._replace(changed={**tick.changed, 'solver': solver})
        plan = answer(controller, tick, counted=solver == recorded)
        if tick.number < until.number:
            controller.commands.replace_last(tick.force)
    return controller, plan


def plant_at(run: Run, tick: Tick) -> Plant:
    """Return the plant when a tick's state arrives, its noise from the beginning of its seed."""
    plant = plants.plant({**run.plant, 'initial_state': run.states[tick.stamp].tolist()})
    for before in run.record.up_to(tick)[-2:-1]:
        # until then, and where the actuator lags or a command is lost, the one before acts
        plant.force = plant.commands.force = before.force
    delay = plant.parameters.delay
    plant.t = -delay
    plant.past[0] = plant.past[0]._replace(t=-delay)
    plant.advance(delay)
    return plant
