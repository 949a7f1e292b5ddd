# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
pytorch_mppi on the default problem.

A tick of MPPI is one update: samples drawn, followed and averaged, in single precision. Ours is
the whole `solve` with one iteration, with what pytorch_mppi has not: the Riccati passes and
the rollouts of the result.
pytorch_mppi runs on the equations of this package (`closed`), and on these compiled.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from timing import Missing, Work
import torch
from torch import Tensor

from dp_swing_ros.control import controllers
from dp_swing_ros.pendulum.model import advance
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import plan_of, Problem
from dp_swing_ros.solvers.mppi import MPPI

STEPS_ON_GPU, SAMPLES_ON_GPU = 100, (2048, 10_000, 100_000, 1_000_000)
THREADS = 8
NOISE = 5.0      # [N] standard deviation of pytorch_mppi's samples
Step = Callable[[Tensor, Tensor], Tensor]


def our_tick(problem: Problem, samples: int, **parameters: Any) -> Work:
    """Return an update of ours, from hanging, beginning with zero forces."""
    solver = MPPI(problem, MPPI.Parameters(samples=samples, iterations=1, **parameters))
    x_0 = hanging()
    X = np.tile(x_0, (problem.horizon + 1, 1))
    plan = plan_of(problem, X, np.zeros(problem.horizon), Status.COMPLETE)

    def run() -> int:
        solver.solve(x_0, plan, np.inf)
        return 1
    return run


def our_ticks(problem: Problem, samples: int) -> dict[str, Work]:
    """Return an update of ours in one thread and in two, by name."""
    return {f'mppi, {threads} threads': our_tick(problem, samples, threads=threads)
            for threads in (1, 2)}


def costs(problem: Problem, dtype: torch.dtype) -> tuple[Step, Step]:
    """Return the running and the terminal cost; the terminal one takes what pytorch_mppi gives."""
    cost = problem.cost
    S, P = torch.tensor(cost.S, dtype=dtype), torch.tensor(cost.P, dtype=dtype)

    def error(x: Tensor) -> Tensor:
        return torch.cat([x[..., :1], 2 * torch.sin(x[..., 1:3] / 2), x[..., 3:]], -1)

    def margin(x: Tensor) -> Tensor:
        return cost.w * torch.relu(x[..., 0].abs() - cost.x_soft) ** 2

    def running(x: Tensor, u: Tensor) -> Tensor:
        return (S * error(x) ** 2).sum(-1) + cost.R * u[..., 0] ** 2 + margin(x)

    def terminal(X: Tensor, U: Tensor) -> Tensor:
        e = error(X[..., -1, :])
        return ((e @ P) * e).sum(-1) + margin(X[..., -1, :])
    return running, terminal


def gpu_ticks() -> tuple[str, dict[str, Work]]:
    """
    Return the name of the GPU, and an update of ours there and on the CPU, by number of samples.

    Over 100 steps, as in the figure that MPPI-Generic publishes. Raises Missing without a GPU.
    """
    if not torch.cuda.is_available():
        raise Missing(f'torch {torch.__version__} finds no NVIDIA GPU on this machine')
    problem = controllers.problem({'horizon': STEPS_ON_GPU})
    return torch.cuda.get_device_name(), {
        f'mppi, {samples:,} samples{where}': our_tick(problem, samples, **parameters)
        for samples in SAMPLES_ON_GPU
        for where, parameters in (('', {'device': 'cuda'}),
                                  (f', {THREADS} threads of the CPU', {'threads': THREADS}))}


def torch_step(problem: Problem) -> Step:
    """Return one step of the model in torch."""
    return lambda x, u: torch.stack(advance(problem.model, x.unbind(-1), u), -1)


def torch_tick(problem: Problem, samples: int, kind: str, threads: int) -> Work:
    """Return an update of pytorch_mppi."""
    from pytorch_mppi import MPPI as Theirs

    step = torch_step(problem)
    running, terminal = costs(problem, torch.float32)
    bound = torch.tensor([problem.u_max])
    solver = Theirs(lambda x, u: step(x, u[..., 0]), running, 6, torch.tensor([[NOISE ** 2]]),
                    num_samples=samples, horizon=problem.horizon, terminal_state_cost=terminal,
                    u_min=-bound, u_max=bound)
    if kind == 'compiled':
        solver.compile()
    x_0 = torch.tensor(hanging(), dtype=torch.float32)

    def run() -> int:
        torch.set_num_threads(threads)
        with torch.inference_mode():
            solver.command(x_0)
        return 1
    return run
