# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which starts near the goal can be held at all: an oracle that no solver of ours has a part in.

    min Σ (eᵀ S e + R u²),  e = x - x_r
    s.t. x⁺ = the plant's own steps,  |u| ≤ u_max,  |x| ≤ track,  |θ| ≤ 0.4,  x_N upright, at rest

IPOPT solves it over both states and forces, from guesses that differ in where the cart goes. A
start counts as one that can be held only where the plant, driven by the forces that were found and
then regulated, is held by the measures of any other run. Where nothing is found, something may
still be there.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from joblib import delayed, Parallel
import numpy as np
import pandas as pd
from peers_casadi import functions
import stamp
from tqdm import tqdm

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.baselines import stabilised, TVLQR
from dp_swing_ros.evaluation.campaign.report import share, spans
from dp_swing_ros.evaluation.campaign.summary import DROP, NEAR_GOAL
from dp_swing_ros.evaluation.comparison import rate
from dp_swing_ros.evaluation.metrics import measure, Metrics
from dp_swing_ros.evaluation.scenarios import Case, SCENARIOS
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import plan_of, Problem
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.simulation.plant import Plant
from dp_swing_ros.tables import compact

DURATION = 10.0               # [s]
PERIOD = 0.05                 # [s] of a step
ENDS = (0.0, 2.2, -2.2)       # [m] where the cart goes in a guess
SPARE = 1e-4                  # [rad] from the bound, for rounding
SHORT = 5e-3                  # [m] from the ends of the track, for what is between two steps
ITERATIONS = 150              # four times what those take that succeed
OPTIONS: dict[str, Any] = {
    'ipopt.print_level': 0, 'ipopt.sb': 'yes', 'ipopt.tol': 1e-9, 'print_time': False,
    'error_on_fail': False}


class Aim(NamedTuple):
    """What a trajectory is to do; by default, to hold what starts near the goal."""

    steps: int = 80                  # of PERIOD until it is at rest
    angle: float = DROP - SPARE      # [rad] the largest on the way
    to_centre: bool = False          # whether the cart is there in the end
    share: float = 1.0               # of the force that it may use; the rest is left for feedback
    iterations: int = ITERATIONS     # of IPOPT


AIM = Aim()


def cases() -> list[Case]:
    """Return the starts."""
    return list(SCENARIOS[NEAR_GOAL].cases(NEAR_GOAL, None, None, DURATION))


class Verdict(NamedTuple):
    """What was found of a start; not a number where nothing was."""

    seed: int
    held: bool
    guesses: int              # that were tried
    iterations: int           # of IPOPT in all of them
    angle: float              # [rad] the largest on the way
    position: float           # [m]
    force: float              # [N]
    cost: float               # Σℓ of the run, as that of any other


class Program:
    """The nonlinear program, made once for all starts and pushes."""

    def __init__(self, problem: Problem, plant: Plant, aim: Aim = AIM) -> None:
        """Write down variables, constraints and cost."""
        import casadi as ca

        N, h = aim.steps, plant.parameters.physics_step
        step = functions(controllers.problem({'step': h}).with_physical(plant.physical))[0]
        x, u = ca.SX.sym('x', 6), ca.SX.sym('u')
        after = x
        for _ in range(round(PERIOD / h)):
            after = step(after, u)
        period = ca.Function('period', [x, u], [after]).map(N)
        X, U = ca.MX.sym('X', 6, N + 1), ca.MX.sym('U', 1, N)
        x_0, pushes = ca.MX.sym('x_0', 6), ca.MX.sym('pushes', 1, N)
        J = (ca.dot(ca.repmat(ca.DM(problem.cost.S), 1, N), X[:, :-1] ** 2)
             + problem.cost.R * ca.dot(U, U))
        program: Any = {
            'x': ca.vertcat(ca.vec(X), ca.vec(U)), 'p': ca.vertcat(x_0, pushes.T), 'f': J,
            'g': ca.vertcat(X[:, 0] - x_0, ca.vec(X[:, 1:] - period(X[:, :-1], U + pushes)),
                            X[0 if aim.to_centre else 1:, N])}
        self.solver = ca.nlpsol('oracle', 'ipopt', program, {
            **OPTIONS, 'ipopt.max_iter': aim.iterations})
        bound = [plant.limits.track_limit - SHORT, aim.angle, aim.angle, np.inf, np.inf, np.inf]
        self.N = N
        self.bounds = np.append(np.tile(bound, N + 1),
                                np.full(N, aim.share * plant.limits.force_limit))

    def solve(self, x_0: Array, guess: Array, pushes: Sequence[float] = ()
              ) -> tuple[Array, Array, int]:
        """
        Return states and forces that IPOPT ends at, and how many iterations it took.

        Shapes: x_0 (6,), guess (N + 1, 6) of the states, pushes [N] one a step, none without.
        """
        N = self.N
        known = np.array(pushes[:N]) if pushes else np.zeros(N)
        found = np.array(self.solver(
            x0=np.append(guess, np.zeros(N)), p=np.append(x_0, known), lbx=-self.bounds,
            ubx=self.bounds, lbg=0, ubg=0)['x']).ravel()
        return found[:-N].reshape(N + 1, 6), found[-N:], self.solver.stats()['iter_count']


def straight(x_0: Array, end: float) -> Array:
    """Return a guess: upright in a quarter of the time, the cart at an end [m] in half of it."""
    time = np.linspace(0, 1, AIM.steps + 1)[:, None]
    X = x_0 * (1 - np.minimum(4 * time, 1))
    X[:, 0] = end * np.minimum(2 * time[:, 0], 1)
    return X


def plant_of(case: Case) -> Plant:
    """Return the plant of a case."""
    return plants.plant({**case.told, **case.plant})


def is_held(metrics: Metrics) -> bool:
    """Return whether a run near the goal is held, without a strike and without being dropped."""
    return metrics.success and metrics.largest_angle <= DROP


def judged(cases: Sequence[Case]) -> list[Verdict]:
    """Return the verdicts of some starts."""
    problem, plant = controllers.problem({}), plants.plant({})
    program = Program(problem, plant)
    return [verdict(problem, program, case) for case in cases]


def verdict(problem: Problem, program: Program, case: Case) -> Verdict:
    """Search for a trajectory that holds a start, and try it on the plant."""
    x_0, iterations = np.array(case.plant['initial_state']), 0
    for guesses, end in enumerate(ENDS, 1):
        X, U, count = program.solve(x_0, straight(x_0, end))
        iterations += count
        metrics = tried(problem, case, X, U)
        if metrics is not None:
            return Verdict(case.seed, True, guesses, iterations, metrics.largest_angle,
                           metrics.largest_position, metrics.largest_force,
                           metrics.closed_loop_cost)
    return Verdict(case.seed, False, len(ENDS), iterations, *[np.nan] * 4)


def tried(problem: Problem, case: Case, X: Array, U: Array,
          holds: Callable[[Metrics], bool] = is_held) -> Metrics | None:
    """Return the metrics of the plant on a trajectory; None where that does not hold it."""
    reference = stabilised(problem, plan_of(problem, X, U, Status.COMPLETE))
    controller = TVLQR(problem, reference)
    controller.joined = 0.0
    pushes = np.array(case.pushes) if case.pushes else None
    metrics = measure(simulate(plant_of(case), controller, case.duration, pushes=pushes))
    return metrics if holds(metrics) else None


def page(verdicts: Sequence[Verdict], made: str) -> str:
    """Return the page."""
    held, others = ([one for one in verdicts if one.held is wanted] for wanted in (True, False))

    def counted(some: Sequence[Verdict]) -> tuple[str, str]:
        iterations = [one.iterations for one in some]
        return (share(rate([one in some for one in verdicts])),
                f'{np.median(iterations):.0f} ({max(iterations)})')
    rows = [('start', 'how many', 'IPOPT: iterations, median (largest)', 'angle on the way [rad]',
             'largest position [m]', 'closed-loop cost, median (largest)', 'seeds'),
            ('can be held', *counted(held), f'{max(one.angle for one in held):.3f}',
             f'{max(one.position for one in held):.2f}',
             f'{np.median([one.cost for one in held]):.0f} ({max(one.cost for one in held):.0f})',
             spans(one.seed for one in held)),
            ('none found', *counted(others), '-', '-', '-', spans(one.seed for one in others))]
    return '\n'.join([
        '# What can be held near the goal\n', made,
        'An oracle that shares no solver with us says which of the starts of '
        '[near the goal](near_goal.md) can be held at all. For each, IPOPT (by CasADi) seeks '
        f'{AIM.steps} forces of 50 ms, at most 20 N, with which steps of 5 ms, those of the '
        f'plant, lead to rest upright while both angles stay within {DROP:g} rad and the cart on '
        f'its track, from {len(ENDS)} guesses that differ in where the cart goes '
        f'({", ".join(f"{end:g}" for end in ENDS)} m). What it finds is then played on the plant '
        f'over {DURATION:g} s, followed by a TVLQR and then regulated, and counts only where that '
        'is held without a strike. Where nothing was found, every guess had ended where the '
        'constraints can locally not be met, or had taken '
        f'{ITERATIONS} iterations. That is no proof. The rows: '
        '[oracle.csv.gz](oracle.csv.gz).\n',
        compact(rows), ''])


def read(path: Path) -> list[Verdict]:
    """Return stored verdicts."""
    return [Verdict(*row) for row in pd.read_csv(path).itertuples(index=False)]


def main() -> None:
    """Judge all starts and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--docs', type=Path, default=stamp.TOP / 'docs')
    parser.add_argument('--jobs', type=int, default=-1)
    arguments = parser.parse_args()
    starts = cases()
    with tqdm(total=len(starts), unit='start', disable=None) as bar:
        verdicts = list[Verdict]()
        for some in Parallel(arguments.jobs, return_as='generator')(
                delayed(judged)(starts[n:n + 5]) for n in range(0, len(starts), 5)):
            verdicts += some
            bar.update(len(some))
    results = arguments.docs / 'results'
    stamp.store_table(pd.DataFrame(verdicts), results / 'oracle.csv.gz')
    (results / 'oracle.md').write_text(page(verdicts, stamp.made(
        'oracle', stamp.sources('oracle'),
        ('numpy', 'scipy', 'casadi'))), encoding='utf-8')


if __name__ == '__main__':
    main()
