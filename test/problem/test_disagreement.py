# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What it costs that the members of a learned model disagree, and its derivatives."""

import dataclasses

from learned_dynamics import LEARNED, model_of, of_chain
import numpy as np
import pytest
import torch

from dp_swing_ros import configuration
from dp_swing_ros.control.trust import trust
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.problem.cost import (
    running, running_cost, running_derivatives, terms, trajectory_cost)
from dp_swing_ros.problem.disagreement import add_expansion, AGREED, Disagreement
from dp_swing_ros.problem.parameters import CostParameters, PredictionParameters
from dp_swing_ros.problem.problem import Problem

STEP, WEIGHT = 0.05, 3.0
KINDS = pytest.mark.parametrize('kind', LEARNED)


def several(dynamics):
    """Return a model of which three others are as likely."""
    random = np.random.default_rng(4)
    draws = dynamics.free * random.normal(1.0, 0.02, (3, len(dynamics.free)))
    return dataclasses.replace(model_of(dynamics), draws=draws,
                               noise=np.array([0.02, 0.05, 0.1]))


@pytest.fixture(scope='module')
def plain():
    """Return the cost where it is free to disagree."""
    return Problem.of(PendulumParameters(), LimitParameters(), CostParameters(),
                      PredictionParameters()).cost


def paying(cost, model):
    return cost._replace(disagreement=Disagreement.of(model, WEIGHT, STEP))


def some(rng, count=5):
    return rng.normal(size=(count, 6)) * (1, 3, 3, 2, 5, 5), 10 * rng.normal(size=count)


@KINDS
def test_it_is_the_weighted_square_of_what_members_differ_by(kind, plain, rng):
    model = several(LEARNED[kind]())
    X, U = some(rng)
    for x, u in zip(X, U):
        own, *others = (np.array(each.accelerations(x, u))
                        for each in (model.dynamics, *model.members))
        expected = WEIGHT * np.mean([(STEP * (other - own) / model.noise) ** 2
                                     for other in others], axis=0).sum()
        more = running(paying(plain, model), x, u) - running(plain, x, u)
        assert more == pytest.approx(expected, rel=1e-6)
        assert expected > 1e-3


def test_it_is_what_diagnostics_call_the_spread(plain):
    """A step of an integrator for an acceleration makes little of a difference."""
    model = several(of_chain(PendulumParameters()))
    problem = Problem.of(PendulumParameters(), LimitParameters(), CostParameters(),
                         PredictionParameters(step=1e-3), model)
    x, u = np.array([0.1, 0.5, -0.4, 0.2, 0.3, 0.1]), 5.0
    x_twice = np.array([x, x])
    spread = trust(model, problem.model, x, u, *x_twice).spread
    d = running(plain._replace(disagreement=Disagreement.of(model, 1.0, 1e-3)), x, u) - running(
        plain, x, u)
    assert spread ** 2 <= d <= 3 * spread ** 2   # the worst speed, and the sum over three


@KINDS
def test_its_derivatives_are_those_of_finite_differences(kind, plain, rng):
    """The gradient; of the Hessian, twice JᵀJ of what is squared."""
    model = several(LEARNED[kind]())
    cost = paying(plain, model)
    X, U = some(rng)
    of_steps = running_derivatives(cost, X, U, None)

    def off(z):
        own, *others = (np.array(each.accelerations(z[:6], z[6]))
                        for each in (model.dynamics, *model.members))
        return np.concatenate([
            (other - own) * np.sqrt(cost.disagreement.weights) for other in others])
    for t, (x, u) in enumerate(zip(X, U)):
        z = np.append(x, u)
        J = np.array([(off(z + h) - off(z - h)) / 2e-6 for h in 1e-6 * np.eye(7)]).T
        Q_z, Q_zz = np.zeros(8), np.zeros((7, 8))
        add_expansion(cost.disagreement, of_steps[0, 12:], t, Q_z, Q_zz)
        scale = np.abs(2 * J.T @ J).max()
        np.testing.assert_allclose(Q_z[:7], 2 * J.T @ off(z), rtol=1e-5, atol=1e-6 * scale)
        np.testing.assert_allclose(Q_zz[:, :7], 2 * J.T @ J, rtol=1e-5, atol=1e-6 * scale)
    np.testing.assert_array_equal(of_steps[:, :12],
                                  running_derivatives(plain, X, U, None))


def test_it_is_a_term_of_the_cost(plain, rng):
    model = several(LEARNED['structured']())
    (X, U), cost = some(rng), paying(plain, model)
    found = terms(cost, X, U[:-1])
    assert sum(found) == pytest.approx(trajectory_cost(cost, X, U[:-1]), rel=1e-12)
    assert found.disagreement > 0 == terms(plain, X, U[:-1]).disagreement


def test_tensors_pay_as_numbers_do(plain, rng):
    """What samples on a GPU cost is the same Python."""
    cost = paying(plain, several(LEARNED['residual']()))
    X, U = some(rng)
    found = running_cost(cost, list(torch.tensor(X).unbind(-1)), torch.tensor(U))
    np.testing.assert_allclose(found, [running(cost, x, u) for x, u in zip(X, U)], rtol=1e-9)


def test_where_nothing_is_to_be_paid_the_cost_is_what_it_was():
    for model, weight in ((None, 1.0), (several(of_chain(PendulumParameters())), 0.0),
                          (dataclasses.replace(model_of(of_chain(PendulumParameters())),
                                               draws=np.empty((0, 0))), 1.0)):
        cost = Problem.of(PendulumParameters(), LimitParameters(),
                          CostParameters(disagreement_weight=weight), PredictionParameters(),
                          model).cost
        assert cost.disagreement is AGREED


@pytest.mark.parametrize('solver', ['ilqr', 'ddp', 'mppi'])
def test_plans_that_pay_keep_to_where_members_agree(solver):
    """Here on what a force does, for inertia and gravity go together."""
    chain = of_chain(PendulumParameters(links=1))
    draws = np.array([chain.free * factor for factor in (0.8, 0.9, 1.25)])
    text = dataclasses.replace(model_of(chain), draws=draws, noise=np.full(2, 0.05),
                               largest=np.full(3, 20.0)).to_text()
    disagreed = {}
    for weight in (0.0, 50.0):
        c = configuration.controller({'links': 1, 'solver': solver, 'dynamics': 'learned',
                                      'model': text, 'disagreement_weight': weight})
        plan = c.solver.solve(hanging(1), None, np.inf)
        assert plan.usable
        cost = c.problem.cost._replace(disagreement=Disagreement.of(
            c.problem.learned, 1.0, STEP))
        disagreed[weight] = terms(cost, plan.X, plan.U).disagreement
    assert 0 < disagreed[50.0] < 0.8 * disagreed[0.0]
