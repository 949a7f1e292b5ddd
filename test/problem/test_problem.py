# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The problem: its regulator, and the parameters that it refuses."""

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from dp_swing_ros.control import controllers
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.derivatives import linearisation
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import angles, hanging, LINKS, SIZES, upright
from dp_swing_ros.problem.parameters import CostParameters, PredictionParameters
from dp_swing_ros.problem.problem import (
    Bounds, policy_rollout, Problem, regulator_rollout, TURN, turns_of)

of_links = pytest.mark.parametrize('links', LINKS)


def problem(cost=CostParameters(), limits=LimitParameters(),
            prediction=PredictionParameters(horizon=100), links=2):
    return Problem.of(PendulumParameters(links=links), limits, cost, prediction)


def default(links, **prediction):
    return problem(controllers.cost({'links': links}), links=links,
                   prediction=PredictionParameters(**{'horizon': 100, **prediction}))


def near(reference, size=0.02):
    """Return a state near a reference, its links leaning to either side in turn."""
    x = np.array(reference, float)
    x[0] += 5 * size
    x[angles(x)] += [size * (-1) ** i for i in range(len(x) // 2 - 1)]
    return x


@pytest.mark.parametrize('reference', [
    (0, 0, 0, 0), (1, np.pi, 0, 0),
    (0, 0, 0, 0, 0, 0), (0.5, np.pi, 0, 0, 0, 0), (0, np.pi, np.pi, 0, 0, 0),
    (-1, 0, np.pi, 0, 0, 0), (0, np.pi, np.pi, np.pi, 0, 0, 0, 0)])
def test_the_regulator_holds_every_equilibrium(reference):
    links = len(reference) // 2 - 1
    p = problem(replace(controllers.cost({'links': links}), reference=reference), links=links)
    x = near(reference)
    X = rollout(p.model, x, regulator_rollout(p, x).U)
    assert np.abs(X[-1] - reference).max() < 0.05


@pytest.mark.parametrize('reference', [(0, 1, 0, 0, 0, 0), (0, 0, 0, 0.5, 0, 0)])
def test_a_reference_that_is_no_equilibrium_is_refused(reference):
    with pytest.raises(ParameterError, match='reference is .*; expected an equilibrium'):
        problem(replace(controllers.cost({'links': 2}), reference=reference))


@pytest.mark.parametrize('track, margin, weight, warns', [
    (2.4, 0.4, 1e4, False), (0.4, 0.4, 1e4, True), (0.8, 0.4, 1e4, True), (0.4, 0.1, 1e4, False),
    (0.4, 0.4, 0.0, False), (np.inf, 0.4, 1e4, False)])
def test_a_margin_that_leaves_little_of_the_track_is_told(track, margin, weight, warns):
    p = problem(CostParameters(track_margin=margin, track_weight=weight),
                LimitParameters(track_limit=track))
    assert bool(p.warning) is warns
    assert not warns or f'track_margin is 0.4 m of the {track:g} m' in p.warning


def test_a_goal_by_its_name_is_the_reference_with_its_angles():
    given = replace(controllers.cost({'links': 2}), reference=(0.5, np.pi, np.pi, 0, 0, 0))
    np.testing.assert_array_equal(problem(given).x_r, given.reference)
    named = problem(replace(given, goal='up_down'))
    np.testing.assert_array_equal(named.x_r, (0.5, 0, np.pi, 0, 0, 0))
    np.testing.assert_array_equal(named.lqr.P, problem(
        replace(given, reference=(0.5, 0, np.pi, 0, 0, 0))).lqr.P)


def test_a_goal_of_another_number_of_links_is_refused():
    with pytest.raises(ParameterError, match="goal is 'up'; expected one of given, down_down, "
                                             'down_up, up_down, up_up for links 2'):
        problem(replace(controllers.cost({'links': 2}), goal='up'))


def test_the_regulator_holds_three_links_up():
    p = problem(controllers.cost({'links': 3}), LimitParameters(force_limit=40.0), links=3)
    x = near(upright(3), 0.002)
    assert np.abs(regulator_rollout(p, x).X[-1]).max() < 0.01


@of_links
def test_the_terminal_value_solves_the_riccati_equation(links):
    p = default(links)
    A, B = linearisation(p.model, upright(links), 0.0)
    P = solve_discrete_are(A, B[:, None], np.diag(p.cost.S), [[p.cost.R]])
    np.testing.assert_allclose(p.cost.P, P, rtol=1e-9)


@of_links
def test_a_policy_goes_on_with_the_regulator(links):
    p, x = default(links), near(upright(links), 0.002)
    U = regulator_rollout(p, x).U
    none = np.zeros((7, SIZES[links]))
    _, X, forces, _ = policy_rollout(p, x, rollout(p.model, x, U[:7]), U[:7], none)
    np.testing.assert_allclose(forces, U, atol=1e-7)
    np.testing.assert_allclose(X, rollout(p.model, x, U), atol=1e-7)


@of_links
def test_what_is_left_of_a_plan_is_completed_by_the_regulator(links):
    p = default(links, horizon=30)
    whole = regulator_rollout(p, near(upright(links), 0.0005))
    started = policy_rollout(p, whole.X[10], whole.X[10:], whole.U[10:], whole.K[10:])
    assert started.X.shape == (31, SIZES[links])
    np.testing.assert_allclose(started.X[:20], whole.X[10:30], atol=1e-9)
    assert started.U[25] == pytest.approx(-p.lqr.K @ started.X[25], rel=1e-3, abs=1e-9)


@of_links
def test_a_policy_does_not_see_whole_turns(links):
    p, x = default(links, horizon=30), near(upright(links), 0.002)
    plain = regulator_rollout(p, x)
    turned = x.copy()
    turned[angles(x)] += [TURN * (-2) ** i for i in range(links)]
    for policy in (plain[1:], (plain.X[:0], plain.U[:0], plain.K[:0])):
        found = policy_rollout(p, turned, *policy)
        np.testing.assert_allclose(found.U, plain.U, atol=1e-6)
        assert found.U[0] == pytest.approx(plain.U[0], rel=1e-6)
    np.testing.assert_allclose(turns_of(p, turned), turned - x)
    as_is = problem(replace(controllers.cost({'links': links}), angle_error='angle'), links=links)
    np.testing.assert_array_equal(turns_of(as_is, turned), 0.0)


@of_links
def test_a_problem_follows_its_model(links):
    p = default(links)
    assert (p.dt, len(p.x_r)) == (p.model.h, SIZES[links])
    finer = replace(p, model=p.model._replace(h=0.01))
    assert finer.dt == 0.01
    heavy = p.with_physical(replace(p.physical, link1_mass=0.7))
    assert heavy.model != p.model
    assert heavy.parameters == p.parameters
    assert not np.allclose(heavy.lqr.K, p.lqr.K)


@pytest.mark.parametrize(('change', 'words'), [
    ({'limits': LimitParameters(force_limit=0.0)}, 'force_limit'),
    ({'cost': CostParameters(state_weights=(0, 100, 100, 2, 6, 0.1))}, 'state_weights'),
    ({'links': 1}, 'parameter reference has 6 numbers; expected 4 for links 1'),
    ({'links': 3, 'cost': CostParameters(reference=tuple(hanging(3).tolist()))},
     'parameter state_weights has 6 numbers; expected 8 for links 3'),
])
def test_an_impossible_problem_is_refused(change, words):
    with pytest.raises(ParameterError, match=words):
        problem(**change)


@pytest.mark.parametrize(('group', 'name', 'value', 'words'), [
    (LimitParameters, 'force_limit', float('nan'), 'finite'),
    (LimitParameters, 'force_limit', -1.0, 'at least 0'),
    (PendulumParameters, 'link1_mass', 0.0, 'at least 0.001 kg'),
    (PendulumParameters, 'links', 4, 'at most 3'),
    (PendulumParameters, 'links', 0, 'at least 1'),
    (PredictionParameters, 'model', 'rk5', 'rk4, euler'),
    (PredictionParameters, 'horizon', 2.5, 'horizon'),
    (CostParameters, 'reference', (0.0, 0.0), 'list of 4'),
    (CostParameters, 'state_weights', (1, 1, 1, 1, 1, -1), 'at least 0'),
])
def test_impossible_parameters_are_refused(group, name, value, words):
    with pytest.raises(ParameterError, match=words) as caught:
        group(**{name: value})
    assert name in str(caught.value)


def test_parameters_are_frozen():
    with pytest.raises(FrozenInstanceError):
        PendulumParameters().link1_mass = 2.0


@of_links
def test_dry_friction_does_not_change_the_regulator(links):
    """Made smooth it would count as strong viscous friction, on which one cannot rely at rest."""
    dry = PendulumParameters(links=links, cart_dry_friction=4.0, joint1_dry_friction=0.05)
    found, expected = (Problem.of(each, LimitParameters(), controllers.cost({'links': links}),
                                  PredictionParameters())
                       for each in (dry, PendulumParameters(links=links)))
    np.testing.assert_array_equal(found.lqr.K, expected.lqr.K)
    np.testing.assert_array_equal(found.cost.P, expected.cost.P)
    assert found.model.pendulum.dry[:2] == (4.0, 0.05)


SPRINGS = {'joint1_stiffness': 0.3, 'joint2_stiffness': 0.2, 'joint1_preload': 0.9}


def sprung(**more):
    return default(2).with_physical(PendulumParameters(**{**SPRINGS, **more}))


@pytest.mark.parametrize('turns', [(0, 0), (1, 1), (-1, -1)])
def test_with_springs_the_goal_is_where_links_rest_on_a_turn(turns):
    """And states stay as they are, which springs do not know turns of."""
    problem, where = sprung(), np.zeros(6)
    where[1:3] = TURN * np.array(turns)
    there, back = problem.with_goal_on(where)
    assert not np.any(back)
    rest = there.x_r
    assert 0.1 < np.abs(rest - where).max() < 0.5
    np.testing.assert_allclose(rollout(there.model, rest, np.zeros(20)), np.tile(rest, (21, 1)),
                               atol=1e-6)
    X = regulator_rollout(there, near(rest)).X
    np.testing.assert_allclose(X[-1], rest, atol=5e-3)
    assert problem.is_reached(rest)
    assert problem.with_goal_on(where)[0] is there


def test_without_springs_every_turn_is_the_same():
    problem, where = default(2), np.array([0.0, TURN, -TURN, 0.0, 0.0, 0.0])
    there, back = problem.with_goal_on(where)
    assert there is problem and back is where
    preloaded = sprung(joint1_stiffness=0.0, joint2_stiffness=0.0)
    assert preloaded.with_goal_on(where)[0] is preloaded and preloaded.x_r[1] != 0.0


def test_springs_that_let_no_link_stand_are_refused():
    with pytest.raises(ParameterError, match=r'joint1_preload.*no rest within.*weaker'):
        sprung(joint1_preload=20.0)
    problem = sprung(joint2_stiffness=0.5)
    wound = np.array([0.0, 0.0, 3 * TURN, 0.0, 0.0, 0.0])
    assert problem.with_goal_on(wound)[0] is problem
    assert problem.on_turn_of(wound) is None and not problem.is_reached(wound)
    assert problem.on_turn_of(problem.x_r) is problem
    for one, x in (default(2), wound), (problem, np.full(6, np.nan)):
        assert one.on_turn_of(x) is one


@of_links
def test_the_forces_of_a_policy_stay_between_two_bounds(links, rng):
    bounded = replace(default(links), bounds=Bounds(-2.0, 9.0))
    x_0 = 0.3 * rng.normal(size=SIZES[links])
    none = np.zeros((10, SIZES[links]))
    found = policy_rollout(bounded, x_0, none, rng.uniform(-20, 20, 10), none)
    assert (found.U[:10].min(), found.U[:10].max()) == (-2.0, 9.0)
    assert (found.U.min(), found.U.max()) == (-2.0, 9.0)
    assert bounded.u_max == 9.0
