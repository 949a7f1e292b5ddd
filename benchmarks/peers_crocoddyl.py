# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
crocoddyl's DDP and FDDP, mim-solvers' SQP and CSQP, on the same problems.

With the bound these are BoxDDP and BoxFDDP, whose limit it is, and CSQP, whose constraint. Of a
step and of its derivatives they ask for all at once, so that CasADi shares what these share, which
crocoddyl's own way, a multibody model of Pinocchio under a Runge-Kutta action, cannot. Settings
are their own, and one thread, as ours.

CSQP is in no whole solve: where one of its steps diverges, as from one cold start
in five, it throws what nobody can catch, out of a parallel region, and the process ends. From a
trajectory that the model follows BoxDDP and BoxFDDP do the same, so of whole solves there is one.

Sources: Mastalli et al., "Crocoddyl: an efficient and versatile framework for multi-contact
optimal control", ICRA 2020; Jordana, Kleff, Meduri, Carpentier, Mansard and Righetti, "Structure-
exploiting sequential quadratic programming for model-predictive control", IEEE Transactions on
Robotics 41, 2025.
"""

from collections.abc import Mapping
import ctypes
import math
from typing import Any

from acados_rti.expressions import Expressions
import casadi as ca
from peers_casadi import Make
from peers_cpp import Peer
from peers_gradient import ALONE, first_plan, ITERATIONS
from timing import Work

from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.problem.problem import Problem

KINDS = ('crocoddyl DDP', 'crocoddyl FDDP', 'crocoddyl BoxDDP', 'crocoddyl BoxFDDP',
         'mim_solvers SQP', 'mim_solvers CSQP')   # as peers_crocoddyl.cpp counts them
BOUNDED = ('crocoddyl BoxDDP', 'crocoddyl BoxFDDP', 'mim_solvers CSQP')
NEVER = 1e-300   # a tolerance that nothing reaches: as many iterations as were asked for


class Crocoddyl(Peer):
    """A solver of crocoddyl or mim-solvers for a problem; its option is the place in KINDS."""

    SOURCE, DISTRIBUTION = 'peers_crocoddyl.cpp', 'libcrocoddyl'
    LIBRARIES = 'mim_solvers', 'crocoddyl'   # the first needs the second
    OPTION = ctypes.c_int

    @staticmethod
    def functions(e: Expressions) -> Mapping[str, list[Any]]:
        """Return step and cost, and their derivatives."""
        value, hessian = e.running     # by (u, x)
        of_terminal, terminal_hessian = e.terminal
        return {
            'running': [e.step, value],
            'running_diff': [ca.jacobian(e.step, e.x), ca.jacobian(e.step, e.u),
                             ca.gradient(value, e.x), ca.gradient(value, e.u),
                             hessian[1:, 1:], hessian[1:, 0], hessian[0, 0]],
            'terminal': [of_terminal],
            'terminal_diff': [ca.gradient(of_terminal, e.x), terminal_hessian]}

    def evaluate(self, plan: Plan) -> None:
        """Evaluate step, cost and all derivatives along a plan."""
        self.code.evaluate(*map(ctypes.c_void_p, (
            self.memory, plan.X.ctypes.data, plan.U.ctypes.data)))


def descents(ours: Problem) -> dict[str, Work]:
    """Return what is timed; their units are iterations."""
    plan = first_plan(ours)
    bounded = math.isfinite(ours.u_max)

    def descent(kind: str) -> Work:
        solver = Crocoddyl(ours, NEVER, KINDS.index(kind))
        return lambda: solver.solve(plan.X.copy(), plan.U.copy(), ITERATIONS)
    solver = Crocoddyl(ours, NEVER, 0)

    def alone() -> int:
        solver.evaluate(plan)
        return 1
    return {**{kind: descent(kind) for kind in KINDS if (kind in BOUNDED) == bounded},
            ALONE: alone}


def solves(ours: Problem, tolerance: float) -> Make:
    """Return whole solves of BoxFDDP; see `peers_solvers`."""
    solver = Crocoddyl(ours, tolerance, KINDS.index('crocoddyl BoxFDDP'))
    return lambda guess, count: lambda: solver.trajectory(guess, count)


SOLVES = {'crocoddyl BoxFDDP': solves}
