# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a report of a tick warns of: a goal that no plan comes to, a motion of no pendulum."""

import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.messages.fields import OK, WARN
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.runtime.report import GoalWatch, Reporter
from dp_swing_ros.runtime.sent import Log
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate


@pytest.mark.parametrize('goal, horizon, warns', [
    ('up_down', 30, True), ('up_down', 40, False), ('up_up', 30, False), ('down_up', 30, False)])
def test_a_goal_that_no_plan_comes_to_is_told(goal, horizon, warns):
    """From hanging; once there, it is not told again."""
    arrival, told = GoalWatch(), []
    controller = controllers.controller({'goal': goal, 'horizon': horizon})
    problem = controller.belief.problem

    def on_tick(t, plan):
        told.append(arrival.warning(
            t, problem.is_reached(controller.belief.x), problem.is_reached(plan.X[-1]),
            problem.horizon * problem.dt))
    simulate(plants.plant({}), controller, 6.0, on_tick=on_tick)
    assert any(told) is warns and bool(told[-1]) is warns
    assert not warns or 'expected a longer' in told[-1]


def test_it_begins_anew_where_time_does():
    arrival = GoalWatch()
    assert not any(arrival.warning(t, False, False, 1.0) for t in (10.0, 13.0))
    assert all(arrival.warning(t, False, False, 1.0) for t in (13.1, 19.0))
    assert not any(arrival.warning(t, False, False, 1.0) for t in (1.0, 4.0))
    assert arrival.warning(5.0, False, False, 1.0) and not arrival.warning(5.1, False, True, 1.0)


def test_plans_in_vain_are_told_until_the_pendulum_is_there():
    arrival = GoalWatch()
    assert not any(arrival.warning(float(t), False, True, 1.0) for t in range(9))
    assert 'plans come to the goal, but the pendulum has not for 9.0 s' in (
        arrival.warning(9.0, False, True, 1.0))
    assert not arrival.warning(10.0, True, True, 1.0)
    assert not arrival.warning(18.0, False, True, 1.0)
    assert arrival.warning(18.1, False, True, 1.0)


def test_a_motion_that_no_pendulum_explains_is_told():
    c, said = controllers.controller({}), []
    reporter, plan = Reporter(c, Log(said.append, lambda: 0.0)), c.update(0.0, hanging())

    def report():
        return reporter.report(0, plan, '', '', time=0.0, delay=0.0, force=0.0, carried=0,
                               resets=0, number=0, real_time=False)
    assert (report().level, report().values['explained'], said) == (OK, True, [])
    c.observer.belief = c.belief._replace(estimate=c.belief.estimate._replace(explained=False))
    found = report()
    assert (found.level, found.values['explained']) == (WARN, False)
    assert 'not those of a chain of rigid links' in found.message
    assert [each.text in found.message for each in said] == [True]
