# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pendulums of another size: in their own units, a run is the same."""

import math

import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.metrics import measure, Outcome, outcome
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.equations import own_units, scale_of
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import LINKS
from dp_swing_ros.pendulum.units import SAME, Units
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate

# what lengths, masses and gravity are in those of the default bodies
SCALES = {'long': (4.0, 1.0, 1.0), 'short': (0.25, 1.0, 1.0), 'heavy': (1.0, 4.0, 1.0),
          'on the moon, about': (1.0, 1.0, 0.25), 'all of it': (0.5, 0.25, 2.0)}


def bodies(lengths, masses, gravity, links=2):
    """Return the default bodies, so many times larger."""
    own = PendulumParameters(links=links)
    return {'links': links, 'gravity': own.gravity * gravity, 'cart_mass': own.cart_mass * masses,
            **{f'link{i}_length': lengths for i in range(1, links + 1)},
            **{f'link{i}_mass': 0.5 * masses for i in range(1, links + 1)}}


def run(scale, solver, periods, plant=None, links=2, lean=math.pi, **mpc):
    """Play a run; return states and forces in those of the default bodies."""
    lengths, masses, gravity = scale
    scale = Units(lengths, math.sqrt(lengths / gravity), masses, masses)
    values = bodies(*(lengths, masses, gravity), links)
    start = [0.1 * lengths, *[lean + 0.02, lean - 0.03, lean][:links], *[0.0] * (links + 1)]
    of_plant = {name: value * scale.factor(unit) for name, (value, unit) in (plant or {}).items()}
    p = plants.plant({**values, **of_plant, 'rate': 20.0 / scale.time, 'initial_state': start,
                      'physics_step': 0.005 * scale.time})
    c = controllers.controller({**values, 'solver': solver, **mpc})
    episode = simulate(p, c, periods / p.parameters.rate, solver)
    size = np.array([lengths, *[1.0] * links, lengths, *[1.0] * links])
    speeds = np.array([*[1.0] * (links + 1), *[scale.time] * (links + 1)])
    return episode.X / size * speeds, episode.U / scale.factor('N'), episode


@pytest.mark.parametrize('solver', ['ilqr', 'ddp'])
@pytest.mark.parametrize('name', SCALES)
def test_a_run_is_the_same_in_own_units(solver, name):
    (X, U, _), (Y, V, _) = (run(scale, solver, 60, estimator='none')
                            for scale in ((1.0, 1.0, 1.0), SCALES[name]))
    np.testing.assert_allclose(V, U, atol=1e-6)
    np.testing.assert_allclose(Y, X, atol=1e-6)


@pytest.mark.parametrize('name', SCALES)
def test_what_is_estimated_is_the_same_in_own_units(name):
    """Of a plant that differs: all that the filter believes shows in the forces."""
    plant = {'actuation_delay': (0.01, 's'), 'force_bias': (0.5, 'N'),
             'cart_dry_friction': (1.0, 'N')}
    (X, U, _), (Y, V, _) = (run(scale, 'ilqr', 60, plant, lean=0.1)
                            for scale in ((1.0, 1.0, 1.0), SCALES[name]))
    # a prior that were not scaled would show as tenths of newtons; the rest is of differences for
    # derivatives, which are the same for all
    np.testing.assert_allclose(V, U, atol=0.02)
    np.testing.assert_allclose(Y, X, atol=0.002)


@pytest.mark.parametrize('name', SCALES)
def test_samples_are_the_same_in_own_units(name):
    """To single precision, until a sample is another that is the best."""
    (_, U, _), (_, V, _) = (run(scale, 'mppi', 3, estimator='none')
                            for scale in ((1.0, 1.0, 1.0), SCALES[name]))
    np.testing.assert_allclose(V, U, atol=0.02)


@pytest.mark.parametrize('name', SCALES)
def test_a_run_is_measured_the_same_in_own_units(name):
    (_, _, large), (_, _, small) = (run(scale, 'ilqr', 80) for scale in (
        (1.0, 1.0, 1.0), SCALES[name]))
    assert outcome(large) is outcome(small) is Outcome.HELD
    one, other, scale = measure(large), measure(small), scale_of(small.physical)
    for metric, unit in (('settling_time', 's'), ('settling_time_with_cart', 's'),
                         ('largest_position', 'm'), ('largest_force', 'N'), ('energy', 'J'),
                         ('closed_loop_cost', '1'), ('uptime', '1'), ('rest_offset', 'm')):
        assert getattr(other, metric) == pytest.approx(
            getattr(one, metric) * scale.factor(unit), rel=1e-3, abs=1e-4 * scale.factor(unit))


@pytest.mark.parametrize('links', LINKS)
def test_the_units_are_those_of_the_bodies(links):
    default = own_units(PendulumParameters(links=links))
    assert scale_of(PendulumParameters(links=links)) == SAME
    for lengths, masses, gravity in SCALES.values():
        found = scale_of(group(PendulumParameters, bodies(lengths, masses, gravity, links)))
        np.testing.assert_allclose(
            found, (lengths, math.sqrt(lengths / gravity), masses, masses), rtol=1e-9)
    # of one link, by hand: D = [[m, a], [a, b]], so λ² = g a / (b - a²/m)
    if links == 1:
        m, a, b, g = 1.5, 0.25, 0.5 / 3, 9.81
        assert default.time == pytest.approx(((b - a ** 2 / m) / (g * a)) ** 0.5)
    assert default.length == pytest.approx(9.81 * default.time ** 2)
    assert default.mass == 1.0 + 0.5 * links


def test_what_is_given_counts_as_it_is_given():
    small = bodies(0.25, 1.0, 1.0)
    values = controllers.MPC.complete({**small, 'track_margin': 0.4, 'force_limit': 20.0})
    assert (values['track_margin'], values['force_limit']) == (0.4, 20.0)
    assert values['step'] == 0.025 and values['track_limit'] == 0.6
    assert values['state_weights'][:2] == (160.0, 100.0)
    assert plants.PLANT.complete(small)['track_limit'] == 0.6


def test_the_defaults_of_the_default_bodies_are_those_that_are_declared():
    for links in LINKS:
        fields = controllers.MPC.fields(links)
        for name, value in controllers.MPC.complete({'links': links}).items():
            assert name == 'links' or value == fields[name].default, name
