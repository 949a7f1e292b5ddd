# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ticks that are answered again."""

import time

from controllers import controller
import numpy as np
import pytest

from dp_swing_ros.rerun.answers import answer, Tick
from dp_swing_ros.simulation import plants
from dp_swing_ros.solvers import SOLVERS

STEP = 0.05


@pytest.mark.parametrize('solver', SOLVERS)
def test_what_a_deadline_ended_is_repeated_in_wild_states_too(solver, rng):
    """Where rollouts from some starts diverge, one must know which starts were made."""
    given = {'name': solver, 'estimator': 'none', 'other_starts': 2}
    c, again, diverged = controller(**given), controller(**given), 0
    for n in range(60):
        speeds = rng.uniform(-1, 1, 3) * rng.choice([1.0, 30.0, 70.0])
        x = np.concatenate((rng.uniform(-3, 3, 3), speeds))
        deadline = time.perf_counter() + rng.choice([0.0, 2e-4, 1.0])
        with np.errstate(all='ignore'):
            plan = c.update(STEP * n, x, deadline=deadline)
            stats = plan.stats
            repeated = answer(again, Tick(
                n, n, STEP * n, x, 0.0, 0.0, True, False, True, False, stats.solves,
                stats.status.name, stats.cost, plan.U[0]))
        diverged += not np.isfinite([each.cost for each in stats.candidates]).all()
        assert (repeated.stats.cost, list(repeated.U)) == (stats.cost, list(plan.U)), n
    assert 0 < diverged < 60


@pytest.mark.parametrize('solver', SOLVERS)
def test_what_was_made_up_for_between_two_steps_is_repeated(solver, rng):
    """Five states a step, and a deadline that leaves other starts to those in between."""
    c, again, made_up = controller(solver), controller(solver), 0
    p = plants.plant({'rate': 100.0, 'seed': 1})
    for n in range(120):
        t, x = n / 100, p.measure().x
        plan = c.update(t, x, deadline=time.perf_counter() + rng.choice([0.0, 2e-4, 1.0]))
        stats = plan.stats
        repeated = answer(again, Tick(n, n, t, x, 0.0, 0.0, True, False, True, False,
                                      stats.solves, stats.status.name, stats.cost, plan.U[0]))
        assert (repeated.stats.cost, list(repeated.U)) == (stats.cost, list(plan.U)), n
        made_up += any(each.start != 'last_plan' for each in stats.candidates[:1])
        p.obey(plan.U[0])
        p.advance(0.01)
    assert made_up > 4   # the more, the slower the machine
