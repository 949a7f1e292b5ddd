# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
pytorch_mppi and MuJoCo's threaded rollouts, on the default problem.

A tick of MPPI is one update: samples drawn, followed and averaged, in single precision. Ours is
the whole `solve` with one iteration, with what pytorch_mppi has not: the Riccati passes and
the rollouts of the result.
pytorch_mppi runs on the paper's equations (`twin`, which solve a linear system in each stage), on
those of this package (`closed`), and on these compiled. MuJoCo's rollouts are in double precision,
and without a cost.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from paper_model import rk4_step
from timing import Missing, Work
import torch
from torch import Tensor

from dp_swing_ros.control import controllers
from dp_swing_ros.pendulum.model import advance
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import Array, hanging
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


def torch_step(problem: Problem, kind: str) -> Step:
    """Return one step of the model in torch."""
    p, h = problem.model.pendulum, problem.dt
    if kind == 'twin':
        return lambda x, u: rk4_step(p, h, x, u)
    return lambda x, u: torch.stack(advance(problem.model, x.unbind(-1), u), -1)


def torch_tick(problem: Problem, samples: int, kind: str, threads: int) -> Work:
    """Return an update of pytorch_mppi."""
    from pytorch_mppi import MPPI as Theirs

    step = torch_step(problem, kind)
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


def mujoco_model(physical: PendulumParameters, h: float) -> Any:
    """Build the pendulum in MuJoCo, with an RK4 step of h [s]; the second hinge is relative."""
    import mujoco

    def link(number: int, above: float, inside: str) -> str:
        mass, length, factor, friction = (getattr(physical, name.format(number)) for name in (
            'link{}_mass', 'link{}_length', 'link{}_inertia_factor', 'joint{}_friction'))
        about = factor * mass * length ** 2 / 12
        return (f'<body pos="0 0 {above}"><joint type="hinge" axis="0 1 0" damping="{friction}"/>'
                f'<inertial pos="0 0 {length / 2}" mass="{mass}" diaginertia="{about} {about} '
                f'{about}"/>{inside}</body>')
    links = link(1, 0.0, link(2, physical.link1_length, ''))
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <option gravity="0 0 {-physical.gravity}" timestep="{h}" integrator="RK4"/>
          <worldbody><body>
            <joint name="cart" type="slide" axis="1 0 0" damping="{physical.cart_friction}"/>
            <inertial pos="0 0 0" mass="{physical.cart_mass}" diaginertia="1 1 1"/>{links}
          </body></worldbody>
          <actuator><motor joint="cart"/></actuator>
        </mujoco>""")


def mujoco_states(x: Array) -> Array:
    """Return MuJoCo's full states: the time, then ours with relative angles."""
    return np.column_stack([np.zeros(len(x)), x[:, :2], x[:, 2] - x[:, 1], x[:, 3:5],
                            x[:, 5] - x[:, 4]])


def mujoco_rollouts(problem: Problem, samples: int, threads: int) -> Work:
    """Return rollouts by MuJoCo's thread pool; units are steps."""
    import mujoco
    from mujoco import rollout

    model = mujoco_model(problem.physical, problem.dt)
    N = problem.horizon
    states = mujoco_states(np.tile(hanging(), (samples, 1)))
    forces = np.random.default_rng(0).normal(0, NOISE, (samples, N, 1))
    out = np.empty((samples, N, states.shape[1]))
    pool = rollout.Rollout(nthread=threads if threads > 1 else 0)
    data = [mujoco.MjData(model) for _ in range(threads)]

    def run() -> int:
        pool.rollout(model, data, states, forces, state=out)
        return samples * N
    return run
