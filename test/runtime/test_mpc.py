# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the mpc does with what comes and when, in virtual time."""

import math
import shutil

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from virtual import (
    DAY, hanging_rig, KNOWN, LEANING, lockstep, PERIOD, periods, Running, TICK)

from dp_swing_ros.control import controllers
from dp_swing_ros.control.planner import Planner
from dp_swing_ros.dynamics.files import load
from dp_swing_ros.estimators import ESTIMATORS
from dp_swing_ros.messages.fields import ERROR, OK, Report, to_state, WARN
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.model import hold, rollout
from dp_swing_ros.pendulum.state import hanging, is_upright, joints, turned, upright
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.runtime import live_parameters
from dp_swing_ros.runtime.handshake import Peers
from dp_swing_ros.runtime.mpc import MpcCore
from dp_swing_ros.runtime.sent import Force, Planned, PutBack, Tried
from dp_swing_ros.simulation import plants
from dp_swing_ros.solvers import SOLVERS

TERMS = ('position', 'angles', 'velocities', 'force', 'limits', 'terminal')
RIG = {'joint_names': ['slide', 'hip', 'knee'], 'joint_signs': [1.0, -1.0, 1.0],
       'joint_offsets': [-0.2, 2.5, 0.7], 'relative_angles': True}
SOLVED = {'CONVERGED', 'ITERATION_LIMIT', 'DEADLINE', 'COMPLETE', 'STALLED'}


def measured(x, stamp):
    """Return what a rig of other names, signs and zeros measures, without velocities."""
    cart, joint1, joint2 = hanging_rig(x).values()
    values = {'lift': 9.0, 'knee': joint2 % (2 * np.pi), 'slide': cart, 'joint3': 7.0,
              'hip': joint1 % (2 * np.pi)}
    message = JointState(name=list(values), position=list(values.values()))
    message.header.stamp = to_stamp(stamp)
    return message


@pytest.mark.parametrize('name', sorted(SOLVERS))
def test_every_state_gets_one_force_a_plan_and_a_report(name):
    run = lockstep(solver=name)
    assert not run.forces   # never before the first state
    run.lockstep(*[LEANING] * 5)
    assert len(run.forces) == len(run.of(Planned)) == len(run.reports) == 5
    assert all(abs(force) <= 20.0 for force in run.forces)
    assert run.plan.U[0] == run.forces[-1] == run.report.values['force']
    assert run.of(Planned)[-1].stamp == run.report.stamp == 4 * PERIOD * 1e9
    # at once: the figures of a tick come after its force
    kinds = [type(each) for each in run.sent if isinstance(each, (Force, Planned, Report))]
    assert kinds == [Force, Planned, Report] * 5
    for key in ('cost', 'iterations', 'solve_time', 'latency', 'late', 'late_total', 'delay'):
        assert math.isfinite(run.report.values[key])
    assert run.report.values['solver'] == name and run.wakes_at == math.inf


def test_a_plan_re_integrates_to_itself():
    run = lockstep()
    run.lockstep(LEANING)
    model = controllers.problem({}).model
    np.testing.assert_array_equal(run.plan.X[0], LEANING)
    np.testing.assert_allclose(rollout(model, LEANING, run.plan.U), run.plan.X, atol=1e-12)


def test_plans_and_tries_are_sent_as_sensors_would_measure_them():
    """Where encoders have zero beside balance, plans lead there."""
    run, x, balance = lockstep(shown_tries=3), LEANING, np.array([0.04, -0.06])
    model = run.core.controller.nominal.model
    for _ in range(100):
        measured = turned(x, balance)
        run.lockstep(measured)
        x = hold(model, x, run.forces[-1], PERIOD)
    X, paths = run.plan.X, run.of(Tried)[-1].paths
    np.testing.assert_allclose(X[0], measured, atol=5e-3)
    np.testing.assert_allclose(X[-1, 1:3], balance, atol=5e-3)
    tip = joint_positions(X[0], run.core.controller.belief.problem.physical.lengths)[-1]
    np.testing.assert_allclose(paths[:, 0], [tip] * len(paths), atol=1e-9)


def test_a_state_that_is_asked_again_gets_the_same_force_and_changes_nothing():
    """As a plant in lockstep asks who joins late."""
    once, twice = lockstep(), lockstep()
    once.lockstep(*[LEANING] * 3)
    for n in range(3):
        for _ in range(2):
            twice.state(LEANING, n * PERIOD)
    assert twice.forces == [force for force in once.forces for _ in range(2)]
    found = [report.values for report in twice.reports]
    assert [each['number'] for each in found] == [1, 3, 5]
    assert [each['again'] for each in found] == [0, 1, 1]
    assert found[-1]['missed_total'] == found[-1]['late_total'] == 0
    twice.core.enable(False)
    twice.state(LEANING, 2 * PERIOD)
    assert twice.forces[-1] == 0.0


def test_the_stream_of_commands_ends_with_zero():
    run = lockstep()
    run.core.close()
    assert not run.forces   # without a state it says nothing, even at the end
    run.lockstep(hanging())
    assert run.forces[-1] != 0.0
    run.core.close()
    assert run.of(Force)[-1] == Force(0, 0.0)


def test_what_was_learned_is_kept_where_asked_to(tmp_path):
    file = tmp_path / 'of' / 'model.json'
    file.parent.mkdir()
    file.write_text('of before')
    run = lockstep(dynamics='adaptive', learned_file=str(file))
    run.core.live.end()
    assert 'nothing was learned' in run.log(WARN)[-1] and file.read_text() == 'of before'
    run.lockstep(LEANING, LEANING + 1e-3)
    run.core.live.end()
    assert load(str(file), 2).about == {'seconds': pytest.approx(0.05)}
    assert list(file.parent.iterdir()) == [file]
    assert f'what was learned is in {tmp_path}' in run.log(OK)[-1]
    shutil.rmtree(file.parent)
    run.core.live.end()
    assert 'No such file or directory; what was learned is lost' in run.log(ERROR)[-1]


def test_a_file_that_cannot_hold_what_is_learned_is_refused(tmp_path):
    for file in tmp_path, tmp_path / 'none' / 'model.json', '~of_nobody/model.json':
        with pytest.raises(ParameterError, match="'learned_file' is .* expected a file in a fold"):
            lockstep(dynamics='adaptive', learned_file=str(file))
    run = lockstep()
    with pytest.raises(ParameterError, match="'learned_file' is "):
        run.change(learned_file=str(tmp_path))
    run.change(learned_file=str(tmp_path / 'model.json'))
    run.lockstep(LEANING)
    assert 'but nothing is learned; expected dynamics adaptive' in run.log(WARN)[-1]


def test_a_state_that_is_not_finite_is_answered_from_the_last_plan():
    run = lockstep()
    run.lockstep(LEANING)
    planned = run.plan.U[1]
    run.lockstep([math.nan] * 6)
    assert run.forces[-1] == pytest.approx(planned, abs=1e-6)
    assert run.report.level == ERROR and 'expected 6 finite numbers' in run.report.message
    assert run.report.values['status'] == 'LAST_POLICY'
    run.lockstep(LEANING)
    assert run.report.values['status'] == 'CONVERGED'


def test_a_first_state_that_is_not_finite_gets_zero():
    run = lockstep()
    run.lockstep([math.nan] * 6)
    assert run.forces == [0.0] and run.report.values['status'] == 'ZERO'
    assert 'failed' not in run.report.message   # none was tried


def test_a_solve_that_fails_is_said_to():
    run = lockstep(track_weight=1e308)   # no finite cost off the track
    run.lockstep([2.5, 0.1, 0.1, 0.0, 0.0, 0.0])
    assert run.forces == [0.0] and run.report.values['status'] == 'ZERO'
    assert 'the solve failed; there is no plan to follow' in run.report.message


def test_what_fails_in_a_tick_costs_its_force_which_is_zero():
    run = lockstep()
    run.lockstep(LEANING, LEANING * 1.1)

    def fail(*_):
        raise ArithmeticError('there is no plan')
    works, run.core.controller.update = run.core.controller.update, fail
    run.lockstep(LEANING * 1.2)
    assert run.forces[-1] == 0.0 and run.core.resets == 1   # the next tick is a first one
    last = run.of(Report)[-1]
    assert (last.part, last.level) == ('failure', ERROR) and 'there is no plan' in last.message
    assert 'test_mpc.py' in last.message and run.log(ERROR) == [f'{last.message}; going on']
    run.core.controller.update = works
    run.numbers.clear()
    run.lockstep(LEANING)
    assert run.forces[-1] == run.forces[0]


def test_a_report_that_fails_costs_no_force():
    run = lockstep()
    run.core.report, report = lambda *_: 1 / 0, run.core.report
    run.lockstep(LEANING)
    assert len(run.forces) == 1 and run.forces[0] != 0.0 and run.core.resets == 0
    run.core.report = report
    run.lockstep(LEANING)
    assert run.report.values['number'] == 2


def test_joints_may_come_in_any_order_but_none_may_miss():
    run, other = lockstep(), lockstep()
    run.lockstep(LEANING)
    other.hear(JointState(name=['joint2', 'cart', 'joint1'], position=LEANING[[2, 0, 1]].tolist(),
                          velocity=LEANING[[5, 3, 4]].tolist()))
    assert other.forces == run.forces
    other.hear(JointState(name=['cart'], position=[0.0], velocity=[0.0]))
    assert len(other.forces) == 1
    assert 'JointState has no joint1, joint2' in other.log(WARN)[-1]


@pytest.mark.parametrize('links', [1, 3])
def test_pendulums_with_other_numbers_of_links_are_controlled(links):
    run = lockstep(links=links)
    leaning = upright(links)
    leaning[1] = 0.02
    run.lockstep(leaning)
    assert run.forces[0] == run.plan.U[0] != 0.0
    assert run.plan.X.shape[1] == 2 * links + 2
    values = run.report.values
    assert {f'estimate_{joint}_position' for joint in joints(links)} <= set(values)
    assert f'link{links}_mass' in values and f'link{links + 1}_mass' not in values
    run.hear(to_joint_state(to_stamp(1.0), hanging(links)[:-2], 0.0))
    assert len(run.forces) == 1 and f'JointState has no joint{links}' in run.log(WARN)[-1]


def test_the_states_of_a_plant_with_more_links_are_refused():
    run = lockstep()
    run.hear(to_joint_state(to_stamp(0.0), hanging(3), 0.0))
    words = ('JointState has 4 joints [cart, joint1, joint2, joint3]; expected 3 [cart, joint1, '
             'joint2]: start plant and mpc with the same links')
    assert run.forces == [0.0] and run.report.values['status'] == 'ZERO'
    assert run.report.level == ERROR and words in run.report.message
    assert run.log(ERROR) == [f'{words}; going on without this state']


def test_what_is_wrong_with_states_is_said_once_a_second():
    run = Running()
    for _ in range(60):
        run.state([math.nan] * 6)
        run.passes(PERIOD)
    assert len(run.log(ERROR)) == 3 and len(run.answers) == 60


@pytest.mark.parametrize('name', ['ilqr', 'mppi'])
def test_a_reset_makes_the_next_tick_a_first_one(name):
    run, states = lockstep(solver=name, seed=3), [LEANING, LEANING * 0.5, LEANING * 0.2]
    run.lockstep(*states)
    assert len(set(run.forces)) == 3
    assert run.core.reset() == (True, 'the next tick is a first one')
    run.numbers.clear()
    run.lockstep(*states)
    assert run.forces[3:] == run.forces[:3]
    assert [each.values['resets'] for each in run.reports] == [0, 0, 0, 1, 1, 1]


def test_in_real_time_the_plan_begins_when_the_force_acts():
    run = Running(estimator='none', clock='stamps')
    run.stream(3, LEANING + (0, 0, 0, 1.0, 0, 0), lambda now: now - 0.02)
    values = run.report.values
    # age, what a tick is given, and the way of the force, which is that of the states
    assert values['age'] == pytest.approx(0.02, abs=1e-6)
    assert values['delay'] == pytest.approx(0.02 + TICK + 1e-3, abs=1e-6)
    assert values['latency'] == pytest.approx(0.02 + TICK, abs=1e-6)
    assert run.plan.X[0, 0] - 1.002 * LEANING[0] == pytest.approx(values['delay'], rel=0.1)


def test_where_states_stop_the_plan_is_followed_and_then_the_force_is_zero():
    run, x = Running(clock='stamps'), LEANING
    for n in range(8):
        run.state(x)
        run.passes(PERIOD - TICK)
        x = run.plan.X[1] + 1e-4 * n
    assert len(run.forces) == 8
    run.passes(2.0)
    carried = int(run.report.values['carried'])
    assert 2 <= carried <= 6 and run.forces[-1] == 0.0 and run.wakes_at == math.inf
    assert [each.values['carried'] for each in run.reports[-carried:]] == [*range(1, carried + 1)]
    assert [each.values['status'] for each in run.reports[-carried:]] == [
        *['LAST_POLICY'] * (carried - 1), 'ZERO']
    assert periods(run.reports[-carried:]) == pytest.approx([PERIOD] * (carried - 1), abs=1e-6)
    assert f'no state came in {carried} periods' in run.report.message
    assert not any('failed' in each.message for each in run.reports)
    # each for when it is there, as long after as states are on their way
    assert run.report.values['delay'] == pytest.approx(1e-3, abs=1e-6)
    run.state(LEANING)   # and answers again when they come back
    assert run.forces[-1] != 0.0 and run.report.values['status'] in SOLVED
    assert run.report.values['carried'] == 0
    assert run.wakes_at < math.inf


def test_after_a_single_state_the_force_ends_too():
    """The watchdog has learnt no period yet."""
    run = Running(clock='stamps')
    run.state(hanging())
    assert run.forces[-1] != 0.0
    run.passes(2.0)
    assert run.forces[-1] == 0.0 and run.wakes_at == math.inf


@pytest.mark.parametrize('period', [0.02, 0.2])
def test_silence_is_half_a_period_more_or_25_ms_by_the_clock_of_the_node(period):
    run = Running(clock='stamps')
    run.stream(9, period=period)
    before, patience = len(run.forces), period + max(0.5 * period, 0.025)
    run.passes(TICK + patience - period - 0.002)   # from the last force on
    assert len(run.forces) == before
    run.passes(0.004)
    assert len(run.forces) == before + 1


def test_in_lockstep_it_waits_for_ever():
    run = lockstep()
    run.lockstep(LEANING, LEANING)
    run.passes(1e6)
    assert len(run.forces) == 2


def test_states_wait_for_a_simulated_clock_that_was_not_heard_yet():
    """Else the first would seem to come before it was measured, and all after it late."""
    run = Running(simulated=0.0, clock='arrival')
    run.state(LEANING, 100.0)
    run.passes(0.5)
    run.core.on_peers(KNOWN)
    assert not run.forces
    run.clocks.simulated_time = 100.001
    run.core.on_peers(KNOWN)
    assert run.report.values['time'] == pytest.approx(100.0, abs=0.01)
    run = Running(simulated=0.0, clock='arrival')   # for ever, where nobody publishes it
    run.state(LEANING, 100.0)
    run.passes(1.9)
    run.core.on_peers(KNOWN)
    assert not run.log(WARN)
    run.passes(0.2)
    run.core.on_peers(KNOWN)
    assert not run.forces and 'nobody publishes /clock' in run.log(WARN)[0]


def test_who_sends_the_first_state_is_waited_for_but_not_for_ever():
    """An announced clock may be of a plant that has not been heard yet, or does not hear."""
    plant = Peers({'/plant'}, {'/plant', '/console'}, set())
    run = Running(peers=plant)
    run.state(LEANING)
    assert not run.forces
    run.plant(lockstep=True)
    run.core.on_peers(plant)
    assert not run.forces    # it would wait for ever for a force that it did not hear
    both = Peers({'/plant', '/second'}, {'/plant', '/second'}, {'/plant', '/second'})
    run.core.on_peers(both)
    assert not run.forces    # of one of them nothing is known
    run.core.on_peers(plant._replace(hearers={'/plant'}))
    assert len(run.forces) == 1 and run.report.values['clock'] == 'lockstep'
    run = Running(peers=plant)
    run.state(LEANING)
    run.passes(1.9)
    run.core.on_peers(plant)
    assert not run.forces
    run.state(LEANING * 1.1)   # the newest is answered
    run.passes(0.2)
    run.core.on_peers(plant)
    assert len(run.forces) == 1
    assert run.report.values['estimate_cart_position'] == pytest.approx(0.11, abs=1e-3)


def test_a_bare_driver_is_answered_at_once():
    run = Running(peers=Peers({'/driver'}, {'/logger'}, set()))
    run.state(LEANING)
    assert len(run.forces) == 1 and run.report.values['clock'] == 'arrival'


def test_ticks_that_outlast_the_period_of_the_states_are_counted(monkeypatch):
    monkeypatch.setattr(Planner, 'is_due', lambda *about: True)   # no step passes meanwhile
    run = lockstep()
    for n in range(6):   # no solve takes less than ten microseconds
        run.state(LEANING * (1 + 1e-4 * n), 1e-5 * n)
    late = [int(each.values['late']) for each in run.reports]
    assert late[1:] == [1] * 5
    assert [each.values['late_total'] for each in run.reports] == np.cumsum(late).tolist()
    assert run.report.level == WARN


def test_states_that_were_overtaken_count_in_the_period_and_are_not_solved():
    run = Running(clock='stamps')
    run.numbers[b'driver'] = 100   # it has sent some before
    run.stream(10)
    assert run.report.values['missed_total'] == 0
    # while a solve went on, several came; two more never arrived
    messages = [to_joint_state(to_stamp(DAY + run.clocks.time + 1e-3 * n), LEANING * 1.1, 0.0)
                for n in range(4)]
    before = len(run.forces)
    run.core.on_states([run.came(each, number=111 + n) for n, each in enumerate(messages)])
    assert len(run.forces) == before + 1 and run.report.values['missed_total'] == 3
    run.passes(PERIOD)
    run.state(LEANING, number=117)
    assert run.report.values['missed_total'] == 5
    assert run.core.schedule.watchdog.period == pytest.approx(PERIOD, rel=1e-6)


def test_a_state_that_waited_is_to_act_later_and_has_less_time():
    run = Running(clock='stamps')
    run.stream(5)
    arrived = run.came(to_joint_state(to_stamp(run.clocks.now()), LEANING * 1.2, 0.0))
    run.clocks.time += 0.01
    run.core.on_states([arrived])
    assert run.report.values['age'] == pytest.approx(0.01, abs=1e-6)
    assert run.report.values['delay'] == pytest.approx(0.01 + TICK + 1e-3, abs=1e-6)
    # of which four fifths of a period are there
    assert run.left[1:] == pytest.approx([0.8 * PERIOD] * 4 + [0.8 * PERIOD - 0.01], abs=1e-6)


def test_a_report_takes_of_the_time_of_the_next_solve():
    run = Running(clock='stamps', time_limit=1.0)
    run.reporting = 0.003
    run.stream(4)
    assert run.left[1:] == pytest.approx([0.8 * PERIOD - 0.003] * 3, abs=1e-6)


def test_a_force_that_is_ready_early_waits_unless_it_is_zero():
    run = Running(clock='stamps', tick_time=0.02)
    run.stream(3)
    assert run.answers[0].values['latency'] == pytest.approx(0.02, abs=1e-6)
    run = Running(clock='stamps', tick_time=0.02, enabled=False)
    run.stream(3)
    assert run.report.values['latency'] == pytest.approx(TICK, abs=1e-6)


def test_a_solve_has_its_time_limit_at_most():
    run = Running(clock='stamps', time_limit=0.03)
    run.stream(3)
    assert run.left == pytest.approx([0.03] * 3)
    run = lockstep(time_limit=0.03)
    run.lockstep(LEANING)
    assert run.left == [math.inf]


def test_the_estimate_is_reported():
    run = lockstep()
    run.lockstep(1.01 * LEANING, LEANING)
    values = run.report.values
    assert values['estimate_joint1_position'] == pytest.approx(LEANING[1], abs=0.01)
    assert 0 < abs(values['innovation_joint1_velocity']) < 1
    assert values['innovation_distance'] < 10 and values['refused'] == 0
    assert values['cart_mass'] == pytest.approx(1.0, rel=0.3)
    assert math.isfinite(values['force_bias'])


@pytest.mark.parametrize('name', sorted(SOLVERS))
def test_a_report_says_why_the_force_is_what_it_is(name):
    run = lockstep(solver=name)
    run.lockstep(hanging(), hanging() + 1e-3)
    values = run.report.values
    assert sum(values[f'cost_{term}'] for term in TERMS) == pytest.approx(values['cost'], rel=1e-9)
    starts, costs = values['starts'].split(), list(map(float, values['costs'].split()))
    assert len(starts) == len(costs) == len(values['solves'].split()) == 3
    assert values['start'] == starts[int(np.argmin(costs))]
    best, next_best, most = sorted(costs)
    assert values['lead'] == pytest.approx(next_best - best, abs=1e-3 * most)
    phases = {'backward_time', 'line_search_time'} if name in ('ilqr', 'ddp') else {
        'noise_time', 'rollouts_time'}
    assert {'estimate_time', 'starts_time', *phases} <= set(values)
    assert all(values[phase] < values['solve_time'] for phase in phases)
    assert values['age'] == 0.0 and values['missed_total'] == 0


def test_a_solve_alone_leads_by_nothing_known():
    run = lockstep()
    run.lockstep(LEANING * 0.1, LEANING * 0.1 + 1e-4)
    values = run.report.values
    assert values['starts'] in ('last_plan', 'regulator') and values['lead'] == math.inf


def test_the_lead_is_that_over_the_next_best_start():
    run = lockstep()
    run.lockstep(hanging())
    costs = sorted(map(float, run.report.values['costs'].split()))
    assert len(costs) > 2   # of a first tick
    assert run.report.values['lead'] == pytest.approx(costs[1] - costs[0], abs=1e-3 * costs[1])


@pytest.mark.parametrize('name', sorted(SOLVERS))
def test_tries_are_shown_where_they_are_asked_for(name):
    run = lockstep(solver=name)
    run.lockstep(hanging())
    assert not run.of(Tried)
    run.change(shown_tries=6)
    run.lockstep(hanging() + 1e-3)
    tried, = run.of(Tried)
    assert tried.stamp == run.of(Planned)[-1].stamp
    assert 1 < len(tried.paths) <= 7 and tried.paths.shape[1:] == (len(run.plan.U) + 1, 2)
    assert tried.weights.max() == 1.0
    # all of them begin where the plan does, at the tip that hangs
    np.testing.assert_allclose(tried.paths[:, 0], tried.paths[:1, 0].repeat(len(tried.paths), 0))
    assert tried.paths[0, 0, 1] == pytest.approx(-sum(controllers.problem({}).physical.lengths),
                                                 rel=0.05)
    assert np.ptp(tried.paths[:, -1, 0]) > 1e-3
    run.change(shown_tries=0)
    run.lockstep(hanging() + 2e-3)
    assert len(run.of(Tried)) == 1


@pytest.mark.parametrize('solver', sorted(SOLVERS))
def test_long_steps_are_no_failure(solver):
    run = lockstep(step=0.35, solver=solver)
    run.lockstep(LEANING, hanging())
    assert len(run.forces) == 2 and all(abs(force) <= 20.0 for force in run.forces)
    assert not any(each.part == 'failure' for each in run.of(Report))


def test_a_margin_as_wide_as_the_track_is_told():
    run = lockstep()
    run.change(track_limit=0.4)
    run.lockstep(LEANING)
    assert any('track_margin is 0.4 m of the 0.4 m of track' in text for text in run.log(WARN))


def test_a_clock_that_jumps_to_and_fro_is_told_of():
    run = Running(simulated=20.0)
    for n in range(3):
        run.core.on_setback()
        run.passes(0.1)
    run.state(LEANING)
    assert 'the clock jumped back 3 times' in run.report.message
    assert 'expected a single publisher of /clock' in run.log(WARN)[-1]


def test_at_the_pace_of_a_simulated_clock_times_are_its_own():
    """Twice as fast: a tick takes twice as long by it, and the states come half as far apart."""
    run = Running(simulated=50.0, clock='stamps', estimator='none')

    def goes_on():
        run.clocks.simulated_time += 2 * PERIOD
    run.stream(2, each=goes_on)
    assert run.core.schedule.pace == pytest.approx(1.1)   # a single tick may be an odd one
    run.stream(60, each=goes_on)
    assert run.core.schedule.pace == pytest.approx(2.0, rel=0.05)
    assert run.report.values['delay'] == pytest.approx(2 * (TICK + 1e-3), rel=0.1)
    assert run.report.values['time_noise'] == pytest.approx(2e-3, rel=0.05)


# clocks


@pytest.mark.parametrize('clock', ['announced', 'stamps'])
@pytest.mark.parametrize('offset', [-10800.0, -0.05, 0.05, 10800.0])
def test_stamps_of_another_clock_do_no_harm(offset, clock):
    """Where stamps are said to be of this clock, those of the last seconds may only seem late."""
    run = Running(clock=clock, peers=Peers({'/driver'}, set(), set()))
    run.stream(30, stamp=lambda now: now + offset)   # but sent by the time of day
    assert len(run.forces) == len(run.answers) == 30
    told = clock == 'stamps' and offset == -0.05    # which is an age that may well be
    assert np.median([each.values['age'] for each in run.answers]) == pytest.approx(
        0.05 if told else 0.0, abs=2e-3)
    assert all(each.values['status'] != 'ZERO' for each in run.answers)
    complaints = [each for each in run.answers if 'the stamp is' in each.message]
    assert len(complaints) == (30 if clock == 'stamps' and not told else 0)


def test_stamps_of_zero_do_no_harm():
    run = Running()
    run.stream(30, stamp=lambda now: 0.0, ways=(1e-3, 3e-3))
    assert [each.values['age'] for each in run.answers[2:]] == pytest.approx(
        [0.0, 2e-3] * 14, abs=1e-6)   # later than the fastest by as much
    assert 'stamps stand still' in run.report.message
    assert all(each.values['status'] != 'ZERO' for each in run.reports)
    assert periods(run.answers[2:]) == pytest.approx(
        [PERIOD - 2e-3, PERIOD + 2e-3] * 13 + [PERIOD - 2e-3], abs=1e-6)
    sent = [each.values['sent'] for each in run.answers]   # tells which state it was
    assert sent == sorted(set(sent)) and sent[0] > (DAY - 1) * 1e9


def test_states_that_come_twice_are_answered_once():
    """As through two bridges."""
    run = Running(clock='stamps')
    for n in range(20):
        state = to_joint_state(to_stamp(run.clocks.now()), LEANING * (1 + 1e-3 * n), 0.0)
        run.hear(state)
        run.hear(state)
        run.passes(PERIOD)
    assert len(run.forces) == 20 and not any('stood still' in each.message for each in run.reports)
    assert run.report.values['missed_total'] == 0


@pytest.mark.parametrize('often', [1, 5])
def test_a_gripper_on_the_same_topic_changes_nothing(often):
    run = Running(clock='stamps')
    gripper = JointState(name=['left_finger', 'right_finger'], position=[0.0, 0.0])
    for n in range(30):
        run.hear(*[gripper] * often, publisher=b'gripper')
        run.state(LEANING * (1 + 1e-3 * n))
        run.passes(PERIOD)
    assert len(run.answers) == 30 and run.report.values['missed_total'] == 0
    assert not any('joint' in each.message for each in run.reports)
    assert len(run.log(WARN)) == 1
    assert 'of /gripper names none of [cart, joint1, joint2]' in run.log(WARN)[0]


def test_a_second_publisher_of_our_joints_is_named_and_the_first_is_obeyed():
    """As joint_state_publisher, whose joints are all zero."""
    run = Running(clock='stamps')
    for n in range(30):
        run.state(LEANING * (1 + 1e-3 * n))
        run.state(np.zeros(6), publisher=b'other')
        run.passes(PERIOD)
    words = '/other publishes states, too; /driver was heard first, and is obeyed'
    assert run.log(WARN) == [words] and len(run.answers) == 30
    assert all(each.values['estimate_cart_position'] > 0.09 for each in run.answers)


def test_rivals_are_named_beside_what_is_wrong_with_a_state():
    run = lockstep()
    run.core.rivals = ['/force_command has 2 publishers, /mpc, /peer; expected one']
    run.lockstep([math.nan] * 6)
    assert run.log(ERROR)[-1].startswith('/force_command has 2 publishers')
    assert run.report.message.startswith('/force_command has 2 publishers')


# rigs


def test_foreign_names_signs_zeros_and_relative_angles_without_velocities_are_swung_up():
    """In lockstep of the rig's making: it goes on when the force has come."""
    run, plant, states = lockstep(**RIG), plants.plant({}), []
    for n in range(120):
        states.append(plant.x.copy())
        force = run.hear(measured(plant.x, PERIOD * n))
        plant.begin_period(0.0)
        plant.obey(force)
        plant.advance(PERIOD)
    assert is_upright(np.array(states[-20:])).all()
    assert len(run.forces) == 120
    values = run.report.values
    assert values['estimate_joint1_velocity'] == pytest.approx(states[-1][4], abs=0.1)
    assert math.isnan(values['innovation_joint1_velocity'])


def test_without_velocities_an_estimator_is_needed():
    run = lockstep(**RIG, estimator='none')
    run.hear(measured(hanging(2), 0.0))
    assert run.forces == [0.0] and 'none' in ESTIMATORS
    assert 'without velocities; estimator ekf does without' in run.log(ERROR)[-1]


def test_the_zero_is_found_while_the_pendulum_hangs():
    run, x = Running(**{**RIG, 'joint_offsets': [-0.2, 0.0, 0.0], 'zero': 'hanging'}), hanging(2)
    for n in range(40):   # it swings: there is no telling where it hangs
        x[1:3] = np.pi + 0.1 * np.sin(2 * np.pi * PERIOD * n)
        run.hear(measured(x, run.clocks.today()))
        run.passes(PERIOD)
    assert not run.forces and 'hang still' in run.of(Report)[-1].message
    assert {each.part for each in run.of(Report)} == {'zero'}
    assert len(run.log(WARN)) == 1 and 'waiting for the pendulum' in run.log(WARN)[0]
    x, n = hanging(2), 0
    while not run.forces and n < 40:
        run.hear(measured(x, run.clocks.today()))
        run.passes(PERIOD)
        n += 1
    assert PERIOD * n < 2.0 and run.forces[0] != 0.0
    announced, = run.announced()
    offsets = announced.parameters['joint_offsets']
    assert offsets[0] == -0.2 and announced.revision == 0
    np.testing.assert_allclose(np.remainder(offsets[1:] - np.array([2.5, 0.7]) + 1, 2 * np.pi), 1,
                               atol=1e-9)
    assert run.log(OK)[-1].startswith('the pendulum hangs still; joint_offsets: [-0.2')


def test_in_lockstep_nobody_sees_it_hang_still():
    run = lockstep(zero='hanging')
    run.lockstep(hanging())
    assert not run.forces
    assert 'in lockstep nobody sees the pendulum hang still; set zero to given' in run.log(WARN)[0]


# plants that begin again


@pytest.mark.parametrize('announced', [{'resets': 1}, {'revision': 0}])
def test_nothing_is_left_of_a_pendulum_that_is_no_more(announced):
    """Neither plan nor estimate, where a plant is reset or started again."""
    run = Running()
    run.plant(revision=0 if 'revision' in announced else 1)
    run.stream(20, x=upright() + 1e-3)
    before = len(run.reports)
    run.plant(**{'revision': 1, **announced})
    assert run.core.resets == 1
    run.stream(5, x=hanging())
    first = run.reports[before].values
    assert 'last_plan' not in first['starts'] and 'rest' in first['starts'].split()
    assert first['force_bias'] == 0.0
    # and the states after it are believed from the first on
    assert {each.values['status'] for each in run.reports[before:]} <= SOLVED


def test_where_no_state_follows_a_reset_the_last_force_is_followed_by_zero():
    run = Running()
    run.plant(revision=1)
    run.stream(20, x=upright() + 1e-2)
    assert run.forces[-1] != 0.0
    before = len(run.forces)
    run.core.reset()
    run.passes(1.0)
    assert run.forces[before:] == [0.0] and run.wakes_at == math.inf


def test_states_that_say_nothing_new_are_as_good_as_none():
    """As where a driver's clock was set back a little: nobody knows how the pendulum moves."""
    run = Running(clock='stamps')
    run.stream(20, x=upright() + 1e-2)
    before = len(run.forces)
    run.stream(12, x=upright() + 1e-2, stamp=lambda now: now - 0.45)
    forces = run.forces[before:]
    assert forces[0] != 0.0 and forces[6:9] == [0.0] * 3 and forces[-1] != 0.0


def test_where_a_simulated_clock_goes_back_and_no_state_comes_the_force_is_zero():
    run = Running(simulated=500.0, clock='stamps')
    for n in range(20):
        run.clocks.simulated_time += PERIOD
        run.state((upright() + 1e-2) * (1 + 1e-3 * n))
        run.passes(PERIOD)
    assert run.forces[-1] != 0.0
    run.clocks.simulated_time = 0.1
    run.core.on_setback()
    before = len(run.forces)
    run.core.on_silence()
    assert run.forces[before:] == [0.0] and run.wakes_at == math.inf


def test_a_plant_whose_states_are_not_obeyed_changes_nothing():
    """Else a stand-in in lockstep would switch off what watches for the driver's silence."""
    run = Running()
    run.senders = {'/driver', '/plant'}
    run.stream(20, x=upright() + 1e-2)
    for revision in (1, 0):   # it is started, twice
        run.plant(lockstep=True, delay=0.5, revision=revision)
    run.stream(3, x=upright() + 1e-2)
    assert run.core.resets == 0 and run.report.values['clock'] == 'arrival'
    assert run.report.values['real_time'] == 1.0
    run.passes(1.0)   # the driver has died
    assert run.forces[-1] == 0.0 and run.wakes_at == math.inf
    run.clocks.time += 1.0
    run.state(hanging(), 0.0, publisher=b'plant')   # and is followed by the plant
    assert run.report.values['clock'] == 'lockstep'


def test_what_a_plant_changes_is_no_reset():
    run = Running()
    run.plant()
    run.stream(3)
    run.plant(revision=1)
    run.plant(revision=2)
    for _ in range(2):   # and what is no plant may begin again
        run.announce('/logger', {'output': 'bag'})
    assert run.core.resets == 0
    run.core.on_configuration('{"not": "one"}')
    run.core.on_configuration('[')
    assert len(run.log(WARN)) == 1 and 'going on without it' in run.log(WARN)[0]
    run.passes(0.1)
    run.state(LEANING * 1.2)
    assert run.report.values['status'] in SOLVED


@pytest.mark.parametrize('name, theirs, own', [('force_limit', 18.0, 20.0),
                                               ('track_limit', 2.3, 2.4)])
def test_a_plant_that_allows_less_is_warned_of_once(name, theirs, own):
    run = Running()
    run.plant(**{name: own})
    run.plant(revision=1, **{name: 2 * own})
    assert not run.log(WARN)
    for revision in (2, 3):
        run.plant(revision=revision, **{name: theirs})
    text, = run.log(WARN)
    assert f'{name} is {own:g}, and that of the plant {theirs:g}' in text


@pytest.mark.parametrize('drive, heard', [('velocity', 1), ('acceleration', 0)])
def test_a_plant_that_clips_velocities_is_warned_of(drive, heard):
    run = Running(drive=drive, cart_speed_limit=1.5)
    run.plant(drive=drive, cart_speed_limit=1.0)
    assert len(run.log(WARN)) == heard
    assert all('cart_speed_limit is 1.5, and that of the plant 1' in text
               for text in run.log(WARN))


def test_states_that_come_too_seldom_are_warned_of_once():
    run = Running()
    run.plant(rate=10.0)
    run.stream(60, period=0.1)
    text, = [each for each in run.log(WARN) if 'states are answered every' in each]
    assert 'expected one at least every 78.2 ms' in text


# parameters


def test_a_change_counts_from_the_next_tick_on():
    run = lockstep()
    run.lockstep(LEANING)
    assert run.report.values['revision'] == 0
    run.change(horizon=40, step=0.04, solver='ddp')
    run.lockstep(LEANING + 1e-3)
    assert (len(run.plan.U), run.plan.dt) == (40, 0.04)
    assert (run.report.values['revision'], run.report.values['solver']) == (1, 'ddp')
    announced, = run.announced()
    assert announced.revision == 1 and announced.parameters['horizon'] == 40
    run.core.reset()   # keeps what was changed
    run.lockstep(LEANING + 2e-3)
    assert len(run.plan.U) == 40 and run.report.values['revision'] == 1


def test_the_newest_bound_of_the_force_counts():
    run = lockstep()
    run.change(force_limit=10.0)
    run.lockstep(hanging())
    assert abs(run.forces[-1]) <= 10.0
    assert np.abs(run.plan.U).max() == pytest.approx(10.0)


def test_what_cannot_be_used_is_put_back(monkeypatch):
    """In real time it turns out later; in lockstep who asked is told."""
    run = Running()
    run.stream(2)
    monkeypatch.setattr(live_parameters, 'SLOWEST', -math.inf)   # of which every tick is late
    values = run.core.live.values
    run.core.on_change({**values, 'horizon': 40}, lambda make: make())
    if run.core.live.loader.thread is not None:
        run.core.live.loader.thread.join()
    run.stream(1)
    assert run.of(PutBack) == [PutBack(values)] and run.report.values['revision'] == 0
    last = next(each for each in run.of(Report) if each.part == 'parameters')
    assert last.level == ERROR and 'the new parameters cannot be used' in last.message
    assert run.log(ERROR) == [last.message] and len(run.plan.U) == 30


@pytest.mark.parametrize(('parameters', 'words'), [
    ({'estimator': 'ukf'}, "'ukf'; expected one of ekf, none"),
    ({'solver': 'lqr'}, "'lqr'; expected one of ddp, ilqr, mppi"),
    ({'horizon': 0}, "'horizon' is 0; expected at least 1"),
    ({'force_limit': 0.0}, 'needs a force'),
    ({'reference': [0.0, 0.5, 0.0, 0.0, 0.0, 3.0], 'state_weights': [0.0] * 6}, 'reference')])
def test_impossible_parameters_are_refused(parameters, words):
    with pytest.raises(ParameterError, match=words):
        Running(**parameters)


# enabled and not


def test_disabled_it_sends_zero_at_once_and_for_each_state():
    run = Running()
    run.stream(20)
    before = len(run.forces)
    assert run.forces[-1] != 0.0
    assert run.core.enable(False) == (True, 'disabled: zero force')
    assert len(run.forces) == before + 1 and run.forces[-1] == 0.0
    run.stream(20)
    assert len(run.forces) == before + 21 and not any(run.forces[before:])
    assert (run.report.level, run.report.values['status']) == (WARN, 'DISABLED')
    assert 'disabled: the force is zero; call mpc/enable' in run.report.message
    assert run.report.values['refused'] == 0   # it goes on estimating
    run.core.enable(False)                     # which changes nothing
    assert len(run.forces) == before + 21 and len(run.log(WARN)) == 1
    run.core.enable(True)
    run.stream(3)
    assert run.forces[-1] != 0.0 and run.report.values['status'] in SOLVED
    run = Running(enabled=False)
    run.stream(5)
    assert run.forces == [0.0] * 5
    run.core.enable(True)
    run.stream(1)
    assert run.forces[-1] != 0.0


def test_disabled_before_the_first_state_it_says_nothing():
    run = Running()
    run.core.enable(False)
    assert not run.forces


def test_in_lockstep_each_state_has_one_force_all_the_same():
    run = lockstep()
    for enabled in (True, False, True):
        before = len(run.forces)
        run.core.enable(enabled)
        run.lockstep(*[LEANING * (1 + 0.1 * n) for n in range(3)])
        assert len(run.forces) == before + 3
        assert all((force != 0.0) == enabled for force in run.forces[before:])


def test_it_brakes_the_cart_before_it_ends():
    run, plant, n = lockstep(controlled_stop=0.5), plants.plant({}), 0
    assert run.core.may_end()   # there is nothing to brake yet

    def swing(count):
        nonlocal n
        for _ in range(count):
            force = run.state(plant.x, PERIOD * n)
            plant.begin_period(0.0)
            plant.obey(force)
            plant.advance(PERIOD)
            n += 1
    swing(12)
    assert abs(plant.x[3]) > 0.5
    assert not run.core.may_end()
    swing(10)
    assert abs(plant.x[3]) < 0.1
    stops = [each for each in run.reports if each.values['status'] == Status.STOP.name]
    assert len(stops) == 10 and 'the process ends' in stops[0].message
    assert stops[0].level == ERROR and len(run.log(ERROR)) == 1
    swing(1)
    assert run.core.may_end() and run.forces[-1] == 0.0


def test_without_states_it_ends_all_the_same():
    run = Running(controlled_stop=0.5)
    run.stream(5)
    assert not run.core.may_end()
    run.passes(1.4)
    assert not run.core.may_end() or not run.core.controller.enabled
    run.passes(0.2)
    assert run.core.may_end()


def test_values_are_complete_and_to_the_letter():
    """What a core is given is what the node declares; a state reads back as it was sent."""
    values = controllers.MPC.complete({})
    core = MpcCore(values, Running().clocks, lambda sent: None)
    assert core.live.values == values
    message = to_joint_state(to_stamp(0), LEANING, 0.0)
    np.testing.assert_array_equal(to_state(message, 2, core.sensors), LEANING)
