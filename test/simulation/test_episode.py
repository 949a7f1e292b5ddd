# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import dataclasses

import numpy as np
import pytest
from synthetic import first, swing_up, without_ticks

from dp_swing_ros.pendulum.equations import Pendulum, resting
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import wrapped
from dp_swing_ros.simulation.episode import Ticks

STATE = {1: ['x', 'theta1', 'x_dot', 'theta1_dot'],
         2: ['x', 'theta1', 'theta2', 'x_dot', 'theta1_dot', 'theta2_dot'],
         3: ['x', 'theta1', 'theta2', 'theta3', 'x_dot', 'theta1_dot', 'theta2_dot', 'theta3_dot']}
OTHERS = ['force', 'cost', 'iterations', 'solve_time', 'latency', 'late', 'status']


@pytest.mark.parametrize('links', STATE)
def test_frame_has_a_row_a_state_with_force_and_tick(links):
    episode = swing_up(links=links)
    frame = episode.to_frame()
    assert list(frame.columns) == [*STATE[links], *OTHERS]
    assert frame.index.name == 't [s]'
    np.testing.assert_array_equal(frame.index, episode.t)
    np.testing.assert_array_equal(frame[STATE[links]], wrapped(episode.X))
    np.testing.assert_array_equal(episode.to_frame(whole_turns=True)[STATE[links]],
                                  episode.X)
    np.testing.assert_array_equal(frame['force'][:-1], episode.U)
    np.testing.assert_array_equal(frame['solve_time'][:-1], episode.ticks.solve_time)
    assert frame['status'].iloc[0] == 'CONVERGED'
    assert frame.iloc[-1][OTHERS].isna().all()
    assert frame.attrs == {
        'solver': 'ilqr', 'physical': episode.physical, 'limits': episode.limits, 'incomplete': ''}


def test_zero_is_upright_in_a_frame_whatever_the_turn():
    episode = swing_up()     # θ2 turns a round on
    assert episode.X[-1, 2] == pytest.approx(2 * np.pi)
    last = episode.to_frame().iloc[-1]
    assert (last['theta1'], last['theta2']) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert episode.to_frame(whole_turns=True).iloc[-1]['theta2'] == episode.X[-1, 2]


@pytest.mark.parametrize('turn', [0.0, 2 * np.pi])
def test_errors_with_springs_are_from_where_the_links_can_rest(turn):
    physical = PendulumParameters(joint1_stiffness=0.3, joint1_preload=0.9, joint2_stiffness=0.1)
    rest = resting(Pendulum.of(physical), np.array([0.0, turn, turn, 0.0, 0.0, 0.0]))
    episode = dataclasses.replace(swing_up(), physical=physical, X=np.tile(rest, (3, 1)))
    np.testing.assert_allclose(episode.errors, 0.0, atol=1e-5)
    assert np.abs(dataclasses.replace(episode, physical=PendulumParameters()).errors).max() > 0.1


def test_ticks_of_a_frame_stand_by_their_states():
    episode = swing_up()
    some = Ticks(*(np.asarray(column)[[3, 7, 7]] for column in episode.ticks))
    some = some._replace(cost=np.array([1.0, 2.0, 3.0]), late=np.array([False, True, True]),
                         status=['MAX_ITERATIONS', 'CONVERGED', 'STALLED'])
    frame = dataclasses.replace(episode, ticks=some).to_frame()
    assert len(frame) == len(episode.t)
    known = frame.dropna(subset=['status'])
    np.testing.assert_array_equal(known.index, episode.t[[3, 7]])
    assert (list(known['cost']), list(known['late'])) == ([1.0, 3.0], [False, True])
    assert list(known['status']) == ['MAX_ITERATIONS', 'STALLED']
    assert frame['iterations'].sum() == 6
    assert frame['late'].sum() == 1


@pytest.mark.parametrize('states', [0, 1])
def test_frame_of_hardly_a_run_has_its_columns(states):
    frame = first(swing_up(), states).to_frame()
    assert list(frame.columns) == [*STATE[2], *OTHERS]
    assert len(frame) == states


def test_frame_without_a_controller_has_no_ticks():
    frame = without_ticks(swing_up()).to_frame()
    assert frame['cost'].isna().all()
    assert frame['force'].notna().sum() == len(frame) - 1
