# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One contract for every dynamics model: its derivatives, its twins and its compiled code."""

import os
import subprocess
import sys

import numpy as np
import pytest
import torch

from dp_swing_ros.kernels import kernel
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.model import curvature
from dp_swing_ros.pendulum.model import expand as expand_at
from dp_swing_ros.pendulum.models import MODELS
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.torch_twin import expand, STEPS
from dp_swing_ros.pendulum.trajectory import hold, rollout, step
from dp_swing_ros.problem.problem import linearisation
from dp_swing_ros.solvers.samples import single

H = 0.05
BODIES = (PendulumParameters(),
          PendulumParameters(cart_mass=1.3, link1_mass=0.4, link2_length=1.1, cart_friction=0.3,
                             joint1_friction=0.1, joint2_friction=0.05, link1_inertia_factor=1.25,
                             link2_inertia_factor=0.6))

each_model = pytest.mark.parametrize('name', sorted(MODELS))
each_twin = pytest.mark.parametrize('name', sorted(STEPS))   # a model need not have one
each_body = pytest.mark.parametrize('bodies', BODIES, ids=['default', 'friction'])


def points(rng, count=20):
    for _ in range(count):
        yield rng.normal(size=6) * (1, 3, 3, 2, 4, 4), rng.normal() * 10


def next_state(model, z):
    x = z[:6].copy()
    step(model, x, z[6], x)
    return x


@kernel
def second_order(model, x, u, costate):
    F, W = np.empty((6, 8)), np.empty((7, 8))
    curvature(model, expand_at(model, x.reshape((1, 6)), np.full(1, u)), 0, costate, F, W)
    return F[:, :6], F[:, 6], W[:, :7]


def central_difference(f, z, step=1e-5):
    return np.stack([(f(z + step * e) - f(z - step * e)) / (2 * step) for e in np.eye(7)], -1)


@each_model
@each_body
def test_jacobian_meets_finite_differences(name, bodies, rng):
    model = MODELS[name].of(Pendulum.of(bodies), H)
    for x, u in points(rng):
        A, B = linearisation(model, x, u)
        expected = central_difference(lambda z: next_state(model, z), np.append(x, u))
        np.testing.assert_allclose(np.column_stack((A, B)), expected, atol=1e-7, rtol=1e-7)


@each_model
@each_body
def test_curvature_meets_finite_differences(name, bodies, rng):
    model = MODELS[name].of(Pendulum.of(bodies), H)
    for x, u in points(rng):
        costate = rng.normal(size=6)

        def gradient(z):
            A, B = linearisation(model, z[:6].copy(), z[6])
            return costate @ np.column_stack((A, B))
        A, B, W = second_order(model, x, u, costate)
        np.testing.assert_allclose(W, central_difference(gradient, np.append(x, u)), atol=1e-6,
                                   rtol=1e-6)
        # each kernel fuses other products and sums: a term of order 1 may differ in its last bit
        np.testing.assert_allclose(A, linearisation(model, x, u)[0], rtol=1e-14, atol=1e-15)
        np.testing.assert_allclose(B, linearisation(model, x, u)[1], rtol=1e-14, atol=1e-15)


@each_twin
@each_body
def test_autograd_of_the_torch_twin_agrees(name, bodies, rng):
    p = Pendulum.of(bodies)
    model = MODELS[name].of(p, H)
    X, U = (np.array(part) for part in zip(*points(rng, 6)))
    x, u = torch.tensor(X), torch.tensor(U)
    states = STEPS[name](p, H, x, u).numpy()
    expansion = expand(name, p, H, x, u)
    for t in range(len(U)):
        costate = rng.normal(size=6)
        A, B, W = second_order(model, X[t], U[t], costate)
        np.testing.assert_allclose(states[t], next_state(model, np.append(X[t], U[t])),
                                   rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(A, expansion.A[t].numpy(), atol=1e-11, rtol=1e-10)
        np.testing.assert_allclose(B, expansion.B[t].numpy(), atol=1e-11, rtol=1e-10)
        contracted = np.einsum('i,ijk->jk', costate, expansion.second[t].numpy())
        np.testing.assert_allclose(W, contracted, atol=1e-10, rtol=1e-9)


@each_model
def test_single_precision_follows_double(name, rng):
    model = MODELS[name].of(Pendulum.of(BODIES[1]), H)
    for x, u in points(rng):
        exact = next_state(model, np.append(x, u))
        x_32 = x.astype(np.float32)
        step(single(model), x_32, np.float32(u), x_32)
        np.testing.assert_allclose(x_32, exact, atol=2e-4, rtol=2e-5)


@each_model
def test_hold_takes_a_remainder_of_a_step(name):
    model = MODELS[name].of(Pendulum.of(BODIES[0]), H)
    x = np.array([0.1, 0.2, -0.3, 0.4, 0.5, -0.6])
    np.testing.assert_array_equal(hold(model, x, 3.0, 2 * H),
                                  rollout(model, x, np.full(2, 3.0))[-1])
    short = hold(model, x, 3.0, 0.01)
    assert 0 < np.abs(short - x).max() < np.abs(hold(model, x, 3.0, H) - x).max()


PROGRAM = """
import numpy as np
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.models import MODELS
from dp_swing_ros.pendulum.model import curvature, expand as expand_at
from dp_swing_ros.pendulum.parameters import PendulumParameters
p = Pendulum.of(PendulumParameters(cart_friction=0.1))
for name in sorted(MODELS):
    model = MODELS[name].of(p, 0.05)
    F, W = np.empty((6, 8)), np.empty((7, 8))
    points = expand_at(model, np.linspace(-1, 1, 6).reshape((1, 6)), np.full(1, 2.0))
    curvature(model, points, 0, np.arange(6.0), F, W)
    print(repr((F[:, :6].sum(), F[:, 6].sum(), W.sum())))
"""


def test_the_kernels_also_run_as_python(rng):
    """What stands in the file is what is compiled: without the compiler the result is the same."""
    run = subprocess.run([sys.executable, '-c', PROGRAM], capture_output=True, text=True,
                         env={**os.environ, 'NUMBA_DISABLE_JIT': '1'}, check=True)
    numbers = run.stdout.replace('np.float64', '').replace('(', ' ').replace(')', ' ')
    numbers = [float(word) for word in numbers.replace(',', ' ').split()]
    expected = []
    p = Pendulum.of(PendulumParameters(cart_friction=0.1))
    for name in sorted(MODELS):
        A, B, W = second_order(MODELS[name].of(p, H), np.linspace(-1, 1, 6), 2.0,
                               np.arange(6.0))
        expected += [A.sum(), B.sum(), W.sum()]
    np.testing.assert_allclose(numbers, expected, rtol=1e-12)
