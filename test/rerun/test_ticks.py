# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.rerun.ticks import gone, own


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
