# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The protocol of the parts of a tick: each in turn of another make, with no more than it needs.

What a part here does not have, no tick asks of it.
"""

from dataclasses import replace
import math

from controllers import controller, plant
import numpy as np
import pytest

from dp_swing_ros.control.observer import Belief
from dp_swing_ros.pendulum.parameters import DIRECT
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import plan_of, regulator_rollout
from dp_swing_ros.simulation.closed_loop import simulate

LEANING = np.array([0.1, 0.02, -0.01, 0.0, 0.05, 0.0])


class Trust:
    """An observer that believes what is measured."""

    def __init__(self, nominal):
        self.nominal, self.nominal_drive, self.adaptive = nominal, DIRECT, None
        self.reset()

    def reset(self):
        self.belief = Belief(-math.inf, np.full(6, np.nan), self.nominal, DIRECT, '', None)

    def is_another_run(self, t):
        return t < self.belief.t

    def update(self, t, x, time_noise, commands):
        self.belief = self.belief._replace(t=t, x=x)
        return self.belief

    def predict_as(self, prediction):
        self.nominal = self.nominal.with_prediction(prediction)
        self.belief = self.belief._replace(problem=self.nominal)


class Immediate:
    """Commands that act where they are sent, so that there is no delay to compensate."""

    sent = None

    def __init__(self):
        self.added = []

    def begin(self, t, speed):
        pass

    def compensate(self, belief, acts_at):
        return belief.x

    def add(self, t, command):
        self.added.append((t, command))

    def last(self, t):   # of the supervisor, that a change may be limited
        return 0.0, t


class Regulator:
    """A planner without a solver: what the regulator does."""

    def reset(self, problem):
        self.kept = []

    def set_problem(self, problem):
        pass

    def plan(self, problem, x_0, acts_at, deadline):
        _, X, U, _ = regulator_rollout(problem, x_0)
        return plan_of(problem, X, U, Status.CONVERGED)

    def warm_start(self, acts_at):
        return None

    def keep(self, plan, acts_at):
        self.kept.append(acts_at)

    def discard(self):
        pass


class Consent:
    """A supervisor that lets all pass."""

    enabled, stopping = True, ''

    def reset(self):
        pass

    def admits(self, belief, x_0, acts_at):
        return True

    def command(self, plan, belief, commands, acts_at):
        return plan


def with_parts(**parts):
    """Return a controller of which some parts are of another make."""
    c = controller(estimator='none')
    for name, part in parts.items():
        setattr(c, name, part(c.nominal) if part is Trust else part())
    c.reset()
    return c


def held(c):
    """Return whether it holds the pendulum upright for a while."""
    end = simulate(plant(start='up_up'), c, 3.0).X[-1]
    return bool(np.all(np.abs(end[:3]) < 0.05))


@pytest.mark.parametrize('parts', [
    {}, {'observer': Trust}, {'planner': Regulator}, {'supervisor': Consent},
    {'observer': Trust, 'planner': Regulator, 'supervisor': Consent}],
    ids=lambda parts: '+'.join(parts) or 'own')
def test_the_pendulum_is_held_with_parts_of_another_make(parts):
    assert held(with_parts(**parts))


def test_each_part_is_asked_in_turn():
    c = with_parts(observer=Trust, planner=Regulator)
    c.commands = Immediate()
    plan = c.update(0.0, LEANING, 0.01)
    assert np.array_equal(plan.X[0], LEANING)
    assert c.planner.kept == [0.01] and c.commands.added == [(0.01, plan.first_force(20.0))]
    assert c.belief.t == 0.0


def test_what_a_supervisor_changes_is_what_is_sent():
    class Halved(Consent):
        def command(self, plan, belief, commands, acts_at):
            return replace(plan, U=plan.U / 2)

    whole, half = (with_parts(planner=Regulator, supervisor=each).update(0.0, LEANING)
                   for each in (Consent, Halved))
    assert whole.first_force(20.0) == 2 * half.first_force(20.0) != 0.0
