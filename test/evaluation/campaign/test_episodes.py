# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import dataclasses

import numpy as np

from dp_swing_ros.evaluation.campaign.contestants import parse, play
from dp_swing_ros.evaluation.campaign.rows import ERROR, identical
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


def test_pushes_reach_the_cart():
    pushes = tuple(np.full(20, 5.0))
    assert play(parse('nothing'), Case('pushes', 0, 1.0, pushes=pushes)).metrics.energy == 0.0
    assert play(parse('nothing'), Case('pushes', 0, 1.0, pushes=pushes)
                ).metrics.largest_position > 0.5


def test_a_deadline_is_that_of_the_mpc():
    row = play(parse('mppi:time_limit=0.0001'), Case('hanging', 0, 1.0))
    assert row.metrics.deadline_misses == 20


def test_an_episode_that_raises_is_a_row():
    row = play(parse('ilqr'), Case('hanging', 5, 1.0, plant={'force_noize': 1.0}))
    assert row.key.seed == 5
    assert row.outcome == ERROR
    assert "'force_noize'" in row.detail
    assert not row.metrics.success
