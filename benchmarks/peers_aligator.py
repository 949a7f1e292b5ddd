# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
aligator's ProxDDP on the same problems; the bound is a constraint.

Settings: those of aligator's own examples, linear rollouts and one thread, as ours; of the first
penalties from 1e-2 to 1e-8 that these have, the one that is fastest and most often right here.
With rollouts of the dynamics, or penalties that may become less, it is no better.

Source: Jallet, Bambade, Arlaud, El-Kazdadi, Mansard and Carpentier, "ProxDDP: proximal constrained
trajectory optimization", IEEE Transactions on Robotics 41, 2025.
"""

from collections.abc import Mapping
import ctypes
import math
from typing import Any

from acados_rti.expressions import Expressions
import casadi as ca
from peers_casadi import Make, TOLERANCE
from peers_cpp import Peer
from peers_gradient import first_plan, ITERATIONS
from timing import Work

from dp_swing_ros.problem.problem import Problem

PENALTY = 1e-6   # the first μ


class ProxDDP(Peer):
    """aligator's solver of a problem; its option is the first penalty."""

    SOURCE, DISTRIBUTION, LIBRARIES = 'peers_aligator.cpp', 'libaligator', ('aligator',)
    DEFINES = 'ALIGATOR_ENABLE_TEMPLATE_INSTANTIATION',
    OPTION = ctypes.c_double

    @staticmethod
    def functions(e: Expressions) -> Mapping[str, list[Any]]:
        """Return values, gradients and Hessians, which aligator asks for one by one."""
        z = ca.vertcat(e.x, e.u)
        force_last = [*range(1, z.numel()), 0]
        return {
            'step': [e.step], 'step_jac': [ca.jacobian(e.step, z)],
            'running': [e.running.value], 'running_jac': [ca.gradient(e.running.value, z)],
            'running_hess': [e.running.hessian[force_last, force_last]],
            'terminal': [e.terminal.value], 'terminal_jac': [ca.gradient(e.terminal.value, z)],
            'terminal_hess': [ca.diagcat(e.terminal.hessian, 0)]}


def descents(ours: Problem) -> dict[str, Work]:
    """Return what is timed, with a bound; its units are iterations."""
    if not math.isfinite(ours.u_max):
        return {}
    solver, plan = ProxDDP(ours, TOLERANCE, PENALTY), first_plan(ours)
    return {'aligator ProxDDP': lambda: solver.solve(plan.X.copy(), plan.U.copy(), ITERATIONS)}


def solves(ours: Problem, tolerance: float) -> Make:
    """Return whole solves; see `peers_solvers`."""
    solver = ProxDDP(ours, tolerance, PENALTY)
    return lambda guess, count: lambda: solver.trajectory(guess, count)


SOLVES = {'aligator ProxDDP': solves}
