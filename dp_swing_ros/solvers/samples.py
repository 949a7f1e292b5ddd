# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Many force sequences drawn and followed at once, in single precision, and what each costs.

The samples go through the model in blocks of LANES side by side: their noise and states stay in
the first-level cache, and the compiler turns every loop over a block into vector instructions.
Hence no branch, no call and no double-precision constant in there.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
import functools
from typing import Any

import numpy as np

from dp_swing_ros.kernels import kernel, now
from dp_swing_ros.kernels.compilation import mapped
from dp_swing_ros.kernels.symbols import clamp, dot
from dp_swing_ros.kernels.unrolling import unrolled
from dp_swing_ros.parameters import parameter, ParameterError, Parameters
from dp_swing_ros.pendulum.model import advance, numbers, size
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.cost import running_cost, terminal_cost
from dp_swing_ros.problem.plan import Tries
from dp_swing_ros.problem.problem import Problem, Rollout
from dp_swing_ros.solvers.noise import fill, LANES, state_from

F = np.float32
MEMORY = 1 << 30   # [bytes] of all samples at most


@dataclass(frozen=True)
class SamplingParameters(Parameters):
    """The samples: how many, how loud, and where they are followed."""

    samples: int = parameter(512, 'force sequences drawn at once, K', minimum=2,
                             maximum=1_000_000)
    smallest_noise: float = parameter(
        0.5, 'standard deviation of the quietest samples', unit='N', minimum=1e-3, scaled=True)
    largest_noise: float = parameter(
        40.0, 'standard deviation of the loudest samples', unit='N', minimum=1e-3, scaled=True)
    noise_correlation: float = parameter(
        0.8, 'correlation of the noise from step to step; 0 is white, as in the paper',
        minimum=0.0, maximum=0.999)
    threads: int = parameter(
        1, 'threads that follow the samples; a second one pays from some 2,000 samples on, where '
        'there is a core for it. Another number draws other samples', minimum=1, maximum=256)
    device: str = parameter(
        'cpu', 'where samples are followed. cpu: here, by Numba; cuda: an NVIDIA GPU, by '
        "torch; torch: the GPU's program on the CPU, to test it",
        choices=lambda: ['cpu', 'cuda', 'torch'])

    @property
    def sigma(self) -> Array:
        """Return the sizes of the noise (samples,) [N], none for the policy itself."""
        spread = np.geomspace(self.smallest_noise, self.largest_noise, self.samples - 1)
        return np.append(0.0, spread).astype(F)


def single(structure: Any) -> Any:
    """Return a model or a cost with all its numbers in single precision."""
    return mapped(lambda number: np.asarray(number, F)[()], structure)


@unrolled
def step_lane(model, cost, offset, gain, noise, bounds, states, total, u, i):
    """Move the sample in lane i by one step under u = offset + gain x + noise, at its cost."""
    x = [states[j, i] for j in range(len(gain))]
    u_i = clamp(offset + dot(gain, x) + noise[i], *bounds)
    u[i] = u_i
    total[i] = total[i] + running_cost(cost, x, u_i)
    for j, x_j in enumerate(advance(model, x, u_i)):
        states[j, i] = x_j


@unrolled
def end_lane(cost, states, total, J, i):
    """Write what the sample in lane i costs in all."""
    J[i] = total[i] + terminal_cost(cost, [states[j, i] for j in range(len(cost.S))])


@kernel
def draw(model, cost, X, U, K, random, sigma, correlation, bounds, V, J):
    """
    Draw samples about the policy u = U[t] + K[t] (x - X[t]), and follow them from X[0].

    Return how long the noise took [s]. random is the state of `noise.fill`. Shapes:
    X (N + 1, 2n + 2), U (N,), K (N, 2n + 2), random (4, LANES), and in float32 sigma and J
    (blocks, LANES), V (blocks, N, LANES).
    """
    N = len(U)
    x_0, gains, offsets = X[0].astype(np.float32), K.astype(np.float32), np.empty(N, np.float32)
    for t in range(N):   # u = offset + K x
        u_t = U[t]
        for j in range(size(model)):
            u_t -= K[t, j] * X[t, j]
        offsets[t] = u_t
    white = np.empty((N, LANES), np.float32)
    scratch = np.empty((size(model) + 3, LANES), np.float32)
    noise_time = 0.0
    for block in range(len(V)):
        began = now()
        fill(random, white.reshape(-1))
        noise_time += now() - began
        follow(model, cost, x_0, offsets, gains, white, sigma[block], correlation, bounds, scratch,
               V[block], J[block])
    return noise_time


@kernel
def follow(model, cost, x_0, offsets, gains, white, sigma, correlation, bounds, scratch, V, J):
    """
    Follow one block of samples under u = offset + gain x + coloured noise, within its bound.

    Write the forces V and the costs J. All is in single precision; scratch is for states, costs
    and noise. Shapes: x_0 (2n + 2,), offsets (N,), gains (N, 2n + 2), white and V (N, LANES),
    sigma and J (LANES,), scratch (2n + 5, LANES).
    """
    n = size(model)
    states, total, coloured, noise = scratch[:n], scratch[n], scratch[n + 1], scratch[n + 2]
    renewal = np.sqrt(np.float32(1) - correlation * correlation)
    for j in range(n):
        states[j, :] = x_0[j]
    scratch[n:] = np.float32(0)
    old, fresh = np.float32(0), np.float32(1)
    for t in range(len(V)):
        offset, gain, fresh_noise, u = offsets[t], numbers(model, gains[t]), white[t], V[t]
        for i in range(LANES):
            coloured[i] = old * coloured[i] + fresh * fresh_noise[i]
            noise[i] = sigma[i] * coloured[i]
            step_lane(model, cost, offset, gain, noise, bounds, states, total, u, i)
        old, fresh = correlation, renewal
    for i in range(LANES):
        end_lane(cost, states, total, J, i)


@kernel
def average(V, w):
    """
    Return the weighted sum of the samples, in double precision.

    Shapes: V (blocks, N, LANES), w (blocks, LANES), both float32 -> (N,).
    """
    N = V.shape[1]
    sums, U = np.zeros((N, LANES), np.float32), np.zeros(N)
    for block in range(len(V)):
        for t in range(N):
            for i in range(LANES):
                sums[t, i] += w[block, i] * V[block, t, i]
    for t in range(N):
        for i in range(LANES):
            U[t] += sums[t, i]
    return U


@functools.cache
def helpers() -> ThreadPoolExecutor:
    """Return the threads beside the caller's, which all solvers share."""
    return ThreadPoolExecutor(thread_name_prefix='mppi')


class Samples:
    """Samples of one problem on the CPU, drawn anew in each update."""

    def __init__(self, problem: Problem, sigma: Array, correlation: float, threads: int) -> None:
        """Take the problem, and the sizes of the noise of each sample (K,), in float32."""
        self.model, self.cost = single(problem.model), single(problem.cost)
        self.correlation, self.bounds = F(correlation), single(problem.bounds)
        # whole blocks; what the last one has beyond the samples weighs nothing
        self.count, blocks = len(sigma), -(-len(sigma) // LANES)
        self.sigma = np.pad(sigma, (0, blocks * LANES - len(sigma))).reshape(blocks, LANES)
        self.w = np.zeros((blocks, LANES), F)
        # memory that is new each time costs more than to fill it
        self.V, self.J = np.empty((blocks, problem.horizon, LANES), F), np.empty_like(self.w)
        self.noise_time = 0.0   # [s] of the last draw, in this thread
        ends = np.linspace(0, blocks, threads + 1).round().astype(int)
        self.parts = list(map(slice, ends[:-1], ends[1:]))   # of the blocks, one for each thread

    def draw(self, best: Rollout, random: np.random.Generator) -> Array:
        """
        Draw samples about a rollout; return their costs, which the next draw overwrites.

        Shapes: -> (K,), in single precision.
        """
        def draw_part(part: slice, state: Array) -> float:
            noise_time: float = draw(
                self.model, self.cost, *best[1:], state, self.sigma[part], self.correlation,
                self.bounds, self.V[part], self.J[part])
            return noise_time

        mine, *others = [(part, state_from(random)) for part in self.parts]
        started = [helpers().submit(draw_part, *other) for other in others]
        self.noise_time = draw_part(*mine)
        for other in started:
            other.result()
        return self.J.reshape(-1)[:self.count]

    def proposals(self, w: Array) -> Array:
        """Return the weighted average of the samples, and the heaviest; w (K,) -> (2, N)."""
        self.w.reshape(-1)[:self.count] = w
        return np.array([average(self.V, self.w), self.forces(int(np.argmax(w)))])

    def forces(self, index: int) -> Array:
        """Return the forces of one sample; -> (N,)."""
        block, lane = divmod(index, LANES)
        found: Array = self.V[block, :, lane].astype(float)
        return found

    def along(self, direction: Array) -> Array:
        """Return Σ_t direction[t] V[t] of every sample; direction (N,) -> (K,)."""
        found: Array = np.einsum('t,btk->bk', direction.astype(F), self.V)
        return found.reshape(-1)[:self.count]


def tries_of(samples: Any, w: Array, count: int) -> Tries:
    """Return samples of all sizes of noise, the heaviest among them; w (K,)."""
    spread = np.linspace(0, len(w) - 1, max(count - 1, 0)).round().astype(int)
    chosen = np.unique(np.append(spread, np.argmax(w)))
    return Tries(np.array([samples.forces(int(index)) for index in chosen]),
                 (w[chosen] / np.max(w)).astype(float))


def samples_of(problem: Problem, parameters: SamplingParameters, solver: str) -> Any:
    """
    Return what draws the samples of a solver by that name, on the device of its parameters.

    Raises ParameterError where that is none of this machine, or torch is missing.
    """
    name, size = f'{solver}.device', 4 * parameters.samples * problem.horizon
    if size > MEMORY:
        raise ParameterError(
            f'parameter {solver}.samples is {parameters.samples}, which over a horizon of '
            f'{problem.horizon} steps take {size / 1e9:.2g} GB; expected {MEMORY / 1e9:.2g} GB '
            'at most')
    given = problem, parameters.sigma, parameters.noise_correlation
    if parameters.device == 'cpu':
        return Samples(*given, parameters.threads)
    try:   # torch takes seconds to import, and only this needs it
        from dp_swing_ros.solvers.device import DeviceSamples
    except ModuleNotFoundError:
        raise ParameterError(
            f'parameter {name} is {parameters.device!r}, but torch is not installed; pip install '
            f'torch, for cuda a CUDA build of it, or choose {name} cpu') from None
    return DeviceSamples(*given, parameters.device, name)
