# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One run of the closed loop, simulated or read from a bag: what metrics and figures look at."""

from dataclasses import dataclass
from typing import NamedTuple

from dp_swing_ros.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.state import Array


class Ticks(NamedTuple):
    """
    What the controller said of each of its ticks.

    Shapes: all (M,); t is the time of the state that a tick answers, on the episode's clock.
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

    Shapes: t (N,) [s] from the first state; X (N, 6); U (N - 1,) [N], the force applied from
    state n to state n + 1.
    """

    t: Array
    X: Array
    U: Array
    ticks: Ticks
    solver: str
    bodies: PendulumParameters
    limits: LimitParameters
