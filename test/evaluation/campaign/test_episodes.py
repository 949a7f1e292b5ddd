# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import dataclasses

import numpy as np

from dp_swing_ros.evaluation.campaign.contestants import parse, play, simulated
from dp_swing_ros.evaluation.campaign.rows import ERROR, identical
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.evaluation.scenarios import Case, SCENARIOS


def test_a_swing_up_is_held():
    row = play(parse('ilqr'), Case('hanging', 3, 4.0))
    assert row.key == ('ilqr', 'hanging', '', None, 3)
    assert (row.outcome, row.detail) == ('HELD', '')
    assert row.metrics.success
    assert row.metrics.ticks == len(row.solve_times) == 80


def test_the_same_case_gives_the_same_row():
    case = next(SCENARIOS['force_noise'].cases('force_noise', range(2, 3), 2, 2.0))
    assert identical(play(parse('mppi'), case), play(parse('mppi'), case))


def test_the_plant_is_changed_and_the_controller_s_model_is_not():
    heavy = Case('model', 0, 1.0, 'link1_mass', 1.25, {'link1_mass': 0.625})
    plain = Case('model', 0, 1.0)
    contestant = parse('ilqr')
    assert play(contestant, heavy).metrics.energy != play(contestant, plain).metrics.energy
    knowing = dataclasses.replace(contestant, mpc={'link1_mass': 0.625}, label='knowing')
    assert play(knowing, heavy).metrics.energy != play(contestant, heavy).metrics.energy


def test_a_drive_of_velocities_is_that_of_the_plant_too():
    case = Case('near_goal', 0, 2.0, plant={'initial_state': [0.0, 0.1, 0.1, 0.0, 0.0, 0.0]})
    episode = simulated(parse('ilqr:drive=velocity'), case)
    assert episode.physical.drive == 'velocity'
    assert measure(episode).success


def test_pushes_reach_the_cart():
    pushes = tuple(np.full(20, 5.0))
    assert play(parse('nothing'), Case('pushes', 0, 1.0, pushes=pushes)).metrics.energy == 0.0
    assert play(parse('nothing'), Case('pushes', 0, 1.0, pushes=pushes)
                ).metrics.largest_position > 0.5


def test_what_is_told_holds_for_plant_and_controller():
    case = Case('tight', 0, 3.0, told={'force_limit': 6.0, 'track_limit': 1.5})
    row = play(parse('ilqr'), case)
    assert row.metrics.largest_force <= 6.0
    assert row.metrics.strikes == 0
    assert play(parse('ilqr'), dataclasses.replace(case, plant=case.told, told={})
                ).metrics.closed_loop_cost != row.metrics.closed_loop_cost


def test_a_reset_puts_the_pendulum_there_and_it_comes_up_again():
    there = (0.5, 3.0, 2.0, 0.0, 1.0, -1.0)
    case = Case('uptime', 0, 8.0, resets=((70, there),))
    episode = simulated(parse('ilqr'), case)
    np.testing.assert_array_equal(episode.X[70], there)
    metrics = measure(episode)
    assert metrics.success and metrics.settling_time > 4.0
    assert metrics.uptime > 0.3


def test_a_deadline_is_that_of_the_mpc():
    row = play(parse('mppi:time_limit=0.0001'), Case('hanging', 0, 1.0))
    assert row.metrics.deadline_misses == 20


def test_the_goal_of_a_case_is_the_controller_s_and_is_measured():
    case = Case('transitions', 0, 6.0, 'up_up to down_down', plant={'start': 'up_up'},
                mpc={'goal': 'down_down'})
    row = play(parse('ilqr'), case)
    assert row.outcome == 'HELD'
    assert 1.0 < row.metrics.settling_time < 4.5


def test_an_episode_that_raises_is_a_row():
    row = play(parse('ilqr'), Case('hanging', 5, 1.0, plant={'force_noize': 1.0}))
    assert row.key.seed == 5
    assert row.outcome == ERROR
    assert "'force_noize'" in row.detail
    assert not row.metrics.success
