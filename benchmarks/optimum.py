# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The least cost of a whole swing-up: a nonlinear program that no solver of ours has a part in.

    min Σ ℓ(x_t, u_t) + ℓ_f(x_N)   over x_0 ... x_N, u_0 ... u_{N-1}
    s.t.   x_{t+1} = the plant's own steps,   x_0 given,   |u_t| ≤ u_max,   |x| ≤ track

ℓ is what `closed_loop_cost` sums over a run, ℓ_f the value of the regulator that goes on from
there. IPOPT solves it over both states and forces, from guesses that differ in where random forces
lead in the first second or so, and with that in the turn and the side on which it is upright; from
then on a guess is upright, at rest. What it finds counts where the plant, driven by the forces and
then regulated, has that cost over the whole run. It is a local optimum: the least known, no bound.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
import tempfile
from typing import Any, NamedTuple

from joblib import delayed, Parallel
import numpy as np
from oracle import SHORT
import pandas as pd
from peers_casadi import compiled, functions
import stamp
from tqdm import tqdm

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.baselines import stabilised, TVLQR
from dp_swing_ros.evaluation.campaign.report import number, share, spans
from dp_swing_ros.evaluation.comparison import median, rate
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.evaluation.scenarios import Case, SCENARIOS
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import plan_of, Problem, turns_of
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.tables import compact

SEEDS = range(1000, 1050)     # held out: nothing was chosen by them
DURATION = 10.0               # [s]
N = 90                        # steps of 50 ms, until nothing is left but to hold it
RISES = range(10, 28)         # steps of a guess until it is upright, in turn
HELD = 5                      # steps for which a random force is held
GUESSES = 54
ITERATIONS = 150              # twice what nearly all those take that converge
SAME = 1e-3                   # of the cost: the same optimum, and the same on the plant
OPTIONS: dict[str, Any] = {
    'ipopt.print_level': 0, 'ipopt.sb': 'yes', 'ipopt.tol': 1e-6, 'ipopt.max_iter': ITERATIONS,
    'print_time': False, 'error_on_fail': False}


def cases() -> list[Case]:
    """Return the starts."""
    return list(SCENARIOS['random'].cases('random', SEEDS, None, DURATION))


class Optimum(NamedTuple):
    """What was found of a start; no number, and guess -1, where nothing was."""

    seed: int
    cost: float               # over the run, on the plant
    program: float            # as the program has it
    converged: int            # guesses
    same: int                 # of them, that end at this cost
    iterations: int           # of IPOPT, of all guesses
    guess: int                # that led there first


class Found(NamedTuple):
    """Where IPOPT ended from one guess."""

    converged: bool
    cost: float
    X: Array                  # (N + 1, 6)
    U: Array                  # (N,) [N]
    iterations: int


def solver(given: Any) -> Any:
    """Return IPOPT for a program, or for the library of one."""
    import casadi as ca

    return ca.nlpsol('optimum', 'ipopt', given, OPTIONS)


def program() -> dict[str, Any]:
    """Write down variables, constraints and cost."""
    import casadi as ca

    problem, h = controllers.problem({}), plants.plant({}).parameters.physics_step
    step = functions(controllers.problem({'step': h}))[0]
    _, running, terminal = functions(problem)
    x, u = ca.MX.sym('x', 6), ca.MX.sym('u')
    after = x
    for _ in range(round(problem.dt / h)):
        after = step(after, u)      # a call, so that there is C code of one step alone
    period = ca.Function('period', [x, u], [after]).map(N)
    X, U, x_0 = ca.MX.sym('X', 6, N + 1), ca.MX.sym('U', 1, N), ca.MX.sym('x_0', 6)
    return {'x': ca.vertcat(ca.vec(X), ca.vec(U)), 'p': x_0,
            'f': ca.sum2(running.map(N)(X[:, :-1], U)) + terminal(X[:, -1]),
            'g': ca.vertcat(X[:, 0] - x_0, ca.vec(X[:, 1:] - period(X[:, :-1], U)))}


def guess(problem: Problem, case: Case, number: int) -> tuple[Array, Array]:
    """Return states and forces: random forces, then upright on the turn to which they led."""
    random, rise = np.random.default_rng((case.seed, number)), RISES[number % len(RISES)]
    X, U, x_0 = np.zeros((N + 1, 6)), np.zeros(N), np.array(case.plant['initial_state'])
    forces = random.uniform(-problem.u_max, problem.u_max, -(-rise // HELD))
    U[:rise] = np.repeat(forces, HELD)[:rise]
    X[:rise + 1] = rollout(problem.model, x_0, U[:rise])
    X[rise:] = problem.x_r + turns_of(problem, X[rise])
    return X, U


def solved(problem: Problem, ipopt: Any, case: Case, X: Array, U: Array) -> Found:
    """Let IPOPT go on from a guess."""
    track = plants.plant({}).limits.track_limit - SHORT
    bounds = np.append(np.tile([track] + 5 * [np.inf], N + 1), np.full(N, problem.u_max))
    found = ipopt(x0=np.append(X, U), p=case.plant['initial_state'], lbx=-bounds, ubx=bounds,
                  lbg=0, ubg=0)
    z, stats = np.array(found['x']).ravel(), ipopt.stats()
    return Found(stats['success'], float(found['f']), z[:-N].reshape(N + 1, 6), z[-N:],
                 stats['iter_count'])


def played(problem: Problem, case: Case, found: Found) -> float:
    """Return the cost of a run of the plant by the forces that were found, NaN if not held."""
    plan = plan_of(problem, found.X, found.U, Status.COMPLETE)
    controller = TVLQR(problem, stabilised(problem, plan))
    controller.joined = 0.0
    metrics = measure(simulate(plants.plant(case.plant), controller, case.duration))
    return metrics.closed_loop_cost if metrics.success else np.nan


def optimum(library: str, case: Case, guesses: int = GUESSES) -> Optimum:
    """Return the best of what is found of a start."""
    problem, ipopt = controllers.problem({}), solver(library)
    all_found = [solved(problem, ipopt, case, *guess(problem, case, n)) for n in range(guesses)]
    iterations = sum(found.iterations for found in all_found)
    converged = sorted((found.cost, n) for n, found in enumerate(all_found) if found.converged)
    for J, n in converged:
        cost = played(problem, case, all_found[n])
        if abs(cost / J - 1) <= SAME:
            same = [other for other, _ in converged if abs(other / J - 1) <= SAME]
            return Optimum(case.seed, cost, J, len(converged), len(same), iterations, n)
    return Optimum(case.seed, np.nan, np.nan, len(converged), 0, iterations, -1)


def page(optima: Sequence[Optimum], made: str) -> str:
    """Return the page."""
    table = pd.DataFrame(optima)
    known = table[table.cost.notna()]

    def line(name: str, values: pd.Series, digits: int) -> tuple[str, ...]:
        of = median(values.to_numpy(dtype=float))
        return (name, f'{number(of.value, digits)} ({number(of.low, digits)} to '
                f'{number(of.high, digits)})', number(values.min(), digits),
                number(values.max(), digits))
    apart = (known.cost / known.program - 1).abs()
    once = known[known.same == 1]
    return '\n'.join([
        '# The least cost of a swing-up\n', made,
        'What a whole run costs at least, as far as is known, without a part of any solver of '
        f'ours: for each of the random starts of seeds {spans(table.seed)}, IPOPT (by CasADi) '
        f'minimises the closed-loop cost Σℓ of [evaluate](../evaluation.md) over {N} forces of '
        '50 ms, at most 20 N, by steps of 5 ms, those of the plant, the value of the regulator at '
        f'the end. There are {GUESSES} guesses for each, of random forces for {RISES[0]} to '
        f'{RISES[-1]} periods, then upright. What is found is played on the plant for '
        f'{DURATION:g} s, followed by a TVLQR and then regulated, and counts only where that is '
        f'held without a strike, at the same cost within {100 * SAME:g} %. Each is a local '
        'optimum, no lower bound. The rows: [optimum.csv.gz](optimum.csv.gz).\n',
        f'An optimum was found, and played, of {share(rate(table.cost.notna().tolist()))} starts; '
        f'the plant and the program differ by {apart.max():.1e} of the cost at most. More than '
        f'one guess led to it in {share(rate((known.same > 1).tolist()))}'
        + (f'; only one in seeds {spans(once.seed)}' if len(once) else '') + '.\n',
        compact([
            ('of a start', 'median (95 %, bootstrap)', 'least', 'most'),
            line('Σℓ', known.cost, 0), line('guesses that converged', table.converged, 0),
            line('guesses that lead to the optimum', known.same, 0),
            line('iterations of IPOPT, all guesses', table.iterations, 0)]), ''])


def read(path: Path) -> list[Optimum]:
    """Return stored optima."""
    return [Optimum(*row) for row in pd.read_csv(path).itertuples(index=False)]


def main() -> None:
    """Seek the optima of all starts and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--docs', type=Path, default=stamp.TOP / 'docs')
    parser.add_argument('--jobs', type=int, default=-1)
    arguments = parser.parse_args()
    starts = cases()
    with tempfile.TemporaryDirectory() as folder:
        library = compiled(solver(program()), Path(folder))
        optima = list(tqdm(
            Parallel(arguments.jobs, return_as='generator', batch_size=1)(
                delayed(optimum)(library, case) for case in starts),
            total=len(starts), unit='start', disable=None))
    results = arguments.docs / 'results'
    stamp.store_table(pd.DataFrame(optima), results / 'optimum.csv.gz')
    (results / 'optimum.md').write_text(page(optima, stamp.made(
        'optimum', stamp.sources('optimum'), ('numpy', 'scipy', 'casadi'))), encoding='utf-8')


if __name__ == '__main__':
    main()
