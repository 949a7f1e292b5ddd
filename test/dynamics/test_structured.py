# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Learned dynamics beside the equations; derivatives are in pendulum/test_models.py."""

import pickle
import subprocess
import sys

from learned_dynamics import bent, of_chain
import numpy as np
import pytest
from similar import sized

from dp_swing_ros.dynamics.structured import harmonics
from dp_swing_ros.pendulum.equations import energy, mass_matrix, Pendulum
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import Model, rollout
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.units import Units

PHYSICAL = PendulumParameters(cart_mass=0.7, link1_mass=0.4, link2_mass=0.6, link1_length=0.8,
                              link2_length=1.1, link2_inertia_factor=1.2)
FRICTIONAL = PendulumParameters(cart_friction=0.2, joint1_friction=0.05, joint2_friction=0.02,
                                cart_dry_friction=1.0, joint2_dry_friction=0.05)


def states(rng, count=20):
    return zip(rng.normal(size=(count, 6)) * (1, 3, 3, 2, 5, 5), 10 * rng.normal(size=count))


@pytest.mark.parametrize('physical', [PHYSICAL, FRICTIONAL], ids=['bodies', 'friction'])
def test_a_chain_of_rigid_links_is_structured(physical, rng):
    chain, p = of_chain(physical), Pendulum.of(physical)
    for x, u in states(rng):
        np.testing.assert_allclose(chain.accelerations(x, u), p.accelerations(x, u), rtol=1e-9,
                                   atol=1e-9)


@pytest.mark.parametrize('physical', [PHYSICAL, FRICTIONAL], ids=['bodies', 'friction'])
def test_of_a_larger_pendulum_they_are_those_of_the_larger_chain(physical):
    scale = Units(3.0, 3.0 ** 0.5, 5.0, 5.0)
    numbers = {name: value for name, value in vars(physical).items()
               if name not in ('links', 'drive')}
    larger = of_chain(PendulumParameters(**sized(numbers, scale)))
    for found, expected in zip(of_chain(physical).sized(scale)[1:], larger[1:]):
        np.testing.assert_allclose(found, expected, rtol=1e-5)
        assert np.any(expected != 0) or physical is PHYSICAL


def test_structured_dynamics_without_friction_and_force_keep_their_energy(rng):
    """Whatever the mass matrix and the potential are."""
    learned = bent()._replace(friction=np.zeros(3), dry=np.zeros(3))
    x = np.array([0.0, 2.0, -1.5, 0.3, 1.0, -2.0])
    X = rollout(Model(learned, INTEGRATORS['rk4'], 1e-3), x, np.zeros(3000))

    def total(x):
        s, c = np.sin(x[1:3]), np.cos(x[1:3])
        potential = learned.potential @ [each.value for each in harmonics(s, c)]
        return 0.5 * x[3:] @ np.array(learned.mass_matrix(s, c)) @ x[3:] + potential
    energies = np.array([total(x) for x in X[::100]])
    assert np.ptp(X[:, 1]) > 1.0
    np.testing.assert_allclose(energies, energies[0], atol=1e-6)


def test_the_energy_of_a_chain_is_that_of_its_equations(rng):
    chain, p = of_chain(PHYSICAL), Pendulum.of(PHYSICAL)
    for x, _ in states(rng):
        s, c = np.sin(x[1:3]), np.cos(x[1:3])
        np.testing.assert_allclose(chain.mass_matrix(s, c), mass_matrix(p, s, c))
        potential = chain.potential @ [each.value for each in harmonics(s, c)]
        kinetic = 0.5 * x[3:] @ np.array(chain.mass_matrix(s, c)) @ x[3:]
        assert kinetic + potential == pytest.approx(energy(p, x))


def test_nothing_depends_on_where_the_cart_is_or_on_whole_turns(rng):
    dynamics = bent()
    for x, u in states(rng):
        np.testing.assert_allclose(
            dynamics.accelerations(x + [1.7, 2 * np.pi, -4 * np.pi, 0, 0, 0], u),
            dynamics.accelerations(x, u), atol=1e-9)


def test_the_free_numbers_are_all_that_changes(rng):
    dynamics = bent()
    again = dynamics.with_free(dynamics.free)
    other = dynamics.with_free(dynamics.free + 0.1)
    for x, u in states(rng, 5):
        assert again.accelerations(x, u) == dynamics.accelerations(x, u)
        assert other.accelerations(x, u) != dynamics.accelerations(x, u)
    np.testing.assert_array_equal(other.free, dynamics.free + 0.1)


def test_another_process_has_the_same_dynamics(tmp_path):
    """One that has met none of so many links."""
    dynamics, file = bent(), tmp_path / 'dynamics'
    assert pickle.loads(pickle.dumps(dynamics)).size is dynamics.size
    file.write_bytes(pickle.dumps(dynamics))
    code = ('import pickle, sys, numpy; from dp_swing_ros.pendulum.model import Model, rollout;'
            'from dp_swing_ros.pendulum.integrators import INTEGRATORS;'
            'p = pickle.load(open(sys.argv[1], "rb")); n = 2 * p.links + 2;'
            'X = rollout(Model(p, INTEGRATORS["rk4"], 0.01), numpy.ones(n), numpy.ones(2));'
            'print(X[-1, 0])')
    run = subprocess.run([sys.executable, '-c', code, str(file)], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    here = rollout(Model(dynamics, INTEGRATORS['rk4'], 0.01), np.ones(2 * dynamics.links + 2),
                   np.ones(2))
    assert float(run.stdout) == here[-1, 0]
