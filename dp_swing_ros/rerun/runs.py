# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded run with all that it takes to continue from any of its ticks."""

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros import configuration
from dp_swing_ros.bags.episodes import CONTROLLER, PLANT, Sample, samples_of
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.control.receding_horizon import MpcParameters
from dp_swing_ros.errors import UserError
from dp_swing_ros.evaluation.metrics import settling_time
from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.cost import running
from dp_swing_ros.rerun.ticks import configuration_of, record_of, Tick


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
        self.plant = configuration_of(bag, PLANT).parameters
        self.record, self.samples = record_of(bag), samples_of(bag)
        self.start, self.end = self.samples[0].stamp, self.samples[-1].stamp
        self.problem = configuration.problem(self.mpc)
        self.solver = str(self.mpc.get('solver', MpcParameters.solver))
        plant = configuration.plant(self.plant)
        self.limits = plant.limits
        self.period = BILLION / plant.parameters.rate   # [ns]

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
                 if tick.x is not None and np.all(np.isfinite(tick.x))
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
        return min((sample.stamp for sample in self.samples), key=lambda stamp: abs(stamp - end))

    def scored(self, solver: str, samples: Sequence[Sample]) -> ScoredTrajectory:
        """Return the trajectory of states with its cost and its settling time."""
        stamps = np.array([sample.stamp for sample in samples])
        t = (stamps - self.start) / BILLION
        X = np.array([sample.x for sample in samples])
        U = np.array([sample.force for sample in samples[1:]])
        steps = np.diff(stamps) / BILLION / self.problem.dt
        cost = math.fsum(share * running(self.problem.cost, x, u)
                         for share, x, u in zip(steps, X, U))
        return ScoredTrajectory(solver, t, X, U, cost, settling_time(t, X))

    def between(self, begin: int, end: int) -> ScoredTrajectory:
        """Return what was recorded between two stamps [ns], both included."""
        return self.scored(self.solver, [sample for sample in self.samples
                                         if begin <= sample.stamp <= end])
