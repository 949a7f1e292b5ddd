# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import math

import pytest
from recorded_runs import told

from dp_swing_ros.declarations import DECLARATIONS
from dp_swing_ros.pendulum.state import LINKS
from dp_swing_ros.report.settings import differences, in_words, provenances, settings


def defaults(node, links=2):
    """Return the parameters that a node tells when it was given the number of links alone."""
    values = {name: field.default for name, field in DECLARATIONS[node].fields(links).items()}
    return {name: list(value) if isinstance(value, tuple) else value
            for name, value in {'use_sim_time': False, **values, 'links': links}.items()}


@pytest.mark.parametrize('links', LINKS)
@pytest.mark.parametrize('node', DECLARATIONS)
def test_defaults_are_not_changed(node, links):
    found = settings({node: told(node, defaults(node, links))})
    assert len(found) == len(defaults(node, links))
    assert {one.name for one in found if one.changed} == ({'links'} if links != 2 else set())
    assert all(one.about for one in found if one.name != 'use_sim_time')


@pytest.mark.parametrize('node', DECLARATIONS)
def test_what_goes_with_the_bodies_is_not_changed(node):
    bodies = {'link1_length': 0.15, 'link2_length': 0.15, 'cart_mass': 0.3}
    ran = DECLARATIONS[node].complete({**bodies, 'force_limit': 3.0})
    found = {one.name: one for one in settings({node: told(node, ran)})}
    assert {name for name, one in found.items() if one.changed} == {*bodies, 'force_limit'}
    assert float(found['track_limit'].value) < 0.5


def test_bodies_of_a_foreign_node_do_no_harm():
    (one,) = settings({'mpc': told('mpc', {'link3_length': 0.2})})
    assert (one.value, one.default) == ('0.2', '')


def test_what_differs_is_changed():
    given = {'horizon': 12, 'state_weights': [1.0] * 6, 'force_limit': math.inf,
             'mppi.samples': 7, 'use_sim_time': True}
    found = settings({'mpc': told('mpc', {**defaults('mpc'), **given})})
    changed = {one.name: one for one in found if one.changed}
    assert set(changed) == set(given)
    assert (changed['horizon'].value, changed['horizon'].default) == ('12', '30')
    assert changed['state_weights'].value == '[1, 1, 1, 1, 1, 1]'
    assert changed['force_limit'].about.endswith('[N]')


def test_nodes_that_are_not_known_tell_their_parameters_all_the_same():
    (one,) = settings({'other': told('other', {'speed': 2.5})})
    assert (one.node, one.name, one.value, one.changed) == ('other', 'speed', '2.5', False)


@pytest.mark.parametrize('value, words', [
    (True, 'true'), (0.1, '0.1'), (1e-9, '1e-09'), (20.0, '20'), (3, '3'), ('', "''"),
    ('ilqr', 'ilqr'), (['a', 'b'], '[a, b]'), ((), '[]')])
def test_values_read_as_they_are_written(value, words):
    assert in_words(value) == words


def test_nodes_of_one_installation_are_told_once():
    found = provenances({'plant': told('plant', {}), 'mpc': told('mpc', {}),
                         'logger': told('logger', {}, machine='another')})
    assert list(found.values()) == [['plant', 'mpc'], ['logger']]
    first, _ = found
    assert (first.commit, first.packages) == ('abc', 'numpy 2.0')


def test_differences_are_what_is_not_the_same_in_all_runs():
    rows = differences([
        {'mpc': told('mpc', {'horizon': 30, 'seed': 1, 'step': 0.05}, commit='old')},
        {'mpc': told('mpc', {'horizon': 20, 'seed': 1}, commit='new')}, {}])
    found = {(node, name): values for node, name, values in rows}
    assert found['mpc', 'horizon'] == ['30', '20', '-']
    assert found['mpc', 'step'] == ['0.05', '-', '-']
    assert found['mpc', 'commit'] == ['old', 'new', '-']


def test_run_without_a_node_does_not_differ_in_it():
    runs = [{'mpc': told('mpc', {'horizon': 30})}, {'plant': told('plant', {'rate': 20.0})}, {}]
    assert differences(runs) == []


def test_runs_with_the_same_do_not_differ():
    assert differences([{'mpc': told('mpc', {'horizon': 30})}] * 2) == []
    assert differences([{}, {}]) == []
