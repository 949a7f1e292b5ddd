# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Whole solves of the default problem to the same cost: ours, and those of all peers.

    the time until J(X, U) ≤ (1 + CLOSE) · (the least J that any contender ends at)

Every contender starts from the same state and trajectory, and stops after the fewest iterations
that bring it there. J is what a plan comes to when it is followed by the model: its forces alone,
or with the gains of the regulator about its states, whichever is less, for with multiple shooting
these may not follow from each other. Cold starts are states of the scenario `random`, and hanging,
with random forces; warm ones lie along closed loops from these, driven by ilqr and ddp in turn,
each disturbed, with the last plan.
"""

from collections.abc import Callable, Iterable
from functools import partial
import math
from typing import Any, NamedTuple

import numpy as np
from peers_casadi import Guess, Make, OPTIONS, Program, Solve, TOLERANCE
from peers_gradient import OURS, peers
from timing import has, median, race, Work

from dp_swing_ros.evaluation.comparison import rate
from dp_swing_ros.evaluation.scenarios import SCENARIOS
from dp_swing_ros.pendulum.derivatives import expand
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import Array, hanging
from dp_swing_ros.problem.cost import trajectory_cost
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import plan_of, policy_rollout, Problem, Rollout
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.solvers.riccati import backward

CLOSE = 1e-6          # of the least cost that any ends at
ITERATIONS = 500      # after which nobody gets any further
STARTS = 200          # of each kind
TAKEN = (1, 25, 50, 75)   # ticks of a closed loop that warm starts are taken from
LEAST = 3             # starts that a ratio is given of
FORCE = 10.0          # [N] bound of the random forces of a cold start
DISTURBANCE = np.array([0.005, 0.01, 0.01, 0.05, 0.1, 0.1])   # standard deviations along the loop
FINER = 1.25          # by how much more iterations are tried


def cold(problem: Problem) -> list[Guess]:
    """Return hanging and random states, each with random forces that are followed."""
    cases = SCENARIOS['random'].cases('random', range(STARTS - 1), None, 0.0)
    states = [hanging(), *(np.array(case.plant['initial_state']) for case in cases)]
    draws = np.random.default_rng(0).uniform(-FORCE, FORCE, (STARTS, problem.horizon))
    return [Guess(x, rollout(problem.model, x, U), U) for x, U in zip(states, draws)]


def warm(problem: Problem) -> list[Guess]:
    """Return disturbed states along closed loops, and the last plan from there."""
    drivers = [SOLVERS[name](problem, SOLVERS[name].Parameters(iterations=ITERATIONS))
               for name in OURS]
    random, guesses = np.random.default_rng(0), list[Guess]()
    for number, start in enumerate(cold(problem)[:math.ceil(STARTS / len(TAKEN))]):
        solver = drivers[number % len(drivers)]
        plan = solver.solve(start.x_0, guess_plan(problem, start), np.inf)
        for tick in range(1, TAKEN[-1] + 1):
            x = plan.X[1] + random.normal(0, DISTURBANCE)
            _, X, U, _ = policy_rollout(problem, x, plan.X[1:], plan.U[1:], plan.K[1:])
            guess = Guess(x, X, U)
            if tick in TAKEN:
                guesses.append(guess)
            plan = solver.solve(x, guess_plan(problem, guess), np.inf)
    return guesses[:STARTS]


def guess_plan(problem: Problem, guess: Guess) -> Any:
    """Return a guess as a plan of ours."""
    return plan_of(problem, guess.X, guess.U, Status.COMPLETE)


def ours(problem: Problem, name: str) -> Make:
    """Return solves of ours."""
    def make(guess: Guess, iterations: int) -> Solve:
        solver = SOLVERS[name](problem, SOLVERS[name].Parameters(
            iterations=iterations, tolerance=TOLERANCE))
        plan = guess_plan(problem, guess)

        def solve() -> tuple[Array, Array]:
            found = solver.solve(guess.x_0, plan, np.inf)
            return found.X, found.U
        return solve
    return make


def casadi(problem: Problem, tolerance: float, name: str) -> Make:
    """Return solves of CasADi."""
    program = Program(problem, name, tolerance)
    return lambda guess, iterations: partial(program.solve, guess, iterations)


def others() -> dict[str, Callable[[Problem, float], Make]]:
    """
    Return by name what makes the solves of a peer, of those that are installed.

    They take a problem, and the tolerance that the peer itself is given.
    """
    found = {name: of for peer in peers() for name, of in peer.SOLVES.items()}
    if has('casadi'):
        found |= {f'casadi {name}': partial(casadi, name=name) for name in OPTIONS}
    return found


def gains(problem: Problem, X: Array, U: Array) -> Array:
    """Return the gains (N, 2n + 2) of the regulator about a trajectory; no peer hands out any."""
    K = np.empty((len(U), X.shape[1]))
    backward(problem.model, problem.cost, expand(problem.model, X, U), X, U, X[:0],
             problem.bounds, 0.0, None, U[:0].copy(), K)
    return K


def followed(problem: Problem, x_0: Array, X: Array, U: Array) -> Rollout:
    """Return what a plan comes to, without feedback or with; the cost is ∞ where it is none."""
    U = np.clip(U, *problem.bounds)
    alone = rollout(problem.model, x_0, U)
    J = trajectory_cost(problem.cost, alone, U)
    found = Rollout(J if np.isfinite(J) else np.inf, alone, U, np.zeros_like(X[1:]))
    if not np.all(np.isfinite(X)) or np.array_equal(X, alone):
        return found
    held = policy_rollout(problem, x_0, X, U, gains(problem, X, U))
    return held if held.J < found.J else found


class Reach(NamedTuple):
    """How a contender fared from one start."""

    end: float                # the cost after ITERATIONS
    iterations: int | None    # the fewest to the goal, None where it ends elsewhere


def reached(problem: Problem, makes: dict[str, Make], guess: Guess) -> dict[str, Reach]:
    """Return how all fare from a start; nothing where that is at the goal already."""
    def cost(make: Make, iterations: int) -> float:
        return followed(problem, guess.x_0, *make(guess, iterations)()).J
    ends = {name: cost(make, ITERATIONS) for name, make in makes.items()}
    goal = (1 + CLOSE) * min(ends.values())
    if trajectory_cost(problem.cost, guess.X, guess.U) <= goal:
        return {}
    return {name: Reach(ends[name], fewest(lambda count, by=make: cost(by, count) <= goal)
                        if ends[name] <= goal else None)
            for name, make in makes.items()}


def fewest(reaches: Callable[[int], bool], most: int = ITERATIONS) -> int:
    """
    Return the fewest iterations that reach a goal, which `most` do: ever more, then bisected.

    Few more at a time: what some reach, more need not where the cost goes up in between.
    """
    low, high = 0, 1
    while high < most and not reaches(high):
        low, high = high, min(max(high + 1, int(FINER * high)), most)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if reaches(middle) else (middle, high)
    return high


def solves(problem: Problem, rounds: int) -> dict[str, dict[str, Any]]:
    """Return by kind of start how often each contender reaches the goal, and how fast."""
    found, makes = {}, {**{name: ours(problem, name) for name in OURS},
                        **{name: of(problem, TOLERANCE) for name, of in others().items()}}
    for kind, guesses in (('cold', cold(problem)), ('warm', warm(problem))):
        each, times = list[dict[str, Reach]](), list[dict[str, Any]]()
        for guess in guesses:
            if not (fared := reached(problem, makes, guess)):
                continue
            each.append(fared)
            times.append(race({
                name: work(makes[name](guess, of.iterations))
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
