# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One run of the closed loop, simulated or read from a bag: what metrics and figures look at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TYPE_CHECKING

import numpy as np

from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import Array, columns, links_of, upright, wrapped

if TYPE_CHECKING:
    from pandas import DataFrame


class Ticks(NamedTuple):
    """
    What the controller reported of each of its ticks.

    Shapes: all (M,); t is the time of the state that a tick answers, on the episode's clock.
    A tick that answers none has its own time; none comes after the last state.
    """

    t: Array           # [s]
    cost: Array
    iterations: Array
    solve_time: Array  # [s]
    latency: Array     # [s] from the stamp of the state to the sending of the force
    late: Array        # bool: the solve took longer than the period
    status: list[str]  # names of plan.Status, or the rung of the fallback ladder


@dataclass(frozen=True)
class Episode:
    """
    States, forces and ticks of one run.

    Shapes: t (N,) [s] from the first state; X (N, 2n + 2); U (N - 1,) [N], the force applied from
    state n to state n + 1.
    """

    t: Array
    X: Array
    U: Array
    ticks: Ticks
    solver: str
    physical: PendulumParameters
    limits: LimitParameters
    incomplete: str = ''  # how many messages of how many a bag held; empty where all
    goal: Array | None = None   # (2n + 2,) where the controller was to hold it; None: upright
    nominal: PendulumParameters | None = None   # of which `physical` are off; None: they are not

    @property
    def x_r(self) -> Array:
        """Return the state (2n + 2,) that the controller was to hold."""
        return upright(links_of(self.X)) if self.goal is None else self.goal

    @property
    def bodies(self) -> PendulumParameters:
        """Return the bodies that it is measured by."""
        return self.nominal or self.physical

    @property
    def errors(self) -> Array:
        """
        Return by how much the states are off from the goal, on its nearest turn; like X.

        Where joints have springs, that is where the links can rest near it.
        """
        from dp_swing_ros.pendulum.equations import (   # here: a logger does without
            errors_from_rest, Pendulum)
        return errors_from_rest(Pendulum.of(self.physical), self.X, self.x_r)

    def to_frame(self, whole_turns: bool = False) -> DataFrame:
        """
        Return the run as a pandas frame: a row a state, its index the time [s].

        Beside the state [m, rad, m/s, rad/s] stand the force [N] of the period that begins there
        and what the controller said of its tick for this state (of two, the later); what there
        is not is missing: the last force, a tick that a state has none of. The angles are in
        (-π, π], 0 upright; with `whole_turns` they are as measured, without jumps. `attrs` holds
        solver, physical parameters and limits, and how many messages of how many the bag had if
        not all.
        """
        import pandas  # here: it takes half a second, which no node should wait for

        X = self.X if whole_turns else wrapped(self.X)
        frame = pandas.DataFrame(X, pandas.Index(self.t, name='t [s]'),
                                 columns(links_of(X)))
        frame['force'] = np.append(self.U, [np.nan] * (len(self.t) - len(self.U)))
        of_ticks = pandas.DataFrame(self.ticks._asdict()).astype({
            'iterations': 'Int64', 'late': 'boolean', 'status': object})
        frame = frame.join(of_ticks.drop_duplicates('t', keep='last').set_index('t'))
        frame.attrs = {'solver': self.solver, 'physical': self.physical, 'limits': self.limits,
                       'incomplete': self.incomplete}
        return frame
