# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The limits of a rig: what is sent keeps them, and where that cannot be, the cart is braked."""

import math

from controllers import controller, plant
import numpy as np
import pytest

from dp_swing_ros.control.commands import SentCommands
from dp_swing_ros.control.supervisor import (
    braked, limited, Supervisor, SupervisorParameters, violation)
from dp_swing_ros.pendulum.model import step
from dp_swing_ros.pendulum.parameters import LimitParameters
from dp_swing_ros.pendulum.state import hanging, is_upright, upright
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import Bounds
from dp_swing_ros.simulation.closed_loop import simulate

SOLVERS = pytest.mark.parametrize('name', ['ilqr', 'ddp', 'mppi'])
NEAR_THE_END = np.array([2.1, math.pi, math.pi, 4.0, 0.0, 0.0])   # which 20 N cannot keep


def commands_of(c, p, duration=3.0):
    """Close the loop; return the commands sent, and the episode."""
    sent = []
    episode = simulate(p, c, duration, on_tick=lambda t, plan: sent.append(plan.first_force(20.0)))
    return np.array([0.0, *sent]), episode


# by itself

def supervised(**parameters):
    """Return a supervisor, and a belief of a moment ago, [s] 0, near the goal."""
    x = upright() + np.array([0.1, 0.02, -0.02, 0.0, 0.0, 0.0])
    belief = controller(estimator='none').observer.belief._replace(t=0.0, x=x)
    return Supervisor(SupervisorParameters(**parameters)), belief


def test_blind_for_too_long_it_lets_no_force_act():
    supervisor, belief = supervised(carry_over=0.2)
    assert supervisor.admits(belief, belief.x, 0.0)
    refused = belief._replace(rejection='it is refused')
    assert supervisor.admits(refused, belief.x, 0.2)
    assert not supervisor.admits(refused, belief.x, 0.25)
    assert not supervisor.admits(belief, belief.x, 0.30)   # it is as old as it was
    assert supervisor.admits(belief._replace(t=0.3), belief.x, 0.35)
    supervisor.reset()
    assert not supervisor.acts(0.35)


def test_disabled_it_admits_nothing_and_says_so():
    supervisor, belief = supervised(enabled=False)
    assert not supervisor.admits(belief, belief.x, 0.0)
    plan = supervisor.fallback(belief, belief.x, None, SentCommands(), 0.0)
    assert plan.stats.status is Status.DISABLED and not plan.U.any()
    assert supervisor.enable(True) and not supervisor.enable(True)
    assert supervisor.admits(belief, belief.x, 0.0)


def test_without_a_solve_it_holds_what_can_be_held_and_lets_go_of_the_rest():
    supervisor, belief = supervised()
    assert supervisor.admits(belief, belief.x, 0.0)
    for x_0, status in ((belief.x, Status.REGULATOR), (hanging(), Status.ZERO)):
        plan = supervisor.fallback(belief, x_0, None, SentCommands(), 0.0)
        assert plan.stats.status is status
    held = supervisor.fallback(belief, belief.x, None, SentCommands(), 0.0)
    last = supervisor.fallback(belief, None, held, SentCommands(), 0.05)
    assert last.stats.status is Status.LAST_POLICY


def test_what_it_is_told_to_stop_is_braked_and_then_disabled():
    supervisor, belief = supervised(controlled_stop=0.5)
    assert supervisor.admits(belief, belief.x, 0.0)
    supervisor.stop('the process ends')
    assert not supervisor.admits(belief, belief.x, 0.0)
    plan = supervisor.fallback(belief, belief.x, None, SentCommands(), 0.0)
    assert plan.stats.status is Status.STOP
    assert supervisor.admits(belief._replace(t=0.45), belief.x, 0.45) is False
    assert supervisor.enabled
    assert not supervisor.acts(0.5)
    assert not supervisor.enabled and not supervisor.stopping


# in a loop

@SOLVERS
@pytest.mark.parametrize('rate', [20.0, 100.0])
def test_a_command_changes_as_fast_as_it_may(name, rate):
    limit = 500.0
    f, _ = commands_of(controller(name, force_rate_limit=limit), plant(rate=rate), 1.5)
    steepest = np.abs(np.diff(f)).max() * rate
    assert 0.99 * limit < steepest <= limit * (1 + 1e-9)   # it would be steeper


def test_a_plan_knows_its_first_force():
    c = controller(force_rate_limit=100.0)
    first = c.update(0.0, hanging())
    assert first.U[0] == 0.0   # how long there was none before is not known
    plan = c.update(0.05, hanging() + 1e-3)
    assert abs(plan.first_force(20.0)) == pytest.approx(100.0 * c.belief.problem.dt)
    step(c.belief.problem.model, plan.X[0], plan.U[0], x := np.empty(6))
    assert np.allclose(x, plan.X[1])
    again = limited(c.belief.problem, plan, Bounds(plan.U[0], plan.U[0]))
    assert again is plan


def test_after_a_gap_a_command_changes_by_no_more_than_in_a_step():
    c = controller(force_rate_limit=100.0)
    t, sent = np.array([0.0, 0.05, 0.23]), []   # a gap that the last plan covers
    for each in t:
        sent.append(c.update(each, hanging() + 0.01 * each).first_force(20.0))
    assert abs(sent[2] - sent[1]) == pytest.approx(100.0 * c.belief.problem.dt)


def test_a_command_is_measured_by_the_one_before_not_by_one_that_it_replaces():
    forces = SentCommands()
    for begins, command in ((0.0, 1.0), (0.05, 2.0)):
        forces.add(begins, command)
    assert forces.last(0.05) == (1.0, 0.0)
    assert forces.last(0.06) == (2.0, 0.05)
    assert forces.last(0.0) == (0.0, 0.0)   # what was before is not known


def test_zero_is_sent_at_once():
    c = controller(force_rate_limit=100.0)
    for n in range(3):
        plan = c.update(0.05 * n, hanging() + 1e-3 * n)
    assert abs(plan.U[0]) > 5.0
    c.enable(False)
    assert c.update(0.15, hanging()).U[0] == 0.0


@SOLVERS
def test_plans_keep_a_limit_of_the_speed(name):
    limit = 2.0
    c, p = controller(name, limits=LimitParameters(cart_speed_limit=limit)), plant()
    _, episode = commands_of(c, p, 8.0)
    assert np.abs(episode.X[:, 3]).max() < limit
    assert is_upright(episode.X[-1])
    _, free = commands_of(controller(name), plant(), 2.0)
    assert np.abs(free.X[:, 3]).max() > 1.5 * limit


def test_the_brake_brings_the_cart_to_rest_and_holds_it():
    c = controller()
    for x in (NEAR_THE_END, np.array([0.0, 2.5, 2.0, -1.0, 1.0, -1.0]), upright()):
        plan = braked(c.belief.problem, x, 0.0, math.inf)
        speeds = np.abs(plan.X[:, 3])
        assert np.all(np.diff(speeds[speeds > 0.1]) < 0) and speeds[-10:].max() < 0.01
        assert np.abs(plan.U).max() <= c.belief.problem.u_max
        slow = braked(c.belief.problem, x, 3.0, 2.0)
        assert np.abs(np.diff(np.append(3.0, slow.U))).max() <= 2.0 + 1e-12


def test_what_is_not_kept_is_said():
    c = controller(limits=LimitParameters(cart_speed_limit=2.0))
    X = np.array([upright(), NEAR_THE_END])
    assert violation(c.belief.problem, X) == '4 m/s instead of cart_speed_limit 2 m/s at most'
    X[1, 0] = -2.5
    assert violation(c.belief.problem, X) == '2.5 m instead of track_limit 2.4 m at most'
    assert violation(c.belief.problem, X[:1]) == ''
    assert violation(c.belief.problem, np.full((1, 6), math.nan)) != ''


@SOLVERS
def test_where_a_limit_cannot_be_kept_the_cart_is_braked_then_free(name):
    c, p = controller(name, controlled_stop=0.5), plant(
        limits=LimitParameters(track_limit=9.0), initial_state=tuple(NEAR_THE_END))
    seen, speeds = [], []
    simulate(p, c, 1.0, on_tick=lambda t, plan: (
        seen.append((plan.stats.status, plan.U[0])), speeds.append(p.x[3])))
    statuses = [status for status, _ in seen]
    assert statuses == [Status.STOP] * 10 + [Status.DISABLED] * 10
    assert seen[0][1] == -20.0 and not any(force for _, force in seen[10:])
    assert abs(speeds[9]) < 0.1 and not c.enabled
    assert c.enable(True)
    assert c.update(1.0, p.x).stats.status is Status.STOP   # it is beyond the limit
    assert c.enable(True)
    c.reset()
    assert c.update(1.05, hanging()).stats.status not in (Status.STOP, Status.DISABLED)


@SOLVERS
def test_where_limits_can_be_kept_it_changes_nothing(name):
    plain, first = commands_of(controller(name), plant())
    stopping, second = commands_of(controller(name, controlled_stop=1.0), plant())
    assert np.array_equal(plain, stopping) and np.array_equal(first.X, second.X)


def test_a_stop_from_outside_goes_on_without_states():
    c, p = controller(controlled_stop=0.3), plant()
    simulate(p, c, 0.5)
    c.stop('the process ends')
    first = c.update(p.t, p.x)
    assert first.stats.status is Status.STOP and abs(p.x[3]) > 0.5
    second = c.fallback(p.t + 0.05)
    assert second.stats.status is Status.STOP and second.U[0] == pytest.approx(first.U[1])
    assert c.fallback(p.t + 0.3).stats.status is Status.DISABLED
    assert c.fallback(p.t + 0.35).U[0] == 0.0


def test_blind_it_does_not_brake():
    c = controller(controlled_stop=5.0)
    c.update(0.0, hanging())
    c.stop('the process ends')
    assert c.fallback(0.1).stats.status is Status.STOP
    assert c.fallback(0.4).stats.status is Status.ZERO
