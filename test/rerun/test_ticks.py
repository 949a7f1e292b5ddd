# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import pytest
from recorded_runs import told, written
from std_msgs.msg import Float64, String
from virtual import LEANING, lockstep, PERIOD

from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.control import controllers
from dp_swing_ros.messages.cdr import to_diagnostics
from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.rerun.ticks import gone, own, record_of
from dp_swing_ros.rerun.verification import verify
from dp_swing_ros.topics import CONFIGURATION, DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES


def configuration(**parameters):
    return Configuration('/mpc', {**controllers.MPC.complete({}), **parameters},
                         '', '', '', '', {})


def recorded(**parameters):
    return own(configuration(**parameters))


def test_solvers_of_packages_that_are_gone_are_left_out_where_they_were_not_used():
    found = recorded(**{'shooting.change': 1.0, 'blend.share': 0.3, 'qos_overrides./a.b': 'c'})
    assert found == controllers.MPC.complete({})


def test_parameters_of_earlier_versions_that_decided_no_force_are_left_out():
    assert recorded(shadow=['ddp']) == controllers.MPC.complete({})


def test_of_those_that_decided_forces_is_said_what_is_not_to_be_had():
    now, before = ({'ddp.hessian': value} for value in ('exact', 'gauss_newton'))
    assert recorded(**now) == recorded(**before) == controllers.MPC.complete({})
    assert gone(configuration(solver='ddp', **now)) == []
    assert gone(configuration(solver='ilqr', **before)) == []
    assert gone(configuration(solver='ddp', **before)) == [
        'ddp.hessian gauss_newton there, not to be had here']


def test_one_that_was_used_is_asked_for():
    with pytest.raises(ParameterError, match='shooting'):
        controllers.controller(recorded(**{'solver': 'shooting', 'shooting.change': 1.0}))


@pytest.mark.parametrize('numbered', [True, False])
def test_a_force_that_was_sent_again_is_no_tick(numbered, tmp_path):
    """As a plant in lockstep asks again; a bag that was converted has no numbers."""
    run = lockstep()
    topics = [topic._replace(name=f'/{topic.name}') for topic in (
        CONFIGURATION, JOINT_STATES, FORCE_COMMAND, DIAGNOSTICS)]
    with written(tmp_path / 'bag', topics) as write:
        configured, states, forces, diagnostics = topics
        write(configured, 1, String(data=told('mpc', run.core.live.values).to_text()))
        for n in range(8):
            stamp = round(n * PERIOD * BILLION)
            message = to_joint_state(to_stamp(stamp), LEANING * (1 + 0.1 * n), 0.0)
            write(states, stamp + 2, message)
            for again in range(3 if n == 2 else 2 if n == 5 else 1):
                write(forces, stamp + 3 + again, Float64(data=run.hear(message)),
                      len(run.forces) * numbered)
            _, level, text, values, _ = run.report
            write(diagnostics, stamp + 9, to_diagnostics(
                to_stamp(stamp), 'mpc', level, text, values, states.name))
    bag = Bag(tmp_path / 'bag')
    assert [tick.number for tick in record_of(bag).ticks] == [1, 2, 3, 6, 7, 8, 10, 11]
    found = verify(bag, iter)
    assert found.ticks == 8 and not found.differences
