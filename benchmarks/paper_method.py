# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The paper's own method: iLQR and DDP whose derivatives come from torch's autograd (II-C.1).

Both take one iteration: expand dynamics and cost, one Riccati pass (25)-(37), one rollout, on the
paper's cost. `step by step` differentiates at one time after the other, as the paper's authors do;
`batched` differentiates at all times at once, which they did not. The tensors of iLQR are not
computed. Everything is in double precision, on one thread.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from paper_model import rk4_step
from timing import Work
import torch
from torch import Tensor
from torch.func import jacrev

from dp_swing_ros.control import controllers
from dp_swing_ros.pendulum.derivatives import expand
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.problem import Bounds, Problem
from dp_swing_ros.solvers.riccati import backward, forward

START = (0.2, 0.05, -0.03, 0.0, 0.0, 0.0)


class Policy(NamedTuple):
    """The policy δu = k + K δx. Shapes: k (N,), K (N, 6)."""

    k: Array
    K: Array


def paper_problem() -> Problem:
    """Return the problem with the paper's cost, without a bound of the force."""
    return controllers.problem({
        'angle_error': 'angle', 'terminal_cost': 'scaled', 'track_weight': 0.0,
        'force_limit': float('inf')})


class PaperMethod:
    """One iteration from a trajectory of the model."""

    def __init__(self, problem: Problem, second_order: bool, batched: bool) -> None:
        """Take the problem; the trajectory is the regulator's."""
        self.problem, self.second_order, self.batched = problem, second_order, batched
        self.p, self.h = problem.model.pendulum, problem.dt
        self.S, self.P = torch.tensor(problem.cost.S), torch.tensor(problem.cost.P)
        self.X, self.U = trajectory(problem)

    def step(self, z: Tensor) -> Tensor:
        """Return f(x, u) of z = (x, u)."""
        return rk4_step(self.p, self.h, z[:6], z[6])

    def running(self, z: Tensor) -> Tensor:
        """Return ℓ of z = (x, u)."""
        return (self.S * z[:6] ** 2).sum() + self.problem.cost.R * z[6] ** 2

    def terminal(self, x: Tensor) -> Tensor:
        """Return ℓ_f."""
        return x @ self.P @ x

    def expansions(self) -> tuple[Tensor, ...]:
        """Return f_z (N, 6, 7), f_zz (N, 6, 7, 7) or none, ℓ_z (N, 7) and ℓ_zz (N, 7, 7)."""
        X, U = torch.tensor(self.X[:-1]), torch.tensor(self.U)
        z = torch.cat([X, U[:, None]], -1)
        wanted = [jacrev(self.running), jacrev(jacrev(self.running))]
        if not self.batched:
            of_step = [jacrev(self.step)] + [jacrev(jacrev(self.step))] * self.second_order
            *steps, l_z, l_zz = [torch.stack([part(one) for one in z])
                                 for part in (*of_step, *wanted)]
            return steps[0], steps[1] if self.second_order else torch.empty(0), l_z, l_zz
        cost = [torch.vmap(part)(z) for part in wanted]
        # not torch.func.hessian, whose forward mode under vmap errs for linalg.solve (torch 2.13)
        second = torch.vmap(jacrev(jacrev(self.step)))(z) if self.second_order else torch.empty(0)
        return torch.vmap(jacrev(self.step))(z), second, *cost

    def policy(self) -> Policy:
        """Do the Riccati pass, (25)-(32)."""
        f_z, f_zz, l_z, l_zz = (part.numpy() for part in self.expansions())
        last = torch.tensor(self.X[-1])
        V_x = jacrev(self.terminal)(last).numpy()
        V_xx = jacrev(jacrev(self.terminal))(last).numpy()
        k, K = np.empty(len(self.U)), np.empty((len(self.U), 6))
        for t in range(len(self.U) - 1, -1, -1):
            Q_z = l_z[t] + f_z[t].T @ V_x
            Q_zz = l_zz[t] + f_z[t].T @ V_xx @ f_z[t]
            if self.second_order:
                Q_zz = Q_zz + np.einsum('i,ijk->jk', V_x, f_zz[t])
            k[t], K[t] = -Q_z[6] / Q_zz[6, 6], -Q_zz[6, :6] / Q_zz[6, 6]
            V_x = Q_z[:6] + K[t] * Q_z[6]
            V_xx = Q_zz[:6, :6] + np.outer(K[t], Q_zz[6, :6])
        return Policy(k, K)

    def run(self) -> int:
        """Do an iteration: the policy, and its rollout in torch, (33)-(35)."""
        k, K = self.policy()
        x = torch.tensor(self.X[0])
        for t in range(len(self.U)):
            u = self.U[t] + k[t] + K[t] @ (x.numpy() - self.X[t])
            x = self.step(torch.cat([x, torch.tensor([u])]))
        return 1


def trajectory(problem: Problem) -> tuple[Array, Array]:
    """Return the states and forces of a regulator that is a little disturbed."""
    random, U = np.random.default_rng(0).uniform(-1, 1, problem.horizon), []
    X = [np.array(START)]
    for disturbance in random:
        U.append(float(-problem.lqr.K @ X[-1] + disturbance))
        X.append(rollout(problem.model, X[-1], np.array(U[-1:]))[1])
    return np.array(X), np.array(U)


def our_iteration(problem: Problem, second_order: bool) -> tuple[Work, Callable[[], Policy]]:
    """Return the same iteration of ours, and what gives its policy."""
    X, U = trajectory(problem)
    k, K, gaps = np.empty(len(U)), np.empty((len(U), 6)), np.empty((0, 6))
    X_new, U_new, infinite = np.empty_like(X), np.empty_like(U), Bounds(-np.inf, np.inf)
    tensor = 1.0 if second_order else None

    def policy() -> Policy:
        # its errors of angles are straight, so Gauss-Newton's Hessian is exact
        backward(problem.model, problem.cost, expand(problem.model, X, U), X, U, gaps, infinite,
                 0.0, tensor, None, k, K)
        return Policy(k, K)

    def run() -> int:
        policy()
        forward(problem.model, problem.cost, X, U, gaps, k, K, 1.0, infinite, X_new, U_new)
        return 1
    return run, policy


def iterations() -> dict[str, Work]:
    """Return all contenders."""
    problem = paper_problem()
    torch.set_num_threads(1)
    contenders = {}
    for name, second_order in (('ilqr', False), ('ddp', True)):
        contenders[name] = our_iteration(problem, second_order)[0]
        for kind, batched in (('batched', True), ('step by step', False)):
            contenders[f'autograd {name}, {kind}'] = PaperMethod(
                problem, second_order, batched).run
    return contenders
