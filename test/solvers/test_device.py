# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The update by torch against the kernels of the CPU; the GPU's own part where there is one."""

from dataclasses import replace
import math

import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.state import hanging, SIZES
from dp_swing_ros.problem.problem import policy_rollout, Rollout
from dp_swing_ros.solvers.mppi import MPPI, MPPIParameters, opened, spread, weights
from dp_swing_ros.solvers.noise import fill, state_from
from dp_swing_ros.solvers.solver import generator

torch = pytest.importorskip('torch')
copy_of = pytest.importorskip('dp_swing_ros.solvers.device').copy_of
SAMPLES = 200
ON_GPU = pytest.mark.skipif(not torch.cuda.is_available(), reason='there is no CUDA GPU')
devices = pytest.mark.parametrize('device', ['torch', pytest.param('cuda', marks=ON_GPU)])


def solver(device, seed=0, values=None, **parameters):
    return MPPI(controllers.problem(values or {'horizon': 20}),
                MPPIParameters(samples=SAMPLES, device=device, **parameters), seed)


def policy(problem, rng):
    """Return a rollout with its gains about random forces."""
    links = problem.physical.links
    x_0 = np.array([0.3, *(2.9, -3.0, 3.0)[:links], 0.1, *(0.5, -0.5, 0.2)[:links]])
    none = np.zeros((problem.horizon, SIZES[links]))
    return Rollout(*opened(problem.model, problem.cost, problem.lqr.K, problem.bounds,
                           problem.horizon, x_0, none, rng.uniform(-10, 10, problem.horizon),
                           none, True))


@devices
def test_the_textbook_s_samples_make_a_plan(device):
    one = solver(device, importance_sampling=True, feedback=False, temperature_scale='fixed',
                 temperature=10.0)
    plan = one.solve(hanging(), None, math.inf)
    assert np.all(np.isfinite(plan.U)) and plan.stats.status != 'FAILED'


@devices
@pytest.mark.parametrize('values', [
    {'model': 'euler'}, {'model': 'rk4'}, {'angle_error': 'angle', 'terminal_cost': 'scaled'},
    {'track_limit': 0.5}, {'links': 1}, {'links': 3}],
    ids=['euler', 'rk4', 'paper', 'short track', 'one link', 'three links'])
def test_forces_and_costs_are_those_of_the_kernel(device, values, rng):
    cpu, other = (solver(kind, values={'horizon': 20, **values}) for kind in ('cpu', device))
    best, noise = policy(cpu.problem, rng), np.empty_like(cpu.samples.V)
    random = state_from(generator(0))   # that of the seed 0
    for block in noise:
        fill(random, block.reshape(-1))
    J = cpu.samples.draw(best, generator(0))
    noise, V = (many.transpose(1, 0, 2).reshape(20, -1)[:, :SAMPLES]
                for many in (noise, cpu.samples.V))
    program = other.samples.program
    program.noise.copy_(torch.from_numpy(noise))
    program.take(other.samples.inputs(best))
    program.run()
    forces, costs = program.forces.cpu().numpy(), program.costs.cpu().numpy()
    np.testing.assert_allclose(forces, V, atol=1e-2)
    np.testing.assert_allclose(costs, J, rtol=1e-3)
    none = np.zeros((20, len(best.X[0])))
    expected = [policy_rollout(cpu.problem, best.X[0], none, u.astype(float), none).J
                for u in forces.T]
    np.testing.assert_allclose(costs, expected, rtol=2e-3)
    w = weights(costs, 0.1 * spread(costs))
    np.testing.assert_allclose(other.samples.proposals(w),
                               [forces @ w, forces[:, np.argmax(w)]], atol=1e-4)


@devices
def test_the_same_seed_gives_the_same_plan(device):
    first, second, other = (solver(device, seed).solve(hanging(), None, math.inf)
                            for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.U, second.U)
    assert not np.array_equal(first.U, other.U)


@devices
def test_another_problem_of_the_same_size_is_another_problem(device, rng):
    """The program is shared; masses, reference and bound are not compiled into it."""
    light, heavy = (solver(device, values={'horizon': 20, 'link2_mass': mass})
                    for mass in (0.5, 0.9))
    assert light.samples.program is heavy.samples.program
    best = policy(light.problem, rng)
    costs = [one.samples.draw(best, one.random).copy() for one in (light, heavy, light)]
    assert np.median(costs[1] / costs[0]) > 1.01


@ON_GPU
def test_another_horizon_compiles_nothing():
    """The rate of the states changes it while control runs."""
    def graphs():
        return torch._dynamo.utils.counters['stats']['unique_graphs']
    solver('cuda', values={'horizon': 20})
    before = graphs()
    for horizon in (23, 31):
        plan = solver('cuda', values={'horizon': horizon}).solve(hanging(), None, math.inf)
        assert len(plan.U) == horizon
    assert graphs() == before > 0


def test_torch_compiles_a_program_of_every_size():
    """It compiles one code object eight times, and runs what comes then fifty times slower."""
    sizes = []

    def backend(graph, inputs):
        sizes.append(len(inputs[0]))
        return graph.forward

    def function(x):
        return x + 1
    for size in range(2, 14):
        torch.compile(copy_of(function), backend=backend, dynamic=False)(torch.zeros(size))
    assert sizes == list(range(2, 14))


@pytest.mark.skipif(torch.cuda.is_available(), reason='there is a CUDA GPU')
def test_a_gpu_that_is_not_there_is_refused():
    parameters = MPPIParameters(device='cuda')
    with pytest.raises(ParameterError, match='finds no CUDA GPU; expected an NVIDIA GPU'):
        MPPI(controllers.problem({}), parameters)
    MPPI(controllers.problem({}), replace(parameters, device='cpu'))
    with pytest.raises(ParameterError, match='one of cpu, cuda, torch'):
        MPPIParameters(device='gpu')
