# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Predictive sampling, MuJoCo MPC's planner, on our pendulum: the best of some splines of forces.

    θ ← argmin J(U(θ_k)) over k,   θ_0 = θ,   θ_k = θ + σ ε_k,   ε_k normal,   U(θ) a cubic spline

θ are the forces at equidistant knots over the horizon, of the last plan, shifted. There is one
such update a tick, no averaging, no feedback, no other start and no regulator. The samples are
followed by the kernel of our MPPI, so that time is not what they want for.

Sources: Howell et al., "Predictive Sampling: Real-time Behaviour Synthesis with MuJoCo", 2022,
arXiv:2212.00541; the settings are those of google-deepmind/mujoco_mpc: `sampling_exploration`,
`sampling_spline_points` and `agent_horizon` of mjpc/tasks/cartpole/task.xml and
mjpc/tasks/acrobot/task.xml, and where these are silent the defaults of mjpc/planners/sampling,
10 trajectories and cubic splines. Noise is a share of the largest control, as there; steps are
10 ms (`agent_timestep`), and so are ticks. The cost is ours.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
import time
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from tqdm import tqdm

from dp_swing_ros.control import controllers
from dp_swing_ros.control.starts import solved
from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.comparison import median, rate
from dp_swing_ros.evaluation.metrics import measure, Metrics, REST
from dp_swing_ros.evaluation.scenarios import PERIOD, SCENARIOS
from dp_swing_ros.kernels import kernel
from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import Array, DEFAULT_LINKS
from dp_swing_ros.problem.plan import Plan, SolverStats, Status
from dp_swing_ros.problem.problem import plan_of, Problem
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import Controller, simulate
from dp_swing_ros.solvers.noise import LANES
from dp_swing_ros.solvers.samples import follow, single
from dp_swing_ros.solvers.solver import generator, policy_of, Seed, Solver
from dp_swing_ros.tables import compact

DURATION = 10.0   # [s]
HEADER = ['controller', 'upright to the end', 'settling [s]',
          f'angle error, last {REST:g} s [rad]', 'closed-loop cost', 'solve [ms]']


@dataclass(frozen=True)
class PredictiveSamplingParameters(Parameters):
    """The samples; the defaults are those of the cart-pole."""

    samples: int = parameter(10, 'splines followed in an update, the last plan among them',
                             minimum=1, maximum=1_000_000)
    iterations: int = parameter(1, 'updates in one solve', minimum=1, maximum=1000)
    exploration: float = parameter(
        0.5, 'standard deviation of the noise at the knots, as a share of the largest force',
        minimum=0.0)
    points: int = parameter(10, 'knots of a spline', minimum=2, maximum=1000)


class PredictiveSampling:
    """The solver; see Solver. A plan has no gains."""

    Parameters = PredictiveSamplingParameters

    def __init__(self, problem: Problem, parameters: PredictiveSamplingParameters,
                 seed: Seed = 0) -> None:
        """Take the problem, and write down what forces follow from knots."""
        self.problem, self.parameters, self.random = problem, parameters, generator(seed)
        self.knots = np.linspace(0, problem.horizon, parameters.points)   # [steps]
        self.spline = splines(self.knots, np.arange(problem.horizon))

    def solve(self, x_0: Array, warm_start: Plan | None, deadline: float) -> Plan:
        """
        Return the cheapest of the splines.

        It may be worse than the warm start, which counts as its spline through the knots; past its
        end the last force is held, as there.
        """
        began, problem, parameters = time.perf_counter(), self.problem, self.parameters
        x_0, _, U, _ = policy_of(problem, x_0, warm_start)
        theta, iteration, status = np.interp(self.knots, np.arange(len(U)), U), 0, Status.COMPLETE
        while iteration < parameters.iterations:
            if time.perf_counter() > deadline:
                status = Status.DEADLINE
                break
            iteration += 1
            theta = self.best(x_0, theta)
        U = np.clip(self.spline @ theta, *problem.bounds)
        plan = plan_of(problem, rollout(problem.model, x_0, U), U, status)
        if not np.isfinite(plan.stats.cost):
            status = Status.FAILED
        return Plan(plan.X, U, plan.K, problem.dt, SolverStats(
            status, plan.stats.cost, iteration, time.perf_counter() - began))

    def best(self, x_0: Array, theta: Array) -> Array:
        """Return the best of the knots (points,) and those drawn about them."""
        sigma = np.float32(self.parameters.exploration * self.problem.u_max)
        noise = self.random.standard_normal(
            (self.parameters.samples, len(theta)), np.float32)
        noise[0] = 0
        drawn = np.clip(theta.astype(np.float32) + sigma * noise, *self.problem.bounds)
        J = costs(self.problem, x_0, self.spline, drawn)
        best = int(np.argmin(np.where(np.isfinite(J), J, np.inf)))
        return theta if best == 0 else drawn[best].astype(float)


def splines(knots: Array, at: Array) -> Array:
    """
    Return the matrix from values at equidistant knots to those of their cubic splines.

    A slope is the mean of both sides' secants. Shapes: knots (n,), at (N,) -> (N, n).
    """
    values = np.eye(len(knots))
    return CubicHermiteSpline(knots, values, np.gradient(values, knots, axis=0))(at)


def costs(problem: Problem, x_0: Array, spline: Array, drawn: Array) -> Array:
    """
    Return what the splines through knots cost from a state, in single precision.

    Shapes: x_0 (2n + 2,), spline (N, points), drawn (K, points) float32 -> (K,) float32.
    """
    blocks = -(-len(drawn) // LANES)
    padded = np.zeros((blocks * LANES, drawn.shape[1]), np.float32)
    padded[:len(drawn)] = drawn
    forces = spline.astype(np.float32) @ padded.reshape(blocks, LANES, -1).transpose(0, 2, 1)
    J = np.empty((blocks, LANES), np.float32)
    follow_all(single(problem.model), single(problem.cost), x_0.astype(np.float32), forces,
               single(problem.bounds), J)
    return J.reshape(-1)[:len(drawn)]


@kernel
def follow_all(model, cost, x_0, forces, bounds, J):
    """Write the costs J (blocks, LANES) of forces (blocks, N, LANES), all in single precision."""
    N = forces.shape[1]
    no_offsets, no_gains = np.zeros(N, np.float32), np.zeros((N, len(x_0)), np.float32)
    ones, scratch = np.ones(LANES, np.float32), np.empty((len(x_0) + 3, LANES), np.float32)
    V = np.empty((N, LANES), np.float32)
    for block in range(len(forces)):
        follow(model, cost, x_0, no_offsets, no_gains, forces[block], ones, np.float32(0), bounds,
               scratch, V, J[block])


class Replanning:
    """A controller that solves at every tick from what is left of its last plan alone."""

    def __init__(self, problem: Problem, solver: Solver) -> None:
        """Begin with no force."""
        self.problem, self.solver, self.began = problem, solver, 0.0
        self.last: Plan | None = None

    def update(self, t: float, x: Array, delay: float) -> Plan:
        """Return the plan from the measured state on; see Controller.update."""
        if self.last is None:
            U = np.zeros(self.problem.horizon)
            left = plan_of(self.problem, rollout(self.problem.model, x, U), U, Status.COMPLETE)
        else:
            left = self.last.shifted(t + delay - self.began)
        self.last, self.began = solved(self.solver, self.problem, x, left, np.inf), t + delay
        return self.last

    def fallback(self, begins: float) -> Plan:
        """Return what is left of the last plan; see Controller.fallback."""
        assert self.last is not None
        return self.last.shifted(begins - self.began)


class Contender(NamedTuple):
    """What makes a controller for a seed, how long a tick is [s], and of which pendulum."""

    controller: Callable[[int], Controller]
    tick: float = PERIOD
    links: int = DEFAULT_LINKS


def replanning(horizon: float, step: float = PERIOD, links: int = DEFAULT_LINKS,
               **parameters: Any) -> Contender:
    """Return predictive sampling with a horizon and a step [s], which is a tick, too."""
    problem = controllers.problem({
        'links': links, 'step': step, 'horizon': round(horizon / step)})

    def controller(seed: int) -> Controller:
        return Replanning(problem, PredictiveSampling(
            problem, PredictiveSamplingParameters(**parameters), seed))
    return Contender(controller, step, links)


def contenders() -> dict[str, Contender]:
    """
    Return predictive sampling, and our solvers with their defaults.

    First as published, on one link, which is what it was made for, and on two; then with our step,
    tick and horizon, and with more samples: in some milliseconds, as our ticks, and in most of a
    tick.
    """
    return {
        'one link, as for the cart-pole': replanning(1.0, 0.01, links=1),
        'one link, 1024 samples': replanning(1.0, 0.01, links=1, samples=1024),
        'as for the cart-pole': replanning(1.0, 0.01),
        'as for the acrobot': replanning(2.0, 0.01, exploration=0.05),
        'our steps': replanning(1.5),
        'our steps, 1024 samples': replanning(1.5, samples=1024),
        'our steps, 8192 samples': replanning(1.5, samples=8192),
        'our steps, 32768 samples': replanning(1.5, samples=32768),
        **{name: Contender(partial(ours, name)) for name in ('ilqr', 'mppi')}}


def ours(name: str, seed: int) -> Controller:
    """Return our controller with a solver."""
    return controllers.controller({'solver': name, 'seed': seed})


def episodes(scenario: str, seeds: range, contender: Contender) -> list[Metrics]:
    """Play a scenario with every seed; the costs are as if at our ticks."""
    found, rate = list[Metrics](), 1 / contender.tick
    for case in SCENARIOS[scenario].cases(scenario, seeds, None, DURATION, contender.links):
        plant = plants.plant({'links': contender.links, **case.plant, 'seed': case.seed,
                              'rate': rate})
        with np.errstate(all='ignore'):   # what leaves the numbers shows in the outcome
            metrics = measure(simulate(plant, contender.controller(case.seed), case.duration))
        found.append(replace(metrics, closed_loop_cost=metrics.closed_loop_cost
                             * contender.tick / PERIOD))
    return found


def row(name: str, found: Sequence[Metrics]) -> list[str]:
    """Return a row of HEADER, with medians and their intervals (bootstrap)."""
    def middle(values: Sequence[float], digits: int = 0) -> str:
        of = median(np.array(values))
        return f'{of.value:.{digits}f} ({of.low:.{digits}f}-{of.high:.{digits}f})'
    held = [metrics for metrics in found if metrics.success]
    return [name, share(rate([metrics.success for metrics in found])),
            middle([metrics.settling_time for metrics in held], 2) if held else '-',
            middle([metrics.hold_error for metrics in found], 4),
            middle([metrics.closed_loop_cost for metrics in found]),
            f'{1e3 * np.median([metrics.median_solve_time for metrics in found]):.2f}']


def main() -> None:
    """Print the table of some scenarios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--scenarios', nargs='+', default=['hanging', 'random'],
                        choices=sorted(SCENARIOS))
    parser.add_argument('--seeds', type=int, default=20)
    parser.add_argument('--only', nargs='+', choices=(everyone := contenders()))
    arguments = parser.parse_args()
    for scenario in arguments.scenarios:
        rows = [row(name, episodes(scenario, range(arguments.seeds), everyone[name]))
                for name in tqdm(arguments.only or everyone, desc=scenario, disable=None)]
        print(f'{scenario}:\n', compact([HEADER, *rows]), sep='\n', flush=True)


if __name__ == '__main__':
    main()
