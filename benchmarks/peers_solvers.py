# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Whole solves of the default problem to the same cost: ours, and those of all peers.

    the time until J(U) ≤ (1 + CLOSE) · (the least J that any contender ends at)

Every contender starts from the same state and trajectory, and stops after the fewest iterations
that bring it there; J is the cost of its forces, followed by the model. Cold starts are states of
the scenario `random`, and hanging, with random forces; warm ones lie along closed loops from
these, each disturbed, with the last plan.
"""

from collections.abc import Callable, Iterable
from functools import partial
import math
from typing import Any, NamedTuple

import numpy as np
from peers_casadi import Guess, OPTIONS, Program, TOLERANCE
from peers_gradient import peers
from timing import has, median, race, Work

from dp_swing_ros.evaluation.comparison import rate
from dp_swing_ros.evaluation.scenarios import SCENARIOS
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import Array, hanging
from dp_swing_ros.problem.cost import trajectory_cost
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import plan_of, policy_rollout, Problem
from dp_swing_ros.solvers import SOLVERS

CLOSE = 1e-6          # of the least cost that any ends at
ITERATIONS = 500      # after which nobody gets any further
STARTS = 200          # of each kind
TICKS = 20            # of a closed loop that warm starts lie along
LEAST = 3             # starts that a ratio is given of
FORCE = 10.0          # [N] bound of the random forces of a cold start
DISTURBANCE = np.array([0.005, 0.01, 0.01, 0.05, 0.1, 0.1])   # standard deviations along the loop
OURS = ('ilqr', 'ddp')

Solve = Callable[[], Array]                    # returns forces (N,)
Make = Callable[[Guess, bool, int], Solve]     # from a guess, warm or not, in so many iterations


def cold(problem: Problem) -> list[Guess]:
    """Return hanging and random states, each with random forces that are followed."""
    cases = SCENARIOS['random'].cases('random', range(STARTS - 1), None, 0.0)
    states = [hanging(), *(np.array(case.plant['initial_state']) for case in cases)]
    draws = np.random.default_rng(0).uniform(-FORCE, FORCE, (STARTS, problem.horizon))
    return [Guess(x, rollout(problem.model, x, U), U) for x, U in zip(states, draws)]


def warm(problem: Problem) -> list[Guess]:
    """Return disturbed states along closed loops, and the last plan from there."""
    solver = SOLVERS['ilqr'](problem, SOLVERS['ilqr'].Parameters(iterations=ITERATIONS))
    random, guesses = np.random.default_rng(0), list[Guess]()
    for start in cold(problem)[:math.ceil(STARTS / TICKS)]:
        plan = solver.solve(start.x_0, guess_plan(problem, start), np.inf)
        for _ in range(min(TICKS, STARTS - len(guesses))):
            x = plan.X[1] + random.normal(0, DISTURBANCE)
            _, X, U, _ = policy_rollout(problem, x, plan.X[1:], plan.U[1:], plan.K[1:])
            guesses.append(Guess(x, X, U))
            plan = solver.solve(x, guess_plan(problem, guesses[-1]), np.inf)
    return guesses


def guess_plan(problem: Problem, guess: Guess) -> Any:
    """Return a guess as a plan of ours."""
    return plan_of(problem, guess.X, guess.U, Status.COMPLETE)


def ours(problem: Problem, name: str) -> Make:
    """Return solves of ours."""
    def make(guess: Guess, warm: bool, iterations: int) -> Solve:
        solver = SOLVERS[name](problem, SOLVERS[name].Parameters(
            iterations=iterations, tolerance=TOLERANCE))
        plan = guess_plan(problem, guess)
        return lambda: solver.solve(guess.x_0, plan, np.inf).U
    return make


def casadi(problem: Problem, name: str) -> Make:
    """Return solves of CasADi."""
    program = Program(problem, name)
    return lambda guess, warm, iterations: partial(program.solve, guess, warm, iterations)


def others() -> dict[str, Callable[[Problem], Make]]:
    """Return by name what makes the solves of a peer, of those that are installed."""
    found = {name: of for peer in peers() for name, of in peer.SOLVES.items()}
    if has('casadi'):
        found |= {f'casadi {name}': partial(casadi, name=name) for name in OPTIONS}
    return found


class Reach(NamedTuple):
    """How a contender fared from one start."""

    end: float                # the cost after ITERATIONS
    iterations: int | None    # the fewest to the goal, None where it ends elsewhere


def reached(problem: Problem, makes: dict[str, Make], guess: Guess,
            is_warm: bool) -> dict[str, Reach]:
    """Return how all fare from a start; nothing where that is at the goal already."""
    def cost(make: Make, iterations: int) -> float:
        U = np.clip(make(guess, is_warm, iterations)(), -problem.u_max, problem.u_max)
        J = trajectory_cost(problem.cost, rollout(problem.model, guess.x_0, U), U)
        return J if np.isfinite(J) else np.inf
    ends = {name: cost(make, ITERATIONS) for name, make in makes.items()}
    goal = (1 + CLOSE) * min(ends.values())
    if trajectory_cost(problem.cost, guess.X, guess.U) <= goal:
        return {}
    return {name: Reach(ends[name], fewest(lambda count, by=make: cost(by, count) <= goal)
                        if ends[name] <= goal else None)
            for name, make in makes.items()}


def fewest(reaches: Callable[[int], bool], most: int = ITERATIONS) -> int:
    """Return the fewest iterations that reach a goal, which `most` do: doubled, then bisected."""
    low, high = 0, 1
    while high < most and not reaches(high):
        low, high = high, min(2 * high, most)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if reaches(middle) else (middle, high)
    return high


def solves(problem: Problem, rounds: int) -> dict[str, dict[str, Any]]:
    """Return by kind of start how often each contender reaches the goal, and how fast."""
    found, makes = {}, {**{name: ours(problem, name) for name in OURS},
                        **{name: of(problem) for name, of in others().items()}}
    for kind, guesses in (('cold', cold(problem)), ('warm', warm(problem))):
        is_warm, each, times = kind == 'warm', list[dict[str, Reach]](), list[dict[str, Any]]()
        for guess in guesses:
            if not (fared := reached(problem, makes, guess, is_warm)):
                continue
            each.append(fared)
            times.append(race({
                name: work(makes[name](guess, is_warm, of.iterations))
                for name, of in fared.items() if of.iterations is not None}, rounds))
        found[kind] = summary(makes, each, times)
    return found


def work(solve: Solve) -> Work:
    """Return a solve as what is timed."""
    def run() -> int:
        solve()
        return 1
    return run


def summary(names: Iterable[str], each: list[dict[str, Reach]],
            times: list[dict[str, Array]]) -> dict[str, Any]:
    """
    Return what is left of the starts: of each contender a rate, a median time [s], and ratios.

    A ratio is that of the median times from a start that both reach the goal from; of all these,
    the median with the interval of the bootstrap over starts, none where they are too few.
    """
    rows: dict[str, Any] = {}
    for name in names:
        typical = [{other: float(np.median(t)) for other, t in of_start.items()}
                   for of_start in times if name in of_start]
        ratios = {our: [t[name] / t[our] for t in typical if our in t] for our in OURS}
        rows[name] = {
            'reached': rate([of[name].iterations is not None for of in each])._asdict(),
            'seconds': median(np.array([t[name] for t in typical]))._asdict() if typical else None,
            'iterations': [of[name].iterations for of in each],
            'end': [of[name].end for of in each],
            'ratios': {our: {**median(np.array(some))._asdict(), 'starts': len(some)}
                       for our, some in ratios.items() if len(some) >= LEAST}}
    return rows
