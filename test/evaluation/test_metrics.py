# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import dataclasses
import math

import numpy as np
import pytest
from synthetic import first, PERIOD, swing_up, without_ticks

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.metrics import measure, Outcome, outcome, settling_time
from dp_swing_ros.pendulum.state import is_upright
from dp_swing_ros.problem.cost import running


def with_state(episode, place, values):
    X = episode.X.copy()
    X[place] = values
    return dataclasses.replace(episode, X=X)


def test_swing_up_is_a_success_that_settles_before_the_rise_ends():
    metrics = measure(swing_up())
    assert metrics.success
    assert 1.5 < metrics.settling_time < 2.0
    assert metrics.states == 81
    assert metrics.ticks == 80
    assert metrics.duration == pytest.approx(4.0)
    assert metrics.late_ticks == 0
    assert metrics.hold_error == pytest.approx(0.0, abs=1e-9)


def test_what_is_largest_counts_either_way():
    episode = with_state(swing_up(), 3, [-1.7, 0, 0, 0, 0, 0])
    episode.U[5] = -19.5
    metrics = measure(dataclasses.replace(episode, U=np.clip(episode.U, -19.5, 19.0)))
    assert metrics.largest_position == 1.7
    assert metrics.largest_force == 19.5


@pytest.mark.parametrize('state', [
    [0, 0.11, 0, 0, 0, 0], [0, 0, -0.11, 0, 0, 0],
    [0, 0, 0, 1.1, 0, 0], [0, 0, 0, 0, -1.1, 0], [0, 0, 0, 0, 0, 1.1], [0, math.nan, 0, 0, 0, 0]])
def test_one_fallen_state_moves_the_settling_time_behind_it(state):
    episode = with_state(swing_up(), 50, state)
    assert measure(episode).settling_time == pytest.approx(51 * PERIOD)


def test_whole_turns_are_upright():
    assert measure(with_state(swing_up(), 50, [2, 4 * np.pi, -2 * np.pi, 0, 0, 0])).success


def test_what_is_measured_is_the_goal():
    """A run whose links come to hang behaves like one that swings up, seen from its goal."""
    goal = np.array([0.3, np.pi, np.pi, 0.0, 0.0, 0.0])
    up = swing_up()
    down = dataclasses.replace(up, X=up.X + goal, goal=goal)
    assert not measure(dataclasses.replace(down, goal=None)).success
    assert outcome(down) is Outcome.HELD
    found, expected = measure(down), measure(up)
    for name in ('settling_time', 'settling_time_with_cart', 'settling_offset', 'rest_offset',
                 'hold_error', 'largest_angle', 'uptime', 'closed_loop_cost', 'energy'):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), abs=1e-9), name
    assert found.largest_position > expected.largest_position


def test_falling_at_the_end_is_no_success():
    metrics = measure(with_state(swing_up(), -1, [0, 0.2, 0, 0, 0, 0]))
    assert not metrics.success
    assert math.isnan(metrics.settling_time)


def test_passing_by_upright_at_the_end_is_no_success():
    assert not measure(first(swing_up(rise=2.0), 45)).success


def test_a_run_that_starts_upright_settles_at_once():
    episode = swing_up()
    assert settling_time(episode.t[:5], np.zeros((5, 6))) == 0.0


def test_hold_error_is_that_of_both_angles_in_the_last_two_seconds():
    episode = swing_up()
    X = episode.X.copy()
    X[-42, 1:3] = 0.09
    X[-41:-20, 1] = 0.03
    X[-20:, 1] = 0.05
    X[-41:, 2] = 2 * np.pi - 0.04
    metrics = measure(dataclasses.replace(episode, X=X))
    squares = (21 * 0.03 ** 2 + 20 * 0.05 ** 2) / 41 + 0.04 ** 2
    assert metrics.hold_error == pytest.approx(math.sqrt(squares / 2))


def test_smoothness_is_the_spread_of_the_steps_of_the_force():
    episode = swing_up()
    forces = np.where(np.arange(80) % 2, 1.0, -1.0)
    assert measure(dataclasses.replace(episode, U=np.full(80, 7.0))).smoothness == 0.0
    assert measure(dataclasses.replace(episode, U=forces)).smoothness == pytest.approx(2, rel=1e-2)


def test_times_of_the_solver_are_quantiles():
    metrics = measure(swing_up())
    assert metrics.median_solve_time == pytest.approx(0.002)
    assert metrics.p99_solve_time == pytest.approx(0.00298)
    assert metrics.largest_solve_time == pytest.approx(0.003)
    assert metrics.median_latency == pytest.approx(0.003)
    assert metrics.p99_latency == pytest.approx(0.00398)


def test_late_ticks_are_counted():
    episode = swing_up()
    episode.ticks.late[[3, 7]] = True
    assert measure(episode).late_ticks == 2


def test_latencies_that_are_unknown_are_left_out():
    episode = swing_up()
    episode.ticks.latency[:] = math.nan
    episode.ticks.latency[4] = 0.006
    assert measure(episode).p99_latency == 0.006


def with_forces(episode, forces):
    return dataclasses.replace(episode, U=np.resize(forces, len(episode.U)).astype(float))


def test_effort_is_summed_over_the_periods():
    episode = with_forces(swing_up(), [4.0, -2.0])
    X = np.zeros_like(episode.X)
    X[:, 0] = 0.01 * np.arange(len(X))       # the cart moves 1 cm a period
    X[:, 4], X[:, 5] = 3.0, 1.0              # so the second joint turns at -2 rad/s
    metrics = measure(dataclasses.replace(episode, X=X))
    assert metrics.energy == pytest.approx(80 * 0.01 * 3.0)
    assert metrics.impulse == pytest.approx(4.0 * 3.0)
    assert metrics.squared_force == pytest.approx(4.0 * 10.0)
    assert metrics.squared_speed == pytest.approx(4.0 * (3.0 ** 2 + 2.0 ** 2))


@pytest.mark.parametrize('links, speeds', [(1, [3.0]), (3, [3.0, -2.0, 4.0])])
def test_squared_speeds_are_those_of_the_joints(links, speeds):
    episode = swing_up(links=links)
    X = np.zeros_like(episode.X)
    X[:, links + 2:] = np.cumsum(speeds)   # of the links; those of the joints are between them
    metrics = measure(dataclasses.replace(episode, X=X))
    assert metrics.squared_speed == pytest.approx(4.0 * np.sum(np.square(speeds)))


@pytest.mark.parametrize('links', [1, 3])
def test_pendulums_of_other_numbers_of_links_are_measured(links):
    episode = swing_up(links=links)
    metrics = measure(episode)
    assert metrics.success and metrics.closed_loop_cost > 0
    X = episode.X.copy()
    X[50, links] = 0.11   # the last angle alone
    assert measure(dataclasses.replace(episode, X=X)).settling_time == pytest.approx(51 * PERIOD)
    assert outcome(first(episode, 30)) is Outcome.NEVER_UP


def test_a_driven_cart_has_no_energy_that_is_known():
    episode = swing_up()
    driven = dataclasses.replace(episode, physical=dataclasses.replace(
        episode.physical, drive='acceleration'))
    assert math.isnan(measure(driven).energy)
    assert measure(episode).energy > 0.0
    assert measure(driven).squared_force == measure(episode).squared_force


def test_roughness_is_that_of_all_the_run():
    forces = np.zeros(80)
    forces[:10] = [5.0, -5.0] * 5
    metrics = measure(dataclasses.replace(swing_up(), U=forces))
    assert metrics.smoothness == 0.0
    assert metrics.roughness == pytest.approx(np.std(np.diff(forces)))


def test_the_largest_angle_does_not_count_the_start():
    X = np.zeros((81, 6))
    X[0, 1:3], X[7, 2] = 3.0, 2 * np.pi - 0.35
    assert measure(dataclasses.replace(swing_up(), X=X)).largest_angle == pytest.approx(0.35)


def test_a_strike_is_an_entry_into_the_end_stop():
    assert measure(swing_up()).strikes == 0
    once = with_state(swing_up(), slice(3, 5), [-2.4, 3, 3, 0, 0, 0])
    assert measure(once).strikes == 1
    assert measure(with_state(once, 8, [2.4, 3, 3, 0, 0, 0])).strikes == 2
    assert measure(with_state(once, 0, [2.4, 3, 3, 0, 0, 0])).strikes == 2


def test_who_met_an_end_stop_has_not_held():
    struck = with_state(swing_up(), 3, [-2.4, 3, 3, 0, 0, 0])
    metrics = measure(struck)
    assert not metrics.success
    assert metrics.settling_time == measure(swing_up()).settling_time
    assert outcome(struck) is Outcome.STRUCK


def test_time_upright_is_a_share_of_the_states():
    episode = swing_up()
    assert measure(episode).uptime == np.mean(is_upright(episode.X))
    fallen = with_state(episode, slice(-10, None), [0, 3, 3, 0, 0, 0])
    assert measure(fallen).uptime == pytest.approx(measure(episode).uptime - 10 / 81)


def test_the_cart_may_be_off_the_centre_when_settled():
    episode = swing_up()
    X = episode.X.copy()
    X[:, 0] = np.linspace(-0.8, 0.0, len(X))
    metrics = measure(dataclasses.replace(episode, X=X))
    assert metrics.settling_offset == -X[round(metrics.settling_time / PERIOD), 0] > 0.3
    assert math.isnan(measure(first(swing_up(), 30)).settling_offset)
    near = np.flatnonzero(X[:, 0] >= -0.1)[0]
    assert math.isnan(metrics.settling_time_with_cart)   # the stay is shorter than a second
    longer = np.vstack([X, np.zeros((20, 6))])
    t = PERIOD * np.arange(len(longer))
    assert measure(dataclasses.replace(
        episode, t=t, X=longer, U=np.zeros(len(t) - 1))).settling_time_with_cart == t[near]


def test_the_closed_loop_cost_is_that_of_the_default_problem(rng):
    X, U = rng.normal(size=(81, 6)) * [2.4, 6, 6, 1, 5, 5], rng.normal(0, 8, 80)
    cost = controllers.problem({}).cost
    expected = sum(running(cost, x, u) for x, u in zip(X, U))
    episode = dataclasses.replace(swing_up(), X=X, U=U)
    assert measure(episode).closed_loop_cost == pytest.approx(expected, rel=1e-12)


def test_solves_over_their_limit_are_counted():
    episode = swing_up()
    episode.ticks.solve_time[:3] = [0.041, 0.02, 0.06]
    assert measure(episode).deadline_misses == 2
    assert measure(episode, time_limit=0.05).deadline_misses == 1


def test_ticks_without_a_solve_are_counted():
    episode = swing_up()
    episode.ticks.status[:4] = ['LAST_POLICY', 'REGULATOR', 'ZERO', 'DEADLINE']
    assert measure(episode).stand_ins == 3


def test_times_of_the_solver_are_those_of_ticks_that_solved():
    episode, expected = swing_up(), measure(swing_up())
    often = dataclasses.replace(episode, ticks=episode.ticks._replace(
        t=np.repeat(episode.ticks.t, 4), status=['FEEDBACK'] * 3 * 80 + episode.ticks.status,
        solve_time=np.append(np.zeros(3 * 80), episode.ticks.solve_time)))
    found = measure(often)
    for name in ('median_solve_time', 'p99_solve_time', 'largest_solve_time', 'deadline_misses'):
        assert getattr(found, name) == getattr(expected, name)
    assert found.ticks == 4 * 80


def test_where_no_tick_solved_their_times_are_unknown():
    episode = swing_up()
    episode.ticks.solve_time[:] = 0.0
    metrics = measure(episode)
    assert math.isnan(metrics.median_solve_time)
    assert math.isnan(metrics.largest_solve_time)
    assert metrics.deadline_misses == 0


def test_outcome_of_a_success():
    assert outcome(swing_up()) is Outcome.HELD


@pytest.mark.parametrize('up, expected', [
    ([], Outcome.NEVER_UP), ([(20, 30)], Outcome.NEVER_HELD), ([(20, 41)], Outcome.FELL),
    ([(20, 41), (70, 81)], Outcome.FELL), ([(70, 81)], Outcome.TOO_LATE),
    ([(5, 15), (20, 30)], Outcome.NEVER_HELD), ([(40, 81)], Outcome.HELD),
    # 20 periods are a second, in whatever way they round
    ([(20, 40)], Outcome.NEVER_HELD), *(([(n, n + 21)], Outcome.FELL) for n in range(60)),
    ([(61, 81)], Outcome.TOO_LATE), ([(60, 81)], Outcome.HELD)])
def test_outcome_is_how_a_run_failed(up, expected):
    X = np.tile([0, np.pi, np.pi, 0, 0, 0], (81, 1))
    for begin, end in up:
        X[begin:end] = 0.0
    assert outcome(dataclasses.replace(swing_up(), X=X)) is expected


def test_outcome_of_a_state_that_is_no_number():
    assert outcome(with_state(swing_up(), 3, math.nan)) is Outcome.DIVERGED


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('states', [0, 1, 2, 3])
def test_short_runs_are_measured(states):
    metrics = measure(first(swing_up(), states))
    assert not metrics.success
    assert metrics.states == states


@pytest.mark.filterwarnings('error')
def test_runs_without_a_controller_are_measured():
    metrics = measure(without_ticks(swing_up()))
    assert metrics.ticks == 0
    assert math.isnan(metrics.median_solve_time)
