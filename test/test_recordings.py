# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page on real recordings: published parameters are what was published."""

from conftest import BENCHMARKS
import numpy as np
import pandas
import pytest

from dp_swing_ros.identification.base_parameters import base_parameters_of_links
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.parameters import PendulumParameters

pytest.importorskip('joblib')

ZERO = 5e-3   # [rad] of an encoder


@pytest.fixture(scope='module')
def recordings():
    """Return the module, which stands beside the package."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        import recordings as found
        yield found


def energy(g, links, theta, omega):
    """Return kinetic and potential energy of links as they were published, from their centres."""
    found, p, v = 0.0, np.zeros(2), np.zeros(2)
    for link, angle, rate in zip(links, theta, omega):
        along, across = np.array([np.sin(angle), np.cos(angle)]), np.array(
            [np.cos(angle), -np.sin(angle)]) * rate
        centre, speed = p + link.centre * along, v + link.centre * across
        found += link.mass * (speed @ speed / 2 + g * centre[1]) + link.inertia * rate ** 2 / 2
        p, v = p + link.length * along, v + link.length * across
    return found


@pytest.mark.parametrize('name', ['single', 'double', 'triple'])
def test_rods_stand_for_the_links_that_were_published(recordings, name, rng):
    """Without friction they move so that the energy of these stays as it is."""
    g, links = recordings.AUTHORS[name]
    values = {key: value for key, value in recordings.as_rods(name).items()
              if not key.endswith('friction')}
    X_0 = np.concatenate((rng.uniform(-3, 3, len(links)), rng.uniform(-3, 3, len(links))))
    theta = recordings.predict(recordings.pendulum(values), X_0, 0.5)
    omega = np.gradient(theta, recordings.STEP, axis=0)
    energies = [energy(g, links, *state) for state in zip(theta, omega)][1:-1]
    scale = sum(link.mass for link in links) * g * 0.15
    np.testing.assert_allclose(energies, energies[0], atol=2e-3 * scale)


def test_what_is_found_of_a_motion_without_noise_predicts_the_rest(recordings, tmp_path):
    """By the page's own functions, on a motion that the published parameters make."""
    X_0 = np.array([2.6, 0.0])
    every = round(recordings.PERIOD / recordings.STEP)
    theta = recordings.predict(recordings.pendulum(recordings.as_rods('single')), X_0, 13.5)
    X = np.hstack((theta + ZERO, np.gradient(theta, recordings.STEP, axis=0)))[::every]
    found = recordings.fit(X, 50).found
    learned = recordings.Predictor(recordings.trained(X, found))
    rows = pandas.DataFrame(recordings.predicted(X, {
        'found': recordings.pendulum(recordings.bodies(found)),
        'learned': learned}, 'single')).set_index('parameters')
    assert found.values['link1_balance'] == pytest.approx(ZERO, abs=2e-4)
    assert rows.loc['found'].theta1.max() < 0.5
    assert rows.loc['learned'].theta1.max() < 5.0   # of single steps, which differ less
    theirs = base_parameters_of_links(group(PendulumParameters, recordings.as_rods('single')))
    for name, (value, _) in theirs.items():
        if 'friction' not in name:
            assert found.base[name].value == pytest.approx(value, rel=1e-3), name
