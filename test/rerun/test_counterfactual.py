# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A solver that takes over its own recorded run does what it did."""

import itertools
import re

import numpy as np
from one_process import record
import pytest
from real_bags import rewritten, value_of
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.messages.fields import nanoseconds
from dp_swing_ros.nodes.connections import publish, subscribe
from dp_swing_ros.nodes.messages import to_stamp
from dp_swing_ros.rerun.counterfactual import (
    controller_at, counterfactual, plant_at, Run)
from dp_swing_ros.rerun.verification import verify
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.topics import DIAGNOSTICS, DISTURBANCE, JOINT_STATES

# at 30 Hz stamps are rounded
RATES = {'ilqr': 30.0, 'ddp': 20.0, 'mppi': 20.0}
FAULTS = ('    position_noise: 0.002\n    velocity_noise: 0.05\n    force_noise: 1.0\n'
          '    state_loss: 0.3\n    command_loss: 0.1\n    actuator_response: 0.5\n'
          '    delay: 0.03\n')


@pytest.fixture(scope='module')
def runs(tmp_path_factory):
    """Return a run in lockstep of each solver."""
    return {solver: Run(Bag(record(
        tmp_path_factory.mktemp(solver), '--solver', solver, '--duration', '3', '--lockstep',
        '--seed', '5', plant=f'    rate: {rate}\n'))) for solver, rate in RATES.items()}


@pytest.fixture(scope='module')
def faulty(tmp_path_factory):
    """Return runs with noise, losses, lag and delay, in lockstep and in real time."""
    return [Run(Bag(record(tmp_path_factory.mktemp('faulty'), '--duration', '2', *mode,
                           plant=FAULTS))) for mode in (['--lockstep'], [])]


def taken_over(run, at, solvers=tuple(SOLVERS), duration=None):
    return counterfactual(run, run.tick_at(at, duration), solvers, duration, lambda: None)


def same(a, b):
    return all(np.array_equal(x, y, equal_nan=True) for x, y in zip(a, b))


@pytest.mark.parametrize('solver', sorted(SOLVERS))
def test_a_solver_that_takes_over_its_own_run_repeats_it_to_the_bit(runs, solver):
    run = runs[solver]
    for at in (0.0, 0.1, 1.7):
        one = taken_over(run, at, [solver])
        assert one.at == pytest.approx(at, abs=1 / 30)
        assert len(one.recorded.t) > 20
        assert same(one.others[0][1:], one.recorded[1:])
        assert one.regret(one.others[0]) == one.regret(one.recorded) == 0.0


def test_another_solver_does_otherwise(runs):
    one = taken_over(runs['ilqr'], 0.5)
    recorded, mppi = one.recorded, one.trajectories()['mppi']
    np.testing.assert_array_equal(recorded.X[0], mppi.X[0])
    np.testing.assert_array_equal(recorded.t, mppi.t)
    assert not np.array_equal(recorded.U, mppi.U)
    assert recorded.cost != mppi.cost
    assert min(one.regret(trajectory) for trajectory in one.trajectories().values()) == 0.0


PUSHES = {20: [6.0], 21: [6.0], 40: [-4.0, 200.0, -5.0], 50: [200.0]}   # [N] after a state


def push(node):
    """Push after some of the states."""
    pushes, number = publish(node, DISTURBANCE), itertools.count()

    def on_state(_):
        for force in PUSHES.get(next(number), []):   # of one period add up, but for 200 N, refused
            pushes.publish(Float64(data=force))
    subscribe(node, JOINT_STATES, on_state)


@pytest.mark.parametrize('mode', [
    ['--lockstep'], pytest.param([], marks=pytest.mark.real_time)])
def test_whoever_takes_over_is_pushed_as_the_recorded_one_was(tmp_path, mode):
    run = Run(Bag(record(tmp_path, '--duration', '3', *mode, plant='start: up_up', meddle=push)))
    one = taken_over(run, 0.5, ['ilqr'], 2.0)
    again, recorded = one.others[0], one.recorded
    begin = next(n for n, push in enumerate(recorded.U) if push != 0.0)
    assert np.abs(recorded.U[begin:begin + 8]).max() > 5.0   # [N]
    if mode:
        assert same(again[1:], recorded[1:])
        found = verify(run.bag, iter)
        assert (found.states, found.differences, found.unverifiable) == (len(run.samples), [], [])
    else:   # forces do not act as late at every tick; without pushes it would not move at all
        window = slice(begin, begin + 20)
        moved, off = recorded.X[window, 0], again.X[window, 0] - recorded.X[window, 0]
        assert np.abs(off).max() < 0.5 * np.abs(moved).max()
        assert run.latency(0.0) == np.median([tick.delay for tick in run.record.ticks]) > 0.0


def reset(node):
    """Reset the mpc after some states."""
    client, number = node.create_client(Trigger, 'mpc/reset'), itertools.count()

    def on_state(_):
        if next(number) == 12:
            client.call_async(Trigger.Request())
    subscribe(node, JOINT_STATES, on_state)


def test_a_reset_in_mid_run_is_repeated(tmp_path):
    run = Run(Bag(record(tmp_path, '--duration', '1', '--lockstep', meddle=reset)))
    assert sum(tick.reset for tick in run.record.ticks[1:]) == 1
    found = verify(run.bag, iter)
    assert (found.states, found.differences, found.unverifiable) == (21, [], [])


def test_the_past_is_what_was_recorded(runs):
    run = runs['ddp']
    one = taken_over(run, 0.5)
    X = np.array([sample.x for sample in run.samples])
    np.testing.assert_array_equal(np.vstack((one.past.X, one.recorded.X[1:])), X)
    assert one.past.t[-1] == one.recorded.t[0] == one.at == 0.5


def test_the_cost_to_go_is_the_running_cost_of_what_followed(runs):
    run = runs['ddp']
    trajectory = taken_over(run, 0.5, ['mppi'], 1.0).others[0]
    assert len(trajectory.U) == 20
    error = trajectory.X[:-1].copy()
    error[:, 1:3] = 2 * np.sin(error[:, 1:3] / 2)
    inside = np.maximum(np.abs(error[:, 0]) - 2.0, 0.0)
    weights = (10.0, 100.0, 100.0, 2.0, 6.0, 0.1)
    expected = np.sum(error ** 2 @ weights) + 0.001 * np.sum(trajectory.U ** 2) \
        + 3000 * np.sum(inside ** 2)
    assert trajectory.cost == pytest.approx(expected, rel=1e-12)


def test_a_controller_goes_by_the_forces_that_were_sent(runs):
    run = runs['ilqr']
    tick = run.tick_at(0.5, None)
    controller, plan = controller_at(run, tick, 'mppi')
    _, (_, *sent) = controller.commands.since(-np.inf, 0.0)
    assert sent[:-1] == [one.force for one in run.record.ticks[:tick.number - 1]]
    assert sent[-1] == plan.first_force(run.problem.u_max)
    assert controller.belief.t == tick.stamp / 1e9


def test_until_it_sends_one_the_force_before_acts(faulty):
    run = faulty[0]
    acting = [plant_at(run, tick).commands.force for tick in run.record.ticks]
    assert acting == [0.0, *(tick.force for tick in run.record.ticks[:-1])]


@pytest.mark.parametrize('mode', [0, 1])
def test_with_all_faults_it_is_the_same_every_time(faulty, mode):
    first, second = (taken_over(faulty[mode], 0.3, ['ilqr', 'mppi']) for _ in range(2))
    for one, other in zip(first.others, second.others):
        assert same(one[1:], other[1:])
        assert np.all(np.isfinite(one.X))
        assert one.t[0] == first.at
        # states are lost, and the last one may be
        assert 1.2 < one.t[-1] - one.t[0] <= faulty[mode].time(faulty[mode].end) - first.at + 0.03
        assert np.diff(one.t).min() > 0.045
        assert np.diff(one.t).max() > 0.09


def test_take_overs_come_in_every_so_many_seconds(runs):
    run = runs['ddp']
    assert [run.time(tick.stamp) for tick in run.ticks_every(0.5, None)] == [
        0.0, 0.5, 1.0, 1.5, 2.0, 2.5]
    assert [run.time(tick.stamp) for tick in run.ticks_every(0.5, 2.0)] == [0.0, 0.5, 1.0]


def test_of_a_run_that_is_looked_at_from_later_on_a_solver_does_nearly_the_same(runs):
    run = runs['ilqr']
    tick = run.tick_at(1.5, None)
    late = run.lately(run.start + 1_000_000_000)
    assert 10 <= len(late.record.up_to(tick)) < len(run.record.up_to(tick))
    assert late.record.up_to(tick)[-1] is tick
    one = counterfactual(late, tick, ['ilqr'], 0.5, lambda: None)
    np.testing.assert_allclose(one.others[0].X, one.recorded.X, atol=0.05)


@pytest.mark.parametrize('topic, first, last', [
    (DIAGNOSTICS, 21, 21), (DIAGNOSTICS, 11, 21), (JOINT_STATES, 21, 21), (JOINT_STATES, 17, 21)])
def test_after_a_gap_a_solver_does_nearly_the_same(runs, tmp_path, topic, first, last):
    """As where the console on a busy machine missed states or what answers them."""
    run = runs['ilqr']
    stamps = {tick.stamp for tick in run.record.ticks if first <= tick.number <= last}

    def missed(message):
        is_one = (nanoseconds(message.header.stamp) in stamps if topic is JOINT_STATES
                  else first <= int(value_of(message, 'number') or 0) <= last)
        return None if is_one else message
    run = Run(Bag(rewritten(run.bag.path, tmp_path / 'bag', topic, missed)))
    assert re.search('tick (11|21) is missing|state of tick 2. is missing', run.record.gap)
    assert [tick.number for tick in run.record.ticks if tick.reset] == [22]
    tick = run.tick_at(1.7, None)
    one = counterfactual(run, tick, ['ilqr'], 0.5, lambda: None)
    np.testing.assert_allclose(one.others[0].X, one.recorded.X, atol=0.05)
    before = run.tick_at(0.2, None)
    assert before.number < 10


def test_a_tick_of_the_run_before_that_is_heard_late_is_none_of_this_run(runs, tmp_path):
    """As where a plant in lockstep began anew, whose stamps come again, on a busy machine."""
    run = runs['ilqr']
    late = run.record.ticks[50].stamp

    def of_before(message):
        if value_of(message, 'number') == '1':
            message.header.stamp = to_stamp(late)
        return message
    again = Run(Bag(rewritten(run.bag.path, tmp_path / 'bag', DIAGNOSTICS, of_before)))
    assert [tick.number for tick in again.record.ticks] == [
        tick.number for tick in run.record.ticks[1:]]
    assert again.tick_at(run.time(late), None).number == 51


def test_parameters_are_those_that_counted_at_the_tick(runs):
    """As if they had been changed in mid-run: another cost, and another solver before it."""
    run = runs['ddp']
    tick = run.tick_at(1.0, None)
    ticks = list(run.record.ticks)
    changed = {**run.mpc, 'force_weight': 10 * run.mpc['force_weight']}
    ticks[10] = ticks[10]._replace(changed=changed)
    ticks[5] = ticks[5]._replace(changed={**changed, 'solver': 'mppi'})
    run = run.lately(run.start)
    run.record = run.record._replace(ticks=ticks)
    before, then = run.as_of(ticks[7]), run.as_of(tick)
    assert (before.solver, then.solver) == ('mppi', 'ddp')
    assert then.problem.cost.R == pytest.approx(10 * runs['ddp'].problem.cost.R)
    assert run.lately(ticks[8].stamp).mpc['solver'] == 'mppi'
    controller, _ = controller_at(run, tick, 'ilqr')
    assert controller.parameters.solver == 'ilqr'   # whatever the recorded one was
    assert controller.belief.problem.cost.R == pytest.approx(then.problem.cost.R)
