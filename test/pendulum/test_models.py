# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One contract for all integrators and numbers of links: derivatives, precisions, tensors."""

import functools
import os
import subprocess
import sys

from learned_dynamics import bent
import numpy as np
import pytest

from dp_swing_ros.pendulum.derivatives import curvature, expand, identity, lanes, linearisation
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import advance, hold, Model, rollout, step
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import LINKS, SIZES
from dp_swing_ros.solvers.samples import single

H = 0.05
PHYSICAL = ({}, {'cart_mass': 1.3, 'link1_mass': 0.4, 'link1_length': 1.1, 'cart_friction': 0.3,
                 'joint1_friction': 0.1, 'joint2_friction': 0.05, 'joint3_friction': 0.02,
                 'link1_inertia_factor': 1.25, 'link2_inertia_factor': 0.6},
            {'cart_friction': 0.3, 'joint1_friction': 0.1, 'cart_dry_friction': 3.0,
             'joint1_dry_friction': 0.05, 'joint2_dry_friction': 0.03,
             'joint3_dry_friction': 0.02},
            {'joint1_stiffness': 0.8, 'joint2_stiffness': 0.3, 'joint3_stiffness': 0.5,
             'joint1_preload': 2.0, 'joint2_preload': -0.4})
# every integrator with two links, one of them with all: each other pair compiles for seconds
ADDRESSES = [*((name, 2) for name in sorted(INTEGRATORS)),
             *(('rk4', links) for links in LINKS if links != 2)]


@pytest.fixture(params=ADDRESSES, ids=lambda each: f'{each[0]}-{each[1]}')
def address(request):
    return request.param


def analytic(name, links, physical):
    return Model(Pendulum.of(PendulumParameters(links=links, **physical)), INTEGRATORS[name], H)


MODELS = {
    **{f'{name}-{links}-{about}': functools.partial(analytic, name, links, physical)
       for name, links in ADDRESSES
       for about, physical in zip(('default', 'friction', 'dry', 'springs'), PHYSICAL)},
    'rk4-learned': lambda: Model(bent(), INTEGRATORS['rk4'], H)}


@pytest.fixture(params=MODELS)
def model(request):
    """Return a model: an integrator, and equations or what is learned."""
    return MODELS[request.param]()


def points(model, rng, count=20):
    """Yield states and forces; half of them nearly at rest, where friction is dry."""
    n = model.pendulum.links
    for k in range(count):
        x, u = rng.normal(size=SIZES[n]) * (1, *[3] * n, 2, *[4] * n), rng.normal() * 10
        if k % 2 == 0:
            x[n + 1:] *= 0.02
        yield x, u


def next_state(model, z):
    x = z[:-1].copy()
    step(model, x, z[-1], x)
    return x


def rollout_step(model, z):
    return rollout(model, z[:-1].copy(), z[-1:].copy())[1]


def second_order(model, x, u, costate):
    """Return F = ∂f/∂(x, u), and the second derivatives of λᵀ f."""
    size = len(x)
    F, W = np.empty((size, lanes(model))), np.empty((size + 1, lanes(model)))
    directions = np.zeros((size + 1, lanes(model)))
    identity(directions)
    curvature(model, expand(model, x[None], np.full(1, u)), 0, costate, directions, F, W)
    return F[:, :size + 1], W[:, :size + 1]


def first_order(model, z):
    return np.column_stack(linearisation(model, z[:-1].copy(), z[-1]))


def central_difference(f, z, step=1e-5):
    """Return ∂f/∂z to the fourth order of the step."""
    def slope(e):
        return (8 * (f(z + e) - f(z - e)) - (f(z + 2 * e) - f(z - 2 * e))) / (12 * step)
    return np.stack([slope(step * e) for e in np.eye(len(z))], -1)


def test_jacobian_meets_finite_differences(model, rng):
    for x, u in points(model, rng):
        z = np.append(x, u)
        expected = central_difference(lambda z: rollout_step(model, z), z, 1e-4)
        np.testing.assert_allclose(first_order(model, z), expected, atol=1e-7, rtol=1e-7)


def test_curvature_meets_finite_differences(model, rng):
    for x, u in points(model, rng):
        costate, z = rng.normal(size=len(x)), np.append(x, u)
        expected = central_difference(lambda z: costate @ first_order(model, z), z, 1e-4)
        F, W = second_order(model, x, u, costate)
        np.testing.assert_allclose(W, expected, atol=1e-6, rtol=1e-6)
        np.testing.assert_allclose(W, W.T, atol=1e-10)
        # each kernel fuses other products and sums: a term of order 1 may differ in its last bit
        np.testing.assert_allclose(F, first_order(model, z), rtol=1e-13, atol=1e-14)


def test_tensors_go_the_same_way_and_autograd_agrees(model, rng):
    import torch   # here, for the kernels as Python need none of its seconds

    def f(z):
        return torch.stack(list(advance(model, z[:-1].unbind(), z[-1])))

    for x, u in points(model, rng, 3):
        z, costate = np.append(x, u), rng.normal(size=len(x))
        tensor = torch.tensor(z)
        np.testing.assert_allclose(f(tensor), rollout_step(model, z), rtol=1e-12, atol=1e-12)
        F, W = second_order(model, x, u, costate)
        np.testing.assert_allclose(F, torch.func.jacrev(f)(tensor), atol=1e-11, rtol=1e-10)
        curved = torch.func.hessian(lambda z: f(z) @ torch.tensor(costate))(tensor)
        np.testing.assert_allclose(W, curved, atol=1e-10, rtol=1e-9)


def test_steps_of_a_long_trajectory_have_their_own_derivatives(address, rng):
    """Beyond those that stand side by side, too."""
    name, links = address
    model = Model(Pendulum.of(PendulumParameters(links=links)), INTEGRATORS[name], H)
    X, U = (np.array(part) for part in zip(*points(model, rng, 37)))
    expanded, size = expand(model, X, U), SIZES[links]
    F, W = np.empty((size, lanes(model))), np.empty((size + 1, lanes(model)))
    directions = np.zeros((size + 1, lanes(model)))
    identity(directions)
    for t in (0, 15, 16, 36):
        curvature(model, expanded, t, X[0], directions, F, W)
        expected = second_order(model, X[t], U[t], X[0])
        np.testing.assert_allclose(F[:, :size + 1], expected[0], rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(W[:, :size + 1], expected[1], rtol=1e-11, atol=1e-11)
        np.testing.assert_array_equal(F[:, size + 1:], 0.0)


def test_single_precision_follows_double(model, rng):
    for x, u in points(model, rng):
        exact = rollout_step(model, np.append(x, u))
        x_32 = x.astype(np.float32)
        step(single(model), x_32, np.float32(u), x_32)
        assert x_32.dtype == np.float32
        np.testing.assert_allclose(x_32, exact, atol=1e-3, rtol=1e-4)


def test_a_step_may_be_written_where_it_was_read(model, rng):
    x, u = next(points(model, rng))
    out = np.empty_like(x)
    step(model, x, u, out)
    np.testing.assert_array_equal(next_state(model, np.append(x, u)), out)
    np.testing.assert_allclose(out, rollout_step(model, np.append(x, u)), rtol=1e-12, atol=1e-13)


def test_hold_takes_a_remainder_of_a_step(address):
    name, links = address
    model = Model(Pendulum.of(PendulumParameters(links=links)), INTEGRATORS[name], H)
    x = np.linspace(-0.6, 0.5, SIZES[links])
    np.testing.assert_array_equal(hold(model, x, 3.0, 2 * H),
                                  rollout(model, x, np.full(2, 3.0))[-1])
    assert hold(model, x, 3.0, 0.0) is x
    short = hold(model, x, 3.0, 0.01)
    assert 0 < np.abs(short - x).max() < np.abs(hold(model, x, 3.0, H) - x).max()


@pytest.mark.parametrize(('name', 'order'), [('euler', 1), ('rk4', 4)])
def test_an_integrator_has_its_order(name, order):
    model = Model(Pendulum.of(PendulumParameters()), INTEGRATORS[name], 1.0)
    x = np.array([0.1, 0.2, -0.3, 0.4, 0.5, -0.6])

    def after(steps, name=name):
        return rollout(model._replace(h=0.2 / steps, integrator=INTEGRATORS[name]), x,
                       np.full(steps, 3.0))[-1]
    exact = after(4096, 'rk4')
    coarse, fine = (np.linalg.norm(after(steps) - exact) for steps in (16, 32))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.3)


def test_the_kernels_also_run_as_python():
    """Without the compiler the result is the same."""
    code = 'import test_models; test_models.print_sums()'
    run = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True,
                         env={**os.environ, 'NUMBA_DISABLE_JIT': '1',
                              'PYTHONPATH': os.pathsep.join(
                                  [os.path.dirname(__file__), *sys.path])})
    np.testing.assert_allclose([float(line) for line in run.stdout.split()], sums(), rtol=1e-11)


def sums():
    """Return sums of first and second derivatives of all models."""
    found = []
    for name, links in ADDRESSES:
        model = Model(Pendulum.of(PendulumParameters(links=links, cart_friction=0.1)),
                      INTEGRATORS[name], H)
        size = SIZES[links]
        x = np.linspace(-1, 1, size)
        F, W = second_order(model, x, 2.0, np.arange(float(size)))
        found += [rollout(model, x, np.full(3, 2.0)).sum(), F.sum(), W.sum()]
    return found


def print_sums():
    """Print them, a line each."""
    print(*map(float, sums()), sep='\n')
