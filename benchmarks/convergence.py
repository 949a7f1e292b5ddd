# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How single solves converge, what becomes of backward passes, what second-order terms bring.

All start from the same states, without a force, and have the goal on the turn where that ends.
What a method has after so many iterations is what it returns with that as its limit and without a
tolerance. What becomes of passes, and which share of the second-order terms they took, is seen in
`descend` written out over the same kernels.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
import math
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np
import pandas as pd
import stamp
from timing import CONFIDENCE, Interval, RESAMPLES
from tqdm import tqdm

from dp_swing_ros.control import controllers, planner
from dp_swing_ros.control.planner import Planner
from dp_swing_ros.evaluation.campaign.contestants import Contestant, parse_all
from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.comparison import median, rate
from dp_swing_ros.evaluation.scenarios import Case, random_start
from dp_swing_ros.figures.style import looks, name_lines, styled
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.derivatives import expand
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import Array, DEFAULT_LINKS, is_upright
from dp_swing_ros.problem.plan import Plan, Status
from dp_swing_ros.problem.problem import (
    follow_policy, kernel_arguments, plan_of, Problem, Rollout, turns_of)
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.solvers.descent import (
    CONVERGED, CUT, Descent, ENDS, FAILED, GROWTH, ITERATION_LIMIT, LEAST, MU_FACTOR, MU_FIRST,
    STALLED)
from dp_swing_ros.solvers.riccati import backward, forward, line_search
from dp_swing_ros.solvers.solver import policy_of
from dp_swing_ros.tables import compact

METHODS = parse_all((
    'iLQR=ilqr', 'DDP, exact Hessian=ddp:ddp.hessian=exact',
    'DDP, Gauss-Newton=ddp:ddp.hessian=gauss_newton', 'MPPI=mppi',
    'textbook MPPI=mppi:config/textbook_mppi.yaml'))
DESCENTS = METHODS[:3]
HELD_OUT = range(1000, 1020)     # on which no parameter was chosen
LIMITS = (1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 25, 32, 40, 50)   # of iterations
REPEATS = 5                      # of each solve, for its time
RANDOM = range(1000)             # from whose starts passes are counted
LOOPS = range(20)                # whose warm starts are solved from
DURATION = 3.0                   # [s] of such a loop: a swing-up
ORDERS = range(1000, 1100)       # from whose starts ends are followed
LONG = 300                       # iterations, after which every descent is at its end
NEWTON = 5                       # steps without a search from there to the optimum itself
CLOSE = 1.0                      # [N] from the optimum: where the end of a descent begins
ROUNDING = 1e-13                 # share of the cost: what falls by less may not have fallen
RESTS = 1e-6                     # [N] the last of them, where it has come to rest
LAST = 8                         # steps of an end in the picture
SHOWN = 1, 3, 10, 50             # iterations in the table
TIMED = 10                       # iterations over which one is timed
NEAR = 0.01                      # of J*: as good as the best
LOWEST = 1e-4                    # share of J* at which the picture ends
COLD, WARM = 'random', 'warm'


class Start(NamedTuple):
    """Where a solve starts: a state (6,), and the plan that it is to improve."""

    x_0: Array
    plan: Plan


def turned(problem: Problem, x_0: Array, plan: Plan) -> Start:
    """Return a start with the goal on the turn where it ends, as the receding horizon does."""
    turns = turns_of(problem, plan.X[-1])
    return Start(x_0 - turns, replace(plan, X=plan.X - turns))


def cold(problem: Problem, seed: int) -> Start:
    """Return the start of a seed of the scenario `random`, without a force."""
    x_0 = np.array(random_start(Case('random', seed), DEFAULT_LINKS).plant['initial_state'])
    U = np.zeros(problem.horizon)
    X = rollout(problem.model, x_0, U)
    return turned(problem, x_0, plan_of(problem, X, U, Status.COMPLETE))


def warm(problem: Problem, seed: int) -> list[Start]:
    """Return the warm starts of the swing-up of a closed loop, from a random start."""
    controller, found = controllers.controller({'estimator': 'none', 'seed': seed}), []

    def search(about: Planner, x_0: Array, starts: Any, deadline: float) -> list[Plan]:
        plans = list(starts)
        if about.last and not is_upright(x_0):
            found.append(turned(problem, x_0, plans[0]))
        return planner.search(about, x_0, plans, deadline)
    controller.planner.search = search
    simulate(plants.plant(random_start(Case('random', seed), DEFAULT_LINKS).plant),
             controller, DURATION)
    return found


def solver_of(method: Contestant, problem: Problem, **changed: Any) -> Any:
    """Return the solver of a method with some of its parameters changed."""
    kind = SOLVERS[method.name]
    values = controllers.MPC.complete(method.mpc)
    return kind(problem, replace(group(kind.Parameters, values, f'{method.name}.'), **changed))


def iterates(problem: Problem, method: Contestant, seed: int) -> list[dict[str, Any]]:
    """Return the cost, and the time [s] to it, with each limit of iterations."""
    start, found = cold(problem, seed), []
    for limit in LIMITS:
        # of a new solver each time, so that all draw the same samples
        stats = [solver_of(method, problem, iterations=limit, tolerance=0.0).solve(
            *start, math.inf).stats for _ in range(REPEATS)]
        found.append({'method': method.label, 'seed': seed, 'iterations': limit,
                      'cost': stats[0].cost,
                      'seconds': float(np.median([one.solve_time for one in stats]))})
    return found


class Pass(NamedTuple):
    """
    One iteration of a descent: whether Q_uu was positive, and whether a step was taken.

    `bounded` is whether the force where it was not positive is on its bound, `share` that of the
    second-order terms, None in iLQR; J and U are those after it.
    """

    positive: bool
    bounded: bool
    accepted: bool
    share: float | None
    J: float
    U: Array


def descent(solver: Descent, start: Start) -> tuple[Status, list[Pass], Rollout]:
    """Return how a descent ends, its passes, and where; `descend`, written out."""
    problem, parameters = solver.problem, solver.parameters
    model, cost, _, bounds = given = kernel_arguments(problem)
    J, X, U, K = follow_policy(*given, *policy_of(problem, *start), problem.horizon)
    mu, share, end, passes = 0.0, solver.tensor, ITERATION_LIMIT, list[Pass]()
    while len(passes) < parameters.iterations:
        k, K_new, X_new, U_new = np.full_like(U, np.nan), *map(np.empty_like, (K, X, U))
        positive, slope, bend = backward(
            model, cost, expand(model, X, U), X, U, X[:0], bounds, mu, share,
            None if solver.hessian is None else share, k, K_new)
        converged = positive and mu == 0 and -slope <= parameters.tolerance * J
        J_new = line_search(model, cost, X, U, J, k, K_new, slope, bend, bounds, X_new,
                            U_new) if positive and not converged else math.inf
        accepted = J_new < J
        if accepted:
            J, X, U = J_new, X_new, U_new
        bounded = not positive and not bounds.low < U[np.isnan(k)][-1] < bounds.high
        passes.append(Pass(positive, bounded, accepted, share, J, U))
        if accepted or converged:
            K = K_new
        if converged:
            end = CONVERGED
            break
        if not positive and share:
            share = share * CUT if share > LEAST else 0.0
        elif accepted:
            mu = mu / MU_FACTOR if mu > MU_FIRST else 0.0
            share = share if share is None else min(max(share * GROWTH, LEAST), 1.0)
        else:
            mu = max(mu * MU_FACTOR, MU_FIRST)
            if mu > parameters.largest_regularisation:
                end = STALLED
                break
    return ENDS[end if np.isfinite(J) else FAILED], passes, Rollout(J, X, U, K)


def counted(problem: Problem, method: Contestant, start: Start) -> dict[str, Any]:
    """Return what becomes of the passes of a solve with the default limits."""
    end, passes, _ = descent(solver_of(method, problem), start)
    accepted = [one for one in passes if one.accepted]
    return {'method': method.label, 'passes': len(passes),
            'aborted': sum(not one.positive for one in passes),
            'on_bound': sum(one.bounded for one in passes), 'accepted': len(accepted),
            'in_full': sum(one.share == 1 for one in passes),
            'without': sum(not one.share for one in passes),
            'steps_in_full': sum(one.share == 1 for one in accepted),
            'converged': int(end is Status.CONVERGED), 'cost': passes[-1].J}


def optimum(problem: Problem, end: Rollout) -> Array | None:
    """
    Return the forces (N,) that Newton's method ends at from the end of a descent.

    Without a line search, for that sees differences of costs alone, and rounding hides those. None
    where it does not come to rest nearby.
    """
    model, cost, _, bounds = kernel_arguments(problem)
    _, X, U, K = end
    for _ in range(NEWTON):
        before = U
        k, K_new, X_new, U_new = map(np.empty_like, (U, K, X, U))
        if not backward(model, cost, expand(model, X, U), X, U, X[:0], bounds, 0.0, 1.0, 1.0, k,
                        K_new)[0]:
            return None
        forward(model, cost, X, U, X[:0], k, K_new, 1.0, bounds, X_new, U_new)
        X, U, K = X_new, U_new, K_new
    rests = np.linalg.norm(U - before) < RESTS and np.linalg.norm(U - end.U) < CLOSE
    return U if rests else None


def ending(problem: Problem, method: Contestant, start: Start) -> Array | None:
    """
    Return the distances [N] of the forces from the optimum over the last steps of a descent.

    From the last that is not close to it to the last that lowers the cost by more than rounding
    may. None where there is no optimum.
    """
    _, passes, end = descent(solver_of(method, problem, iterations=LONG, tolerance=0.0), start)
    U, steps = optimum(problem, end), [one for one in passes if one.accepted]
    if U is None or not steps:
        return None
    J, e = (np.array(of) for of in zip(*((one.J, np.linalg.norm(one.U - U)) for one in steps)))
    rounded, far = np.flatnonzero(-np.diff(J) < ROUNDING * J[1:]), np.flatnonzero(e > CLOSE)
    return e[far[-1] if far.size else 0:rounded[0] + 1 if rounded.size else None]


def order(distances: Array) -> float:
    """Return q of e⁺ = c e^q by the slope of log e⁺ against log e, NaN below three distances."""
    e = np.log(distances)
    return float(np.polyfit(e[:-1], e[1:], 1)[0]) if len(e) > 2 else math.nan


def pooled(part: Array, whole: Array) -> Interval:
    """Return Σ part / Σ whole; its interval draws starts anew. Shapes: (starts,) both."""
    chosen = np.random.default_rng(0).integers(len(part), size=(RESAMPLES, len(part)))
    tail = (1 - CONFIDENCE) / 2
    low, high = np.quantile(part[chosen].sum(axis=1) / whole[chosen].sum(axis=1), [tail, 1 - tail])
    return Interval(float(part.sum() / whole.sum()), float(low), float(high))


def suboptimality(found: pd.DataFrame) -> pd.DataFrame:
    """Return the iterates with J / J* - 1, J* the least cost that anyone found of a start."""
    least = found.groupby('seed')['cost'].transform('min')
    return found.assign(above=found['cost'] / least - 1)


def percent(of: Any) -> str:
    """Return a share and its interval for a cell."""
    return f'{100 * of.value:.1f} % ({100 * of.low:.1f}-{100 * of.high:.1f})'


def methods_table(found: pd.DataFrame) -> str:
    """Return how far each method is above J* after some iterations, and what one takes."""
    lines = []
    for label, of in suboptimality(found).groupby('method', sort=False):
        at = dict(list(of.groupby('iterations')))
        lines.append((str(label), *(percent(median(at[limit]['above'].to_numpy()))
                                    for limit in SHOWN),
                      share(rate((at[SHOWN[-1]]['above'] <= NEAR).tolist())),
                      f'{1e3 * at[TIMED]["seconds"].median() / TIMED:.3f}'))
    return compact([('method', *(f'after {limit}' for limit in SHOWN),
                     f'within {100 * NEAR:g} % of J\\* in the end', 'ms an iteration'), *lines])


def times(of: Interval) -> str:
    """Return a ratio and its interval for a cell."""
    return f'{of.value:.3f} ({of.low:.3f}-{of.high:.3f})'


def passes_table(found: pd.DataFrame) -> str:
    """Return what became of passes; intervals draw seeds, for passes of one are no strangers."""
    lines = []
    for (kind, label), of in found.groupby(['start', 'method'], sort=False):
        seeds = of.assign(solves=1).drop(columns=['start', 'method']).groupby('seed').sum()

        def part(name: str, whole: str) -> Interval:
            return pooled(seeds[name].to_numpy(), seeds[whole].to_numpy())
        iterations = part('passes', 'solves')
        lines.append((
            str(kind), str(label), str(len(of)), str(seeds['passes'].sum()),
            percent(part('aborted', 'passes')),
            percent(part('on_bound', 'aborted')) if of['aborted'].any() else '-',
            str(seeds['accepted'].sum()),
            f'{of["converged"].sum()}: {percent(part("converged", "solves"))}',
            f'{iterations.value:.1f} ({iterations.low:.1f}-{iterations.high:.1f})'))
    return compact([('starts', 'method', 'solves', 'passes', 'aborted', 'of these on a bound',
                     'steps', 'converged', 'iterations'), *lines])


def second_order_table(found: pd.DataFrame) -> str:
    """Return which shares of the second-order terms DDP took, and what they brought."""
    lines = []
    for kind, of in found.groupby('start', sort=False):
        by_method = {label: one.reset_index(drop=True)
                     for label, one in of.groupby('method', sort=False)}
        ilqr = by_method.pop(DESCENTS[0].label)
        for label, ddp in by_method.items():
            together, solves = same_optimum(ilqr, ddp), np.ones(len(ddp))

            def per_seed(part: Any, whole: Any) -> Interval:
                pairs = pd.DataFrame({'part': part, 'whole': whole}).groupby(ddp['seed']).sum()
                return pooled(*pairs[pairs['whole'] > 0].to_numpy(float).T)
            ratio = np.log(ddp['cost'] / ilqr['cost'])
            lines.append((
                str(kind), str(label), *(percent(per_seed(part, ddp['passes'])) for part in (
                    ddp['in_full'], ddp['passes'] - ddp['in_full'] - ddp['without'],
                    ddp['without'])), percent(per_seed(ddp['steps_in_full'], ddp['accepted'])),
                times(Interval(*np.exp(per_seed(ratio, solves)).tolist())),
                *(percent(per_seed(apart, solves)) for apart in (
                    ratio < -np.log1p(NEAR), ratio > np.log1p(NEAR))), str(together.sum()),
                *(times(per_seed(ddp[name] * together, ilqr[name] * together))
                  for name in ('passes', 'accepted'))))
    return compact([('starts', 'method', 'passes with s = 1', '0 < s < 1', 's = 0',
                     'steps with s = 1', 'cost over that of iLQR', f'{100 * NEAR:g} % cheaper',
                     f'{100 * NEAR:g} % dearer', 'in the same optimum',
                     'passes over those of iLQR', 'steps over those of iLQR'), *lines])


def same_optimum(one: pd.DataFrame, other: pd.DataFrame) -> 'pd.Series[bool]':
    """Return of which starts the solves of two methods converged, at nearly one cost."""
    near = np.abs(np.log(other['cost'] / one['cost'])) <= np.log1p(NEAR)
    return (one['converged'] == 1) & (other['converged'] == 1) & near


def orders_table(found: pd.DataFrame) -> str:
    """Return the order of convergence of each descent."""
    lines = []
    for label, of in found.groupby('method', sort=False):
        ends = [end['distance'].to_numpy() for _, end in of.groupby('seed')]
        q = median(np.array([order(end) for end in ends]))
        ratio = median(np.array([np.median(end[1:] / end[:-1]) for end in ends if len(end) > 1]))
        lines.append((str(label), str(len(ends)), str(q.runs),
                      f'{q.value:.2f} ({q.low:.2f}-{q.high:.2f})',
                      f'{ratio.value:.2g} ({ratio.low:.2g}-{ratio.high:.2g})',
                      ', '.join(f'{np.median([end[-n] for end in ends if len(end) >= n]):.0e}'
                                for n in (3, 2, 1))))
    return compact([('method', 'ends', 'with an order', 'order q', 'distance, step to step',
                     'last three distances [N]'), *lines])


def page(found: pd.DataFrame, passes: pd.DataFrame, ends: pd.DataFrame, made: str) -> str:
    """Return the page."""
    return '\n'.join([
        '# How solves converge\n', made,
        'One solve of the default problem (30 steps of 50 ms), without a deadline or a '
        'tolerance, from the same cold starts for all: the states of the scenario `random`, no '
        'force. Medians, with their 95 % intervals in brackets (bootstrap; Wilson for counts).\n',
        '![Cost above the best by iteration and by time, and the last steps of descents]'
        '(../figures/convergence.png)\n',
        '## Cost by iteration\n',
        f'J / J\\* - 1 over {found["seed"].nunique()} held-out starts (seeds '
        f'{found["seed"].min()} to {found["seed"].max()}), J\\* being the least cost that any of '
        f'the methods found of a start within {max(LIMITS)} iterations. An iteration is a '
        'backward pass or an update; they take the time of the '
        f'last column, the median over {TIMED} iterations in one process. In the picture the '
        'bands are quartiles. The rows: [convergence.csv.gz](convergence.csv.gz).\n',
        methods_table(found) + '\n',
        '## What becomes of backward passes\n',
        f'Solves with the default limits, so 50 iterations at most and a tolerance: from '
        f'{passes[passes["start"] == COLD]["seed"].nunique()} random starts as above (seeds from '
        f'0), and from the warm starts of {passes[passes["start"] == WARM]["seed"].nunique()} '
        f'closed loops of iLQR over their first {DURATION:g} s, until they are upright. A pass '
        'is aborted where Q_uu is not positive; on a bound is where the force of that step '
        'stands on its bound, where no curvature would be needed for a minimum. The rows: '
        '[convergence_passes.csv.gz](convergence_passes.csv.gz).\n',
        passes_table(passes) + '\n',
        '## What the second-order terms bring\n',
        'The same solves. DDP takes a share s of the second-order terms, which it cuts where a '
        'pass is aborted and raises with every step; with s = 0 throughout it is iLQR. The cost '
        'at the end of a solve is compared with that of iLQR from the same start (geometric '
        'mean). In the same optimum are the solves of a start that both converged, at costs '
        f'within {100 * NEAR:g} %: their passes and steps are compared there. Intervals draw '
        'seeds.\n',
        second_order_table(passes) + '\n',
        '## The last steps\n',
        f'Descents from {ends.attrs["starts"]} held-out starts to their ends. The distance of '
        'the forces from the optimum, e = ‖U - U\\*‖, is followed from the last step at which '
        f'it exceeds {CLOSE:g} N to the last that lowers the cost by more than rounding may, '
        f'{ROUNDING:g} of it. U\\* is where {NEWTON} steps of '
        "Newton's method without a line search lead from the end; descents for which that is "
        'refused, as Q_uu is not positive, or does not come to rest, are left out. The order is '
        'the q of e⁺ = c e^q, by the slope of log e⁺ against log e: 1 is linear, 2 quadratic. '
        'The rows: [convergence_ends.csv.gz](convergence_ends.csv.gz).\n',
        orders_table(ends), ''])


@styled
def picture(found: pd.DataFrame, ends: pd.DataFrame) -> Figure:
    """Show the cost above the best by iteration and by time, and the last steps of descents."""
    figure = Figure((9.6, 3.6), layout='constrained')
    by_iteration, by_time, last = figure.subplots(1, 3)
    look = {label: of.line for label, of in looks({'contestants': {
        method.label: {'name': method.name} for method in METHODS}}).items()}
    for label, of in suboptimality(found).groupby('method', sort=False):
        by_limit = of.groupby('iterations')
        above = by_limit['above'].quantile([0.25, 0.5, 0.75]).unstack().clip(lower=LOWEST)
        band(by_iteration, above.index.to_numpy(), above.to_numpy().T, look[label])
        band(by_time, 1e3 * by_limit['seconds'].median().to_numpy(), above.to_numpy().T,
             look[label])
    for label, of in ends.groupby('method', sort=False):
        aligned = pd.DataFrame([pd.Series(end['distance'].to_numpy()[::-1][:LAST])
                                for _, end in of.groupby('seed')])
        band(last, -aligned.columns.to_numpy(), aligned.quantile([0.25, 0.5, 0.75]).to_numpy(),
             look[label])
    for axes in (by_iteration, by_time):
        axes.set(xscale='log', yscale='log')
    by_iteration.set(xlabel='iteration', ylabel='J / J* - 1')
    by_time.set(xlabel='time [ms]')
    last.set(xlabel='steps before the end', ylabel='distance from the optimum [N]', yscale='log')
    for axes in (by_iteration, by_time, last):
        axes.grid()
    name_lines(figure, look, entry=1.5)
    return figure


def band(axes: Axes, x: Array, quartiles: Array, look: dict[str, Any]) -> None:
    """Draw a median and the band of its quartiles; shapes: x (n,), quartiles (3, n)."""
    low, middle, high = quartiles
    axes.plot(x, middle, **look)
    axes.fill_between(x, low, high, color=look['color'], alpha=0.12, linewidth=0)


def all_iterates(problem: Problem, seeds: Sequence[int]) -> pd.DataFrame:
    """Solve from some starts with each limit; one call of each method compiles first."""
    for method in METHODS:
        solver_of(method, problem, iterations=1).solve(*cold(problem, seeds[0]), math.inf)
    return pd.DataFrame([row for seed in tqdm(seeds, unit='start', desc='iterates', disable=None)
                         for method in METHODS for row in iterates(problem, method, seed)])


def all_passes(problem: Problem, seeds: Sequence[int], loops: Sequence[int]) -> pd.DataFrame:
    """Count the passes of solves from random starts, and from the warm starts of loops."""
    starts = [(COLD, seed, cold(problem, seed)) for seed in seeds]
    starts += [(WARM, seed, start) for seed in loops for start in warm(problem, seed)]
    return pd.DataFrame([
        {'start': kind, 'seed': seed, **counted(problem, method, start)}
        for kind, seed, start in tqdm(starts, unit='start', desc='passes', disable=None)
        for method in DESCENTS])


def all_ends(problem: Problem, seeds: Sequence[int]) -> pd.DataFrame:
    """Follow the ends of descents from some starts."""
    rows = []
    for seed in tqdm(seeds, unit='start', desc='ends', disable=None):
        for method in DESCENTS:
            end = ending(problem, method, cold(problem, seed))
            rows += [] if end is None else [
                {'method': method.label, 'seed': seed, 'distance': e} for e in end]
    found = pd.DataFrame(rows)
    found.attrs['starts'] = len(seeds)
    return found


def main() -> None:
    """Solve, and write the page, its rows and its picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--docs', type=Path, default=stamp.TOP / 'docs')
    docs, problem = parser.parse_args().docs, controllers.problem({})
    tables = {'': all_iterates(problem, HELD_OUT), '_passes': all_passes(problem, RANDOM, LOOPS),
              '_ends': all_ends(problem, ORDERS)}
    for name, table in tables.items():
        stamp.store_table(table, docs / 'results' / f'convergence{name}.csv.gz')
    found, passes, ends = tables.values()
    picture(found, ends).savefig(docs / 'figures' / 'convergence.png')
    (docs / 'results' / 'convergence.md').write_text(page(
        found, passes, ends, stamp.made('convergence', stamp.sources('convergence'))),
        encoding='utf-8')


if __name__ == '__main__':
    main()
