# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
pytorch_mppi and MuJoCo's threaded rollouts, on the default problem.

A tick of MPPI is one update: samples drawn, followed and averaged, in single precision. Ours is
the whole `solve` with one iteration, with what pytorch_mppi has not: the Riccati pass, two
proposals, and the rollouts of the result. pytorch_mppi runs on torch_twin's equations (`twin`,
which solve a linear system in each stage), on the closed form of ours written in torch (`closed`),
and on that compiled. MuJoCo's rollouts are in double precision, and without a cost.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from timing import Work
import torch
from torch import Tensor

from dp_swing_ros.dynamics import Pendulum
from dp_swing_ros.dynamics.torch_twin import rk4_step
from dp_swing_ros.parameters import PendulumParameters
from dp_swing_ros.plan import Status
from dp_swing_ros.problem import Problem
from dp_swing_ros.solvers.mppi import MPPI
from dp_swing_ros.starts import plan_of
from dp_swing_ros.state import Array, HANGING

NOISE = 5.0      # [N] standard deviation of pytorch_mppi's samples
Step = Callable[[Tensor, Tensor], Tensor]


def our_tick(problem: Problem, samples: int) -> Work:
    """Return an update of ours, from hanging, beginning with zero forces."""
    solver = MPPI(problem, MPPI.Parameters(samples=samples, iterations=1))
    x_0 = np.array(HANGING)
    X = np.tile(x_0, (problem.horizon + 1, 1))
    plan = plan_of(problem, X, np.zeros(problem.horizon), Status.COMPLETE)

    def run() -> int:
        solver.solve(x_0, plan, np.inf)
        return 1
    return run


def closed_form(p: Pendulum, h: float) -> Step:
    """Return the RK4 step without a linear solve: the inverse of D by its cofactors."""
    def derivative(x: Tensor, u: Tensor) -> Tensor:
        th_1, th_2, v, w_1, w_2 = x[..., 1:].unbind(-1)
        s_1, c_1, s_2, c_2 = th_1.sin(), th_1.cos(), th_2.sin(), th_2.cos()
        s_12, c_12 = s_1 * c_2 - c_1 * s_2, c_1 * c_2 + s_1 * s_2
        m_01, m_02, m_12 = p.d_01 * c_1, p.d_02 * c_2, p.d_12 * c_12
        i_00, i_11 = p.d_11 * p.d_22 - m_12 * m_12, p.d_00 * p.d_22 - m_02 * m_02
        i_22 = p.d_00 * p.d_11 - m_01 * m_01
        i_01, i_02 = m_02 * m_12 - m_01 * p.d_22, m_01 * m_12 - m_02 * p.d_11
        i_12 = m_01 * m_02 - p.d_00 * m_12
        per_det = 1 / (p.d_00 * i_00 + m_01 * i_01 + m_02 * i_02)
        slip = p.b_2 * (w_1 - w_2)
        r_0 = u - p.b_0 * v + p.d_01 * s_1 * w_1 * w_1 + p.d_02 * s_2 * w_2 * w_2
        r_1 = p.g * p.d_01 * s_1 - p.d_12 * s_12 * w_2 * w_2 - p.b_1 * w_1 - slip
        r_2 = p.g * p.d_02 * s_2 + p.d_12 * s_12 * w_1 * w_1 + slip
        return torch.stack([v, w_1, w_2, (i_00 * r_0 + i_01 * r_1 + i_02 * r_2) * per_det,
                            (i_01 * r_0 + i_11 * r_1 + i_12 * r_2) * per_det,
                            (i_02 * r_0 + i_12 * r_1 + i_22 * r_2) * per_det], -1)

    def step(x: Tensor, u: Tensor) -> Tensor:
        k_1 = derivative(x, u)
        k_2 = derivative(x + h / 2 * k_1, u)
        k_3 = derivative(x + h / 2 * k_2, u)
        k_4 = derivative(x + h * k_3, u)
        return x + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)
    return step


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


def torch_step(problem: Problem, kind: str) -> Step:
    """Return one step of the model in torch."""
    p, h = problem.model.pendulum, problem.dt
    if kind == 'twin':
        return lambda x, u: rk4_step(p, h, x, u)
    return closed_form(p, h)


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
    x_0 = torch.tensor(HANGING, dtype=torch.float32)

    def run() -> int:
        torch.set_num_threads(threads)
        with torch.inference_mode():
            solver.command(x_0)
        return 1
    return run


def mujoco_model(bodies: PendulumParameters, h: float) -> Any:
    """Build the same bodies in MuJoCo, with an RK4 step of h [s]; the second hinge is relative."""
    import mujoco

    def link(number: int, above: float, inside: str) -> str:
        mass, length, factor, friction = (getattr(bodies, name.format(number)) for name in (
            'link{}_mass', 'link{}_length', 'link{}_inertia_factor', 'joint{}_friction'))
        about = factor * mass * length ** 2 / 12
        return (f'<body pos="0 0 {above}"><joint type="hinge" axis="0 1 0" damping="{friction}"/>'
                f'<inertial pos="0 0 {length / 2}" mass="{mass}" diaginertia="{about} {about} '
                f'{about}"/>{inside}</body>')
    links = link(1, 0.0, link(2, bodies.link1_length, ''))
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <option gravity="0 0 {-bodies.gravity}" timestep="{h}" integrator="RK4"/>
          <worldbody><body>
            <joint name="cart" type="slide" axis="1 0 0" damping="{bodies.cart_friction}"/>
            <inertial pos="0 0 0" mass="{bodies.cart_mass}" diaginertia="1 1 1"/>{links}
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

    model = mujoco_model(problem.bodies, problem.dt)
    N = problem.horizon
    states = mujoco_states(np.tile(HANGING, (samples, 1)))
    forces = np.random.default_rng(0).normal(0, NOISE, (samples, N, 1))
    out = np.empty((samples, N, states.shape[1]))
    pool = rollout.Rollout(nthread=threads if threads > 1 else 0)
    data = [mujoco.MjData(model) for _ in range(threads)]

    def run() -> int:
        pool.rollout(model, data, states, forces, state=out)
        return samples * N
    return run
