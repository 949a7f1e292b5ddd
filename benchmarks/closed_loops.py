# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Closed loops with the solvers of peers: who holds the pendulum from random states, and how fast.

Each solver goes through the scenario `random` twice. Alone it solves once a tick, from the last
forces, shifted by a step. With ours around it the last plan is followed with feedback, and there
are the other starts of a tick. All else is alike: the default problem, exact states, no estimator,
no deadline, one thread, one run after another in one process.

A whole solve of a peer ends where it has converged, about as closely as ours, or after ITERATIONS.
What it comes to is followed by the model; where that costs more than what it began from, this is
kept.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import math
from pathlib import Path
import sys
import time
from typing import Any, ClassVar, NamedTuple

from benchmark import quiet
import benchmark_figures
from campaigns import DURATION, METHODS
import numpy as np
from peers_casadi import Guess, Make
from peers_solvers import followed, gains, others
from stamp import folders, made, sources, TOP
from timing import has

from dp_swing_ros import provenance
from dp_swing_ros.evaluation.campaign.contestants import Contestant, measured, simulated
from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.campaign.rows import Row, solves
from dp_swing_ros.evaluation.comparison import paired_ratio, Rate, rate, Ratio
from dp_swing_ros.evaluation.scenarios import Case, SCENARIOS
from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan, SolverStats, Status
from dp_swing_ros.problem.problem import policy_rollout, Problem
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.solvers.solver import policy_of, Seed
from dp_swing_ros.tables import compact

CASES, FEW = 100, 10
ITERATIONS = 50
CONVERGED = 1e-3   # the tolerance of peers; ours stop at 1e-4 of a cost of some 10
BOUNDED = 'ilqr_6_iterations'   # at most, so that a tick ends soon, as that of acados_rti does
OURS: dict[str, dict[str, Any]] = {**{name: {} for name in METHODS},
                                   BOUNDED: {'ilqr.iterations': 6}}
SLOW = ('aligator', 'casadi')   # who go through few cases
SAMPLING, FEWEST = 'hydrax', 5   # who goes through fewest, and alone: one update takes 0.1 s
PEERS = ('comma-deps-acados', 'libaligator', 'libcrocoddyl', 'libmim-solvers', 'casadi',
         'hydrax')
EXACT = {'estimator': 'none'}
ALONE, AROUND = 'alone', 'with ours around it'
KINDS: dict[str, dict[str, Any]] = {
    ALONE: {**EXACT, 'first_starts': 1, 'other_starts': 0, 'warm_start': 'forces'}, AROUND: EXACT}


@dataclass(frozen=True)
class WholeParameters(Parameters):
    """How long a solve goes on."""

    iterations: int = parameter(ITERATIONS, 'most iterations in one solve', minimum=1)


class Whole:
    """Whole solves of a peer, as a solver of ours."""

    Parameters = WholeParameters
    of: ClassVar[Callable[[Problem, float], Make]]
    made: ClassVar[dict[Any, Make]]   # for a problem, which takes seconds

    def __init__(self, problem: Problem, parameters: WholeParameters, seed: Seed = 0) -> None:
        """Take the problem; it has no use for a seed."""
        self.problem, self.parameters = problem, parameters
        # by what it is of, so that what is made in a warm-up serves all runs
        key = problem.physical, problem.parameters, tuple(problem.cost.x_r)
        if key not in self.made:
            self.made[key] = type(self).of(problem, CONVERGED)
        self.make = self.made[key]

    def solve(self, x_0: Array, warm_start: Plan | None, deadline: float) -> Plan:
        """Return the cheaper of the warm start and what the peer makes of it; see Solver.solve."""
        began, problem = time.perf_counter(), self.problem
        start = policy_rollout(problem, *policy_of(problem, x_0, warm_start))
        solve = self.make(Guess(x_0, start.X, start.U), self.parameters.iterations)
        found, status = followed(problem, x_0, *solve()), Status.COMPLETE
        if not found.J < start.J:
            found = start
            status = Status.STALLED if np.isfinite(start.J) else Status.FAILED
        K = gains(problem, found.X, found.U)
        return Plan(found.X, found.U, K, problem.dt, SolverStats(
            status, found.J, 1, time.perf_counter() - began))


def whole(name: str, of: Callable[[Problem, float], Make]) -> type[Whole]:
    """Return whole solves of a peer as a class of solvers; `of` makes what solves a problem."""
    return type(name, (Whole,), {'of': staticmethod(of), 'made': {}})


def peers() -> dict[str, Any]:
    """Return the solvers of peers that are installed, by a name that a parameter may have."""
    found: dict[str, Any] = {
        name: whole(name, of) for name, of in (
            (name.lower().replace(' ', '_'), of) for name, of in others().items())}
    if has('comma-deps-acados'):
        from acados_rti.solver import AcadosRTI
        found['acados_rti'] = AcadosRTI
    if has('hydrax') and has('jax'):   # which Python 3.10 has not
        import peers_hydrax
        for name in ('MPPI', 'predictive sampling'):
            solver = f'{SAMPLING}_{name.lower().replace(" ", "_")}'
            found[solver] = whole(solver, peers_hydrax.solves(name))
    return found


def contestants(cases: int) -> dict[tuple[str, str], tuple[Contestant, list[Case]]]:
    """Return who goes through which cases, by solver and kind."""
    all_of = list(SCENARIOS['random'].cases('random', range(cases), None, DURATION))
    return {(name, kind): (Contestant(f'{name} {kind}', 'ilqr' if name == BOUNDED else name, {},
                                      {**parameters, **OURS.get(name, {})}),
                           all_of[:FEWEST if name.startswith(SAMPLING) else
                                  FEW if name.startswith(SLOW) else cases])
            for name in [*OURS, *sorted(set(SOLVERS) - {*METHODS})]
            for kind, parameters in KINDS.items()
            if kind == ALONE or not name.startswith(SAMPLING)}


def played(cases: int) -> dict[tuple[str, str], list[Row]]:
    """Return the rows of all, who take turns case by case."""
    of = contestants(cases)
    rows: dict[tuple[str, str], list[Row]] = {key: [] for key in of}
    for n in range(cases):
        for key, (contestant, theirs) in of.items():
            if n < len(theirs):
                rows[key].append(measured(contestant, theirs[n], simulated(contestant, theirs[n])))
        print(f'\r{n + 1} of {cases}', end='', file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return rows


class Loop(NamedTuple):
    """How a solver fared: of how many runs it held, at what cost, and its ticks [ms]."""

    held: Rate
    cost: Ratio     # over that of ilqr with ours around it, where both hold
    p50: float
    p99: float


def loops(rows: Mapping[tuple[str, str], Sequence[Row]]) -> dict[tuple[str, str], Loop]:
    """Return how all fared."""
    best, found = costs(rows[METHODS[0], AROUND]), {}
    for key, of in rows.items():
        p50, p99 = (1e3 * float(np.quantile(solves(of), q)) for q in (0.5, 0.99))
        found[key] = Loop(rate([row.metrics.success for row in of]),
                          paired_ratio(costs(of), best[:len(of)]), p50, p99)
    return found


def costs(rows: Sequence[Row]) -> Array:
    """Return the costs of closed loops, NaN where it was not held."""
    return np.array([row.metrics.closed_loop_cost if row.metrics.success else np.nan
                     for row in rows])


def ahead(found: Mapping[tuple[str, str], Loop]) -> list[str]:
    """Return where a peer is ahead of all of ours of its kind, in time if they hold as much."""
    words = []
    for (name, kind), loop in found.items():
        if name in OURS:
            continue
        ours = [found[our, kind] for our in OURS]
        as_good = [our for our in ours if share_of(our) >= share_of(loop)]
        if loop.held.low > max(our.held.high for our in ours):
            words.append(f'`{name}` {kind} holds more')
        if loop.cost.high < min(our.cost.low for our in ours):
            words.append(f'`{name}` {kind} costs less')
        for q in ('p50', 'p99'):
            if getattr(loop, q) < min((getattr(our, q) for our in as_good), default=math.inf):
                words.append(f'the {q} of a tick of `{name}` {kind} is shorter')
    return words


def share_of(loop: Loop) -> float:
    """Return the share of its runs that a solver holds."""
    return loop.held.successes / loop.held.runs


def page(found: Mapping[tuple[str, str], Loop], made: str) -> str:
    """Return the part of the page as Markdown."""
    return '\n\n'.join((
        '# Closed loops with the solvers of peers', made.strip(),
        f'{max(loop.held.runs for loop in found.values())} random starts, 10 s each, of slow '
        f'solvers the first {FEW}, of those of hydrax the first {FEWEST}; exact states, no '
        'estimator, the default problem. *Alone*: one solve a tick from the last forces, shifted. '
        '*With ours around it*: the other starts of a tick, and the last plan followed with '
        'feedback. `acados_rti` takes one quadratic program a solve, whose step is halved until '
        f'the cost falls, and `{BOUNDED}` ends a solve of `ilqr` early; the other peers go on '
        f'until they have converged, {ITERATIONS} iterations at most, and those of hydrax, with '
        'the samples, noise and spline of its examples, take one update. Costs are of the closed '
        f'loop, over those of `{METHODS[0]}` with ours around it on the same starts where both '
        'hold (geometric mean, 95 % interval).',
        '**Where a peer is ahead:** ' + ('; '.join(ahead(found)) or 'nowhere') + '. In the time '
        'of a tick it is where that is shorter than of all of ours that hold as large a share.',
        compact([('solver', 'around it', 'held', 'times the cost', 'a tick, p50 [ms]', 'p99 [ms]'),
                 *((f'`{name}`', kind, share(loop.held),
                    f'{loop.cost.value:.3g} ({loop.cost.low:.3g}-{loop.cost.high:.3g})'
                   if loop.held.successes else '-',
                    f'{loop.p50:.3g}', f'{loop.p99:.3g}')
                   for (name, kind), loop in found.items())]),
        '![what is held, and the time of a tick](../figures/closed_loops.png)')) + '\n'


def main() -> None:
    """Run all, and write the part."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--cases', type=int, default=CASES)
    parser.add_argument('--docs', type=Path, default=TOP / 'results')
    arguments = parser.parse_args()
    sys.path.append(str(TOP / 'examples' / 'acados_rti'))   # which need not be installed
    SOLVERS.update(peers())
    with quiet():
        found = loops(played(arguments.cases))
    results, figures = folders(arguments.docs)
    (results / 'closed_loops.md').write_text(page(found, made(
        'closed_loops', sources('closed_loops'),
        [*provenance.COMPUTING, *filter(has, PEERS)])), encoding='utf-8')
    benchmark_figures.loops(found, KINDS).savefig(figures / 'closed_loops.png')


if __name__ == '__main__':
    main()
