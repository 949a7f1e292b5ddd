# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
hydrax on the default problem: MPPI, CEM and predictive sampling, with MJX as the model.

Bodies, RK4 step, cost, bounds and horizon are ours; samples, noise, spline and elites are those of
its authors' examples of this plant and of the cart with one pole, whose noise is a share of the
bound. A tick is one update. It is made for GPUs; here XLA compiles it for the processor, and takes
all cores. So MuJoCo MPC's own method, predictive sampling, is compared, too.

A checkout of its repository is needed, at COMMIT: its package on the index is another one.

Sources: Kurtz, github.com/vincekurtz/hydrax; Howell et al., "Predictive Sampling: Real-time
Behaviour Synthesis with MuJoCo", 2022.
"""

from collections.abc import Callable
from itertools import count
import os
from typing import Any

os.environ.setdefault('JAX_PLATFORMS', 'cpu')

from hydrax.algs import CEM, MPPI, PredictiveSampling
from hydrax.task_base import Task
import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from peers_casadi import Guess, Make, Solve
from timing import Work

from dp_swing_ros.pendulum.parameters import LimitParameters
from dp_swing_ros.pendulum.state import Array, hanging, to_joints
from dp_swing_ros.problem.problem import Problem
from dp_swing_ros.simulation.engines import mjcf

COMMIT = 'e06f1446c78f2d6da3eda24073f30f96208dcb3c'   # Makefile takes it from here
SAMPLES = 1024    # of the examples, as all that follows
NOISE = 0.3       # standard deviation, as a share of the bound
KNOTS = 4         # a second, of a cubic spline
METHODS: dict[str, Callable[..., Any]] = {
    'MPPI': lambda task, samples, noise, **spline: MPPI(
        task, samples, noise, temperature=0.1, **spline),
    'CEM': lambda task, samples, noise, **spline: CEM(
        task, samples, num_elites=max(samples * 3 // 128, 1), sigma_start=noise,
        sigma_min=noise / 6, **spline),
    'predictive sampling': lambda task, samples, noise, **spline: PredictiveSampling(
        task, samples, noise, **spline)}


class Pendulum(Task):   # type: ignore[misc]
    """The default problem, as a task of hydrax."""

    def __init__(self, problem: Problem) -> None:
        """Take bodies, step, cost and bound."""
        self.problem = problem
        model = mujoco.MjModel.from_xml_string(mjcf(
            problem.physical, LimitParameters(track_limit=np.inf)))
        model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, problem.dt
        model.actuator_ctrllimited[:] = True
        model.actuator_ctrlrange[:] = -problem.u_max, problem.u_max
        super().__init__(model)
        self.data = self.make_data()

    def of_state(self, state: Any) -> tuple[Any, Any]:
        """Return the error of a state (2n + 2,), and what it costs along the way."""
        cost = self.problem.cost
        q, v = (jnp.concatenate((of[:1], jnp.cumsum(of[1:]))) for of in (state.qpos, state.qvel))
        e = jnp.concatenate((q[:1], 2 * jnp.sin(q[1:] / 2), v))
        return e, jnp.sum(jnp.asarray(cost.S) * e ** 2) + self.margin(q[0])

    def margin(self, x: Any) -> Any:
        """Return what it costs to be near the end of the track."""
        cost = self.problem.cost
        return cost.w * jnp.maximum(jnp.abs(x) - cost.x_soft, 0.0) ** 2

    def running_cost(self, state: Any, control: Any) -> Any:
        """Return ℓ of a force and of the state after it, of which hydrax counts the cost."""
        return (self.of_state(state)[1] + self.problem.cost.R * control[0] ** 2) / self.dt

    def terminal_cost(self, state: Any) -> Any:
        """Return ℓ_f of the last state, less ℓ of it, which was counted."""
        e, running = self.of_state(state)
        return e @ jnp.asarray(self.problem.cost.P) @ e + self.margin(state.qpos[0]) - running

    def at(self, x: Array) -> Any:
        """Return a state (2n + 2,) as hydrax takes it."""
        q, v = map(to_joints, np.split(x, 2))
        return self.data.replace(qpos=jnp.array(q), qvel=jnp.array(v))


def controller(problem: Problem, name: str, samples: int) -> Any:
    """Return a controller of hydrax, which makes one update a tick."""
    horizon = problem.dt * problem.horizon
    return METHODS[name](
        Pendulum(problem), samples, NOISE * problem.u_max, plan_horizon=horizon,
        spline_type='cubic', num_knots=round(KNOTS * horizon))


def costs(problem: Problem, x_0: Array, U: Array) -> Array:
    """Return what forces cost from a state, but for ℓ of that; shapes: U (S, N), -> (S,)."""
    one = controller(problem, 'MPPI', len(U))
    _, found = one.eval_rollouts(one.model, one.task.at(x_0), jnp.array(U[..., None]),
                                 jnp.zeros((len(U), one.num_knots, 1)))
    return np.asarray(found.costs.sum(axis=1), float)


def tick(problem: Problem, name: str, samples: int) -> Work:
    """Return an update from hanging, each going on from the last."""
    one = controller(problem, name, samples)
    update, state, kept = jax.jit(one.optimize), one.task.at(hanging()), [one.init_params()]

    def run() -> int:
        kept[0], _ = jax.block_until_ready(update(state, kept[0]))
        return 1
    return run


def solves(name: str) -> Callable[[Problem, float], Make]:
    """Return what makes solves of one update each, from the spline next to given forces."""
    def of(problem: Problem, tolerance: float) -> Make:
        one = controller(problem, name, SAMPLES)
        update, first, numbers = jax.jit(one.optimize), one.init_params(), count()
        t = jnp.linspace(first.tk[0], first.tk[-1], one.ctrl_steps)
        each = jnp.eye(one.num_knots)[..., None]   # what forces a knot alone makes
        spline = np.asarray(one.interp_func(t, first.tk, each))[..., 0]

        def make(guess: Guess, iterations: int) -> Solve:
            knots = np.linalg.lstsq(spline.T, guess.U)[0]

            def solve() -> tuple[Array, Array]:
                found, _ = update(one.task.at(guess.x_0), first.replace(
                    mean=jnp.array(knots[:, None]), rng=jax.random.key(next(numbers))))
                U = np.asarray(found.mean, float)[:, 0] @ spline
                return np.full((len(U) + 1, len(guess.x_0)), np.nan), U   # it keeps no states
            return solve
        return make
    return of
