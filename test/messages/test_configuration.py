# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import math

import pytest

from dp_swing_ros.messages.configuration import Configuration, from_text

TOLD = Configuration('/second/mpc', {'solver': 'ddp', 'horizon': 30, 'force_limit': math.inf,
                                     'mppi.temperature': 0.1 + 0.2, 'state_weights': [1e-5, 2.0]},
                     '0.1.0', 'abc-dirty', '0123', 'a processor, 2 cores', {'numpy': '2.3'})


def test_what_was_told_reads_back_to_the_bit():
    assert from_text(TOLD.to_text()) == TOLD


@pytest.mark.parametrize('text', ['', '{', 'mpc', 'node: /mpc', 'a: [', TOLD.to_text()[:-60]])
def test_anything_else_is_an_error_that_tells_it(text):
    with pytest.raises(ValueError, match='a configuration is'):
        from_text(text)


def with_parameters(**parameters):
    return TOLD._replace(parameters=parameters).to_text()


@pytest.mark.parametrize('parameters', [
    {'lockstep': 'no'}, *({'lockstep': False, name: value} for name, value in (
        ('rate', 0.0), ('rate', 'abc'), ('rate', math.nan), ('rate', [20.0]), ('rate', 1e300),
        ('delay', -1.0), ('delay', math.inf), ('disturbance_limit', {'a': 1}))),
    {'links': 4}, {'links': 2, 'link1_mass': 0.0}, {'links': 2, 'force_limit': math.nan},
    {'joint_names': [1, 2, 3]}, {'other': [[1.0]]}, {'other': None}, {1: 2}])
def test_what_others_announce_is_checked_as_what_users_give(parameters):
    with pytest.raises(ValueError, match='parameter|a configuration has'):
        from_text(TOLD._replace(parameters=parameters).to_text())


def test_what_nobody_relies_on_may_be_anything_that_a_parameter_may():
    given = {'rate': 0.001, 'bag': 'x', 'other': ['a', True, 1, math.inf]}   # of replay, and more
    assert from_text(with_parameters(**given)).parameters == given


def test_secrets_in_older_bags_are_left_out():
    assert from_text(with_parameters(token='abc', port=8080)).parameters == {'port': 8080}


def test_a_text_of_many_values_is_refused_before_it_is_read():
    with pytest.raises(ValueError, match='more than 2000 nodes'):
        from_text(with_parameters(other=list(range(3000))))
