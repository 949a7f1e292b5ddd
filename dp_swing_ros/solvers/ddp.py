# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
DDP: the dynamics are expanded to second order in each iteration.

Source: the paper, II-C, (22)-(37), with the errata of docs/model.md.
"""

from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.problem.problem import Problem
from dp_swing_ros.solvers.descent import DescentParameters, solve
from dp_swing_ros.solvers.solver import Seed


class DDP:
    """The solver; deterministic, so it has no use for a seed."""

    Parameters = DescentParameters

    def __init__(self, problem: Problem, parameters: DescentParameters, seed: Seed = 0) -> None:
        """Take the problem and what ends a descent."""
        self.problem, self.parameters = problem, parameters

    def solve(self, x_0: Array, warm_start: Plan | None, deadline: float) -> Plan:
        """Return a locally optimal plan; see Solver.solve."""
        return solve(self.problem, self.parameters, True, x_0, warm_start, deadline)
