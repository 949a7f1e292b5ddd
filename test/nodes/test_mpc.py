# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller as a process: one force for every state, whatever the state."""

import math
import signal
import time

from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import pytest
import rclpy
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from dp_swing_ros.control import controllers
from dp_swing_ros.messages.fields import from_diagnostics, from_trajectory, seconds
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.nodes.mpc import MpcNode
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import hanging, joints, upright
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.topics import (
    DIAGNOSTICS, FORCE_COMMAND, FORCE_COMMAND_STAMPED, JOINT_STATES, PLAN)

LEANING = np.array([0.1, 0.02, -0.01, 0.0, 0.05, 0.0])


class Conversation:
    """Sends states to an mpc in simulated time, and hears what it answers."""

    def __init__(self, peer, start_node, parameters=(), arguments=()):
        self.peer = peer
        self.forces, self.plans = peer.record(FORCE_COMMAND), peer.record(PLAN)
        self.reports = peer.record(DIAGNOSTICS)
        self.node = start_node('mpc', {'clock': 'lockstep', **dict(parameters)}, arguments)
        self.node.wait_for('ready')
        self.states = peer.publisher(JOINT_STATES)
        counted = peer.node.count_publishers
        assert peer.until(lambda: counted('force_command') and counted('mpc/plan'))
        peer.spin(0.5)
        self.n = 0

    def send(self, x, stamp=None):
        """Send a state and return the force that answers it."""
        before = len(self.forces)
        stamp = to_stamp(self.n * 50_000_000) if stamp is None else stamp
        self.states.publish(to_joint_state(stamp, np.asarray(x, float), 0.0))
        self.n += 1
        assert self.peer.until(lambda: len(self.forces) > before), self.node.output()
        return self.forces[-1].data

    def report(self):
        """Return the report on the last tick."""
        assert self.peer.until(lambda: len(self.reports) >= self.n)
        return from_diagnostics(self.reports[-1], 'mpc')


@pytest.mark.parametrize('name', sorted(SOLVERS))
def test_every_state_gets_one_force_a_plan_and_a_report(peer, start_node, name):
    talk = Conversation(peer, start_node, {'solver': name})
    assert not talk.forces   # never before the first state
    for n in range(5):
        force = talk.send(LEANING)
        assert abs(force) <= 20.0
    peer.spin(0.3)
    assert len(talk.forces) == len(talk.plans) == len(talk.reports) == 5
    plan, report = from_trajectory(talk.plans[-1]), talk.report()
    assert plan.U[0] == talk.forces[-1].data == report.values['force']
    assert seconds(talk.plans[-1].header.stamp) == pytest.approx(0.2)
    assert report.values['solver'] == name
    for key in ('cost', 'iterations', 'solve_time', 'latency', 'late', 'late_total', 'delay'):
        assert math.isfinite(report.values[key])
    assert talk.node.stop() == 0


def test_the_published_plan_re_integrates_to_itself(peer, start_node):
    talk = Conversation(peer, start_node)
    talk.send(LEANING)
    assert peer.until(lambda: talk.plans)
    plan = from_trajectory(talk.plans[0])
    model = controllers.problem({}).model
    np.testing.assert_array_equal(plan.X[0], LEANING)
    np.testing.assert_allclose(rollout(model, LEANING, plan.U), plan.X, atol=1e-12)
    np.testing.assert_allclose(plan.t, np.arange(31) * 0.05, atol=1e-9)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_the_stream_of_commands_ends_with_zero(peer, start_node, number):
    talk = Conversation(peer, start_node)
    assert talk.send(hanging()) != 0.0
    talk.node.signal(number)
    assert peer.until(lambda: len(talk.forces) > 1)
    assert talk.forces[-1].data == 0.0
    assert talk.node.wait() == 0
    assert 'Traceback' not in talk.node.output()


def test_without_a_state_it_says_nothing_even_at_the_end(peer, start_node):
    talk = Conversation(peer, start_node)
    talk.node.stop()
    peer.spin(0.3)
    assert not talk.forces


def test_a_state_that_is_not_finite_is_answered_from_the_last_plan(peer, start_node):
    talk = Conversation(peer, start_node)
    talk.send(LEANING)
    assert peer.until(lambda: talk.plans)
    planned = from_trajectory(talk.plans[0]).U[1]
    force = talk.send([math.nan] * 6)
    assert force == pytest.approx(planned, abs=1e-6)
    report = talk.report()
    assert report.level == 2
    assert 'expected 6 finite numbers' in report.message
    assert report.values['status'] == 'LAST_POLICY'
    talk.send(LEANING)
    assert talk.report().values['status'] == 'CONVERGED'


def test_a_first_state_that_is_not_finite_gets_zero(peer, start_node):
    talk = Conversation(peer, start_node)
    assert talk.send([math.nan] * 6) == 0.0
    assert talk.report().values['status'] == 'ZERO'
    assert 'failed' not in talk.report().message   # none was tried


def test_a_solve_that_fails_is_said_to(peer, start_node):
    talk = Conversation(peer, start_node, {'track_weight': 1e308})   # no finite cost off the track
    assert talk.send([2.5, 0.1, 0.1, 0.0, 0.0, 0.0]) == 0.0
    assert talk.report().values['status'] == 'ZERO'
    assert 'the solve failed; there is no plan to follow' in talk.report().message


def test_joints_may_come_in_any_order_but_none_may_miss(peer, start_node):
    talk = Conversation(peer, start_node)
    expected = talk.send(LEANING)
    assert peer.call(Trigger, 'mpc/reset').success
    shuffled = JointState(name=['joint2', 'cart', 'joint1'], position=LEANING[[2, 0, 1]].tolist(),
                          velocity=LEANING[[5, 3, 4]].tolist())
    talk.states.publish(shuffled)
    assert peer.until(lambda: len(talk.forces) == 2)
    assert talk.forces[-1].data == expected
    talk.states.publish(JointState(name=['cart'], position=[0.0], velocity=[0.0]))
    talk.node.wait_for('JointState has no joint1, joint2')


@pytest.mark.parametrize('links', [1, 3])
def test_pendulums_with_other_numbers_of_links_are_controlled(peer, start_node, links):
    talk = Conversation(peer, start_node, {'links': links})
    leaning = upright(links)
    leaning[1] = 0.02
    force = talk.send(leaning)
    assert force != 0.0
    assert peer.until(lambda: talk.plans)
    plan, values = from_trajectory(talk.plans[0]), talk.report().values
    assert plan.X.shape[1] == 2 * links + 2 and plan.U[0] == force
    assert {f'estimate_{joint}_position' for joint in joints(links)} <= set(values)
    assert f'link{links}_mass' in values and f'link{links + 1}_mass' not in values
    talk.states.publish(to_joint_state(to_stamp(10 ** 9), hanging(links)[:-2], 0.0))
    talk.node.wait_for(f'JointState has no joint{links}')


def test_the_states_of_a_plant_with_more_links_are_refused(peer, start_node):
    forces, reports = peer.record(FORCE_COMMAND), peer.record(DIAGNOSTICS)
    mpc = start_node('mpc', {'links': 2})
    start_node('plant', {'links': 3, 'lockstep': True})
    mpc.wait_for('JointState has 4 joints [cart, joint1, joint2, joint3]; expected 3 [cart, '
                 'joint1, joint2]: start plant and mpc with the same links')
    assert peer.until(lambda: len(forces) > 5)
    assert not any(force.data for force in forces)
    refusals = [from_diagnostics(each, 'mpc') for each in reports]
    last = [each for each in refusals if each is not None][-1]
    assert last.level == DiagnosticStatus.ERROR[0]
    assert 'JointState has 4 joints' in last.message and last.values['status'] == 'ZERO'


@pytest.mark.parametrize('name', ['ilqr', 'mppi'])
def test_a_reset_makes_the_next_tick_a_first_one(peer, start_node, name):
    talk = Conversation(peer, start_node, {'solver': name, 'seed': 3})

    def run():
        talk.n = 0
        return [talk.send(LEANING * scale) for scale in (1.0, 0.5, 0.2)]
    first = run()
    assert len(set(first)) == 3
    assert peer.call(Trigger, 'mpc/reset').success
    assert run() == first


def test_in_real_time_the_plan_begins_when_the_force_acts(peer, start_node):
    talk = Conversation(peer, start_node, {'estimator': 'none', 'clock': 'stamps'})
    for n in range(3):
        talk.send(LEANING + (1e-6 * n, 0, 0, 1.0, 0, 0), peer.node.get_clock().now().to_msg())
    assert peer.until(lambda: len(talk.reports) == len(talk.plans) == len(talk.forces))
    plan, report = next((plan, report) for plan, report in zip(talk.plans, (
        from_diagnostics(message, 'mpc') for message in talk.reports))
        if report.values['carried'] == 0)
    assert 0 < report.values['delay'] < 1
    assert report.values['latency'] >= report.values['solve_time']
    moved = from_trajectory(plan).X[0, 0] - LEANING[0]
    assert moved == pytest.approx(report.values['delay'], rel=0.5)


def test_where_states_stop_the_plan_is_followed_and_then_the_force_is_zero(peer, start_node):
    talk = Conversation(peer, start_node, {'clock': 'stamps'})
    x = LEANING
    for n in range(8):
        talk.send(x, peer.node.get_clock().now().to_msg())
        peer.spin(0.05)
        assert peer.until(lambda: talk.plans)
        x = from_trajectory(talk.plans[-1]).X[1] + 1e-4 * n
    ended = time.monotonic()
    assert peer.until(lambda: talk.forces[-1].data == 0.0)
    assert time.monotonic() - ended < 2.0   # 0.25 s, and what a busy machine adds
    peer.spin(1.0)
    assert peer.until(lambda: len(talk.reports) == len(talk.forces))
    reports = [from_diagnostics(message, 'mpc') for message in talk.reports]
    carried = int(reports[-1].values['carried'])
    assert 1 <= carried <= 6
    assert [report.values['carried'] for report in reports[-carried:]] == [*range(1, carried + 1)]
    assert [report.values['status'] for report in reports[-carried:]] == [
        *['LAST_POLICY'] * (carried - 1), 'ZERO']
    assert f'no state came in {carried} periods' in reports[-1].message
    assert not [report for report in reports if 'failed' in report.message]
    # and answers again when they come back
    talk.n = len(talk.reports)
    assert talk.send(LEANING, peer.node.get_clock().now().to_msg()) != 0.0
    assert talk.report().values['status'] in ('CONVERGED', 'ITERATION_LIMIT')


def test_after_a_single_state_the_force_ends_too(peer, start_node):
    """The watchdog has learnt no period yet."""
    talk = Conversation(peer, start_node, {'clock': 'stamps'})
    assert talk.send(hanging(), peer.node.get_clock().now().to_msg()) != 0.0
    assert peer.until(lambda: talk.forces[-1].data == 0.0)


def test_states_wait_for_a_simulated_clock_that_was_not_heard_yet(peer, start_node):
    """Else the first would seem to come before it was measured, and all after it late."""
    talk = Conversation(peer, start_node, {'use_sim_time': True, 'clock': 'arrival'})
    clock = peer.node.create_publisher(Clock, '/clock', 10)
    talk.states.publish(to_joint_state(to_stamp(100_000_000_000), LEANING, 0.0))
    peer.spin(0.5)
    assert not talk.forces
    assert peer.until(clock.get_subscription_count)
    clock.publish(Clock(clock=to_stamp(100_001_000_000)))
    assert peer.until(lambda: talk.reports)
    values = from_diagnostics(talk.reports[-1], 'mpc').values
    assert values['time'] == pytest.approx(100.0, abs=0.01)


@pytest.mark.parametrize('period', [0.02, 0.2])
def test_silence_is_half_a_period_more_or_25_ms_by_the_clock_of_the_node(peer, start_node, period):
    clock = peer.node.create_publisher(Clock, '/clock', 10)
    talk = Conversation(peer, start_node, {'clock': 'stamps', 'use_sim_time': True})
    assert peer.until(clock.get_subscription_count)

    def advance(time):
        now = to_stamp(100.0 + time)
        clock.publish(Clock(clock=now))
        peer.spin(0.2)
        return now
    for n in range(6):
        talk.send(LEANING * (1 + 1e-3 * n), advance(period * n))
    peer.spin(0.2)
    before = len(talk.forces)   # there may be more than states, until the period is known
    patience = period + max(0.5 * period, 0.025)
    advance(5 * period + patience - 0.002)
    peer.spin(0.5)
    assert len(talk.forces) == before
    advance(5 * period + patience + 0.002)
    assert peer.until(lambda: len(talk.forces) == before + 1)


def test_ticks_that_outlast_the_period_of_the_states_are_counted(peer, start_node):
    """States that come while a solve goes on overwrite each other, so the mpc hears few."""
    talk = Conversation(peer, start_node, {'solver': 'mppi', 'mppi.samples': 65536,
                                           'mppi.iterations': 1, 'first_starts': 1,
                                           'estimator': 'none', 'clock': 'stamps'})
    x = LEANING.copy()

    def enough():
        for _ in range(5):   # together, so that a busy machine cannot space them out
            x[:] += 0.001
            talk.states.publish(to_joint_state(peer.node.get_clock().now().to_msg(), x, 0.0))
        peer.spin(0.01)
        return len(talk.forces) > 12   # after a late one, the next ones catch up
    assert peer.until(enough)
    assert peer.until(lambda: len(talk.reports) == len(talk.forces))
    values = [from_diagnostics(message, 'mpc').values for message in talk.reports]
    late = [int(each['late']) for each in values]
    assert sum(late) >= 3
    assert [each['late_total'] for each in values] == np.cumsum(late).tolist()


def test_states_that_were_overwritten_count_in_the_period(peer, start_node):
    talk = Conversation(peer, start_node, {'solver': 'mppi', 'mppi.samples': 65536,
                                           'estimator': 'none'})
    talk.send(LEANING)
    stamps = [to_stamp(1_000_000 * n) for n in range(1, 500)]
    for n, stamp in enumerate(stamps):
        talk.states.publish(to_joint_state(stamp, LEANING * (1 + 1e-4 * n), 0.0))
    assert peer.until(lambda: stamps[-1] in [each.header.stamp for each in talk.reports])
    assert len(talk.reports) < 250
    # no solve takes less than the millisecond from one state to the next
    assert all(from_diagnostics(each, 'mpc').values['late'] for each in talk.reports[1:])


def test_in_lockstep_it_waits_for_ever(peer, start_node):
    talk = Conversation(peer, start_node)
    for _ in range(3):
        talk.send(LEANING)
    peer.spin(0.5)
    assert len(talk.forces) == 3


def test_the_estimate_is_reported(peer, start_node):
    talk = Conversation(peer, start_node)
    talk.send(1.01 * LEANING)
    talk.send(LEANING)
    values = talk.report().values
    assert values['estimate_joint1_position'] == pytest.approx(LEANING[1], abs=0.01)
    assert 0 < abs(values['innovation_joint1_velocity']) < 1
    assert values['innovation_distance'] < 10
    assert values['refused'] == 0
    assert values['cart_mass'] == pytest.approx(1.0, rel=0.3)
    assert math.isfinite(values['force_bias'])


@pytest.mark.parametrize(('parameters', 'words'), [
    ({'estimator': 'ukf'}, ('estimator', "'ukf'", 'one of ekf, none')),
    ({'ekf.gates': 5.0}, ("unknown parameter 'ekf.gates'", "did you mean 'ekf.gate'")),
    ({'solver': 'lqr'}, ('solver', "'lqr'", 'one of ddp, ilqr, mppi')),
    ({'mppi.sample': 5}, ("unknown parameter 'mppi.sample'", "did you mean 'mppi.samples'")),
    ({'horizon': 0}, ('horizon', 'at least 1')),
    ({'force_limit': 0.0}, ('force_limit', 'needs a force')),
    ({'reference': [0.0, 0.5, 0.0, 0.0, 0.0, 3.0], 'state_weights': [0.0] * 6},
     ('reference', 'state_weights', 'no regulator'))])
def test_impossible_parameters_end_it_with_one_line(start_node, parameters, words):
    node = start_node('mpc', parameters)
    assert node.wait() == 2
    assert 'Traceback' not in node.output()
    last = node.output().strip().splitlines()[-1]
    assert last.startswith('mpc: error: ') and all(word in last for word in words), node.output()


def test_a_second_master_is_a_warning_in_the_diagnostics(peer, start_node):
    talk = Conversation(peer, start_node)
    peer.publisher(JOINT_STATES)
    peer.node.create_publisher(Float64, 'force_command', 10)

    def last():
        found = [from_diagnostics(each, 'mpc: topics') for each in talk.reports]
        return found[-1] if found else None
    assert peer.until(lambda: last() and last().values['rivals'] == 2)
    assert last().level == DiagnosticStatus.WARN[0]
    assert '/joint_states has 2 publishers' in last().message
    rival = '/force_command has 2 publishers, /mpc, /peer; expected one'
    assert rival in last().message
    assert talk.node.output().count(rival) == 1
    talk.send(hanging() * math.nan)
    talk.node.wait_for('going on without this state')   # which is not the fault of the sensors
    assert f'{rival}; ' in talk.node.output().splitlines()[-1]


@pytest.mark.parametrize('solver', sorted(SOLVERS))
def test_long_steps_end_in_no_traceback(peer, start_node, solver):
    talk = Conversation(peer, start_node, {'step': 0.35, 'solver': solver})
    for x in (LEANING, hanging()):
        assert abs(talk.send(x)) <= 20.0
    assert talk.node.stop() == 0
    assert 'Traceback' not in talk.node.output()


def test_a_signal_while_it_compiles_ends_it(start_node, tmp_path):
    node = start_node('mpc', environment={'XDG_CACHE_HOME': str(tmp_path)})
    node.wait_for('preparing the solver')
    assert node.stop(timeout=60) == 0


def test_the_first_force_answers_the_first_state(peer, start_node):
    """A start is over when each hears the other."""
    states, forces = peer.record(JOINT_STATES), peer.record(FORCE_COMMAND_STAMPED)
    start_node('mpc').wait_for('ready')
    plant = start_node('plant', {'duration': 1.0})
    assert plant.wait() == 0
    assert peer.until(lambda: len(states) >= 20 and len(forces) >= 20)
    assert forces[0].header.stamp == states[0].header.stamp
    assert 'no force' not in plant.output()


def test_a_clock_that_jumps_to_and_fro_is_told_of(peer, start_node):
    talk = Conversation(peer, start_node, {'use_sim_time': True})
    clock = peer.node.create_publisher(Clock, '/clock', 10)
    assert peer.until(lambda: clock.get_subscription_count() > 0)
    for n in range(8):
        clock.publish(Clock(clock=to_stamp(10 ** 9 * (20 + n - 10 * (n % 2)))))
        peer.spin(0.1)
    talk.send(LEANING)
    assert 'the clock jumped back' in talk.report().message
    talk.node.wait_for('expected a single publisher of /clock')


@pytest.fixture
def mpc():
    """Return an mpc in this process that has prepared itself."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = MpcNode()
    node.prepare()
    yield node
    node.close()
    node.destroy_node()
    rclpy.try_shutdown()


def test_a_margin_as_wide_as_the_track_is_told(mpc, capfd):
    mpc.controller = controllers.controller({'track_limit': 0.4})
    mpc.warn_of_problem()
    assert 'track_margin is 0.4 m of the 0.4 m of track' in capfd.readouterr().err


def test_a_tick_that_fails_costs_its_force_which_is_zero(mpc, peer):
    forces, reports = peer.record(FORCE_COMMAND), peer.record(DIAGNOSTICS)
    assert peer.until(lambda: mpc.forces.get_subscription_count()
                      and mpc.diagnostics.publisher.get_subscription_count())

    def fail():
        raise ArithmeticError('there is no plan')
    mpc.surely(fail)
    assert peer.until(lambda: forces and reports)
    assert [force.data for force in forces] == [0.0]
    assert mpc.resets == 1   # the next tick is a first one
    status, = reports[-1].status
    assert status.name == 'mpc: failure' and 'there is no plan' in status.message
