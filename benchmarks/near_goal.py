# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Who holds the pendulum near the goal, and which starts can be held at all.

Run by `make results`, which keeps what it prints as docs/results/near_goal.md; takes a minute.
"""

import argparse

from joblib import delayed, Parallel
import numpy as np
from scipy.optimize import linprog

from dp_swing_ros import configuration
from dp_swing_ros.campaign.contestants import parse
from dp_swing_ros.campaign.episodes import play
from dp_swing_ros.catch import Catch
from dp_swing_ros.comparison import wilson
from dp_swing_ros.problem import linearisation, Problem
from dp_swing_ros.scenarios import Case, SCENARIOS
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.state import ANGLES, Array

DROPPED = 0.4   # [rad]
STEPS = 60      # of the trajectory that might hold it
SEEDS = range(100)


def least_angle(problem: Problem, x_0: Array) -> float:
    """
    Return the smallest largest angle [rad] of any forces that bring the linear model to rest.

    A linear program: min s  s.t.  |θ_t| ≤ s, |u_t| ≤ u_max, x_N = 0; infinite where there is none.
    """
    A, B = linearisation(problem.model, np.zeros(6), 0.0)
    free, forced = x_0, np.zeros((6, STEPS))
    rows, bounds = [], []
    for t in range(STEPS):
        free, forced = A @ free, A @ forced
        forced[:, t] += B
        for sign in (1, -1):
            rows.append(np.hstack([sign * forced[ANGLES], -np.ones((2, 1))]))
            bounds.append(-sign * free[ANGLES])
    found = linprog(np.append(np.zeros(STEPS), 1.0), np.vstack(rows), np.concatenate(bounds),
                    np.hstack([forced, np.zeros((6, 1))]), -free,
                    [(-problem.u_max, problem.u_max)] * STEPS + [(0, None)])
    return float(found.fun) if found.success else np.inf


def caught_angle(problem: Problem, x_0: Array) -> float:
    """Return the largest angle [rad] of a plan that starts from the catch."""
    caught = Catch(problem).start(x_0)
    return np.inf if caught is None else float(np.abs(caught.X[:, ANGLES]).max())


def largest_angle(name: str, case: Case) -> float:
    """Return the largest angle [rad] of a run."""
    return play(parse(name), case).metrics.largest_angle


def main() -> None:
    """Print the page."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    cases = list(SCENARIOS['near_goal'].cases('near_goal', SEEDS, None, 10.0))
    starts = [np.array(case.plant['initial_state']) for case in cases]
    problem = configuration.problem({'horizon': STEPS})
    least = np.array([least_angle(problem, x) for x in starts])
    caught = np.array([caught_angle(problem, x) for x in starts])
    with Parallel(n_jobs=-1) as parallel:
        runs = {name: np.array(parallel(delayed(largest_angle)(name, case) for case in cases))
                for name in SOLVERS}
    held = {name: angles <= DROPPED for name, angles in runs.items()}
    possible = (caught <= DROPPED) | np.any(list(held.values()), axis=0)
    impossible = ~possible & (least > DROPPED)
    open_question = ~possible & ~impossible
    print(f"""# Near the goal

Made by `make results` (near_goal.py): starts at rest with both angles within ±0.3 rad (the paper's
Figs. 8-10), seeds {SEEDS[0]} to {SEEDS[-1]}, 10 s, defaults, so 20 N at most. Dropped is what
leaves {DROPPED:g} rad.

With 20 N not every such start can be held: of {len(cases)},

* {np.sum(possible)} can, for a trajectory that stays within {DROPPED:g} rad is known;
* {np.sum(impossible)} cannot to first order: no forces bring the linear model to rest within \
{DROPPED:g} rad and {STEPS * problem.dt:g} s
  (a linear program; the best largest angle is beyond {DROPPED:g} rad, or there is none);
* {np.sum(open_question)} are open: the linear model can, but no trajectory of the real one was \
found{_seeds(open_question)}.

| solver | held, of those that can be | 95 % interval (Wilson) | dropped though they can be |
| --- | --- | --- | --- |""")
    for name in SOLVERS:
        number = int(np.sum(held[name] & possible))
        low, high = wilson(number, int(np.sum(possible)))
        dropped = _seeds(possible & ~held[name]) or ' none'
        print(f'| `{name}` | {number} of {np.sum(possible)} | {100 * low:.1f}-{100 * high:.1f} % |'
              f'{dropped} |')


def _seeds(chosen: Array) -> str:
    numbers = ', '.join(str(SEEDS[i]) for i in np.flatnonzero(chosen))
    return f' (seeds {numbers})' if numbers else ''


if __name__ == '__main__':
    main()
