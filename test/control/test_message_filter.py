# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which states cannot be, at the edges of what can."""

import math
from pathlib import Path

from controllers import controller, plant
import numpy as np
import pytest

from dp_swing_ros import declarations
from dp_swing_ros.control import controllers
from dp_swing_ros.control.message_filter import MessageFilter
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.pendulum.state import is_upright, LINKS, SIZES, upright
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate

TRACK = 2.4


def moving(x, t, until):
    """Predict that all positions move by 1 m and 1 rad a second."""
    return x + (until - t) * np.repeat([1.0, 0.0], len(x) // 2)


@pytest.mark.parametrize('links, place, bound, words', [
    *((links, 0, 2 * TRACK, 'position of cart') for links in LINKS),
    *((links, i, 2000 * math.pi, f'position of joint{i}')
      for links in LINKS for i in range(1, links + 1)),
    *((links, links + 1, 100.0, 'velocity of cart') for links in LINKS),
    *((links, links + 1 + i, 100.0, f'velocity of joint{i}')
      for links in LINKS for i in range(1, links + 1))])
@pytest.mark.parametrize('sign', [-1, 1])
def test_a_state_is_in_reach_up_to_its_bound(links, place, bound, words, sign):
    x = upright(links)
    x[place] = sign * bound
    assert MessageFilter(links, TRACK).rejection(0.0, x, moving) == ''
    assert words in MessageFilter(links, TRACK).rejection(0.0, 1.001 * x, moving)


@pytest.mark.parametrize('links', LINKS)
def test_only_the_last_half_second_is_asked_of(links):
    """A position that was the same a second ago, and has not been since, may be so again."""
    size, past = SIZES[links], MessageFilter(links, TRACK)
    for n in range(100):
        assert past.rejection(0.05 * n, np.full(size, 0.01 * n), moving) == ''
        assert len(past.past) <= 11
    frozen = np.full(size, 0.01 * 99)
    assert 'whole state has stood still' in past.rejection(5.0, frozen, moving)
    past.reset()
    assert past.rejection(5.05, frozen, moving) == ''


def rocking(n, links, dt=0.05):
    """Return the positions and velocities of a pendulum that rocks, at a tick."""
    phase = 0.3 + 0.9 * n * dt + np.arange(links + 1)
    return 2.9 * np.sin(phase), 2.9 * 0.9 * np.cos(phase)


def wrapped(q):
    """Return positions with angles from -π to π."""
    return np.concatenate((q[:1], (q[1:] + math.pi) % (2 * math.pi) - math.pi))


@pytest.mark.parametrize('late', [0.0, 5e-3])
@pytest.mark.parametrize('noise', [0.0, 5e-3])
@pytest.mark.parametrize('turns', [0, 1], ids=['unwrapped', 'wrapped'])
@pytest.mark.parametrize('links', LINKS)
def test_velocities_that_are_differences_of_positions_are_not_measured(links, turns, noise, late,
                                                                       rng):
    """Those of joints that pass ±π, too; a driver knows by how much they turned, and when."""
    messages, before, told = MessageFilter(links, TRACK), None, []
    for n in range(60):
        t = 0.05 * n + rng.uniform(0, late)
        q = rocking(n, links)[0] * (1, *[1 + turns] * links) + rng.normal(0.0, noise, links + 1)
        v = np.zeros(links + 1) if before is None else (q - before) / 0.05
        before = q
        x = np.concatenate((wrapped(q) if turns else q, v))
        assert messages.rejection(t, x, moving) == ''
        seen = messages.with_velocities_measured(np.concatenate((q, v)))
        np.testing.assert_array_equal(seen[:links + 1], q)
        told.append(np.isnan(seen[links + 1:]).all())
        assert told[-1] or np.isfinite(seen).all()
    assert all(told[1:]), np.flatnonzero(~np.array(told[1:]))


@pytest.mark.parametrize('noise', [0.0, 1e-3])
@pytest.mark.parametrize('links', LINKS)
def test_velocities_that_are_measured_are_believed(links, noise, rng):
    messages = MessageFilter(links, TRACK)
    for n in range(60):
        q, v = rocking(n, links)
        x = np.concatenate((q, v + rng.normal(0.0, noise, links + 1)))
        assert messages.rejection(0.05 * n, x, moving) == ''
        np.testing.assert_array_equal(messages.with_velocities_measured(x), x)


def test_what_stands_still_has_velocities_that_are_measured():
    messages = MessageFilter(2, TRACK)
    for n in range(3):
        assert messages.rejection(0.05 * n, np.zeros(6), lambda x, t, until: x) == ''
        np.testing.assert_array_equal(messages.with_velocities_measured(np.zeros(6)), np.zeros(6))


def encoded(q, counts):
    """Return what encoders of some counts a turn say, without velocities."""
    unit = np.array([0.2, *[2 * math.pi] * (len(q) - 1)]) / counts
    return np.concatenate((np.round(q / unit) * unit, np.full(len(q), np.nan)))


@pytest.mark.parametrize('counts', [256, 2048])
@pytest.mark.parametrize('links', LINKS)
def test_an_encoder_that_stands_still_for_some_ticks_is_believed(links, counts):
    """It creeps by a third of a count a tick, as the model says it does."""
    messages, unit = MessageFilter(links, TRACK), np.array([0.2, *[2 * math.pi] * links]) / counts
    repeated, before = 0, None

    def predict(x, t, until):
        return x + (until - t) / 0.05 * np.concatenate((unit / 3, np.zeros(links + 1)))
    for n in range(60):
        x = encoded(n * unit / 3, counts)
        assert messages.rejection(0.05 * n, x, predict) == '', n
        messages.accept(x, np.zeros(2 * links + 2))
        repeated += n > 0 and np.array_equal(x, before, equal_nan=True)
        before = x
    assert repeated > 20


@pytest.mark.parametrize('dead', [[0], [1], [0, 1, 2]])
@pytest.mark.parametrize('counts', [256, 2048])
def test_an_encoder_that_is_dead_is_not(dead, counts):
    messages = MessageFilter(2, TRACK)
    for n in range(40):
        q = 0.05 * n * np.ones(3)    # all move by 1 m and 1 rad a second
        q[dead] = 0.05 * min(n, 20)
        rejection = messages.rejection(0.05 * n, encoded(q, counts), moving)
        assert n > 20 or rejection == ''
        messages.accept(encoded(q, counts), np.zeros(6))
        if rejection:
            break
    assert 21 <= n <= 26
    assert 'has stood still to the bit' in rejection


@pytest.mark.parametrize('velocities', ['differenced', 'none'])
@pytest.mark.parametrize('counts', [0, 2048])
def test_a_swing_up_without_velocities_refuses_no_state(velocities, counts):
    c, seen = controller(), []

    def look(t, plan):
        seen.append((c.belief.rejection, np.isnan(c.belief.estimate.innovation[3:]).all()))
    simulate(plant(velocities=velocities, encoder_counts=counts), c, 6.0, on_tick=look)
    rejections, unmeasured = zip(*seen)
    assert set(rejections) == {''}
    assert np.mean(unmeasured[2:50]) == 1.0      # but where all encoders stand still
    assert is_upright(c.belief.x)


def test_a_dead_encoder_of_a_swing_up_is_found():
    c, p, found = controller(), plant(velocities='none', encoder_counts=2048), []
    for n in range(30):
        x = p.measure().x
        if n == 20:
            stuck = x[1]
        if n > 20:
            x[1] = stuck
        p.obey(c.update(p.t, x).first_force(20.0))
        p.advance(0.05)
        found.append(c.belief.rejection)
    assert not any(found[:21])
    assert 'joint1 has stood still' in ''.join(found[21:25])


def test_without_an_estimator_velocities_are_needed():
    c = controller(estimator='none')
    with pytest.raises(ValueError, match='without velocities; estimator ekf does without'):
        c.update(0.0, np.array([0.0, 0.1, 0.2, np.nan, np.nan, np.nan]))


def test_a_position_that_stands_still_at_a_turning_point_is_not_believed_for_it():
    """A joint that swings to and fro comes by where it is stuck; its speed gives it away."""
    past, t = MessageFilter(2, TRACK), 0.05 * np.arange(4)

    def swinging(x, t, until):
        """Predict that joint 1 is back where it was after 0.15 s."""
        return x + (0.0, x[4] * (until - t) * (0.15 - (until - t)) / 0.15, 0.1, 0.0, 0.0, 0.0)

    answers = [past.rejection(time, np.array([n, 1.0, n, 1.0, v, 1.0]), swinging)
               for n, (time, v) in enumerate(zip(t, (-0.1, 0.0, 1.5, 2.0)))]
    assert answers[:3] == ['', '', ''] and 'joint1 has stood still' in answers[3]


def test_a_position_may_stand_still_for_one_period_from_rest():
    """As forward Euler's does in its first step, whatever the force; for two it may not."""
    past, x = MessageFilter(2, TRACK), np.zeros(6)
    assert past.rejection(0.0, x, moving) == ''
    assert past.rejection(0.05, x + (0.0, 0.0, 0.0, 1.0, 1.0, 1.0), moving) == ''
    assert 'cart has stood still' in past.rejection(0.1, x + (0, 0, 0, 2.0, 2.0, 2.0), moving)


@pytest.mark.parametrize('solver', ['ilqr', 'ddp'])
def test_no_state_of_the_paper_s_own_plant_is_refused(solver):
    config = Path(__file__).parents[2] / 'config'
    values = declarations.read([config / 'paper.yaml', config / 'paper_euler.yaml'])
    for seed in range(3):
        mpc = controllers.controller({**values['mpc'], 'solver': solver, 'seed': seed})
        episode = simulate(plants.plant(values['plant']), mpc, 3.0)
        assert measure(episode).stand_ins == 0
        assert measure(episode).settling_time < 2.0


def test_what_one_prediction_lets_stand_still_may():
    past = MessageFilter(2, TRACK)
    for n in range(6):
        assert past.rejection(0.05 * n, np.zeros(6), moving, lambda x, t, until: x) == ''
    assert 'stood still' in past.rejection(0.3, np.zeros(6), moving, moving)


def test_a_plant_that_is_replaced_is_not_refused_for_ever():
    """
    What hung still while nobody was heard is swung up, though a bias was learned of the other.

    What is sent at first does not arrive: its plant is not found yet.
    """
    first, hanging_still = plants.plant({'force_bias': 1.5}), plants.plant({})
    control = controllers.controller({'solver': 'ilqr'})
    assert measure(simulate(first, control, 5.0)).success
    assert abs(control.belief.drive.bias) > 0.5
    begun = first.t + 1.0
    for n in range(20):
        control.update(begun + 0.05 * n, hanging_still.measure().x)   # in vain
    found = [control.update(begun + 0.05 * n, hanging_still.measure().x).stats.status
             for n in range(20, 60)]
    assert any(status not in (Status.ZERO, Status.LAST_POLICY) for status in found)
