# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a tick shows of a learned model, and what becomes of the plan."""

import dataclasses
import math

from learned_dynamics import model_of, of_chain
import numpy as np
import pytest

from dp_swing_ros import configuration
from dp_swing_ros.pendulum.parameters import Drive, PendulumParameters
from dp_swing_ros.simulation.closed_loop import simulate

SLOW = np.array([0.1, 3.0, 3.1, 0.2, 1.0, -2.0])
FAST = np.array([0.1, 3.0, 3.1, 0.2, 1.0, 15.0])   # it has seen 12 rad/s


@pytest.fixture(scope='module')
def model():
    """Return the text of a model of a heavier second link."""
    return model_of(of_chain(PendulumParameters(link2_mass=0.8))).to_text()


def controller(model, **values):
    return configuration.controller({'dynamics': 'learned', 'model': model, 'estimator': 'none',
                                     **values})


def test_at_first_there_is_nothing_to_compare_with(model):
    c = controller(model)
    c.update(0.0, SLOW)
    assert math.isnan(c.trust.error) and 0 < c.trust.spread < 10
    assert c.trust.reach == pytest.approx(1 / 6)   # 2 of 12 rad/s; 1 of 10, 0.2 of 3 m/s
    assert c.trust.warning == ''


def test_a_wrong_prediction_shows(model):
    """In deviations of what was missed in training, of which these models have 0.05."""
    errors = []
    for mass in (0.8, 0.5):
        c = controller(model)
        simulate(configuration.plant({'link2_mass': mass}), c, 1.0)
        errors.append(c.trust.error)
    assert errors[0] < 0.2 and errors[1] > 5 * errors[0]


def test_members_that_agree_have_no_spread():
    whole = model_of(of_chain(PendulumParameters()))
    text = type(whole)(whole.dynamics, whole.dynamics.free[None], whole.noise, whole.largest,
                       {}).to_text()
    c = controller(text)
    c.update(0.0, SLOW)
    assert c.trust.spread == 0.0


@pytest.mark.parametrize('unseen', ['learned', 'analytic'])
def test_beyond_what_was_seen_there_is_a_warning_and_where_asked_the_equations_plan(model, unseen):
    c = controller(model, unseen=unseen)
    plan = c.update(0.0, FAST)
    assert '1.2 times as fast as all' in c.trust.warning
    assert (c.problem.learned is None) == (unseen == 'analytic')
    alone = configuration.controller({'estimator': 'none'})
    assert np.array_equal(plan.U, alone.update(0.0, FAST).U) == (unseen == 'analytic')
    c.update(0.05, SLOW)
    assert c.trust.warning == '' and c.problem.learned is not None


def test_with_an_estimator_it_goes_back_and_forth_too(model):
    c = controller(model, unseen='analytic', estimator='ekf')
    c.update(0.0, FAST)
    assert c.problem.learned is None
    for n in range(1, 8):
        c.update(0.05 * n, np.array([0.0, 0.02 * n, -0.01 * n, 0.0, 0.4, -0.2]))
    assert (c.problem.learned is None) == (c.trust.reach > 1.1)


def test_what_a_reset_forgets(model):
    c = controller(model)
    first = c.update(0.0, SLOW)
    c.update(0.05, SLOW + 0.01)
    c.reset()
    assert c.trust is None
    np.testing.assert_array_equal(c.update(0.0, SLOW).U, first.U)


def test_where_a_learned_model_is_wild_a_tick_has_a_finite_force():
    """It is right about upright, and where its second link hangs that weighs less than nothing."""
    chain = of_chain(PendulumParameters())
    inertia = chain.inertia.copy()
    inertia[5, [0, 3]] = np.array((0.75, 0.25)) * chain.inertia[5, 0]   # of D_22: 1 and cos θ_2
    wild = dataclasses.replace(model_of(chain._replace(inertia=inertia)), drive=Drive(0.05, 0.05))
    c = controller(wild.to_text())
    hanging = np.array([0.0, np.pi, np.pi, 0.0, 0.0, 9.0])
    for n, x in enumerate((np.zeros(6), hanging, hanging)):
        with np.errstate(all='ignore'):
            plan = c.update(0.05 * n, x)
            ahead = c.when_it_acts(x, 0.05 * n)
        assert np.isfinite(ahead).all() == (n == 0)
        assert np.all(np.isfinite(plan.U)) and np.abs(plan.U).max() <= 20.0
        assert (plan.stats.status.name in ('ZERO', 'LAST_POLICY', 'REGULATOR')) == (n > 0)
