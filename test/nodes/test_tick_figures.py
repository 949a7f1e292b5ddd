# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an mpc says about a tick, as a stranger on its topics finds it."""

import math
import signal

import numpy as np
import pytest
from std_srvs.srv import Trigger
from test_live import put
from test_mpc import Conversation, LEANING

from dp_swing_ros.messages.fields import from_diagnostics, from_trajectory, to_state
from dp_swing_ros.nodes.messages import to_joint_state
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.topics import DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES, TRIES

TERMS = ('position', 'angles', 'velocities', 'force', 'limits', 'terminal')


def points_of(cloud):
    """Return the points of a cloud by the names of its fields; each (height, width)."""
    kind = np.dtype([(field.name, np.float32) for field in cloud.fields])
    assert kind.itemsize == cloud.point_step and cloud.row_step == kind.itemsize * cloud.width
    return np.frombuffer(bytes(cloud.data), kind).reshape(cloud.height, cloud.width)


def reports_in(messages):
    """Return what the mpc reported in diagnostics."""
    found = [from_diagnostics(each, 'mpc') for each in messages]
    return [each for each in found if each is not None]


@pytest.mark.parametrize('name', sorted(SOLVERS))
def test_a_report_says_why_the_force_is_what_it_is(peer, start_node, name):
    talk = Conversation(peer, start_node, {'solver': name})
    for n in range(2):
        talk.send(hanging() + 1e-3 * n)
    values = talk.report().values
    assert sum(values[f'cost_{term}'] for term in TERMS) == pytest.approx(values['cost'], rel=1e-9)
    starts, costs = values['starts'].split(), list(map(float, values['costs'].split()))
    assert len(starts) == len(costs) == len(values['solves'].split()) == 2
    assert values['start'] == starts[int(np.argmin(costs))]
    assert values['lead'] == pytest.approx(max(costs) - min(costs), abs=1e-3 * max(costs))
    phases = {'backward_time', 'line_search_time'} if name in ('ilqr', 'ddp') else {
        'noise_time', 'rollouts_time'}
    assert {'estimate_time', 'starts_time', *phases} <= set(values)
    assert all(values[phase] < values['solve_time'] for phase in phases)
    assert values['age'] == 0.0 and values['missed_total'] == 0


def test_a_solve_alone_leads_by_nothing_known(peer, start_node):
    talk = Conversation(peer, start_node)
    for n in range(2):
        talk.send(LEANING * 0.1 + 1e-4 * n)
    values = talk.report().values
    assert values['starts'] in ('last_plan', 'regulator') and values['lead'] == math.inf


@pytest.mark.parametrize('name', sorted(SOLVERS))
def test_tries_are_shown_where_they_are_asked_for(peer, start_node, name):
    clouds = peer.record(TRIES)
    talk = Conversation(peer, start_node, {'solver': name})
    talk.send(hanging())
    talk.report()
    assert not clouds
    assert put(peer, shown_tries=6) == ''
    talk.send(hanging() + 1e-3)
    assert peer.until(lambda: clouds and len(talk.plans) == 2)
    cloud, plan = clouds[-1], from_trajectory(talk.plans[-1])
    points = points_of(cloud)
    assert cloud.header.frame_id == 'track'
    assert cloud.header.stamp == talk.plans[-1].header.stamp
    assert 1 < cloud.height <= 7 and cloud.width == len(plan.U) + 1
    assert points['weight'].max() == 1.0 and not points['y'].any()
    # all of them begin where the plan does, at the tip that hangs
    np.testing.assert_allclose(points['z'][:, 0], points['z'][0, 0])
    assert points['z'][0, 0] == pytest.approx(-sum(PendulumParameters().lengths), rel=0.05)
    assert np.ptp(points['x'][:, -1]) > 1e-3
    assert put(peer, shown_tries=0) == ''
    before = len(clouds)
    talk.send(hanging() + 2e-3)
    talk.report()
    assert len(clouds) == before


def test_states_that_others_overtook_are_counted_and_not_solved(peer, start_node):
    talk = Conversation(peer, start_node, {'clock': 'arrival', 'solver': 'mppi',
                                           'mppi.samples': 20_000, 'time_limit': 10.0})
    for n in range(3):
        talk.send(LEANING + 1e-3 * n, peer.node.get_clock().now().to_msg())
    for n in range(20):
        talk.states.publish(to_joint_state(peer.node.get_clock().now().to_msg(),
                                           LEANING + 1e-3 * (n + 3), 0.0))

    def reported():
        return [each.values for each in reports_in(talk.reports) if 'missed_total' in each.values]

    def answered():
        return sum(not each['carried'] for each in reported())
    assert peer.until(lambda: answered() and answered() + reported()[-1]['missed_total'] == 23)
    assert reported()[-1]['missed_total'] > 0


def test_no_plan_from_before_a_reset_of_the_plant_is_followed(peer, start_node):
    """In real time, where no stamp goes back."""
    forces, states, reports = map(peer.record, (FORCE_COMMAND, JOINT_STATES, DIAGNOSTICS))
    plant = start_node('plant', {'start': 'up_up'})
    start_node('mpc').wait_for('ready')

    def of_mpc():
        return [each.values for each in reports_in(reports) if 'resets' in each.values]
    assert peer.until(lambda: len(of_mpc()) > 20)
    assert of_mpc()[-1]['resets'] == 0
    assert put(peer, 'plant', start='down_down') == ''
    assert peer.call(Trigger, 'plant/reset').success
    assert peer.until(lambda: any(each['resets'] for each in of_mpc()))
    first = next(each for each in of_mpc() if each['resets'])
    assert 'last_plan' not in first['starts'] and 'rest' in first['starts'].split()
    # and the states after it are believed from the first on
    count = len(of_mpc())
    assert peer.until(lambda: len(of_mpc()) > count + 5)
    assert {each['status'] for each in of_mpc()[-5:]} <= {
        'CONVERGED', 'ITERATION_LIMIT', 'DEADLINE'}
    assert all(math.isfinite(each.data) for each in forces) and plant.popen.poll() is None
    assert np.abs(to_state(states[-1], 2)[1]) > 1.0


def test_a_plant_that_is_started_again_is_another_one(peer, start_node):
    """Of which nothing is known: neither a plan nor an estimate is left of the one before."""
    reports = peer.record(DIAGNOSTICS)
    plant = start_node('plant', {'start': 'up_up', 'force_bias': 2.0})
    start_node('mpc').wait_for('ready')

    def of_mpc():
        return [each.values for each in reports_in(reports) if 'resets' in each.values]
    assert peer.until(lambda: of_mpc() and of_mpc()[-1].get('force_bias', 0.0) > 1.0)
    assert of_mpc()[-1]['resets'] == 0
    plant.signal(signal.SIGKILL)
    start_node('plant', {'start': 'up_up'})
    assert peer.until(lambda: any(
        each['resets'] == 1 and not each['carried'] for each in of_mpc()))
    first = next(each for each in of_mpc() if each['resets'] == 1 and not each['carried'])
    assert 'last_plan' not in first['starts'] and first['force_bias'] == 0.0
    peer.spin(1.0)
    assert of_mpc()[-1]['resets'] == 1   # said once
