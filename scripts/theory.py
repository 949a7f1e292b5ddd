# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The pictures of docs/theory.md: `python scripts/theory.py docs/figures`.

Each solves one small problem with the package's own solvers; run by `make docs`.
"""

import math
from pathlib import Path
import sys
from typing import Any

from matplotlib import colormaps
from matplotlib.figure import Figure
import numpy as np

from dp_swing_ros.control import controllers
from dp_swing_ros.control.bounded_lqr import BoundedLQR
from dp_swing_ros.figures.style import FAINT, FORCE, INK, LINKS, PALETTE, styled
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import hanging, upright
from dp_swing_ros.problem.plan import Plan, Status
from dp_swing_ros.problem.problem import plan_of, policy_rollout, regulator_rollout
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.solvers.mppi import MPPI, spread, weights
from dp_swing_ros.solvers.samples import Samples

SHOWN = (0, 1, 2, 4, 8, 16)   # iterations whose plans are drawn
SIZE = (9.0, 3.0)             # [inch]
LEAN = (0.2, 0.2)          # [rad] of the links, where the bound matters
PROBLEM = controllers.problem({})
T = PROBLEM.dt * np.arange(PROBLEM.horizon + 1)


def random_start(seed: int) -> Plan:
    """Return a plan of random forces from hanging."""
    U = np.random.default_rng(seed).uniform(-10.0, 10.0, PROBLEM.horizon)
    return plan_of(PROBLEM, rollout(PROBLEM.model, hanging(), U), U, Status.COMPLETE)


def solved(name: str, start: Plan, iterations: int) -> Plan:
    """Return the plan after so many iterations from a start."""
    if iterations == 0:
        return start
    solver = SOLVERS[name](PROBLEM, SOLVERS[name].Parameters(iterations=iterations, tolerance=0.0))
    plan: Plan = solver.solve(hanging(), start, math.inf)
    return plan


def axes_of(figure: Figure, *titles: str) -> Any:
    """Return axes side by side, with titles."""
    axes = figure.subplots(1, len(titles))
    for each, title in zip(axes, titles):
        each.set_title(title)
        each.grid(True)
    return axes


@styled
def descent(seed: int = 3) -> Figure:
    """Draw the plans of a descent, and how its cost falls."""
    figure, start = Figure(figsize=SIZE, layout='constrained'), random_start(seed)
    left, right = axes_of(figure, 'the plan of iLQR after so many iterations',
                          'cost J after each iteration')
    for n, iterations in enumerate(SHOWN):
        left.plot(T, solved('ilqr', start, iterations).X[:, 1],
                  color=colormaps['viridis_r'](n / len(SHOWN)), label=str(iterations))
    left.set(xlabel='time [s]', ylabel=r'$\theta_1$ [rad]')
    left.legend(ncols=2)
    for name, colour in zip(('ilqr', 'ddp'), PALETTE):
        counts = range(31)
        right.plot(counts, [solved(name, start, count).stats.cost for count in counts],
                   color=colour, label={'ilqr': 'iLQR', 'ddp': 'DDP'}[name])
    right.set(xlabel='iteration', yscale='log')
    right.legend()
    return figure


@styled
def sampling(seed: int = 3) -> Figure:
    """Draw the samples of one update of MPPI, and what they weigh."""
    figure = Figure(figsize=SIZE, layout='constrained')
    left, right = axes_of(figure, 'samples of an update, the heavy ones dark',
                          'cost and weight of the samples')
    parameters = MPPI.Parameters()
    start = random_start(seed)
    best = policy_rollout(PROBLEM, hanging(), start.X, start.U, start.K)
    samples = Samples(PROBLEM, parameters.sigma, parameters.noise_correlation, 1)
    J = samples.draw(best, np.random.default_rng(seed)).copy()
    w = weights(J, parameters.temperature * spread(J))
    forces = samples.V.transpose(0, 2, 1).reshape(-1, PROBLEM.horizon)[:len(J)]
    order = np.argsort(w)
    for k in (*order[:-40:8], *order[-40:]):
        X = rollout(PROBLEM.model, hanging(), forces[k].astype(float))
        share = float(w[k] / w.max())
        left.plot(T, X[:, 1], color=INK if share > 0.02 else FAINT,
                  alpha=max(share, 0.25), linewidth=0.5 + 1.5 * share)
    average = rollout(PROBLEM.model, hanging(), samples.proposals(w)[0])
    left.plot(T, average[:, 1], color=PALETTE[1], label='weighted average', linewidth=2.2)
    left.plot(T, best.X[:, 1], color=PALETTE[0], label='about which they were drawn')
    left.set(xlabel='time [s]', ylabel=r'$\theta_1$ [rad]', ylim=(0, 2 * math.pi))
    left.legend(loc='upper left')
    right.scatter(J, w, s=9, color=INK)
    right.set(xlabel='cost $J_k$', ylabel='weight $w_k$', xscale='log')
    return figure


@styled
def bound() -> Figure:
    """Draw the regulator and the bounded LQR from where the bound of the force matters."""
    figure = Figure(figsize=SIZE, layout='constrained')
    left, right = axes_of(figure, 'angles: link 1 and link 2', 'force')
    x_0 = upright()
    x_0[1:3] = LEAN
    bounded = BoundedLQR(PROBLEM).start(x_0)
    assert bounded is not None, 'the goal is out of reach'
    for found, name, line in ((regulator_rollout(PROBLEM, x_0), 'regulator', '--'),
                              (bounded, 'bounded LQR', '-')):
        for i, colour in enumerate(LINKS[:2]):
            left.plot(T, found.X[:, 1 + i], line, color=colour, label=name if i == 0 else None)
        right.step(T[:-1], found.U, line, where='post', color=FORCE, label=name)
    left.set(xlabel='time [s]', ylabel='[rad]', ylim=(-1.5, 1.5))
    right.set(xlabel='time [s]', ylabel='$u$ [N]')
    left.legend()
    right.legend()
    return figure


if __name__ == '__main__':
    for name, figure in (('descent', descent()), ('mppi', sampling()), ('bound', bound())):
        figure.savefig(Path(sys.argv[1]) / f'theory_{name}.png')
